//! What a SOURCE folder holds: its layout, frames, time stamps, rig and truth.

mod datasets;
mod disparity_file;
mod layout;
mod listing;
mod sequence;
mod timestamps;

use std::path::{Path, PathBuf};

use crate::IoError;
use datasets::Recognised;
pub use disparity_file::DisparityFile;
pub use layout::DatasetLayout;
use layout::KNOWN_LAYOUTS;
pub use sequence::{Clock, DepthSensor, FrameFiles, Sequence, TruthFiles};

/// A recognised recording: one sequence, or a set of independent scenes.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Source {
    /// The folder, as it was given.
    pub path: PathBuf,
    /// The dataset layout.
    pub layout: DatasetLayout,
    /// Why the folder was taken for this layout.
    pub reason: String,
    /// The sequences, never empty; no motion is made between two of them.
    pub sequences: Vec<Sequence>,
}

impl Source {
    /// Recognise a folder and list what it holds. Images are not decoded.
    ///
    /// # Errors
    /// The folder is missing, empty or of no known layout; it has no left or no right images; its
    /// calibration or time stamps are missing or wrong. The error names the file and the line.
    pub fn open(path: &Path) -> Result<Self, IoError> {
        Self::open_with(path, None)
    }

    /// The same with another calibration file in place of the source's own.
    ///
    /// # Errors
    /// As [`Source::open`]; and what is wrong with the calibration file.
    pub fn open_with(path: &Path, calibration: Option<&Path>) -> Result<Self, IoError> {
        let folder = path.canonicalize().map_err(|error| IoError::system(path, "open", &error))?;
        let recognised = if folder.is_dir() {
            datasets::recognise_folder(&folder, calibration)?.ok_or_else(|| unknown_layout(path, &folder))?
        } else {
            let in_file =
                if folder.is_file() { datasets::recognise_file(&folder, calibration)? } else { None };
            in_file.ok_or_else(|| {
                IoError::new(path, "is not a folder", format_args!("give a sequence folder; {KNOWN_LAYOUTS}"))
            })?
        };
        let Recognised { layout, reason, sequences } = recognised;
        Ok(Self { path: path.to_owned(), layout, reason, sequences })
    }
}

/// The error of a folder whose layout is not known.
fn unknown_layout(path: &Path, folder: &Path) -> IoError {
    let empty = folder.read_dir().is_ok_and(|mut entries| entries.next().is_none());
    let reason = if empty {
        "is an empty folder"
    } else if datasets::holds_images_only(folder) {
        "holds images of one camera: depth needs a second one, or depth images"
    } else {
        "has no layout that is known"
    };
    IoError::new(path, reason, KNOWN_LAYOUTS)
}
