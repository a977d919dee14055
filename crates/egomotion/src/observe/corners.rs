//! Well-spread corners: the best of each cell by the smaller eigenvalue of the structure tensor.

use rayon::prelude::*;

use super::pyramid::Gradients;

/// Half the side of the window over which the structure tensor is summed, in pixels.
const RADIUS: usize = 3;

/// A pixel whose neighbourhood can be located in both directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Column, in pixels.
    pub u: usize,
    /// Row, in pixels.
    pub v: usize,
    /// Smaller eigenvalue of the mean structure tensor, in (grey levels per pixel)².
    pub strength: f32,
}

/// The strongest corner of each square cell, strongest first.
///
/// `cell_px` is the side of a cell, `border_px` is kept free around the image, and corners below
/// `least_strength` (in (grey levels per pixel)²) are left out.
pub fn corners(gradients: &Gradients, cell_px: usize, border_px: usize, least_strength: f32) -> Vec<Corner> {
    let (width, height) = gradients.du.size();
    let border = border_px.max(RADIUS);
    if width <= 2 * border || height <= 2 * border {
        return Vec::new();
    }
    let cell = cell_px.max(1);
    let cell_rows = (height - 2 * border).div_ceil(cell);
    let mut found: Vec<Corner> = (0..cell_rows)
        .into_par_iter()
        .flat_map_iter(|row| {
            let rows = border + row * cell..(border + (row + 1) * cell).min(height - border);
            best_of_cells(gradients, rows, border..width - border, cell, least_strength)
        })
        .collect();
    found.sort_by(|a, b| b.strength.total_cmp(&a.strength).then((a.v, a.u).cmp(&(b.v, b.u))));
    found
}

/// The strongest corner of each cell in one row of cells.
fn best_of_cells(
    gradients: &Gradients,
    rows: std::ops::Range<usize>,
    columns: std::ops::Range<usize>,
    cell: usize,
    least: f32,
) -> Vec<Corner> {
    let cells = columns.len().div_ceil(cell);
    let mut best = vec![Corner { u: 0, v: 0, strength: least }; cells];
    let mut strengths = vec![0.0; columns.len()];
    for v in rows {
        row_strengths(gradients, v, &columns, &mut strengths);
        for (i, &strength) in strengths.iter().enumerate() {
            let best = &mut best[i / cell];
            if strength > best.strength {
                *best = Corner { u: columns.start + i, v, strength };
            }
        }
    }
    best.retain(|corner| corner.strength > least);
    best
}

/// Smaller eigenvalue of the windowed structure tensor along one row.
fn row_strengths(gradients: &Gradients, v: usize, columns: &std::ops::Range<usize>, out: &mut [f32]) {
    let first = columns.start - RADIUS;
    let span = columns.len() + 2 * RADIUS;
    let mut sums = vec![[0.0_f32; 3]; span];
    for row in v - RADIUS..=v + RADIUS {
        let du = &gradients.du.row(row)[first..first + span];
        let dv = &gradients.dv.row(row)[first..first + span];
        for ((s, &a), &b) in sums.iter_mut().zip(du).zip(dv) {
            s[0] += a * a;
            s[1] += a * b;
            s[2] += b * b;
        }
    }
    let count = ((2 * RADIUS + 1) * (2 * RADIUS + 1)) as f32;
    for (i, out) in out.iter_mut().enumerate() {
        let mut t = [0.0_f32; 3];
        for s in &sums[i..i + 2 * RADIUS + 1] {
            t[0] += s[0];
            t[1] += s[1];
            t[2] += s[2];
        }
        let half_difference = 0.5 * (t[0] - t[2]);
        *out = (0.5 * (t[0] + t[2]) - (half_difference * half_difference + t[1] * t[1]).sqrt()) / count;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Grid;
    use crate::observe::pyramid::gradients;

    #[test]
    fn a_square_shows_its_corners_and_not_its_edges() {
        let image =
            Grid::from_fn(
                80,
                80,
                |u, v| if (20..60).contains(&u) && (20..60).contains(&v) { 100.0 } else { 0.0 },
            );
        let found = corners(&gradients(&image), 20, 5, 1.0);
        assert_eq!(found.len(), 4, "{found:?}");
        for corner in found {
            let near = |c: usize| c.abs_diff(20).min(c.abs_diff(59)) <= RADIUS + 1;
            assert!(near(corner.u) && near(corner.v), "{corner:?}");
        }
    }

    #[test]
    fn constant_and_tiny_images_have_none() {
        for (width, height) in [(1, 1), (7, 7), (64, 64)] {
            assert!(corners(&gradients(&Grid::filled(width, height, 50.0)), 10, 3, 0.0).is_empty());
        }
    }
}
