//! NumPy arrays (`.npy`): numbers of any common type in either byte order, row by row or column by column.
//!
//! The header is read here and not by a crate: its length is the file's word, and nothing is allocated by it.

use std::path::Path;

use egomotion::geometry::{Field, Grid};

use crate::{IoError, read, write};

/// An array: its shape, and its values in C order.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Length of each axis; none for a single number.
    pub shape: Vec<usize>,
    /// The values, the last axis running fastest.
    pub values: Vec<f64>,
}

/// The longest header that is read, in bytes: a bound on memory; NumPy's own are under 200.
const MAX_HEADER_BYTES: usize = 1 << 16;

/// What every `.npy` starts with.
const MAGIC: &[u8] = b"\x93NUMPY";

/// A map of two axes (height, width); every value that is not finite is missing.
///
/// # Errors
/// The file cannot be read, or [`decode`] refuses its content, or it has not two axes.
pub fn read_map(path: &Path) -> Result<Field, IoError> {
    map(&decode(&read::bytes(path)?, path)?, path)
}

/// An array of two axes as a map.
pub(crate) fn map(array: &Array, path: &Path) -> Result<Field, IoError> {
    let refuse =
        || IoError::new(path, format_args!("has the shape {:?}", array.shape), "give (height, width)");
    let &[height, width] = array.shape.as_slice() else { return Err(refuse()) };
    read::pixels(path, width, height)?;
    let values = array.values.iter().map(|&v| v as f32).collect();
    Grid::from_values(width, height, values).map(Field::from_grid).ok_or_else(refuse)
}

/// Write a map as an array of single precision, (height, width); missing pixels are NaN.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, map: &Grid<f32>) -> Result<(), IoError> {
    array(path, &format!("({}, {})", map.height(), map.width()), map.values().iter().copied())
}

/// Write a flow map as an array of single precision, (height, width, 2); missing pixels are NaN.
///
/// # Errors
/// The file cannot be written.
pub fn write_flow(path: &Path, [u, v]: [&Field; 2]) -> Result<(), IoError> {
    let pixels = u.grid().values().iter().zip(v.grid().values());
    let shape = format!("({}, {}, 2)", u.height(), u.width());
    array(path, &shape, pixels.flat_map(|(&u, &v)| [u, v]))
}

/// An array of version 1.0, whose values begin at a multiple of 64 bytes.
fn array(path: &Path, shape: &str, values: impl Iterator<Item = f32>) -> Result<(), IoError> {
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}");
    let begun = MAGIC.len() + 4 + header.len() + 1;
    header.extend(std::iter::repeat_n(' ', begun.next_multiple_of(64) - begun));
    header.push('\n');
    let mut content = MAGIC.to_vec();
    content.extend([1, 0]);
    content.extend((header.len() as u16).to_le_bytes());
    content.extend(header.as_bytes());
    values.for_each(|value| content.extend(value.to_le_bytes()));
    write::bytes(path, &content)
}

/// A flow map of the axes (height, width, 2); a pixel is missing where one component is not finite.
///
/// # Errors
/// The file cannot be read, or [`decode`] refuses its content, or it has other axes.
pub fn read_flow(path: &Path) -> Result<[Field; 2], IoError> {
    let array = decode(&read::bytes(path)?, path)?;
    let refuse =
        || IoError::new(path, format_args!("has the shape {:?}", array.shape), "give (height, width, 2)");
    let &[height, width, 2] = array.shape.as_slice() else { return Err(refuse()) };
    read::pixels(path, width, height)?;
    let (pixels, _) = array.values.as_chunks::<2>();
    let plane = |k: usize| {
        let value = |pixel: &[f64; 2]| {
            if pixel.iter().all(|v| v.is_finite()) { pixel[k] as f32 } else { f32::NAN }
        };
        Grid::from_values(width, height, pixels.iter().map(value).collect()).map(Field::from_grid)
    };
    plane(0).zip(plane(1)).map(|(u, v)| [u, v]).ok_or_else(refuse)
}

/// An array from the content of a `.npy`; `path` names it in errors.
///
/// # Errors
/// The header is not that of a `.npy`, the type is no number, or the length does not fit the shape.
pub fn decode(content: &[u8], path: &Path) -> Result<Array, IoError> {
    let refuse = |reason: String| IoError::new(path, reason, "give a NumPy array of numbers (np.save)");
    let (header, values) = split(content).ok_or_else(|| refuse("is not a .npy file".into()))?;
    let header = Header::parse(header).map_err(refuse)?;
    let count = header.shape.iter().try_fold(1_usize, |n, &side| n.checked_mul(side));
    let count = count.filter(|n| (1..=read::MAX_PIXELS).contains(n)).ok_or_else(|| {
        refuse(format!("has the shape {:?}, not 1 to {} numbers", header.shape, read::MAX_PIXELS))
    })?;
    let size = header.dtype.size();
    if values.len() != count * size {
        return Err(refuse(format!(
            "holds {} bytes of values, its shape {:?} needs {}",
            values.len(),
            header.shape,
            count * size
        )));
    }
    let values = header.dtype.numbers(values);
    let values = if header.fortran { transposed(&values, &header.shape) } else { values };
    Ok(Array { shape: header.shape, values })
}

/// The header's text, and what follows it.
fn split(content: &[u8]) -> Option<(&str, &[u8])> {
    let rest = content.strip_prefix(MAGIC)?;
    let (version, rest) = rest.split_first_chunk::<2>()?;
    let (length, rest) = match version[0] {
        1 => rest.split_first_chunk::<2>().map(|(n, rest)| (u16::from_le_bytes(*n) as usize, rest))?,
        2 | 3 => rest.split_first_chunk::<4>().map(|(n, rest)| (u32::from_le_bytes(*n) as usize, rest))?,
        _ => return None,
    };
    let (header, values) = rest.split_at_checked(length).filter(|_| length <= MAX_HEADER_BYTES)?;
    Some((std::str::from_utf8(header).ok()?, values))
}

/// From the order in which the first axis runs fastest to that in which the last does.
fn transposed(values: &[f64], shape: &[usize]) -> Vec<f64> {
    let mut index = vec![0; shape.len()];
    let mut out = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        let at = index.iter().zip(shape).rev().fold(0, |at, (&i, &side)| at * side + i);
        out.push(values[at]);
        for (i, &side) in index.iter_mut().zip(shape).rev() {
            *i += 1;
            if *i < side {
                break;
            }
            *i = 0;
        }
    }
    out
}

/// The type of the numbers.
#[derive(Debug, Clone, Copy)]
struct Dtype {
    /// f, i or u.
    class: u8,
    bytes: usize,
    big: bool,
}

impl Dtype {
    fn parse(text: &str) -> Option<Self> {
        let &[order, class, bytes] = text.as_bytes() else { return None };
        let bytes = usize::from(bytes.checked_sub(b'0')?);
        let known = match class {
            b'f' => matches!(bytes, 4 | 8),
            b'i' | b'u' => matches!(bytes, 1 | 2 | 4 | 8),
            _ => false,
        };
        let big = match order {
            b'<' | b'|' => false,
            b'>' => true,
            b'=' => cfg!(target_endian = "big"),
            _ => return None,
        };
        known.then_some(Self { class, bytes, big })
    }

    fn size(self) -> usize {
        self.bytes
    }

    /// All numbers of some bytes.
    fn numbers(self, bytes: &[u8]) -> Vec<f64> {
        let big = self.big;
        match (self.class, self.bytes) {
            (b'f', 4) => numbers(bytes, big, |b| f32::from_le_bytes(b).into()),
            (b'f', _) => numbers(bytes, big, f64::from_le_bytes),
            (b'u', 1) => numbers(bytes, big, |b| u8::from_le_bytes(b).into()),
            (b'u', 2) => numbers(bytes, big, |b| u16::from_le_bytes(b).into()),
            (b'u', 4) => numbers(bytes, big, |b| u32::from_le_bytes(b).into()),
            (b'u', _) => numbers(bytes, big, |b| u64::from_le_bytes(b) as f64),
            (_, 1) => numbers(bytes, big, |b| i8::from_le_bytes(b).into()),
            (_, 2) => numbers(bytes, big, |b| i16::from_le_bytes(b).into()),
            (_, 4) => numbers(bytes, big, |b| i32::from_le_bytes(b).into()),
            _ => numbers(bytes, big, |b| i64::from_le_bytes(b) as f64),
        }
    }
}

/// Numbers of N bytes each, whose value is told by their little-endian bytes.
fn numbers<const N: usize>(bytes: &[u8], big: bool, number: impl Fn([u8; N]) -> f64) -> Vec<f64> {
    let (all, _) = bytes.as_chunks::<N>();
    let reversed = |bytes: &[u8; N]| {
        let mut bytes = *bytes;
        bytes.reverse();
        bytes
    };
    all.iter().map(|bytes| number(if big { reversed(bytes) } else { *bytes })).collect()
}

/// The header: a Python dictionary of three entries.
#[derive(Debug)]
struct Header {
    dtype: Dtype,
    fortran: bool,
    shape: Vec<usize>,
}

impl Header {
    fn parse(text: &str) -> Result<Self, String> {
        let entry = |key: &str| {
            let at = text.find(&format!("'{key}'")).or_else(|| text.find(&format!("\"{key}\"")));
            let rest = &text[at.ok_or_else(|| format!("has no {key}"))? + key.len() + 2..];
            rest.trim_start().strip_prefix(':').map(str::trim_start).ok_or_else(|| format!("has no {key}"))
        };
        let descr = entry("descr")?;
        let word: String = descr.chars().skip(1).take_while(|c| !matches!(c, '\'' | '"')).take(16).collect();
        let dtype = Dtype::parse(&word).ok_or_else(|| format!("has numbers of the type \"{word}\""))?;
        let order = entry("fortran_order")?;
        let fortran = order.starts_with("True");
        if !fortran && !order.starts_with("False") {
            return Err("has no fortran_order".into());
        }
        let shape = entry("shape")?;
        let inner = shape.strip_prefix('(').and_then(|rest| rest.split_once(')')).map(|(inner, _)| inner);
        let sides = inner.ok_or("has no shape")?.split(',').map(str::trim).filter(|side| !side.is_empty());
        let shape = sides.take(33).map(|side| side.parse::<usize>()).collect::<Result<Vec<_>, _>>();
        let shape = shape.ok().filter(|shape| shape.len() <= 32).ok_or("has no shape")?;
        Ok(Self { dtype, fortran, shape })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file as NumPy writes it.
    fn npy(descr: &str, fortran: &str, shape: &str, values: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
        let length = (header.len() as u16).to_le_bytes();
        [MAGIC, &[1, 0], &length, header.as_bytes(), values].concat()
    }

    fn values(content: &[u8]) -> (Vec<usize>, Vec<f64>) {
        let array = decode(content, Path::new("a.npy")).unwrap();
        (array.shape, array.values)
    }

    fn refused(content: &[u8]) -> String {
        decode(content, Path::new("a.npy")).unwrap_err().to_string()
    }

    #[test]
    fn types_orders_and_shapes() {
        let f32s = [1.5f32, -2.0, 3.0, 4.0, 5.0, 6.0].map(f32::to_le_bytes).concat();
        let expected = vec![1.5, -2.0, 3.0, 4.0, 5.0, 6.0];
        assert_eq!(values(&npy("<f4", "False", "(2, 3)", &f32s)), (vec![2, 3], expected));
        // Columns first: the same bytes are another matrix.
        assert_eq!(values(&npy("<f4", "True", "(2, 3)", &f32s)).1, [1.5, 3.0, 5.0, -2.0, 4.0, 6.0]);
        let big = [0.1f64, -7.0].map(f64::to_be_bytes).concat();
        assert_eq!(values(&npy(">f8", "False", "(2,)", &big)), (vec![2], vec![0.1, -7.0]));
        assert_eq!(values(&npy("|i1", "False", "(2,)", &[255, 3])).1, [-1.0, 3.0]);
        assert_eq!(values(&npy(">u2", "False", "(2,)", &[1, 0, 255, 255])).1, [256.0, 65535.0]);
        assert_eq!(values(&npy("<i4", "False", "()", &(-5i32).to_le_bytes())), (vec![], vec![-5.0]));
    }

    #[test]
    fn heads_and_lengths_are_checked() {
        assert!(refused(b"\x93NUMPX").contains("a.npy: is not a .npy file"));
        assert!(refused(&npy("<c8", "False", "(1,)", &[0; 8])).contains("type \"<c8\""));
        assert!(refused(&npy("<f4", "Maybe", "(1,)", &[0; 4])).contains("fortran_order"));
        assert!(refused(&npy("<f4", "False", "(2,)", &[0; 4])).contains("holds 4 bytes"));
        assert!(refused(&npy("<f4", "False", "(99999999, 99999999)", &[])).contains("shape"));
        assert!(refused(&npy("<f4", "False", "(18446744073709551615, 2)", &[])).contains("shape"));
        assert!(refused(&npy("<f4", "False", "(-1, 2)", &[])).contains("shape"));
        // A header longer than the file.
        assert!(refused(&[MAGIC, &[2, 0, 255, 255, 255, 255]].concat()).contains("not a .npy"));
    }
}
