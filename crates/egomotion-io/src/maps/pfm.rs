//! PFM maps: one f32 a pixel, rows from the bottom up, NaN is missing.

use std::path::Path;

use egomotion::geometry::{Field, Grid};

use crate::{IoError, read, write};

/// A map; every value that is not finite is missing. See [`decode`].
///
/// # Errors
/// The file cannot be read, or [`decode`] refuses its content.
pub fn read(path: &Path) -> Result<Field, IoError> {
    read_grid(path).map(Field::from_grid)
}

/// A map as it stands in the file, where infinity may be a value. See [`decode`].
///
/// # Errors
/// The file cannot be read, or [`decode`] refuses its content.
pub fn read_grid(path: &Path) -> Result<Grid<f32>, IoError> {
    decode(&read::bytes(path)?, path)
}

/// A map from the content of a PFM of either byte order; `path` names it in errors.
///
/// The scale tells the byte order by its sign; its size is ignored, as by Middlebury's programs.
///
/// # Errors
/// The head is not that of a one-channel PFM, or the length does not fit the size.
pub fn decode(content: &[u8], path: &Path) -> Result<Grid<f32>, IoError> {
    let refuse = |reason: &str| {
        IoError::new(path, reason, "give a one-channel PFM (head \"Pf\", width, height, scale)")
    };
    let mut rest = content;
    let mut word = || next_word(&mut rest).ok_or_else(|| refuse("has no PFM head"));
    let (kind, width, height, scale) = (word()?, word()?, word()?, word()?);
    match kind {
        "Pf" => {}
        "PF" => return Err(refuse("is a PFM of three channels")),
        _ => return Err(refuse("is not a PFM")),
    }
    let side = |text: &str| text.parse::<usize>().map_err(|_| refuse("has a PFM head without a size"));
    let (width, height) = (side(width)?, side(height)?);
    let scale = read::number(scale)
        .ok()
        .filter(|s| *s != 0.0)
        .ok_or_else(|| refuse("has a PFM head without a scale"))?;
    let length = 4 * read::pixels(path, width, height)?;
    // A head written in text mode ends in two bytes.
    let values = if rest.len() == length + 1 { rest.strip_prefix(b"\n").unwrap_or(rest) } else { rest };
    if values.len() != length {
        let reason = format!("holds {} bytes of values, {width}x{height} pixels need {length}", values.len());
        return Err(IoError::new(path, reason, "the file is cut or damaged; write it again"));
    }
    let number = if scale < 0.0 { f32::from_le_bytes } else { f32::from_be_bytes };
    let mut all = Vec::with_capacity(width * height);
    for row in values.chunks_exact(4 * width).rev() {
        all.extend(row.as_chunks().0.iter().map(|&bytes| number(bytes)));
    }
    Grid::from_values(width, height, all).ok_or_else(|| refuse("has no values"))
}

/// The next word of the head, and the one white space after it, taken off the content.
fn next_word<'a>(content: &mut &'a [u8]) -> Option<&'a str> {
    let start = content.iter().take(64).position(|b| !b.is_ascii_whitespace())?;
    let from = &content[start..];
    let end = from.iter().take(64).position(u8::is_ascii_whitespace)?;
    *content = &from[end + 1..];
    std::str::from_utf8(&from[..end]).ok()
}

/// Write a map, little-endian, NaN for missing pixels (take a [`Field`]'s `grid()`).
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, map: &Grid<f32>) -> Result<(), IoError> {
    write::atomically(path, |file| {
        write!(file, "Pf\n{} {}\n-1.0\n", map.width(), map.height())?;
        let mut line = Vec::with_capacity(4 * map.width());
        for v in (0..map.height()).rev() {
            line.clear();
            line.extend(map.row(v).iter().flat_map(|value| value.to_le_bytes()));
            file.write_all(&line)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(content: &[u8]) -> String {
        decode(content, Path::new("m.pfm")).unwrap_err().to_string()
    }

    #[test]
    fn both_byte_orders_and_the_bottom_row_first() {
        let big =
            [b"Pf 2 2 1.0\n".as_slice(), &[1f32, 2.0, 3.0, f32::INFINITY].map(f32::to_be_bytes).concat()]
                .concat();
        let map = decode(&big, Path::new("m.pfm")).unwrap();
        assert_eq!(map.values(), [3.0, f32::INFINITY, 1.0, 2.0]);
        let little = [b"Pf\r\n1 1\r\n-0.003\r\n".as_slice(), &7.5f32.to_le_bytes()].concat();
        assert_eq!(decode(&little, Path::new("m.pfm")).unwrap().values(), [7.5]);
    }

    #[test]
    fn a_map_comes_back_bit_for_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.pfm");
        let mut map = Grid::from_fn(4, 3, |u, v| 1.0 / (1.0 + u as f32) - v as f32);
        map.set(1, 2, f32::NAN);
        map.set(3, 0, f32::INFINITY);
        write(&path, &map).unwrap();
        let bits = |map: &Grid<f32>| map.values().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&read_grid(&path).unwrap()), bits(&map));
        let field = read(&path).unwrap();
        assert_eq!((field.get(1, 2), field.get(3, 0), field.count()), (None, None, 10));
    }

    #[test]
    fn heads_and_lengths_are_checked() {
        for head in [
            "",
            "Pf",
            "Pf 2 2",
            "Pf -2 2 1\n",
            "Pf 2 x 1\n",
            "Pf 1 1 0\nabcd",
            "Pf 1 1 nan\nabcd",
            "P5 1 1 1\nabcd",
        ] {
            assert!(refused(head.as_bytes()).contains("m.pfm: "), "{head}");
        }
        assert!(refused(b"PF 1 1 -1\nabcdabcdabcd").contains("three channels"));
        assert!(refused(b"Pf 2 1 -1\nabcd").contains("holds 4 bytes"));
        assert!(refused(b"Pf 1 1 -1\nabcdefgh").contains("holds 8 bytes"));
        assert!(refused(b"Pf 99999999 99999999 -1\n").contains("size"));
        assert!(refused(b"Pf 18446744073709551615 2 -1\n").contains("size"));
    }
}
