//! The paper's laboratory: its sections 5 and 7 as studies that anyone can repeat.
//!
//! A [`Study`] is a list of independent parts; each part gives records, and the records of all parts give
//! tables and figures as plain values ([`Publication`]). Files, pages and progress are the command's.
#![deny(missing_docs)]
#![deny(clippy::disallowed_methods)]
#![warn(clippy::too_many_lines)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod assumptions;
pub mod consistency;
pub mod contender;
pub mod draw;
pub mod efficiency;
pub mod figure;
pub mod range;
pub mod real;
pub mod sensitivity;
pub mod table;
pub mod tally;
pub mod uncertainty;
pub mod world;

use serde::Serialize;
use serde::de::DeserializeOwned;

pub use figure::{Axis, Content, Figure, Line, Panel, Point, Series};
pub use range::OutOfRange;
pub use table::{Cell, Column, Table};

/// An experiment made of independent parts. Its own fields are its settings: they decide every number.
///
/// A part gives the same records whatever the number of threads and whichever parts ran before it, so a
/// study can be stopped after any part and resumed.
pub trait Study: Serialize + Sync {
    /// What a part finds.
    type Record: Serialize + DeserializeOwned + Clone + Send;
    /// Why a part may fail.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Name, as in `egomotion study NAME`.
    fn name(&self) -> &'static str;

    /// Nothing if it can be run with these settings.
    ///
    /// # Errors
    /// [`OutOfRange`] names the first setting that has no meaning.
    fn check(&self) -> Result<(), OutOfRange> {
        Ok(())
    }

    /// Names of the parts, each its own, in the order they run.
    fn parts(&self) -> Vec<String>;

    /// Run the part of that index in [`Study::parts`].
    ///
    /// # Errors
    /// Whatever keeps the part from being run: files that cannot be read. Simulated parts do not fail.
    fn run(&self, part: usize) -> Result<Vec<Self::Record>, Self::Error>;

    /// Tables and figures of the records so far, in the order of the parts; some parts may be missing.
    fn publish(&self, records: &[Self::Record]) -> Publication;
}

/// What a study shows.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Publication {
    /// One line that says what it is.
    pub title: String,
    /// Full results, for files only.
    pub data: Vec<Table>,
    /// Tables for the page, files too.
    pub tables: Vec<Table>,
    /// Figures, in the order of the page.
    pub figures: Vec<Figure>,
}
