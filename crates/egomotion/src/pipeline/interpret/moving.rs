//! Where the scene moves by itself, and how disparity changes there.

use rayon::prelude::*;

use crate::geometry::distribution::CHI2_1_P9973;
use crate::geometry::{Cells, Gaussian};
use crate::motion::RigidPrediction;
use crate::observe::temporal_disparity::{PatchMotion, disparity_change};
use crate::observe::{DensePair, StereoPyramid};

/// Side of the cells in which moving pixels are gathered, in pixels. [`Moving::index`] divides by it, so it is a power of
/// two.
const CELL_PX: usize = 4;
/// Distance of the pixels of a cell that are compared with the rigid motion, in both directions.
const PROBE_PX: usize = 2;
/// Neighbours whose disparities differ by less than this share of the larger one are of one surface.
const SAME_SURFACE_SHARE: f64 = 0.05;

/// Cells of the image that do not move with the rigid scene.
#[derive(Debug, Clone)]
pub(super) struct Moving {
    layout: Cells,
    /// `None` where nothing moves by itself.
    cells: Vec<Option<Cell>>,
}

/// What was found of one cell.
#[derive(Debug, Clone, Copy)]
struct Cell {
    /// The disparity of what moves there.
    disparity: f64,
    /// d′/d − 1 with its variance, where the patch was found again in all four images.
    change: Option<Gaussian<1>>,
}

impl Moving {
    /// Look at every cell of a pair of frames.
    pub(super) fn find(
        pair: &DensePair<'_>,
        images: (&StereoPyramid, &StereoPyramid),
        rigid: &RigidPrediction<'_>,
    ) -> Self {
        let layout = Cells::tiling(pair.flow.size(), CELL_PX);
        let cells = (0..layout.count())
            .into_par_iter()
            .with_min_len(layout.columns().max(1))
            .map(|i| cell(pair, images, rigid, layout.corner(i)))
            .collect();
        Self { layout, cells }
    }

    /// How the cells lie in the image.
    pub(super) fn layout(&self) -> &Cells {
        &self.layout
    }

    /// [`Cells::index`] for every pixel of an image: a division by a constant is a shift.
    #[inline(always)]
    pub(super) fn index(&self, u: usize, v: usize) -> usize {
        v / CELL_PX * self.layout.columns() + u / CELL_PX
    }

    /// The disparity of what moves by itself in a cell; `None` if nothing does.
    pub(super) fn disparity(&self, cell: usize) -> Option<f64> {
        self.cells[cell].map(|cell| cell.disparity)
    }

    /// Whether a pixel lies in a cell that moves by itself.
    #[inline(always)]
    pub(super) fn is_moving(&self, u: usize, v: usize) -> bool {
        self.cells[self.index(u, v)].is_some()
    }

    /// Whether what moves in a cell was found again in all four images.
    pub(super) fn is_confirmed(&self, cell: usize) -> bool {
        self.cells[cell].is_some_and(|cell| cell.change.is_some())
    }

    /// Whether two disparities may be those of one surface, seen by neighbours.
    pub(super) fn same_surface(a: f64, b: f64) -> bool {
        (a - b).abs() < SAME_SURFACE_SHARE * a.max(b)
    }

    /// d and d′ of a pixel in a cell that moves; `Some(None)` where they are not known, `None` elsewhere.
    pub(super) fn disparities(
        &self,
        pair: &DensePair<'_>,
        u: usize,
        v: usize,
    ) -> Option<Option<Gaussian<2>>> {
        let cell = self.index(u, v);
        self.cells[cell].is_some().then(|| {
            let maps = pair.disparities(u, v);
            match pair.disparity(u, v) {
                Some(d) => self.ratio(d.0, cell).map_or(maps, |ratio| Some(joint(d, &ratio, maps.as_ref()))),
                None => maps,
            }
        })
    }

    /// d′/d − 1 of the surface at disparity `d` around a cell.
    ///
    /// Windows of neighbours overlap: their mean is taken to be no surer than they are.
    fn ratio(&self, d: f64, cell: usize) -> Option<Gaussian<1>> {
        let columns = self.layout.columns();
        let (column, row, rows) = (cell % columns, cell / columns, self.layout.count() / columns);
        let (mut sum, mut weights, mut count) = (0.0, 0.0, 0.0);
        for r in row.saturating_sub(1)..(row + 2).min(rows) {
            for c in column.saturating_sub(1)..(column + 2).min(columns) {
                let Some(Cell { disparity, change: Some(change) }) = self.cells[r * columns + c] else {
                    continue;
                };
                if Self::same_surface(disparity, d) {
                    let weight = change.variance().recip();
                    sum += weight * change.value();
                    weights += weight;
                    count += 1.0;
                }
            }
        }
        (weights > 0.0).then(|| Gaussian::scalar(sum / weights, count / weights))
    }
}

/// d and d′ from d, its change, and the later map's d′ where that agrees.
fn joint((d, variance): (f64, f64), ratio: &Gaussian<1>, maps: Option<&Gaussian<2>>) -> Gaussian<2> {
    let growth = 1.0 + ratio.value();
    let mut both = Gaussian::independent(
        [d, d * growth],
        [variance, growth * growth * variance + d * d * ratio.variance()],
    );
    (both.cov.m12, both.cov.m21) = (growth * variance, growth * variance);
    if let Some(maps) = maps {
        let (innovation, spread) = (maps.mean.y - both.mean.y, both.cov.m22 + maps.cov.m22);
        if innovation * innovation < CHI2_1_P9973 * spread {
            let gain = both.cov.column(1) / spread;
            both.mean += gain * innovation;
            both.cov -= gain * gain.transpose() * spread;
        }
    }
    both
}

/// The cell that begins at pixel (u, v).
fn cell(
    pair: &DensePair<'_>,
    (before, after): (&StereoPyramid, &StereoPyramid),
    rigid: &RigidPrediction<'_>,
    (u, v): (usize, usize),
) -> Option<Cell> {
    let (width, height) = pair.flow.size();
    let (mut apart, mut together) = (0, 0);
    let mut best: Option<(f64, (usize, usize))> = None;
    for v in (v + PROBE_PX / 2..(v + CELL_PX).min(height)).step_by(PROBE_PX) {
        for u in (u + PROBE_PX / 2..(u + CELL_PX).min(width)).step_by(PROBE_PX) {
            let (Some((d, variance)), Some(moved)) = (pair.disparity(u, v), pair.displacement(u, v)) else {
                continue;
            };
            let (x, y) = pair.rig.image_from_pixel(u as f64, v as f64);
            if rigid.contradicts_flow(&nalgebra::Vector3::new(x, y, d), variance, &moved) {
                apart += 1;
                if best.is_none_or(|(least, _)| variance < least) {
                    best = Some((variance, (u, v)));
                }
            } else {
                together += 1;
            }
        }
    }
    let (_, (u, v)) = best.filter(|_| apart > together)?;
    let (disparity, _) = pair.disparity(u, v)?;
    Some(Cell { disparity, change: change_at(pair, (before, after), rigid, (u, v), disparity) })
}

/// The relative change of `d` at a pixel.
fn change_at(
    pair: &DensePair<'_>,
    (before, after): (&StereoPyramid, &StereoPyramid),
    rigid: &RigidPrediction<'_>,
    (u, v): (usize, usize),
    d: f64,
) -> Option<Gaussian<1>> {
    let flow = pair.flow.get(u, v)?.mean;
    let seen = PatchMotion {
        at: (u as f64, v as f64),
        shift: pair.rig.shift_from_disparity(d),
        flow: (flow.x, flow.y),
    };
    let (x, y) = pair.rig.image_from_pixel(u as f64, v as f64);
    let by_maps = pair.disparities(u, v).map(|maps| maps.mean.y - maps.mean.x);
    let by_motion = rigid.moved(&nalgebra::Vector3::new(x, y, d)).map(|moved| moved.z - d);
    let expected: Vec<f64> = by_maps.into_iter().chain([0.0]).chain(by_motion).collect();
    let change = disparity_change(before, after, &seen, &expected)?;
    Some(Gaussian::scalar(change.value() / d, change.variance() / (d * d)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ratio_of_disparities_is_surer_than_their_difference() {
        let ratio = Gaussian::scalar(0.1, 1e-6);
        let alone = joint((10.0, 0.04), &ratio, None);
        assert!((alone.mean.y - 11.0).abs() < 1e-12);
        // Var(ln d′/d) is that of the ratio: the error of d is shared.
        let by = nalgebra::Vector2::new(-1.0 / alone.mean.x, 1.0 / alone.mean.y);
        assert!((by.dot(&(alone.cov * by)) - 1e-6 / 1.21).abs() < 1e-12);
        // A map that says the same changes nothing but the variances; one that lies far off is left out.
        let map = |d: f64| Gaussian::independent([10.0, d], [0.04, 0.04]);
        let same = joint((10.0, 0.04), &ratio, Some(&map(11.0)));
        assert!((same.mean - alone.mean).norm() < 1e-12 && same.cov.m11 < alone.cov.m11);
        let weights = (1.0 / (1.21 * 0.04 + 1e-4), 1.0 / 0.04);
        assert!((same.cov.m22 - 1.0 / (weights.0 + weights.1)).abs() < 1e-12);
        assert_eq!(joint((10.0, 0.04), &ratio, Some(&map(14.0))), alone);
    }
}
