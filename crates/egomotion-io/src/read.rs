//! Reading whole files with a bound on their size, and numbers out of text.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde::de::DeserializeOwned;

use crate::IoError;

/// The most pixels that a decoded image or map may have, 2²⁸: a bound on memory, 1 GiB in single precision.
pub const MAX_PIXELS: usize = 1 << 28;

/// The most pixels that a byte of a file can stand for: deflate, the densest code of the formats read here, makes
/// at most 1032 bytes of one (<https://zlib.net/zlib_tech.html>), and a pixel has at least one bit.
const MAX_PIXELS_PER_BYTE: usize = 8 * 1032;

/// The longest text file that is read, in bytes (256 MiB): a bound on memory, far above any calibration or trajectory.
const MAX_TEXT_BYTES: u64 = 1 << 28;

/// The longest binary file that is read, in bytes: a map of [`MAX_PIXELS`] with 8 bytes each, and its head.
const MAX_BINARY_BYTES: u64 = (MAX_PIXELS as u64) * 8 + (1 << 20);

/// A whole binary file.
///
/// # Errors
/// The file cannot be read, or is longer than any map can be.
pub(crate) fn bytes(path: &Path) -> Result<Vec<u8>, IoError> {
    bounded(path, MAX_BINARY_BYTES)
}

/// A whole text file.
///
/// # Errors
/// The file cannot be read, is longer than 256 MB, or is not UTF-8.
pub fn text(path: &Path) -> Result<String, IoError> {
    let not_text =
        |_| IoError::new(path, "is not a text file", "check that the name belongs to this kind of file");
    String::from_utf8(bounded(path, MAX_TEXT_BYTES)?).map_err(not_text)
}

/// The value that a TOML file holds.
///
/// # Errors
/// The file cannot be read, or does not hold such a value; the error names the line.
pub fn toml<T: DeserializeOwned>(path: &Path) -> Result<T, IoError> {
    toml_text(&text(path)?, path)
}

/// The value that a text in TOML holds; errors name the file at `path`, which it was read from.
///
/// # Errors
/// The text does not hold such a value; the error names the line.
pub fn toml_text<T: DeserializeOwned>(text: &str, path: &Path) -> Result<T, IoError> {
    ::toml::from_str(text).map_err(|e| {
        let error = IoError::new(path, e.message().replace('\n', " "), "correct the file");
        match e.span() {
            Some(span) => error.at_line(line_at(text, span.start)),
            None => error,
        }
    })
}

/// Number of the line, from 1, on which the byte at `offset` stands.
pub fn line_at(text: &str, offset: usize) -> usize {
    text.bytes().take(offset).filter(|&b| b == b'\n').count() + 1
}

fn bounded(path: &Path, limit: u64) -> Result<Vec<u8>, IoError> {
    let failed = |error: std::io::Error| IoError::system(path, "read", &error);
    let file = File::open(path).map_err(failed)?;
    let mut content = Vec::new();
    // The length that the system tells may be wrong (pipes, devices), so the reading itself is bounded.
    file.take(limit + 1).read_to_end(&mut content).map_err(failed)?;
    if content.len() as u64 > limit {
        return Err(IoError::new(
            path,
            format_args!("is longer than {limit} bytes"),
            "check that this is the right file",
        ));
    }
    Ok(content)
}

/// The lines of a text that hold something, with their numbers from 1; `#` starts a comment.
pub(crate) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let numbered = text.lines().enumerate().map(|(i, line)| (i + 1, line));
    let bare = numbered.map(|(n, line)| (n, line.split('#').next().unwrap_or_default().trim()));
    bare.filter(|(_, line)| !line.is_empty())
}

/// One finite number; the reason if the word is none.
pub(crate) fn number(word: &str) -> Result<f64, String> {
    let shown = || word.chars().take(40).collect::<String>();
    let value: f64 = word.parse().map_err(|_| format!("\"{}\" is not a number", shown()))?;
    if value.is_finite() { Ok(value) } else { Err(format!("\"{}\" is not a finite number", shown())) }
}

/// All numbers of a line, separated by white space; the reason if one is not a finite number.
pub(crate) fn numbers(line: &str) -> Result<Vec<f64>, String> {
    line.split_whitespace().map(number).collect()
}

/// Width × height, if it is positive and at most [`MAX_PIXELS`].
///
/// # Errors
/// Names the file and the size.
pub(crate) fn pixels(path: &Path, width: usize, height: usize) -> Result<usize, IoError> {
    let count = width.checked_mul(height).filter(|n| (1..=MAX_PIXELS).contains(n));
    let reason = format_args!("has a size of {width}x{height} pixels").to_string();
    count.ok_or_else(|| IoError::new(path, reason, format_args!("give an image of 1 to {MAX_PIXELS} pixels")))
}

/// [`pixels`] of an image whose file has so many bytes, if they can hold them: nothing is allocated on the word of a
/// head alone.
///
/// # Errors
/// Names the file and the size.
pub(crate) fn pixels_of(path: &Path, width: usize, height: usize, bytes: usize) -> Result<usize, IoError> {
    let count = pixels(path, width, height)?;
    if count <= bytes.saturating_mul(MAX_PIXELS_PER_BYTE) {
        return Ok(count);
    }
    let reason = format_args!("has a size of {width}x{height} pixels, but only {bytes} bytes").to_string();
    Err(IoError::new(path, reason, "the file is cut or damaged; replace it"))
}
