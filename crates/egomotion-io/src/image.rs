//! Grey images from PNG files, and grey and colour PNG files for people to look at.

use std::path::Path;

use egomotion::geometry::{Grid, Image};
use png::{BitDepth, ColorType};

use crate::raster::{self, Raster};
use crate::{IoError, read};

/// Rec. 601 luma of red, green and blue.
const LUMA: [f32; 3] = [0.299, 0.587, 0.114];

/// A grey image from a PNG file; see [`decode`].
///
/// # Errors
/// The file cannot be read, is not a PNG, is cut or corrupt, or has more than [`read::MAX_PIXELS`].
pub fn read(path: &Path) -> Result<Image, IoError> {
    decode(&read::bytes(path)?, path)
}

/// (width, height) of a PNG file in pixels, from its head alone.
///
/// # Errors
/// The file cannot be read, or does not start as a PNG.
pub fn size(path: &Path) -> Result<(usize, usize), IoError> {
    raster::size(path)
}

/// A grey image from the content of a PNG; `path` names it in errors.
///
/// Grey levels are 0 … 255, or 0 … 65535 of a 16-bit file; colour becomes Rec. 601 luma; alpha is
/// ignored.
///
/// # Errors
/// The content is not a PNG, is cut or corrupt, or has more than [`read::MAX_PIXELS`].
pub fn decode(content: &[u8], path: &Path) -> Result<Image, IoError> {
    let raster = Raster::decode(content, path)?;
    let levels = match raster.depth {
        BitDepth::Sixteen => grey(&raster, |bytes: [u8; 2]| f32::from(u16::from_be_bytes(bytes))),
        _ => grey(&raster, |[byte]: [u8; 1]| f32::from(byte)),
    };
    Grid::from_values(raster.width, raster.height, levels)
        .ok_or_else(|| IoError::new(path, "has not as many samples as pixels", "replace the file"))
}

/// The grey level of each pixel, from samples of N bytes.
fn grey<const N: usize>(raster: &Raster, number: impl Fn([u8; N]) -> f32) -> Vec<f32> {
    let (samples, _) = raster.samples.as_chunks::<N>();
    let pixels = samples.chunks_exact(raster.channels());
    let level = |pixel: &[[u8; N]]| match pixel {
        [r, g, b, ..] => LUMA[0] * number(*r) + LUMA[1] * number(*g) + LUMA[2] * number(*b),
        [grey, ..] => number(*grey),
        [] => 0.0,
    };
    pixels.map(level).collect()
}

/// Write an 8-bit grey PNG; levels are rounded and clipped to 0 … 255, NaN becomes 0.
///
/// # Errors
/// The file cannot be written, or the image is empty.
pub fn write_grey(path: &Path, image: &Image) -> Result<(), IoError> {
    // `as` saturates and maps NaN to 0.
    let samples = image.values().iter().map(|level| level.round() as u8).collect();
    eight_bit(image.size(), ColorType::Grayscale, samples).write(path)
}

/// Write an 8-bit colour PNG of (red, green, blue).
///
/// # Errors
/// The file cannot be written, or the image is empty.
pub fn write_rgb(path: &Path, image: &Grid<[u8; 3]>) -> Result<(), IoError> {
    let samples = image.values().as_flattened().to_vec();
    eight_bit(image.size(), ColorType::Rgb, samples).write(path)
}

fn eight_bit((width, height): (usize, usize), colour: ColorType, samples: Vec<u8>) -> Raster {
    Raster { width, height, colour, depth: BitDepth::Eight, samples }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encoded(colour: ColorType, depth: BitDepth, samples: &[u8]) -> Vec<u8> {
        let mut content = Vec::new();
        let mut encoder = png::Encoder::new(&mut content, 2, 1);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        if colour == ColorType::Indexed {
            encoder.set_palette(vec![0, 0, 0, 100, 200, 50]);
        }
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(samples).unwrap();
        writer.finish().unwrap();
        content
    }

    fn levels(colour: ColorType, depth: BitDepth, samples: &[u8]) -> Vec<f32> {
        decode(&encoded(colour, depth, samples), Path::new("a.png")).unwrap().values().to_vec()
    }

    #[test]
    fn every_kind_of_png_becomes_grey() {
        use {BitDepth::*, ColorType::*};
        let luma = 0.299 * 100.0 + 0.587 * 200.0 + 0.114 * 50.0;
        assert_eq!(levels(Grayscale, Eight, &[7, 250]), [7.0, 250.0]);
        assert_eq!(levels(Grayscale, Sixteen, &[1, 2, 255, 255]), [258.0, 65535.0]);
        assert_eq!(levels(Grayscale, One, &[0b0100_0000]), [0.0, 255.0]);
        assert_eq!(levels(GrayscaleAlpha, Eight, &[7, 0, 250, 9]), [7.0, 250.0]);
        assert_eq!(levels(Indexed, One, &[0b0100_0000]), [0.0, luma]);
        assert_eq!(levels(Rgb, Eight, &[0, 0, 0, 100, 200, 50]), [0.0, luma]);
        assert_eq!(levels(Rgba, Eight, &[0, 0, 0, 0, 100, 200, 50, 3]), [0.0, luma]);
        let wide = levels(Rgba, Sixteen, &[0, 0, 0, 0, 0, 0, 0, 0, 100, 0, 200, 0, 50, 0, 9, 9]);
        assert!((wide[1] - 256.0 * luma).abs() < 0.01);
    }

    #[test]
    fn grey_and_colour_come_back_as_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let mut image = Image::from_fn(5, 3, |u, v| (40 * u + v) as f32);
        write_grey(&path, &image).unwrap();
        assert_eq!(read(&path).unwrap(), image);
        assert_eq!(size(&path).unwrap(), (5, 3));
        for (level, expected) in [(f32::NAN, 0.0), (-4.0, 0.0), (254.6, 255.0), (1e9, 255.0)] {
            image.set(4, 2, level);
            write_grey(&path, &image).unwrap();
            assert_eq!(read(&path).unwrap().at(4, 2), expected);
        }
        write_rgb(&path, &Grid::filled(2, 2, [255, 0, 0])).unwrap();
        assert_eq!(read(&path).unwrap(), Image::filled(2, 2, 0.299 * 255.0));
        assert!(write_grey(&path, &Image::filled(0, 3, 0.0)).unwrap_err().to_string().contains("a.png"));
    }

    #[test]
    fn a_size_beyond_the_bound_is_refused_before_it_is_allocated() {
        let mut content = encoded(ColorType::Grayscale, BitDepth::Eight, &[1, 2]);
        content[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
        let check = crc32(&content[12..29]).to_be_bytes();
        content[29..33].copy_from_slice(&check);
        let error = decode(&content, Path::new("huge.png")).unwrap_err().to_string();
        assert!(error.contains("huge.png: has a size of 65536x65536"), "{error}");
    }

    /// The check sum of a PNG chunk, bit by bit.
    fn crc32(bytes: &[u8]) -> u32 {
        let step = |crc: u32| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
        let over = |crc, byte: &u8| (0..8).fold(crc ^ u32::from(*byte), |c, _| step(c));
        !bytes.iter().fold(!0, over)
    }
}
