//! True disparity in the encodings of the sets.

use std::path::PathBuf;

use egomotion::geometry::{Field, Grid};

use crate::maps::{disparity_png, npz, pfm};
use crate::{IoError, image, read};

/// A file of true disparity.
#[derive(Debug, Clone, PartialEq)]
pub struct DisparityFile {
    /// The file.
    pub(super) file: PathBuf,
    /// How it holds disparity.
    pub(super) encoding: DisparityEncoding,
}

/// How a file holds disparity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum DisparityEncoding {
    /// KITTI's 16-bit PNG, in 1/256 px, 0 missing.
    Kitti,
    /// Grey levels, 0 missing.
    Levels {
        /// Levels for each pixel of disparity.
        per_px: f64,
    },
    /// PFM, infinite is missing.
    Pfm,
    /// The first array of an `.npz`, infinite is missing.
    Npz,
}

impl DisparityFile {
    /// The map, as shifts u_left − u_right in pixels.
    ///
    /// # Errors
    /// The file cannot be read, or is not what its set says.
    pub fn read(&self) -> Result<Field, IoError> {
        let file = &self.file;
        match self.encoding {
            DisparityEncoding::Kitti => disparity_png::read(file),
            DisparityEncoding::Pfm => pfm::read(file),
            DisparityEncoding::Npz => npz::read_map(file),
            DisparityEncoding::Levels { per_px } => {
                let levels = image::read(file)?;
                let (width, height) = levels.size();
                read::pixels(file, width, height)?;
                let disparity = |level: f32| if level > 0.0 { level / per_px as f32 } else { f32::NAN };
                Ok(Field::from_grid(Grid::from_fn(width, height, |u, v| disparity(levels.at(u, v)))))
            }
        }
    }
}
