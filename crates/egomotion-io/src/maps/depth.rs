//! Depth images: 16-bit PNG with a scale, float in the four bytes of a PNG pixel (TartanAir), `.npy`, PFM.

use std::path::Path;

use egomotion::geometry::{Field, Grid};
use png::{BitDepth, ColorType};

use crate::image::raster::Raster;
use crate::maps::{npy, pfm};
use crate::{IoError, read};

/// Depth in metres, missing where the sensor saw nothing (0, or not a number).
///
/// `levels_per_m` is the scale of 16-bit PNG files; all others hold metres.
///
/// # Errors
/// The file cannot be read, or is no depth image of a known kind.
pub fn read(path: &Path, levels_per_m: f64) -> Result<Field, IoError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let mut depth = match extension.as_str() {
        "npy" => npy::read_map(path)?,
        "pfm" => pfm::read(path)?,
        _ => decode_png(&read::bytes(path)?, levels_per_m, path)?,
    };
    for v in 0..depth.height() {
        depth.row_mut(v).iter_mut().filter(|z| **z <= 0.0).for_each(|z| *z = f32::NAN);
    }
    Ok(depth)
}

/// Depth in metres from the content of a PNG; `path` names it in errors.
///
/// # Errors
/// The content is not a PNG, is cut or corrupt, or is neither 16-bit grey nor 8-bit RGBA.
pub fn decode_png(content: &[u8], levels_per_m: f64, path: &Path) -> Result<Field, IoError> {
    let raster = Raster::decode(content, path)?;
    let values: Option<Vec<f32>> = match (raster.colour, raster.depth) {
        (ColorType::Grayscale, BitDepth::Sixteen) => raster.wide().map(|levels| {
            let metres = |level: u16| {
                if level == 0 { f32::NAN } else { (f64::from(level) / levels_per_m) as f32 }
            };
            levels.map(metres).collect()
        }),
        // Written from memory as blue, green, red, alpha.
        (ColorType::Rgba, BitDepth::Eight) => {
            let (pixels, _) = raster.samples.as_chunks::<4>();
            Some(pixels.iter().map(|&[r, g, b, a]| f32::from_le_bytes([b, g, r, a])).collect())
        }
        _ => None,
    };
    values.and_then(|v| Grid::from_values(raster.width, raster.height, v)).map(Field::from_grid).ok_or_else(
        || IoError::new(path, "is no depth image", "give 16-bit grey PNG, or float32 in 8-bit RGBA"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png(colour: ColorType, depth: BitDepth, samples: &[u8]) -> Vec<u8> {
        let mut content = Vec::new();
        let mut encoder = png::Encoder::new(&mut content, 2, 1);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(samples).unwrap();
        writer.finish().unwrap();
        content
    }

    #[test]
    fn levels_become_metres_and_nothing_is_missing() {
        let content = png(ColorType::Grayscale, BitDepth::Sixteen, &[0, 0, 0x27, 0x10]);
        let depth = decode_png(&content, 5000.0, Path::new("d.png")).unwrap();
        assert_eq!((depth.get(0, 0), depth.get(1, 0)), (None, Some(2.0)));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.pfm");
        pfm::write(&path, &Grid::from_values(2, 1, vec![-1.0, 40_800.0]).unwrap()).unwrap();
        let depth = read(&path, 5000.0).unwrap();
        assert_eq!((depth.get(0, 0), depth.get(1, 0)), (None, Some(40_800.0)));
    }

    #[test]
    fn four_bytes_are_a_float() {
        let [b0, b1, b2, b3] = 7.25f32.to_le_bytes();
        let samples = [b2, b1, b0, b3, 0, 0, 0xC0, 0x7F];
        let depth =
            decode_png(&png(ColorType::Rgba, BitDepth::Eight, &samples), 1.0, Path::new("d.png")).unwrap();
        assert_eq!(depth.get(0, 0), Some(7.25));
        let eight = png(ColorType::Grayscale, BitDepth::Eight, &[1, 2]);
        let error = decode_png(&eight, 1.0, Path::new("d.png")).unwrap_err().to_string();
        assert!(error.contains("d.png: is no depth image"), "{error}");
    }
}
