//! Middlebury flow maps (`.flo`): interleaved (vx, vy) as little-endian f32, rows from the top down.

use std::path::Path;

use egomotion::geometry::Field;

use crate::{IoError, read, write};

/// The number every `.flo` starts with; its bytes read "PIEH".
const MAGIC: f32 = 202021.25;

/// Largest magnitude of a known component in pixels, by the format's definition: larger ones mark unknown flow.
const MAX_KNOWN_FLOW_PX: f32 = 1e9;

/// A flow map, (vx, vy) in pixels; a pixel with NaN or more than 10⁹ px in one component is missing.
///
/// # Errors
/// The file cannot be read, or [`decode`] refuses its content.
pub fn read(path: &Path) -> Result<[Field; 2], IoError> {
    decode(&read::bytes(path)?, path)
}

/// A flow map from the content of a `.flo`, (vx, vy) in pixels; `path` names it in errors.
///
/// # Errors
/// The head is not that of a `.flo`, or the length does not fit the size.
pub fn decode(content: &[u8], path: &Path) -> Result<[Field; 2], IoError> {
    let refuse = |reason: &str| IoError::new(path, reason, "give a Middlebury .flo file");
    let (head, values) =
        content.split_first_chunk::<12>().ok_or_else(|| refuse("is too short for a .flo head"))?;
    let word = |i: usize| [head[i], head[i + 1], head[i + 2], head[i + 3]];
    if f32::from_le_bytes(word(0)) != MAGIC {
        return Err(refuse("is not a .flo file"));
    }
    let side = |i| usize::try_from(i32::from_le_bytes(word(i))).map_err(|_| refuse("has a negative size"));
    let (width, height) = (side(4)?, side(8)?);
    let length = 8 * read::pixels(path, width, height)?;
    if values.len() != length {
        let reason = format!("holds {} bytes of values, {width}x{height} pixels need {length}", values.len());
        return Err(IoError::new(path, reason, "the file is cut or damaged; write it again"));
    }
    let mut flow = [Field::missing(width, height), Field::missing(width, height)];
    for (i, b) in values.chunks_exact(8).enumerate() {
        let pixel = [[b[0], b[1], b[2], b[3]], [b[4], b[5], b[6], b[7]]].map(f32::from_le_bytes);
        if pixel.iter().all(|component| component.abs() <= MAX_KNOWN_FLOW_PX) {
            flow.iter_mut()
                .zip(pixel)
                .for_each(|(field, value)| field.set(i % width, i / width, Some(value)));
        }
    }
    Ok(flow)
}

/// Write a flow map given in pixels; a pixel with a missing component is NaN in both.
///
/// # Errors
/// The file cannot be written, or the two components differ in size.
pub fn write(path: &Path, [vx, vy]: &[Field; 2]) -> Result<(), IoError> {
    if vx.size() != vy.size() {
        return Err(IoError::new(
            path,
            "the components of the flow differ in size",
            "give two planes of one size",
        ));
    }
    let (width, height) = vx.size();
    write::atomically(path, |file| {
        file.write_all(&MAGIC.to_le_bytes())?;
        file.write_all(&(width as u32).to_le_bytes())?;
        file.write_all(&(height as u32).to_le_bytes())?;
        let mut line = Vec::with_capacity(8 * width);
        for v in 0..height {
            line.clear();
            for (&x, &y) in vx.row(v).iter().zip(vy.row(v)) {
                let pixel = if x.is_nan() || y.is_nan() { [f32::NAN; 2] } else { [x, y] };
                line.extend(pixel.map(f32::to_le_bytes).as_flattened());
            }
            file.write_all(&line)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use egomotion::geometry::Grid;

    #[test]
    fn flow_comes_back_and_unknown_is_missing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f.flo");
        let plane = |values: [f32; 4]| Field::from_grid(Grid::from_values(2, 2, values.to_vec()).unwrap());
        write(&path, &[plane([0.125, f32::NAN, 3.0, -4.5]), plane([1.0, 2.0, f32::NAN, 1e-7])]).unwrap();
        let content = std::fs::read(&path).unwrap();
        assert_eq!((&content[..4], content.len()), (b"PIEH".as_slice(), 12 + 32));
        assert!(f32::from_le_bytes(content[24..28].try_into().unwrap()).is_nan());
        let [vx, vy] = read(&path).unwrap();
        let back: Vec<_> = (0..4).map(|i| (vx.get(i % 2, i / 2), vy.get(i % 2, i / 2))).collect();
        assert_eq!(back, [(Some(0.125), Some(1.0)), (None, None), (None, None), (Some(-4.5), Some(1e-7))]);
    }

    #[test]
    fn middlebury_marks_unknown_by_a_huge_number() {
        let values = [1.0f32, 2.0, 1.66e9, 1.66e9].map(f32::to_le_bytes).concat();
        let content = [b"PIEH".as_slice(), &2i32.to_le_bytes(), &1i32.to_le_bytes(), &values].concat();
        let [vx, vy] = decode(&content, Path::new("f.flo")).unwrap();
        assert_eq!([vx.get(0, 0), vy.get(0, 0), vx.get(1, 0)], [Some(1.0), Some(2.0), None]);
    }

    #[test]
    fn heads_and_lengths_are_checked() {
        let head = |w: i32, h: i32| [b"PIEH".as_slice(), &w.to_le_bytes(), &h.to_le_bytes()].concat();
        let refused = |content: &[u8]| decode(content, Path::new("f.flo")).unwrap_err().to_string();
        assert!(refused(b"PIEH").contains("f.flo: is too short"));
        assert!(refused(b"PIEG12345678").contains("not a .flo"));
        assert!(refused(&head(-1, 4)).contains("negative"));
        assert!(refused(&head(0, 4)).contains("size of 0x4"));
        assert!(refused(&head(i32::MAX, i32::MAX)).contains("size"));
        assert!(refused(&head(2, 2)).contains("holds 0 bytes"));
    }
}
