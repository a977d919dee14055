//! Well-spread corners: the best of each cell by the smaller eigenvalue of the structure tensor.

use rayon::prelude::*;

use crate::geometry::{Grid, Image};
use crate::simd::vectorised;

/// Half the side of the window over which the structure tensor is summed, in pixels.
const RADIUS: usize = 3;
/// Side of that window, in pixels.
const SIDE: usize = 2 * RADIUS + 1;
/// Columns handled at once, so that they vectorise.
const LANES: usize = 16;

/// A pixel whose neighbourhood can be located in both directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Corner {
    /// Column, in pixels.
    pub(super) u: usize,
    /// Row, in pixels.
    pub(super) v: usize,
    /// Smaller eigenvalue of the mean structure tensor, in (grey levels per pixel)².
    pub(super) strength: f32,
}

/// Square cells over an image, a border kept free.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CornerCells {
    size: (usize, usize),
    cell: usize,
    border: usize,
}

impl CornerCells {
    /// Cells of side `cell_px` over an image of `size`, with `border_px` kept free around it.
    pub(super) fn new(size: (usize, usize), cell_px: usize, border_px: usize) -> Self {
        Self { size, cell: cell_px.max(1), border: border_px.max(RADIUS + 1) }
    }

    /// Number of cells along the columns and down the rows.
    pub(super) fn count(&self) -> (usize, usize) {
        let along = |n: usize| n.saturating_sub(2 * self.border).div_ceil(self.cell);
        (along(self.size.0), along(self.size.1))
    }

    /// Column and row of the cell that a place lies in, in pixels; `None` on the border and outside.
    pub(super) fn of(&self, u: f64, v: f64) -> Option<(usize, usize)> {
        let along = |c: f64, n: usize| {
            let inside = c >= self.border as f64 && c < n as f64 - self.border as f64;
            inside.then(|| (c as usize - self.border) / self.cell)
        };
        Some((along(u, self.size.0)?, along(v, self.size.1)?))
    }

    fn columns(&self) -> std::ops::Range<usize> {
        self.border..self.size.0 - self.border
    }

    fn rows(&self, row: usize) -> std::ops::Range<usize> {
        let first = self.border + row * self.cell;
        first..(first + self.cell).min(self.size.1 - self.border)
    }
}

/// The strongest corner of each cell that is not `taken` (one value per cell), strongest first.
///
/// Corners below `least_strength` (in (grey levels per pixel)²) are left out.
pub(super) fn corners(
    image: &Image,
    cells: &CornerCells,
    taken: &Grid<bool>,
    least_strength: f32,
) -> Vec<Corner> {
    let (across, down) = cells.count();
    if across == 0 || down == 0 || taken.size() != (across, down) || image.size() != cells.size {
        return Vec::new();
    }
    let mut found: Vec<Corner> = (0..down)
        .into_par_iter()
        .filter(|&row| taken.row(row).iter().any(|&taken| !taken))
        .flat_map_iter(|row| {
            let best = best_of_columns(image, cells.rows(row), cells.columns(), least_strength);
            best_of_cells(&best, cells, taken.row(row), least_strength)
        })
        .collect();
    found.sort_by(|a, b| b.strength.total_cmp(&a.strength).then((a.v, a.u).cmp(&(b.v, b.u))));
    found
}

/// The strongest of each free cell in one row of cells.
fn best_of_cells(best: &ColumnMaxima, cells: &CornerCells, taken: &[bool], least: f32) -> Vec<Corner> {
    let columns = cells.columns();
    let strongest = |(k, (strengths, rows)): (usize, (&[f32], &[f32]))| {
        let mut corner = Corner { u: 0, v: 0, strength: least };
        for (i, (&strength, &row)) in strengths.iter().zip(rows).enumerate() {
            if strength > corner.strength {
                corner = Corner { u: columns.start + k * cells.cell + i, v: row as usize, strength };
            }
        }
        (corner.strength > least && !taken[k]).then_some(corner)
    };
    best.strength
        .chunks(cells.cell)
        .zip(best.row.chunks(cells.cell))
        .enumerate()
        .filter_map(strongest)
        .collect()
}

/// The largest strength down each column of a few rows, and the row where it is.
struct ColumnMaxima {
    strength: Vec<f32>,
    row: Vec<f32>,
}

fn best_of_columns(
    image: &Image,
    rows: std::ops::Range<usize>,
    columns: std::ops::Range<usize>,
    least: f32,
) -> ColumnMaxima {
    let span = columns.len() + 2 * RADIUS;
    let mut best = ColumnMaxima { strength: vec![least; columns.len()], row: vec![0.0; columns.len()] };
    // Products of derivatives of the last rows, row r in slot r mod SIDE.
    let mut products = vec![0.0_f32; SIDE * 3 * span];
    let mut sums = vec![0.0_f32; 3 * span];
    let first = columns.start - RADIUS - 1;
    let row_of_products = |row: usize, products: &mut [f32]| {
        let source = [row - 1, row, row + 1].map(|r| &image.row(r)[first..first + span + 2]);
        let slot = &mut products[(row % SIDE) * 3 * span..][..3 * span];
        derivative_products(source, slot);
    };
    for row in rows.start - RADIUS..rows.start + RADIUS {
        row_of_products(row, &mut products);
    }
    for v in rows {
        row_of_products(v + RADIUS, &mut products);
        sum_of_slots(&products, &mut sums);
        strongest_so_far(&sums, v as f32, &mut best.strength, &mut best.row);
    }
    best
}

vectorised! {
/// u², u v and v² of Scharr's derivatives of a row, ½(−1 0 1) along and (3 10 3)/16 across, one after the other.
derivative_products(source: [&[f32]; 3], out: &mut [f32]) {
    let [above, here, below] = source;
    let span = out.len() / 3;
    let (uu, rest) = out.split_at_mut(span);
    let (uv, vv) = rest.split_at_mut(span);
    let (above, here, below) = (&above[..span + 2], &here[..span + 2], &below[..span + 2]);
    let vv = &mut vv[..span];
    for i in 0..span {
        let smooth = |i: usize| 3.0 * (above[i] + below[i]) + 10.0 * here[i];
        let slope = |i: usize| below[i] - above[i];
        let du = (smooth(i + 2) - smooth(i)) / 32.0;
        let dv = (3.0 * (slope(i) + slope(i + 2)) + 10.0 * slope(i + 1)) / 32.0;
        uu[i] = du * du;
        uv[i] = du * dv;
        vv[i] = dv * dv;
    }
}
}

vectorised! {
sum_of_slots(products: &[f32], sums: &mut [f32]) {
    let n = sums.len();
    let slot: [&[f32]; SIDE] = std::array::from_fn(|k| &products[k * n..(k + 1) * n]);
    for (i, sum) in sums.iter_mut().enumerate() {
        *sum = (slot[0][i] + slot[1][i]) + (slot[2][i] + slot[3][i]) + (slot[4][i] + slot[5][i]) + slot[6][i];
    }
}
}

vectorised! {
/// Smaller eigenvalues of the windowed structure tensor along a row, kept where they beat the rows above.
strongest_so_far(sums: &[f32], row: f32, best: &mut [f32], rows: &mut [f32]) {
    let span = best.len() + 2 * RADIUS;
    let sums = [&sums[..span], &sums[span..2 * span], &sums[2 * span..3 * span]];
    let (bests, rest) = best.as_chunks_mut::<LANES>();
    let (blocks, rest_rows) = rows.as_chunks_mut::<LANES>();
    let whole = bests.len() * LANES;
    for (k, (best, rows)) in bests.iter_mut().zip(blocks).enumerate() {
        keep_stronger(sums, k * LANES, row, best, rows);
    }
    for (k, (best, rows)) in rest.iter_mut().zip(rest_rows).enumerate() {
        keep_stronger(sums, whole + k, row, std::array::from_mut(best), std::array::from_mut(rows));
    }
}
}

#[inline(always)]
fn keep_stronger<const N: usize>(
    sums: [&[f32]; 3],
    first: usize,
    row: f32,
    best: &mut [f32; N],
    rows: &mut [f32; N],
) {
    let mut tensor = [[0.0_f32; N]; 3];
    for (t, sums) in tensor.iter_mut().zip(sums) {
        for k in 0..SIDE {
            let shifted = &sums[first + k..first + k + N];
            for i in 0..N {
                t[i] += shifted[i];
            }
        }
    }
    for i in 0..N {
        let (a, b, c) = (tensor[0][i], tensor[1][i], tensor[2][i]);
        let half_difference = 0.5 * (a - c);
        let smaller = 0.5 * (a + c) - (half_difference * half_difference + b * b).sqrt();
        let smaller = smaller / (SIDE * SIDE) as f32;
        rows[i] = if smaller > best[i] { row } else { rows[i] };
        best[i] = if smaller > best[i] { smaller } else { best[i] };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(image: &Image, cell: usize, border: usize, least: f32) -> Vec<Corner> {
        let cells = CornerCells::new(image.size(), cell, border);
        let (across, down) = cells.count();
        corners(image, &cells, &Grid::filled(across, down, false), least)
    }

    fn square() -> Image {
        let inside = |c: usize| (20..60).contains(&c);
        Grid::from_fn(80, 80, |u, v| if inside(u) && inside(v) { 100.0 } else { 0.0 })
    }

    #[test]
    fn a_square_shows_its_corners_and_not_its_edges() {
        let found = all(&square(), 20, 5, 1.0);
        assert_eq!(found.len(), 4, "{found:?}");
        for corner in found {
            let near = |c: usize| c.abs_diff(20).min(c.abs_diff(59)) <= RADIUS + 1;
            assert!(near(corner.u) && near(corner.v), "{corner:?}");
        }
    }

    #[test]
    fn cells_that_are_taken_give_none() {
        let image = square();
        let cells = CornerCells::new(image.size(), 20, 5);
        let (across, down) = cells.count();
        let mut taken = Grid::filled(across, down, false);
        let (a, b) = cells.of(20.0, 20.0).unwrap();
        taken.set(a, b, true);
        let found = corners(&image, &cells, &taken, 1.0);
        assert!(found.len() == 3 && found.iter().all(|c| cells.of(c.u as f64, c.v as f64) != Some((a, b))));
        assert_eq!(cells.of(4.9, 20.0), None);
        assert_eq!(cells.of(20.0, 75.0), None);
        assert_eq!(cells.of(f64::NAN, 20.0), None);
    }

    #[test]
    fn constant_and_tiny_images_have_none() {
        for (width, height) in [(1, 1), (7, 7), (9, 9), (64, 64)] {
            assert!(all(&Grid::filled(width, height, 50.0), 10, 3, 0.0).is_empty());
        }
    }
}
