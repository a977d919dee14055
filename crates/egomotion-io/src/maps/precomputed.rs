//! Disparity and flow that others computed: one file for each frame in a folder, of a format that its name tells.

use std::path::{Path, PathBuf};

use egomotion::geometry::Field;

use crate::IoError;
use crate::maps::{disparity_png, flo, flow_png, npy, pfm};

/// Standard deviation of precomputed disparity or flow that comes without one, in pixels. Larger values widen every
/// interval that follows from it.
pub const DEFAULT_SIGMA_PX: f32 = 0.3;

/// File name extensions of a disparity map, in the order in which they are looked for.
pub(crate) const DISPARITY_EXTENSIONS: &[&str] = &["pfm", "npy", "png"];
/// File name extensions of a flow map, in the order in which they are looked for.
pub(crate) const FLOW_EXTENSIONS: &[&str] = &["flo", "npy", "png"];

/// The map of a frame in a folder: named by the stem of its image, or by its number in any width.
pub(crate) fn find(folder: &Path, image: &Path, index: usize, extensions: &[&str]) -> Option<PathBuf> {
    let stem = image.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let names = [stem.to_owned(), format!("{index:06}"), format!("{index:010}"), index.to_string()];
    let mut files = names
        .iter()
        .filter(|name| !name.is_empty())
        .flat_map(|name| extensions.iter().map(move |extension| folder.join(format!("{name}.{extension}"))));
    files.find(|file| file.is_file())
}

/// A disparity map in pixels: PFM, `.npy`, or KITTI's 16-bit PNG; what is not finite is missing.
///
/// # Errors
/// The file cannot be read, or is no such map.
pub(crate) fn read_disparity(path: &Path) -> Result<Field, IoError> {
    match extension(path).as_str() {
        "pfm" => pfm::read(path),
        "npy" => npy::read_map(path),
        "png" => disparity_png::read(path),
        _ => Err(IoError::new(path, "is no disparity map by its name", "give .pfm, .npy or KITTI's .png")),
    }
}

/// A flow map, (vx, vy) in pixels: `.flo`, `.npy` of (height, width, 2), or KITTI's 16-bit PNG.
///
/// # Errors
/// The file cannot be read, or is no such map.
pub(crate) fn read_flow(path: &Path) -> Result<[Field; 2], IoError> {
    match extension(path).as_str() {
        "flo" => flo::read(path),
        "npy" => npy::read_flow(path),
        "png" => flow_png::read(path),
        _ => Err(IoError::new(path, "is no flow map by its name", "give .flo, .npy or KITTI's .png")),
    }
}

fn extension(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;
    use egomotion::geometry::Grid;

    #[test]
    fn a_map_is_found_by_stem_or_number_and_read_by_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        pfm::write(&at("left_7.pfm"), &Grid::filled(3, 2, 4.5)).unwrap();
        disparity_png::write(&at("000008.png"), &Field::from_grid(Grid::filled(3, 2, 6.0))).unwrap();
        let found = |stem: &str, index| find(folder.path(), Path::new(stem), index, DISPARITY_EXTENSIONS);
        assert_eq!(found("x/left_7.png", 7), Some(at("left_7.pfm")));
        assert_eq!(found("x/left_8.png", 8), Some(at("000008.png")));
        assert_eq!(found("x/left_9.png", 9), None);
        assert_eq!(read_disparity(&at("left_7.pfm")).unwrap().get(2, 1), Some(4.5));
        assert_eq!(read_disparity(&at("000008.png")).unwrap().get(2, 1), Some(6.0));
        assert!(read_disparity(&at("a.txt")).unwrap_err().to_string().contains("by its name"));
        assert!(read_flow(&at("a.pfm")).unwrap_err().to_string().contains("by its name"));
    }
}
