//! KITTI flow maps: 16-bit RGB PNG, (v − 32768)/64 for each component, the third channel tells validity.

use std::path::Path;

use egomotion::geometry::{Field, Grid};
use png::{BitDepth, ColorType};

use crate::image::raster::Raster;
use crate::{IoError, read};

/// Levels for each pixel of flow, by KITTI's definition of the format.
const LEVELS_PER_PX: f32 = 64.0;
/// The level of no flow, by the same definition.
const LEVEL_OF_NO_FLOW: f32 = 32768.0;

/// A flow map, (vx, vy) in pixels.
///
/// # Errors
/// The file cannot be read, is not a PNG, is cut or corrupt, or is not 16-bit RGB.
pub fn read(path: &Path) -> Result<[Field; 2], IoError> {
    decode(&read::bytes(path)?, path)
}

/// A flow map from the content of a PNG, (vx, vy) in pixels; `path` names it in errors.
///
/// # Errors
/// The content is not a PNG, is cut or corrupt, or is not 16-bit RGB.
pub fn decode(content: &[u8], path: &Path) -> Result<[Field; 2], IoError> {
    let raster = Raster::decode(content, path)?;
    let samples = raster.wide().filter(|_| raster.colour == ColorType::Rgb).ok_or_else(|| {
        IoError::new(
            path,
            "is not a 16-bit RGB PNG",
            "give a KITTI flow map (64 v + 32768, third channel valid)",
        )
    })?;
    let samples: Vec<u16> = samples.collect();
    let (pixels, _) = samples.as_chunks::<3>();
    let component = |k: usize| {
        let value = |pixel: &[u16; 3]| {
            if pixel[2] > 0 { (f32::from(pixel[k]) - LEVEL_OF_NO_FLOW) / LEVELS_PER_PX } else { f32::NAN }
        };
        Grid::from_values(raster.width, raster.height, pixels.iter().map(value).collect())
            .map(Field::from_grid)
    };
    component(0)
        .zip(component(1))
        .map(|(u, v)| [u, v])
        .ok_or_else(|| IoError::new(path, "has not as many samples as pixels", "replace the file"))
}

/// Write a flow map given in pixels, rounded to 1/64 px.
///
/// What the format cannot hold, a component below −512 px or of 512 px and more, becomes missing.
///
/// # Errors
/// The file cannot be written, the map is empty, or the two components differ in size.
pub fn write(path: &Path, [vx, vy]: &[Field; 2]) -> Result<(), IoError> {
    if vx.size() != vy.size() {
        return Err(IoError::new(
            path,
            "the components of the flow differ in size",
            "give two planes of one size",
        ));
    }
    let (width, height) = vx.size();
    let pixels =
        vx.grid().values().iter().zip(vy.grid().values()).map(|(&x, &y)| match (level(x), level(y)) {
            (Some(x), Some(y)) => [x, y, 1],
            _ => [0, 0, 0],
        });
    let samples = pixels.flatten().flat_map(u16::to_be_bytes).collect();
    Raster { width, height, colour: ColorType::Rgb, depth: BitDepth::Sixteen, samples }.write(path)
}

fn level(component: f32) -> Option<u16> {
    let level = (component * LEVELS_PER_PX + LEVEL_OF_NO_FLOW).round();
    (0.0..=f32::from(u16::MAX)).contains(&level).then_some(level as u16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use egomotion::geometry::Grid;

    #[test]
    fn flow_comes_back_to_1_in_64() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f.png");
        let plane = |values: &[f32]| Field::from_grid(Grid::from_values(3, 2, values.to_vec()).unwrap());
        let vx = plane(&[0.0, -512.0, 511.984, 512.0, f32::NAN, 1.25]);
        let vy = plane(&[0.0, 3.01, -0.5, 1.0, 1.0, f32::NAN]);
        write(&path, &[vx, vy]).unwrap();
        let [vx, vy] = read(&path).unwrap();
        let back: Vec<_> = (0..6).map(|i| (vx.get(i % 3, i / 3), vy.get(i % 3, i / 3))).collect();
        let known = |x: f32, y: f32| (Some(x), Some(y));
        let far = 32767.0 / 64.0;
        let expected = [known(0.0, 0.0), known(-512.0, 193.0 / 64.0), known(far, -0.5)];
        assert_eq!(back[..3], expected);
        assert_eq!(back[3..], [(None, None); 3]);
    }

    #[test]
    fn a_disparity_map_is_not_a_flow_map() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f.png");
        crate::maps::disparity_png::write(&path, &Field::missing(3, 2)).unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("f.png: is not a 16-bit RGB PNG"));
        assert!(write(&path, &[Field::missing(3, 2), Field::missing(2, 3)]).is_err());
    }
}
