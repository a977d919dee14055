//! Images from a stream, one after the other: PNG files end to end, or raw grey frames of a known size.

use std::io::Read;
use std::path::{Path, PathBuf};

use egomotion::geometry::{Grid, Image};

use crate::{IoError, image, read};

/// The longest PNG that is read, in bytes (1 GiB): a bound on memory, whatever the stream promises. An image of
/// [`read::MAX_PIXELS`] 8-bit levels needs a quarter of it.
const MAX_PNG_BYTES: usize = 1 << 30;

/// How the images of a stream are coded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StreamFormat {
    /// PNG files, each ending where the next begins.
    Png,
    /// 8-bit grey levels row by row, of (width, height) pixels each.
    Raw {
        /// Pixels of a row.
        width: usize,
        /// Rows.
        height: usize,
    },
}

/// Images of a stream.
#[derive(Debug)]
pub struct ImageStream<R> {
    source: R,
    format: StreamFormat,
    /// What errors call the stream.
    name: PathBuf,
    images: usize,
    /// Where the next image begins is not known any more.
    lost: bool,
}

impl<R: Read> ImageStream<R> {
    /// The images of a stream that errors call `name`.
    pub fn new(source: R, format: StreamFormat, name: &Path) -> Self {
        Self { source, format, name: name.to_owned(), images: 0, lost: false }
    }

    /// The next image; `None` where the stream ends between two of them.
    ///
    /// # Errors
    /// The stream cannot be read, ends inside an image, or holds something else; the number of the image is named,
    /// from 0. After a PNG that is whole but cannot be decoded the next one is read, after anything else nothing.
    pub fn next_image(&mut self) -> Result<Option<Image>, IoError> {
        if self.lost {
            return Ok(None);
        }
        self.lost = true;
        let content = match self.format {
            StreamFormat::Png => self.next_png()?,
            StreamFormat::Raw { width, height } => self.exactly(read::pixels(&self.name, width, height)?)?,
        };
        self.lost = false;
        let Some(content) = content else { return Ok(None) };
        self.images += 1;
        match self.format {
            StreamFormat::Png => {
                let name = format!("{} image {}", self.name.display(), self.images - 1);
                image::decode(&content, Path::new(&name)).map(Some)
            }
            StreamFormat::Raw { width, height } => {
                Ok(Grid::from_values(width, height, content.into_iter().map(f32::from).collect()))
            }
        }
    }

    /// One PNG: its signature, then chunks up to the one called IEND.
    fn next_png(&mut self) -> Result<Option<Vec<u8>>, IoError> {
        let Some(mut content) = self.exactly(8)? else { return Ok(None) };
        if content != image::PNG_SIGNATURE {
            let advice = "pipe PNG files one after the other, or raw frames with --raw WxH";
            return Err(IoError::new(&self.name, format_args!("image {} is no PNG", self.images), advice));
        }
        loop {
            let head = self.rest(8)?;
            let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
            if length > MAX_PNG_BYTES || content.len() + length > MAX_PNG_BYTES {
                let reason =
                    format_args!("image {} is longer than {MAX_PNG_BYTES} bytes", self.images).to_string();
                return Err(IoError::new(&self.name, reason, "check what is piped in"));
            }
            let body = self.rest(length + 4)?;
            let last = &head[4..8] == b"IEND";
            content.extend(head);
            content.extend(body);
            if last {
                return Ok(Some(content));
            }
        }
    }

    /// So many bytes of an image that has begun.
    fn rest(&mut self, count: usize) -> Result<Vec<u8>, IoError> {
        let bytes = self.at_most(count)?;
        if bytes.len() == count { Ok(bytes) } else { Err(self.cut()) }
    }

    /// So many bytes; `None` where the stream ends before the first.
    fn exactly(&mut self, count: usize) -> Result<Option<Vec<u8>>, IoError> {
        let bytes = self.at_most(count)?;
        match bytes.len() {
            0 => Ok(None),
            length if length == count => Ok(Some(bytes)),
            _ => Err(self.cut()),
        }
    }

    /// Memory grows with what is there, not with what is promised.
    fn at_most(&mut self, count: usize) -> Result<Vec<u8>, IoError> {
        let mut bytes = Vec::new();
        let found = (&mut self.source).take(count as u64).read_to_end(&mut bytes);
        found.map_err(|error| IoError::system(&self.name, "read", &error))?;
        Ok(bytes)
    }

    fn cut(&self) -> IoError {
        IoError::new(&self.name, format_args!("ends inside image {}", self.images), "pipe whole images in")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png(level: f32) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        image::write_grey(&path, &Image::filled(5, 3, level)).unwrap();
        std::fs::read(path).unwrap()
    }

    fn stream(content: &[u8], format: StreamFormat) -> ImageStream<&[u8]> {
        ImageStream::new(content, format, Path::new("standard input"))
    }

    #[test]
    fn images_follow_each_other() {
        let mut both = stream(&[], StreamFormat::Png);
        assert_eq!(both.next_image().unwrap(), None);
        let content = [png(7.0), png(250.0)].concat();
        both = stream(&content, StreamFormat::Png);
        assert_eq!(both.next_image().unwrap().unwrap(), Image::filled(5, 3, 7.0));
        assert_eq!(both.next_image().unwrap().unwrap(), Image::filled(5, 3, 250.0));
        assert_eq!(both.next_image().unwrap(), None);
        // A damaged image in the middle costs that image alone.
        let mut damaged = content.clone();
        damaged[45] ^= 0xff;
        both = stream(&damaged, StreamFormat::Png);
        assert!(
            both.next_image().unwrap_err().to_string().contains("standard input image 0: is not a whole PNG")
        );
        assert_eq!(both.next_image().unwrap().unwrap(), Image::filled(5, 3, 250.0));
        let raw = [1, 2, 3, 4, 5, 6, 7, 8];
        let mut raw = stream(&raw, StreamFormat::Raw { width: 2, height: 2 });
        assert_eq!(raw.next_image().unwrap().unwrap().values(), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(raw.next_image().unwrap().unwrap().at(1, 1), 8.0);
        assert_eq!(raw.next_image().unwrap(), None);
    }

    #[test]
    fn a_stream_that_is_cut_or_something_else_is_refused_by_number() {
        let whole = [png(7.0), png(9.0)].concat();
        for length in 1..whole.len() {
            let mut cut = stream(&whole[..length], StreamFormat::Png);
            let found: Result<Vec<_>, _> = std::iter::from_fn(|| cut.next_image().transpose()).collect();
            match found {
                Ok(images) => assert_eq!((images.len(), length), (1, png(7.0).len())),
                Err(error) => {
                    assert!(error.to_string().contains("standard input: ends inside image"), "{error}")
                }
            }
        }
        let refused = |content: &[u8], format| stream(content, format).next_image().unwrap_err().to_string();
        assert!(
            refused(b"\xff\xd8\xff\xe0 a JPEG", StreamFormat::Png)
                .contains("standard input: image 0 is no PNG")
        );
        let mut huge = whole[..8].to_vec();
        huge.extend([0xff, 0xff, 0xff, 0xff]);
        huge.extend(b"IDAT");
        assert!(refused(&huge, StreamFormat::Png).contains("image 0 is longer than"));
        assert!(
            refused(&[1, 2, 3], StreamFormat::Raw { width: 2, height: 2 }).contains("ends inside image 0")
        );
        assert!(refused(&[], StreamFormat::Raw { width: 0, height: 2 }).contains("has a size of 0x2"));
    }
}
