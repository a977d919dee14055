//! Flow without a prediction: coarse to fine, and back.

use super::compare::Images;
use super::refine::refine;
use super::smooth::smooth;
use super::widen::widened;
use super::{Displacement, FlowField, FlowOptions, FlowPair, consistency, densify, search};
use crate::geometry::{Grid, Image};
use crate::observe::planes::Planes;
use crate::observe::spline;

/// Flow by search at every patch; `images` are those at full resolution.
pub(super) fn flow(pair: &FlowPair<'_>, images: Images<'_>, options: &FlowOptions) -> FlowField {
    let levels = pair.levels();
    let coarsest = levels.len() - 1;
    let finest = options.finest_search_level.min(coarsest);
    let found = coarse_to_fine(&levels, None, finest, |_, _, _| true, options);
    let wide = (finest > 0).then(|| {
        let (from, to) = levels[finest];
        let to = &spline::coefficients(to);
        refined(Images { from, to }, found.clone(), None, options)
    });
    let found = densify::enlarge(found, finest, images.from.size());
    let mut flow = refined(images, found, wide.as_ref().map(|wide| (wide, finest)), options);
    if options.consistency_px.is_finite() {
        let coarse = options.consistency_level.min(coarsest);
        let back: Vec<(&Image, &Image)> = levels.iter().map(|&(a, b)| (b, a)).collect();
        let backward = coarse_to_fine(&back, None, coarse, |_, _, _| true, options);
        consistency::reject(&mut flow, &backward, coarse, options.consistency_px);
    }
    FlowField::from_planes(flow)
}

/// Dense inverse search from the coarsest level down to level `finest`; the displacement is in pixels of
/// that level. `wanted` gets level and upper left pixel of a patch.
pub(super) fn coarse_to_fine(
    levels: &[(&Image, &Image)],
    initial: Option<&FlowField>,
    finest: usize,
    wanted: impl Fn(usize, usize, usize) -> bool + Sync,
    options: &FlowOptions,
) -> Displacement {
    let coarsest = levels.len() - 1;
    let mut flow: Option<Displacement> = None;
    for (level, (a, b)) in levels.iter().enumerate().skip(finest).rev() {
        let prediction = initial.map(|f| (f, level));
        let pair = search::Pair::new(a, b);
        let wanted = |x: usize, y: usize| wanted(level, x, y);
        let patches = search::search(&pair, flow.as_ref(), prediction, wanted, level == coarsest, options);
        flow = Some(densify::densify(&pair, &patches));
    }
    flow.unwrap_or_else(|| {
        let zero = Grid::filled(0, 0, 0.0);
        Displacement { u: zero.clone(), v: zero }
    })
}

/// Lucas–Kanade from a displacement that is smoothed before each iteration; (u, v, uu, uv, vv), and where
/// texture is wanting the `wide` answer of a level.
fn refined(
    images: Images<'_>,
    mut flow: Displacement,
    wide: Option<(&Planes<5>, usize)>,
    options: &FlowOptions,
) -> Planes<5> {
    let (width, height) = images.from.size();
    for _ in 1..options.refine_iterations {
        let before = smooth(&flow);
        let mut moved = Planes::<2>::filled(width, height, 0.0);
        refine(images, options, f32::INFINITY, before.rows(), &mut moved, |_, _, solved, [u, v]| {
            u.copy_from_slice(&solved.moved_u[..width]);
            v.copy_from_slice(&solved.moved_v[..width]);
        });
        let [u, v] = moved.into_grids();
        flow = Displacement { u, v };
    }
    let before = smooth(&flow);
    let mut answers = Planes::<5>::filled(width, height, f32::NAN);
    refine(images, options, f32::INFINITY, before.rows(), &mut answers, |y, _, solved, out| {
        let rows = [&solved.u, &solved.v, &solved.uu, &solved.uv, &solved.vv];
        let [u, v, uu, uv, vv] = out;
        for (to, from) in [&mut *u, &mut *v, &mut *uu, &mut *uv, &mut *vv].into_iter().zip(rows) {
            to.copy_from_slice(&from[..width]);
        }
        for x in (0..width).filter(|&x| solved.uu[x] == f32::INFINITY) {
            let answer = wide.and_then(|(wide, level)| widened(wide, level, (x, y)));
            [u[x], v[x], uu[x], uv[x], vv[x]] = answer.unwrap_or([f32::NAN; 5]);
        }
    });
    answers
}

impl Displacement {
    /// Rows for [`refine`].
    fn rows(&self) -> impl Fn(usize, &mut [f32], &mut [f32]) + Sync + '_ {
        |y, u, v| {
            u.copy_from_slice(self.u.row(y));
            v.copy_from_slice(self.v.row(y));
        }
    }
}
