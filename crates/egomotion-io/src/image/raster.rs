//! PNG files as raw samples: what images, disparity maps and flow maps have in common.

use std::io::Cursor;
use std::path::Path;

use png::{BitDepth, ColorType, Compression, Decoder, Encoder, Transformations};

use crate::{IoError, read, write};

/// A decoded PNG: interleaved samples, 16-bit ones big-endian as in the file.
pub(crate) struct Raster {
    pub width: usize,
    pub height: usize,
    pub colour: ColorType,
    pub depth: BitDepth,
    pub samples: Vec<u8>,
}

impl Raster {
    /// A PNG's samples; palettes and less than 8 bits become 8 bits, everything else stays as it is.
    pub(crate) fn decode(content: &[u8], path: &Path) -> Result<Self, IoError> {
        let failed = |error: png::DecodingError| broken(path, &error);
        let mut decoder = Decoder::new(Cursor::new(content));
        decoder.set_ignore_text_chunk(true);
        decoder.set_ignore_iccp_chunk(true);
        decoder.set_transformations(Transformations::EXPAND);
        let mut reader = decoder.read_info().map_err(failed)?;
        let (width, height) = (reader.info().width as usize, reader.info().height as usize);
        read::pixels_of(path, width, height, content.len())?;
        let size = reader.output_buffer_size().ok_or_else(|| broken(path, &"it is too large"))?;
        let mut samples = vec![0; size];
        let frame = reader.next_frame(&mut samples).map_err(failed)?;
        // The rest carries the end of the file, so that a cut file is never taken for a whole one.
        reader.finish().map_err(failed)?;
        if (frame.width as usize, frame.height as usize) != (width, height) {
            return Err(broken(path, &"it is an animation of smaller frames"));
        }
        Ok(Self { width, height, colour: frame.color_type, depth: frame.bit_depth, samples })
    }

    /// Samples of one pixel.
    pub(crate) fn channels(&self) -> usize {
        self.colour.samples()
    }

    /// The samples as 16-bit numbers, if the file has 16 bits.
    pub(crate) fn wide(&self) -> Option<impl Iterator<Item = u16>> {
        let pairs = self.samples.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]]));
        (self.depth == BitDepth::Sixteen).then_some(pairs)
    }

    /// Write as a PNG that appears whole or not at all.
    pub(crate) fn write(&self, path: &Path) -> Result<(), IoError> {
        let encoded = self.encode().map_err(|error| {
            IoError::new(path, format_args!("cannot be encoded: {error}"), "give an image that is not empty")
        })?;
        write::bytes(path, &encoded)
    }

    fn encode(&self) -> Result<Vec<u8>, png::EncodingError> {
        let mut encoded = Vec::new();
        // A PNG's sides are 31-bit numbers; anything larger is refused by the encoder as 0.
        let side = |n: usize| u32::try_from(n).unwrap_or(0);
        let mut encoder = Encoder::new(&mut encoded, side(self.width), side(self.height));
        encoder.set_color(self.colour);
        encoder.set_depth(self.depth);
        encoder.set_compression(Compression::Fast);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.samples)?;
        writer.finish()?;
        Ok(encoded)
    }
}

/// (width, height) from a PNG's head alone.
pub(crate) fn size(path: &Path) -> Result<(usize, usize), IoError> {
    let file = std::fs::File::open(path).map_err(|error| IoError::system(path, "read", &error))?;
    let mut decoder = Decoder::new(std::io::BufReader::new(file));
    let info = decoder.read_header_info().map_err(|error| broken(path, &error))?;
    let (width, height) = (info.width as usize, info.height as usize);
    read::pixels(path, width, height).map(|_| (width, height))
}

fn broken(path: &Path, reason: &dyn std::fmt::Display) -> IoError {
    IoError::new(path, format_args!("is not a whole PNG image: {reason}"), "replace the file")
}
