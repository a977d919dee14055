//! Grey images from PNG, JPEG, TIFF and PNM files, and grey and colour PNG files for people to look at.

pub(crate) mod raster;
pub mod stream;
pub(crate) mod undistort;

use std::io::{BufReader, Cursor};
use std::path::Path;

use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use egomotion::geometry::{Grid, Image};
use png::{BitDepth, ColorType};

use crate::{IoError, read};
use raster::Raster;

/// Weights of red, green and blue in the luma of ITU-R BT.601, which sum to 1.
const LUMA_WEIGHTS: [f32; 3] = [0.299, 0.587, 0.114];

/// 16-bit levels for each 8-bit one: 65535 is as white as 255, and 65535 = 257 · 255.
pub const LEVELS_16_PER_8_BIT: f32 = 257.0;

/// File name extensions of the images that can be read, in small letters.
const EXTENSIONS: [&str; 8] = ["png", "jpg", "jpeg", "tif", "tiff", "pgm", "ppm", "pnm"];

/// Formats that are read beside PNG, whose decoder disparity, flow and depth maps share.
const FORMATS_BESIDE_PNG: [ImageFormat; 3] = [ImageFormat::Jpeg, ImageFormat::Tiff, ImageFormat::Pnm];
/// The first eight bytes of every PNG file (PNG specification, section 5.2).
pub(crate) const PNG_SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Grey level of red, green and blue: the luma of ITU-R BT.601, in the unit of its arguments.
#[inline]
pub fn luma([red, green, blue]: [f32; 3]) -> f32 {
    LUMA_WEIGHTS[0] * red + LUMA_WEIGHTS[1] * green + LUMA_WEIGHTS[2] * blue
}

/// Whether a file's name ends like that of an image.
pub(crate) fn has_image_extension(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
    ending.is_some_and(|ending| EXTENSIONS.contains(&&*ending))
}

/// A grey image from a file; see [`decode`].
///
/// # Errors
/// The file cannot be read, is no image of a known kind, is cut or corrupt, or has more than [`read::MAX_PIXELS`].
pub fn read(path: &Path) -> Result<Image, IoError> {
    decode(&read::bytes(path)?, path)
}

/// (width, height) of an image file in pixels, from its head alone.
///
/// # Errors
/// The file cannot be read, or does not start as an image of a known kind.
pub fn size(path: &Path) -> Result<(usize, usize), IoError> {
    if let Ok(size) = raster::size(path) {
        return Ok(size);
    }
    let file = std::fs::File::open(path).map_err(|error| IoError::system(path, "read", &error))?;
    let reader = ImageReader::new(BufReader::new(file)).with_guessed_format();
    let reader = reader.map_err(|error| IoError::system(path, "read", &error))?;
    if !reader.format().is_some_and(|format| FORMATS_BESIDE_PNG.contains(&format)) {
        return raster::size(path);
    }
    let (width, height) = reader.into_dimensions().map_err(|error| broken(path, &error))?;
    let size = (width as usize, height as usize);
    read::pixels(path, size.0, size.1).map(|_| size)
}

/// A grey image from the content of a PNG, JPEG, TIFF, PGM or PPM file; `path` names it in errors.
///
/// Grey levels are 0 … 255, those of a 16-bit file with their fractions: what is measured in an image is judged by
/// the noise of such levels. Colour becomes Rec. 601 luma; alpha is ignored.
///
/// # Errors
/// The content is no image of a known kind, is cut or corrupt, or has more pixels than [`read::MAX_PIXELS`]
/// or than its bytes can hold.
pub fn decode(content: &[u8], path: &Path) -> Result<Image, IoError> {
    if !content.starts_with(PNG_SIGNATURE) {
        return decode_other_format(content, path);
    }
    let raster = Raster::decode(content, path)?;
    let levels = match raster.depth {
        BitDepth::Sixteen => {
            grey(&raster, |bytes: [u8; 2]| f32::from(u16::from_be_bytes(bytes)) / LEVELS_16_PER_8_BIT)
        }
        _ => grey(&raster, |[byte]: [u8; 1]| f32::from(byte)),
    };
    grid(path, (raster.width, raster.height), levels)
}

fn grid(path: &Path, (width, height): (usize, usize), levels: Vec<f32>) -> Result<Image, IoError> {
    Grid::from_values(width, height, levels)
        .ok_or_else(|| IoError::new(path, "has not as many samples as pixels", "replace the file"))
}

/// A grey image from the content of one of [`FORMATS_BESIDE_PNG`].
fn decode_other_format(content: &[u8], path: &Path) -> Result<Image, IoError> {
    let reader = ImageReader::new(Cursor::new(content)).with_guessed_format();
    let mut reader = reader.map_err(|error| IoError::system(path, "read", &error))?;
    if !reader.format().is_some_and(|format| FORMATS_BESIDE_PNG.contains(&format)) {
        let reason = "is no PNG, JPEG, TIFF, PGM or PPM image";
        return Err(IoError::new(path, reason, "give images of one of these kinds"));
    }
    let mut limits = Limits::default();
    limits.max_alloc = Some(4 * read::MAX_PIXELS as u64);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|error| broken(path, &error))?;
    let (width, height) = decoder.dimensions();
    let size = (width as usize, height as usize);
    read::pixels_of(path, size.0, size.1, content.len())?;
    let image = DynamicImage::from_decoder(decoder).map_err(|error| broken(path, &error))?;
    let levels = match image {
        DynamicImage::ImageLuma8(grey) => grey.iter().map(|&level| f32::from(level)).collect(),
        DynamicImage::ImageLuma16(grey) => {
            grey.iter().map(|&level| f32::from(level) / LEVELS_16_PER_8_BIT).collect()
        }
        DynamicImage::ImageRgb16(_) | DynamicImage::ImageRgba16(_) | DynamicImage::ImageLumaA16(_) => {
            grey_levels(&image.into_rgb16(), LEVELS_16_PER_8_BIT)
        }
        _ => grey_levels(&image.into_rgb8(), 1.0),
    };
    grid(path, size, levels)
}

/// The grey level of each pixel of interleaved red, green and blue, of which `unit` is one 8-bit level.
fn grey_levels<T: Copy + Into<f32>>(samples: &[T], unit: f32) -> Vec<f32> {
    let (pixels, _) = samples.as_chunks::<3>();
    pixels.iter().map(|&[r, g, b]: &[T; 3]| luma([r.into(), g.into(), b.into()]) / unit).collect()
}

fn broken(path: &Path, reason: &dyn std::fmt::Display) -> IoError {
    IoError::new(path, format_args!("is not a whole image: {reason}"), "replace the file")
}

/// The grey level of each pixel, from samples of N bytes.
fn grey<const N: usize>(raster: &Raster, number: impl Fn([u8; N]) -> f32) -> Vec<f32> {
    let (samples, _) = raster.samples.as_chunks::<N>();
    let pixels = samples.chunks_exact(raster.channels());
    let level = |pixel: &[[u8; N]]| match pixel {
        [r, g, b, ..] => luma([number(*r), number(*g), number(*b)]),
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
        assert_eq!(levels(Grayscale, Sixteen, &[1, 2, 255, 255]), [258.0 / 257.0, 255.0]);
        assert_eq!(levels(Grayscale, One, &[0b0100_0000]), [0.0, 255.0]);
        assert_eq!(levels(GrayscaleAlpha, Eight, &[7, 0, 250, 9]), [7.0, 250.0]);
        assert_eq!(levels(Indexed, One, &[0b0100_0000]), [0.0, luma]);
        assert_eq!(levels(Rgb, Eight, &[0, 0, 0, 100, 200, 50]), [0.0, luma]);
        assert_eq!(levels(Rgba, Eight, &[0, 0, 0, 0, 100, 200, 50, 3]), [0.0, luma]);
        let wide = levels(Rgba, Sixteen, &[0, 0, 0, 0, 0, 0, 0, 0, 100, 0, 200, 0, 50, 0, 9, 9]);
        assert!((wide[1] - 256.0 / 257.0 * luma).abs() < 1e-4);
    }

    #[test]
    fn other_kinds_become_grey() {
        use ::image::{Luma, Rgb};
        let encoded = |image: DynamicImage, format| {
            let mut content = Cursor::new(Vec::new());
            image.write_to(&mut content, format).unwrap();
            content.into_inner()
        };
        let folder = tempfile::tempdir().unwrap();
        let grey = ::image::GrayImage::from_fn(17, 9, |u, v| Luma([(10 * u + v) as u8]));
        let wide = ::image::ImageBuffer::from_fn(17, 9, |u, v| Luma([(1000 * u + v) as u16]));
        let colour = ::image::RgbImage::from_pixel(17, 9, Rgb([100, 200, 50]));
        let luma = 0.299 * 100.0 + 0.587 * 200.0 + 0.114 * 50.0;
        for (format, name) in
            [(ImageFormat::Tiff, "a.tif"), (ImageFormat::Pnm, "a.pgm"), (ImageFormat::Jpeg, "a.jpg")]
        {
            let path = folder.path().join(name);
            assert!(has_image_extension(&path));
            let content = encoded(grey.clone().into(), format);
            std::fs::write(&path, &content).unwrap();
            assert_eq!(size(&path).unwrap(), (17, 9));
            let image = read(&path).unwrap();
            // JPEG loses some.
            assert!((image.at(16, 8) - 168.0).abs() < 4.0 && (image.at(3, 0) - 30.0).abs() < 4.0, "{name}");
            if format != ImageFormat::Jpeg {
                assert_eq!(image.at(16, 8), 168.0);
                assert_eq!(
                    decode(&encoded(wide.clone().into(), format), &path).unwrap().at(16, 8),
                    16008.0 / 257.0
                );
            }
            let image = decode(&encoded(colour.clone().into(), format), &path).unwrap();
            assert!((image.at(5, 5) - luma).abs() < 2.0, "{name}: {}", image.at(5, 5));
            for length in 0..content.len() - 2 {
                // Cut anywhere it is an error or, where only the filling of a JPEG's end is lost, an image.
                let cut = decode(&content[..length], &path);
                assert!(cut.is_err() || format == ImageFormat::Jpeg, "{name} {length}");
            }
        }
        let error = decode(b"GIF89a, or whatever", Path::new("a.gif")).unwrap_err().to_string();
        assert!(error.contains("a.gif: is no PNG, JPEG, TIFF, PGM or PPM image"), "{error}");
        let error = decode(b"P5 100000 100000 255 ", Path::new("a.pgm")).unwrap_err().to_string();
        assert!(error.contains("a.pgm: has a size of 100000x100000"), "{error}");
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
