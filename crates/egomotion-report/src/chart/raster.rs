//! Planes as small PNG pictures.

use egomotion::geometry::Grid;

use super::colour::Rgb;

/// Level of deflate, 1 to 9: the next ones take twice the time for a few percent.
const DEFLATE_LEVEL: u8 = 3;

/// A plane of at most `most` columns, each pixel the one amid the block it stands for: never a mixture of two surfaces.
pub(crate) fn centres(plane: &Grid<f32>, most: usize) -> Grid<f64> {
    let (small, rows) = reduced(plane.size(), most);
    let amid = |n: usize, of: usize| (0..n).map(|i| (2 * i + 1) * of / (2 * n)).collect::<Vec<_>>();
    let (columns, lines) = (amid(small, plane.width()), amid(rows, plane.height()));
    Grid::from_fn(small, rows, |u, v| plane.at(columns[u], lines[v]).into())
}

/// A plane of at most `most` columns, each pixel the mean of what is finite in the block it stands for, or 0.
pub(crate) fn means(plane: &Grid<f32>, most: usize) -> Grid<f64> {
    let (small, rows) = reduced(plane.size(), most);
    let blocks =
        |n: usize, of: usize| (0..n).map(|i| i * of / n..((i + 1) * of).div_ceil(n)).collect::<Vec<_>>();
    let (columns, lines) = (blocks(small, plane.width()), blocks(rows, plane.height()));
    Grid::from_fn(small, rows, |u, v| {
        let block = lines[v].clone().flat_map(|y| &plane.row(y)[columns[u].clone()]);
        let (sum, count) = block
            .filter(|value| value.is_finite())
            .fold((0.0, 0_u32), |(sum, count), &value| (sum + f64::from(value), count + 1));
        sum / f64::from(count.max(1))
    })
}

/// (columns, rows) of a plane brought to at most `most` columns, its shape kept.
fn reduced((width, height): (usize, usize), most: usize) -> (usize, usize) {
    let small = width.min(most);
    (small, (height * small).div_ceil(width.max(1)).min(height))
}

/// A grey PNG, or one in the colours of a palette whose entry 0 is transparent; `None` if it is empty.
pub(crate) fn encode(pixels: &Grid<u8>, palette: Option<&[Rgb]>) -> Option<Vec<u8>> {
    let (width, height) = (u32::try_from(pixels.width()).ok()?, u32::try_from(pixels.height()).ok()?);
    let mut content = Vec::new();
    let mut encoder = png::Encoder::new(&mut content, width, height);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_deflate_compression(png::DeflateCompression::Level(DEFLATE_LEVEL));
    if let Some(palette) = palette {
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_palette([&[[0; 3]], palette].concat().as_flattened().to_vec());
        encoder.set_trns(vec![0]);
        // Neighbouring indices are not neighbouring numbers to a filter.
        encoder.set_filter(png::Filter::NoFilter);
    } else {
        encoder.set_color(png::ColorType::Grayscale);
    }
    let mut writer = encoder.write_header().ok()?;
    writer.write_image_data(pixels.values()).ok()?;
    writer.finish().ok()?;
    Some(content)
}

/// A PNG made by [`encode`] with another palette, entry 0 included; `None` if it has none of that length.
pub(crate) fn recolour(png: &[u8], palette: &[Rgb]) -> Option<Vec<u8>> {
    let colours = palette.as_flattened();
    let name = png.windows(4).position(|chunk| chunk == b"PLTE")?;
    let length = u32::try_from(colours.len()).ok()?.to_be_bytes();
    if name.checked_sub(4).and_then(|start| png.get(start..name)) != Some(length.as_slice()) {
        return None;
    }
    let mut content = png.to_vec();
    let end = name + 4 + colours.len();
    content.get_mut(name + 4..end)?.copy_from_slice(colours);
    let sum = crc32(content.get(name..end)?).to_be_bytes();
    content.get_mut(end..end + 4)?.copy_from_slice(&sum);
    Some(content)
}

/// The check sum of a PNG chunk (ISO 3309), bit by bit: palettes are short.
fn crc32(bytes: &[u8]) -> u32 {
    let bit = |c: u32, _| (c >> 1) ^ (0xedb8_8320 & (c & 1).wrapping_neg());
    !bytes.iter().fold(!0, |c, &byte| (0..8).fold(c ^ u32::from(byte), bit))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_sum_is_the_known_one() {
        // Of an empty IEND chunk, as in every PNG, and the standard's own example.
        assert_eq!([crc32(b"IEND"), crc32(b"123456789")], [0xae42_6082, 0xcbf4_3926]);
    }
}
