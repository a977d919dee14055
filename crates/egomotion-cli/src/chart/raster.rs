//! Planes as small PNG pictures.

use egomotion::geometry::Grid;

use super::colour::Rgb;

/// A plane of at most `most` columns, each pixel made from the block it stands for.
pub fn reduce(
    plane: &Grid<f32>,
    most: usize,
    of_block: impl Fn(&mut dyn Iterator<Item = f32>) -> f64,
) -> Grid<f64> {
    let (width, height) = plane.size();
    let small = width.min(most);
    let rows = (height * small).div_ceil(width.max(1)).min(height);
    let share = |i: usize, n: usize, of: usize| i * of / n.max(1)..((i + 1) * of).div_ceil(n.max(1));
    Grid::from_fn(small, rows, |u, v| {
        let columns = share(u, small, width);
        of_block(&mut share(v, rows, height).flat_map(|y| columns.clone().map(move |x| plane.at(x, y))))
    })
}

/// A grey PNG, or one in the colours of a palette whose entry 0 is transparent; `None` if it is empty.
pub fn encode(pixels: &Grid<u8>, palette: Option<&[Rgb]>) -> Option<Vec<u8>> {
    let (width, height) = (u32::try_from(pixels.width()).ok()?, u32::try_from(pixels.height()).ok()?);
    let mut content = Vec::new();
    let mut encoder = png::Encoder::new(&mut content, width, height);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Balanced);
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
pub fn recolour(png: &[u8], palette: &[Rgb]) -> Option<Vec<u8>> {
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
