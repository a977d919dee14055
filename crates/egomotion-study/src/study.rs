//! The trait that every study implements, and what a study publishes.

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::figure::Figure;
use crate::range::OutOfRange;
use crate::table::Table;

/// An experiment made of independent parts. Its fields are its settings, and they decide every number.
///
/// A part gives the same records on any number of threads, whichever parts ran before it. So a study can be stopped
/// after any part and resumed, and its parts can run on several machines.
pub trait Study: Serialize + Sync {
    /// A finding of a part: a value that can be written to a file and read back.
    type Record: Serialize + DeserializeOwned + Clone + Send;
    /// Why a part may fail.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Name of the study, as in `egomotion study NAME`.
    fn name(&self) -> &'static str;

    /// Check that the study can be run with these settings.
    ///
    /// # Errors
    /// [`OutOfRange`] names the first setting that has no meaning.
    fn check(&self) -> Result<(), OutOfRange> {
        Ok(())
    }

    /// Names of the parts in the order in which they run; no two are the same.
    fn parts(&self) -> Vec<String>;

    /// Run the part of that index in [`Study::parts`].
    ///
    /// # Errors
    /// The cause, such as an unknown sequence or a file that cannot be read.
    fn run(&self, part: usize) -> Result<Vec<Self::Record>, Self::Error>;

    /// Tables and figures of the records so far, in the order of the parts; some parts may be missing.
    fn publish(&self, records: &[Self::Record]) -> Publication;
}

/// The tables and figures of a study.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Publication {
    /// The title, one line.
    pub title: String,
    /// Full results, for files only.
    pub data: Vec<Table>,
    /// Tables for the page and for files.
    pub tables: Vec<Table>,
    /// Figures, in the order of the page.
    pub figures: Vec<Figure>,
}
