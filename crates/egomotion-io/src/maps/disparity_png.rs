//! KITTI disparity maps: 16-bit grey PNG, disparity × 256, 0 is missing.

use std::path::Path;

use egomotion::geometry::{Field, Grid};
use png::{BitDepth, ColorType};

use crate::image::raster::Raster;
use crate::{IoError, read};

/// Levels for each pixel of disparity, by KITTI's definition of the format.
const LEVELS_PER_PX: f32 = 256.0;

/// A disparity map, in pixels.
///
/// # Errors
/// The file cannot be read, is not a PNG, is cut or corrupt, or is not 16-bit grey.
pub fn read(path: &Path) -> Result<Field, IoError> {
    decode(&read::bytes(path)?, path)
}

/// A disparity map from the content of a PNG, in pixels; `path` names it in errors.
///
/// # Errors
/// The content is not a PNG, is cut or corrupt, or is not 16-bit grey.
pub fn decode(content: &[u8], path: &Path) -> Result<Field, IoError> {
    let raster = Raster::decode(content, path)?;
    let disparity = |level: u16| if level == 0 { f32::NAN } else { f32::from(level) / LEVELS_PER_PX };
    let samples = raster.wide().filter(|_| raster.colour == ColorType::Grayscale);
    let values =
        samples.and_then(|s| Grid::from_values(raster.width, raster.height, s.map(disparity).collect()));
    values.map(Field::from_grid).ok_or_else(|| {
        IoError::new(
            path,
            "is not a 16-bit grey PNG",
            "give a KITTI disparity map (disparity x 256, 0 missing)",
        )
    })
}

/// Write a disparity map given in pixels.
///
/// Disparities are rounded to 1/256 px. What the format cannot hold becomes missing: negative
/// ones and those of 256 px and more. Valid ones below 1/256 px become 1/256 px, because 0 means missing.
///
/// # Errors
/// The file cannot be written, or the map is empty.
pub fn write(path: &Path, disparity: &Field) -> Result<(), IoError> {
    let (width, height) = disparity.size();
    let samples = disparity.grid().values().iter().flat_map(|&d| level(d).to_be_bytes()).collect();
    Raster { width, height, colour: ColorType::Grayscale, depth: BitDepth::Sixteen, samples }.write(path)
}

fn level(disparity: f32) -> u16 {
    let level = (disparity * LEVELS_PER_PX).round();
    if disparity >= 0.0 && level <= f32::from(u16::MAX) { level.max(1.0) as u16 } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn disparities_come_back_to_1_in_256() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.png");
        let given = [f32::NAN, 0.0, 1.0, 37.126, 255.996, 256.0, -1.0, 0.001, f32::INFINITY];
        let field = Field::from_grid(Grid::from_values(9, 1, given.to_vec()).unwrap());
        write(&path, &field).unwrap();
        let back = read(&path).unwrap();
        let expected = [
            None,
            Some(1.0 / 256.0),
            Some(1.0),
            Some(9504.0 / 256.0),
            Some(65535.0 / 256.0),
            None,
            None,
            Some(1.0 / 256.0),
            None,
        ];
        for (u, value) in expected.into_iter().enumerate() {
            assert_eq!(back.get(u, 0), value, "{u}");
        }
    }

    #[test]
    fn an_eight_bit_image_is_not_a_disparity_map() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.png");
        crate::image::write_grey(&path, &Grid::filled(3, 2, 9.0)).unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains("d.png: is not a 16-bit grey PNG"), "{error}");
    }
}
