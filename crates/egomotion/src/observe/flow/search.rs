//! Dense inverse search at one level: overlapping 8×8 patches, each with its own displacement.
//!
//! Inverse-compositional and mean-compensated: with template T, its gradients g and the patch J moved by
//! the displacement, H = Σ (g − ḡ)(g − ḡ)ᵀ is fixed and each step is −H⁻¹ Σ (g − ḡ)(J − T).

use super::FlowField;
use super::displacement::{Displacement, interpolate};
use crate::geometry::{Grid, Image};
use crate::observe::pyramid::{Gradients, gradients};
use crate::simd::vectorised;
use rayon::prelude::*;

/// Side of a patch, in pixels.
pub(super) const PATCH: usize = 8;
/// Pixels of a patch.
const PATCH_PIXELS: f32 = (PATCH * PATCH) as f32;
/// Distance of neighbouring patches, in pixels of each level: smaller is slower and denser.
const PATCH_STRIDE_PX: usize = 4;
/// Most iterations of a patch at a level.
const ITERATIONS: usize = 12;
/// How often a patch tries what its four neighbours found; twice as often at the coarsest level.
const PROPAGATION_ROUNDS: usize = 2;
/// Width of the border by which the second image is continued, in pixels, so that patches may leave it.
const MARGIN: usize = 2 * PATCH;
/// Added to the diagonal of H, in (grey levels per pixel)²: without texture a patch stays where it began.
const DAMPING: f32 = 32.0;
/// A patch that strays farther than this from where it began, in pixels of its level, is put back.
const MAX_STRAY_PX: f32 = PATCH as f32;
/// A patch is done when its step is shorter than this, in pixels of its level.
const SETTLED_PX: f32 = 0.02;
/// Factor by which what a neighbour found must lower the cost to be taken up.
const CLEARLY_BETTER: f32 = 0.95;
/// A neighbour whose match differs by less than this (sum of both components), in pixels of the level, has found the same.
const SAME_MATCH_PX: f32 = 0.25;

/// Two images of one level, made ready for search.
pub(super) struct SearchPair<'a> {
    pub from: &'a Image,
    gradients: Gradients,
    /// The second image with a border of [`MARGIN`] repeated pixels.
    to: Image,
}

impl<'a> SearchPair<'a> {
    pub(super) fn new(from: &'a Image, to: &Image) -> Self {
        let (width, height) = to.size();
        let mut padded = Grid::filled(width + 2 * MARGIN, height + 2 * MARGIN, 0.0_f32);
        let stride = padded.width();
        padded.values_mut().par_chunks_mut(stride).enumerate().for_each(|(y, row)| {
            let source = to.row(y.saturating_sub(MARGIN).min(height - 1));
            row[MARGIN..MARGIN + width].copy_from_slice(source);
            row[..MARGIN].fill(source[0]);
            row[MARGIN + width..].fill(source[width - 1]);
        });
        Self { from, gradients: gradients(from), to: padded }
    }

    /// The 8×8 pixels of the second image at (x, y), bilinear; clamped to the border's outer edge.
    #[inline(always)]
    pub(super) fn patch(&self, x: f32, y: f32) -> [[f32; PATCH]; PATCH] {
        let place = |c: f32, size: usize| {
            let c = (c + MARGIN as f32).clamp(0.0, (size - PATCH - 2) as f32);
            (c as usize, c - c.floor())
        };
        let ((x, a), (y, b)) = (place(x, self.to.width()), place(y, self.to.height()));
        let line = |y: usize| {
            let mut out = [0.0_f32; PATCH];
            if let Some(source) = self.to.row(y).get(x..).and_then(|s| s.first_chunk::<{ PATCH + 1 }>()) {
                for i in 0..PATCH {
                    out[i] = source[i] + a * (source[i + 1] - source[i]);
                }
            }
            out
        };
        let mut patch = [[0.0_f32; PATCH]; PATCH];
        let mut above = line(y);
        for (k, out) in patch.iter_mut().enumerate() {
            let below = line(y + k + 1);
            for i in 0..PATCH {
                out[i] = above[i] + b * (below[i] - above[i]);
            }
            above = below;
        }
        patch
    }
}

/// A patch's displacement, in pixels of its level, and its cost.
#[derive(Debug, Clone, Copy)]
pub(super) struct Match {
    pub u: f32,
    pub v: f32,
    /// Variance of the difference of the two patches, in squared grey levels.
    pub cost: f32,
}

/// The patches of a level, row by row; the last of each row and column touches the border.
pub(super) struct Patches {
    pub columns: usize,
    pub rows: usize,
    size: (usize, usize),
    pub matches: Vec<Match>,
}

impl Patches {
    /// Upper left pixel of the patch (column, row).
    pub(super) fn corner(&self, column: usize, row: usize) -> (usize, usize) {
        (
            (column * PATCH_STRIDE_PX).min(self.size.0 - PATCH),
            (row * PATCH_STRIDE_PX).min(self.size.1 - PATCH),
        )
    }

    fn take(&mut self, templates: &[(usize, Template)], found: &[Match]) {
        for ((i, _), found) in templates.iter().zip(found) {
            self.matches[*i] = *found;
        }
    }
}

/// What a patch of the first image looks for.
struct Template {
    x: f32,
    y: f32,
    grey: [[f32; PATCH]; PATCH],
    du: [[f32; PATCH]; PATCH],
    dv: [[f32; PATCH]; PATCH],
    mean_du: f32,
    mean_dv: f32,
    /// (H + damping)⁻¹: uu, uv, vv.
    inverse: [f32; 3],
}

/// The 8×8 values of `plane` from (x, y), which lie inside.
fn block(plane: &Grid<f32>, x: usize, y: usize) -> [[f32; PATCH]; PATCH] {
    let mut out = [[0.0; PATCH]; PATCH];
    for (k, out) in out.iter_mut().enumerate() {
        out.copy_from_slice(&plane.row(y + k)[x..x + PATCH]);
    }
    out
}

/// Σ a b over the patch, in eight lanes.
fn dot(a: &[[f32; PATCH]; PATCH], b: &[[f32; PATCH]; PATCH]) -> f32 {
    let mut lanes = [0.0_f32; PATCH];
    for (a, b) in a.iter().zip(b) {
        for i in 0..PATCH {
            lanes[i] += a[i] * b[i];
        }
    }
    lanes.iter().sum()
}

impl Template {
    fn new(pair: &SearchPair<'_>, (x, y): (usize, usize)) -> Self {
        const ONES: [[f32; PATCH]; PATCH] = [[1.0; PATCH]; PATCH];
        let grey = block(pair.from, x, y);
        let (du, dv) = (block(&pair.gradients.du, x, y), block(&pair.gradients.dv, x, y));
        let (mean_du, mean_dv) = (dot(&du, &ONES) / PATCH_PIXELS, dot(&dv, &ONES) / PATCH_PIXELS);
        let uu = dot(&du, &du) - PATCH_PIXELS * mean_du * mean_du + DAMPING;
        let uv = dot(&du, &dv) - PATCH_PIXELS * mean_du * mean_dv;
        let vv = dot(&dv, &dv) - PATCH_PIXELS * mean_dv * mean_dv + DAMPING;
        let det = uu * vv - uv * uv;
        Self {
            x: x as f32,
            y: y as f32,
            grey,
            du,
            dv,
            mean_du,
            mean_dv,
            inverse: [vv / det, -uv / det, uu / det],
        }
    }

    /// The cost of a displacement, and the step that lowers it.
    #[inline(always)]
    fn evaluate(&self, pair: &SearchPair<'_>, u: f32, v: f32) -> (f32, [f32; 2]) {
        let moved = pair.patch(self.x + u, self.y + v);
        let [mut sum, mut squares, mut du, mut dv] = [[0.0_f32; PATCH]; 4];
        for (k, moved) in moved.iter().enumerate() {
            for i in 0..PATCH {
                let r = moved[i] - self.grey[k][i];
                sum[i] += r;
                squares[i] += r * r;
                du[i] += r * self.du[k][i];
                dv[i] += r * self.dv[k][i];
            }
        }
        let total = |lanes: [f32; PATCH]| lanes.iter().sum::<f32>();
        let mean = total(sum) / PATCH_PIXELS;
        let cost = total(squares) / PATCH_PIXELS - mean * mean;
        let (bu, bv) =
            (total(du) - PATCH_PIXELS * mean * self.mean_du, total(dv) - PATCH_PIXELS * mean * self.mean_dv);
        let [uu, uv, vv] = self.inverse;
        (cost, [-(uu * bu + uv * bv), -(uv * bu + vv * bv)])
    }

    /// Descend from (u, v); where it began if that leads nowhere.
    #[inline(always)]
    fn descend(&self, pair: &SearchPair<'_>, u: f32, v: f32) -> Match {
        let (cost, mut step) = self.evaluate(pair, u, v);
        let mut best = Match { u, v, cost };
        for _ in 0..ITERATIONS {
            let (next_u, next_v) = (best.u + step[0], best.v + step[1]);
            let is_near = (next_u - u).abs().max((next_v - v).abs()) < MAX_STRAY_PX;
            if !is_near {
                return Match { u, v, cost };
            }
            let (next_cost, next_step) = self.evaluate(pair, next_u, next_v);
            let is_better = next_cost < best.cost;
            if is_better {
                best = Match { u: next_u, v: next_v, cost: next_cost };
            }
            if !is_better || step[0].abs().max(step[1].abs()) < SETTLED_PX {
                break;
            }
            step = next_step;
        }
        best
    }
}

/// Search the displacement of the patches of a level.
///
/// Each begins at the better of what the `coarser` level found and the `prediction` (a flow at full
/// resolution, and this level), then takes up what its neighbours found if that fits clearly better.
/// The coarsest level gets more rounds of that, since it has nothing else to begin with. Patches whose
/// upper left pixel is not `wanted` keep the prediction.
pub(super) fn search(
    pair: &SearchPair<'_>,
    coarser: Option<&Displacement>,
    prediction: Option<(&FlowField, usize)>,
    wanted: impl Fn(usize, usize) -> bool + Sync,
    is_coarsest: bool,
) -> Patches {
    let size = pair.from.size();
    let count = |side: usize| (side - PATCH).div_ceil(PATCH_STRIDE_PX) + 1;
    let mut patches = Patches { columns: count(size.0), rows: count(size.1), size, matches: vec![] };
    let places: Vec<(usize, usize)> =
        (0..patches.rows).flat_map(|row| (0..patches.columns).map(move |column| (column, row))).collect();
    let templates: Vec<(usize, Template)> = places
        .par_iter()
        .enumerate()
        .filter_map(|(i, &(column, row))| {
            let (x, y) = patches.corner(column, row);
            wanted(x, y).then(|| (i, Template::new(pair, (x, y))))
        })
        .collect();

    let still = |&(column, row): &(usize, usize)| {
        let (x, y) = patches.corner(column, row);
        let (u, v) = prediction.and_then(|p| predicted(p, centre(x as f32, y as f32))).unwrap_or_default();
        Match { u, v, cost: 0.0 }
    };
    // Where all are wanted none keeps the prediction.
    patches.matches = if templates.len() < places.len() {
        places.par_iter().map(still).collect()
    } else {
        vec![Match { u: 0.0, v: 0.0, cost: 0.0 }; places.len()]
    };
    let found: Vec<Match> = templates
        .par_iter()
        .map(|(_, template)| {
            let (u, v) = begin(pair, template, centre(template.x, template.y), coarser, prediction);
            descend(pair, template, u, v)
        })
        .collect();
    patches.take(&templates, &found);
    for _ in 0..PROPAGATION_ROUNDS * if is_coarsest { 2 } else { 1 } {
        let before = &patches.matches;
        let columns = patches.columns;
        let after = |(i, template): &(usize, Template)| {
            let (column, row) = (i % columns, i / columns);
            let neighbours = [
                (column > 0).then(|| i - 1),
                (column + 1 < columns).then_some(i + 1),
                (row > 0).then(|| i - columns),
                (row + 1 < patches.rows).then_some(i + columns),
            ];
            from_neighbours(pair, template, before, *i, neighbours)
        };
        let found: Vec<Match> = templates.par_iter().map(after).collect();
        patches.take(&templates, &found);
    }
    patches
}

/// The middle of the patch at (x, y).
fn centre(x: f32, y: f32) -> (f32, f32) {
    (x + 0.5 * PATCH as f32, y + 0.5 * PATCH as f32)
}

/// The prediction for a level at (x, y), in pixels of the level.
fn predicted((flow, level): (&FlowField, usize), (x, y): (f32, f32)) -> Option<(f32, f32)> {
    let scale = (1_usize << level) as f32;
    let (column, row) = ((x * scale) as usize, (y * scale) as usize);
    let (column, row) = (column.min(flow.u.width() - 1), row.min(flow.u.height() - 1));
    Some((flow.u.get(column, row)? / scale, flow.v.get(column, row)? / scale))
}

vectorised! {
/// [`Template::descend`].
descend(pair: &SearchPair<'_>, template: &Template, u: f32, v: f32) -> Match {
    template.descend(pair, u, v)
}
}

vectorised! {
/// [`Template::evaluate`], the cost alone.
cost(pair: &SearchPair<'_>, template: &Template, u: f32, v: f32) -> f32 {
    template.evaluate(pair, u, v).0
}
}

/// Where a patch begins: the better of the coarser level's displacement and the predicted one.
fn begin(
    pair: &SearchPair<'_>,
    template: &Template,
    (x, y): (f32, f32),
    coarser: Option<&Displacement>,
    prediction: Option<(&FlowField, usize)>,
) -> (f32, f32) {
    let found = coarser.map_or((0.0, 0.0), |flow| {
        (2.0 * interpolate(&flow.u, 0.5 * x, 0.5 * y), 2.0 * interpolate(&flow.v, 0.5 * x, 0.5 * y))
    });
    match prediction.and_then(|p| predicted(p, (x, y))) {
        Some(p) if cost(pair, template, p.0, p.1) < cost(pair, template, found.0, found.1) => p,
        _ => found,
    }
}

/// The best of a patch's own match and its neighbours', taken up and refined if clearly better.
fn from_neighbours(
    pair: &SearchPair<'_>,
    template: &Template,
    before: &[Match],
    own: usize,
    neighbours: [Option<usize>; 4],
) -> Match {
    let own = before[own];
    let mut best = Match { cost: own.cost * CLEARLY_BETTER, ..own };
    for other in neighbours.into_iter().flatten().map(|i| before[i]) {
        if (other.u - own.u).abs() + (other.v - own.v).abs() < SAME_MATCH_PX {
            continue;
        }
        let cost = cost(pair, template, other.u, other.v);
        if cost < best.cost {
            best = Match { cost, ..other };
        }
    }
    if best.cost < own.cost * CLEARLY_BETTER { descend(pair, template, best.u, best.v) } else { own }
}
