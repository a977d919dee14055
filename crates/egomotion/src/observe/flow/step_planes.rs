//! The planes of a Lucas–Kanade step: what each pixel's window answered, and in which state it is.
//!
//! Planes are handed out in strips of rows, which tasks fill side by side. A state is written into the planes
//! themselves, as the values that [`StepState`] names: kernels read and write it without a branch.

use super::FlowField;
use super::displacement::Displacement;
use crate::geometry::{Field, Grid};

/// What a step says of a pixel.
///
/// The order is that of the questions: a pixel that is not seen has no texture to speak of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StepState {
    /// The second image does not show it: it has left the image, or is hidden.
    Unseen,
    /// Its window has not enough texture in two directions; a damped step does no harm.
    Textureless,
    /// Its window has texture, and nothing in reach explains it.
    Refuted,
    /// Displacement and covariance are to be believed.
    Measured,
}

/// The `uu` of a textureless pixel.
pub(super) const TEXTURELESS: f32 = f32::INFINITY;
/// The `uu` of a refuted pixel. Both have no displacement.
pub(super) const REFUTED: f32 = f32::NAN;
/// The displacement of a pixel that is not measured.
pub(super) const UNMEASURED: f32 = f32::NAN;
/// The residual of a pixel that the second image does not show.
pub(super) const UNSEEN: f32 = f32::INFINITY;

/// Whether a pixel of this displacement is measured.
#[inline(always)]
pub(super) fn is_measured(displacement: f32) -> bool {
    !displacement.is_nan()
}

/// Whether a pixel of this variance `uu` lacks texture.
#[inline(always)]
pub(super) fn is_textureless(uu: f32) -> bool {
    uu == TEXTURELESS
}

/// Whether the second image shows a pixel of this residual.
#[inline(always)]
pub(super) fn is_seen(residual: f32) -> bool {
    residual < UNSEEN
}

impl StepState {
    /// The state that displacement, variance and residual of a pixel tell.
    pub(super) fn of(u: f32, uu: f32, residual: f32) -> Self {
        if !is_seen(residual) {
            Self::Unseen
        } else if is_textureless(uu) {
            Self::Textureless
        } else if is_measured(u) {
            Self::Measured
        } else {
            Self::Refuted
        }
    }
}

/// Displacement of one pixel, in pixels, with its covariance, in px².
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PixelFlow {
    pub u: f32,
    pub v: f32,
    pub uu: f32,
    pub uv: f32,
    pub vv: f32,
}

impl PixelFlow {
    /// No displacement.
    pub(super) const MISSING: Self =
        Self { u: f32::NAN, v: f32::NAN, uu: f32::NAN, uv: f32::NAN, vv: f32::NAN };
}

/// Displacements with their covariance as planes of one size.
#[derive(Debug, Clone)]
pub(super) struct FlowPlanes {
    pub u: Grid<f32>,
    pub v: Grid<f32>,
    pub uu: Grid<f32>,
    pub uv: Grid<f32>,
    pub vv: Grid<f32>,
}

/// Rows of [`FlowPlanes`], to be written.
#[derive(Debug)]
pub(super) struct FlowRows<'a> {
    pub u: &'a mut [f32],
    pub v: &'a mut [f32],
    pub uu: &'a mut [f32],
    pub uv: &'a mut [f32],
    pub vv: &'a mut [f32],
}

impl FlowPlanes {
    /// Planes filled with one value.
    pub(super) fn filled(width: usize, height: usize, value: f32) -> Self {
        let plane = Grid::filled(width, height, value);
        Self { u: plane.clone(), v: plane.clone(), uu: plane.clone(), uv: plane.clone(), vv: plane }
    }

    /// (width, height), in pixels.
    pub(super) fn size(&self) -> (usize, usize) {
        self.u.size()
    }

    /// Strips of so many rows, the last perhaps lower.
    pub(super) fn strips(&mut self, rows: usize) -> Vec<FlowRows<'_>> {
        let Self { u, v, uu, uv, vv } = self;
        let strips = strips_of([u, v, uu, uv, vv], rows).into_iter();
        strips.map(|[u, v, uu, uv, vv]| FlowRows { u, v, uu, uv, vv }).collect()
    }

    /// The displacement at pixel (x, y), inside.
    pub(super) fn at(&self, x: usize, y: usize) -> PixelFlow {
        let [u, v, uu, uv, vv] = [&self.u, &self.v, &self.uu, &self.uv, &self.vv].map(|plane| plane.at(x, y));
        PixelFlow { u, v, uu, uv, vv }
    }

    /// Displacement at pixel (x, y) of full resolution from these planes of a `level`, or `None` where one that is
    /// needed is missing.
    ///
    /// A window of the same number of pixels at a coarser level covers more of the image: it sees texture
    /// farther away, and its noise is less. The displacement is bilinear, with the covariance of the nearest pixel,
    /// for neighbours share most of their error, so that their mean has no less.
    #[inline]
    pub(super) fn at_full_resolution(&self, level: usize, (x, y): (usize, usize)) -> Option<PixelFlow> {
        let scale = (1_usize << level) as f32;
        let (right, bottom) = (self.size().0 - 1, self.size().1 - 1);
        let (fx, fy) = (x as f32 / scale, y as f32 / scale);
        let near = ((fx.round() as usize).min(right), (fy.round() as usize).min(bottom));
        let (x0, y0) = ((fx as usize).min(right), (fy as usize).min(bottom));
        let (x1, y1) = ((x0 + 1).min(right), (y0 + 1).min(bottom));
        let (a, b) = (fx - x0 as f32, fy - y0 as f32);
        let mean = |plane: &Grid<f32>| {
            let line = |y: usize| {
                let left = plane.at(x0, y);
                // A neighbour that is not needed may be missing.
                if a > 0.0 { left + a * (plane.at(x1, y) - left) } else { left }
            };
            let above = line(y0);
            if b > 0.0 { above + b * (line(y1) - above) } else { above }
        };
        let (u, v) = (mean(&self.u), mean(&self.v));
        if u.is_nan() || v.is_nan() {
            return None;
        }
        let variance = |plane: &Grid<f32>| scale * scale * plane.at(near.0, near.1);
        let (uu, uv, vv) = (variance(&self.uu), variance(&self.uv), variance(&self.vv));
        Some(PixelFlow { u: scale * u, v: scale * v, uu, uv, vv })
    }

    /// The flow that the planes hold.
    pub(super) fn into_field(self) -> FlowField {
        FlowField {
            u: Field::from_grid(self.u),
            v: Field::from_grid(self.v),
            cov_uu: self.uu,
            cov_uv: self.uv,
            cov_vv: self.vv,
        }
    }
}

impl FlowRows<'_> {
    /// Row `k` of a strip, of so many pixels.
    pub(super) fn row(&mut self, k: usize, width: usize) -> FlowRows<'_> {
        let row = k * width..(k + 1) * width;
        FlowRows {
            u: &mut self.u[row.clone()],
            v: &mut self.v[row.clone()],
            uu: &mut self.uu[row.clone()],
            uv: &mut self.uv[row.clone()],
            vv: &mut self.vv[row],
        }
    }

    /// Write the displacement of pixel `i`.
    #[inline]
    pub(super) fn set(&mut self, i: usize, flow: PixelFlow) {
        (self.u[i], self.v[i]) = (flow.u, flow.v);
        (self.uu[i], self.uv[i], self.vv[i]) = (flow.uu, flow.uv, flow.vv);
    }
}

/// What a step at a coarse level gives, everything in pixels of the level.
#[derive(Debug, Clone)]
pub(super) struct StepPlanes {
    /// Displacement and covariance where they are measured; see [`StepState`].
    pub flow: FlowPlanes,
    /// By how much the displacement after the step differs from the predicted one, everywhere.
    pub correction_u: Grid<f32>,
    pub correction_v: Grid<f32>,
    /// Variance of the difference of grey levels after the step, and before it; [`UNSEEN`] where there is none.
    pub residual: Grid<f32>,
    pub residual_before: Grid<f32>,
}

/// Rows of [`StepPlanes`], to be written.
#[derive(Debug)]
pub(super) struct StepRows<'a> {
    pub flow: FlowRows<'a>,
    pub correction_u: &'a mut [f32],
    pub correction_v: &'a mut [f32],
    pub residual: &'a mut [f32],
    pub residual_before: &'a mut [f32],
}

impl Default for StepPlanes {
    fn default() -> Self {
        let plane = || Grid::filled(0, 0, f32::NAN);
        Self {
            flow: FlowPlanes::filled(0, 0, f32::NAN),
            correction_u: plane(),
            correction_v: plane(),
            residual: plane(),
            residual_before: plane(),
        }
    }
}

impl StepPlanes {
    /// Make them of this size; what they hold is then anything.
    pub(super) fn resize(&mut self, width: usize, height: usize) {
        if self.flow.size() == (width, height) {
            return;
        }
        let plane = || Grid::filled(width, height, f32::NAN);
        self.flow = FlowPlanes::filled(width, height, f32::NAN);
        (self.correction_u, self.correction_v) = (plane(), plane());
        (self.residual, self.residual_before) = (plane(), plane());
    }

    /// (width, height), in pixels.
    pub(super) fn size(&self) -> (usize, usize) {
        self.flow.size()
    }

    /// State of pixel (x, y), inside.
    pub(super) fn state(&self, x: usize, y: usize) -> StepState {
        StepState::of(self.flow.u.at(x, y), self.flow.uu.at(x, y), self.residual.at(x, y))
    }

    /// Strips of so many rows, the last perhaps lower.
    pub(super) fn strips(&mut self, rows: usize) -> Vec<StepRows<'_>> {
        let Self { flow, correction_u, correction_v, residual, residual_before } = self;
        let others = strips_of([correction_u, correction_v, residual, residual_before], rows);
        let strips = flow.strips(rows).into_iter().zip(others);
        strips
            .map(|(flow, [correction_u, correction_v, residual, residual_before])| StepRows {
                flow,
                correction_u,
                correction_v,
                residual,
                residual_before,
            })
            .collect()
    }
}

impl StepRows<'_> {
    /// State of pixel `i` of the strip.
    pub(super) fn state(&self, i: usize) -> StepState {
        StepState::of(self.flow.u[i], self.flow.uu[i], self.residual[i])
    }

    /// Take over all that `other` holds of pixel (x, y), for pixel `i` of the strip.
    pub(super) fn take(&mut self, i: usize, other: &StepPlanes, (x, y): (usize, usize)) {
        self.flow.set(i, other.flow.at(x, y));
        self.correction_u[i] = other.correction_u.at(x, y);
        self.correction_v[i] = other.correction_v.at(x, y);
        self.residual[i] = other.residual.at(x, y);
        self.residual_before[i] = other.residual_before.at(x, y);
    }
}

impl Displacement {
    /// Strips of so many rows of u and of v, the last perhaps lower.
    pub(super) fn strips(&mut self, rows: usize) -> Vec<[&mut [f32]; 2]> {
        strips_of([&mut self.u, &mut self.v], rows)
    }
}

/// Planes of one size in strips of so many rows, the last perhaps lower.
fn strips_of<const N: usize>(planes: [&mut Grid<f32>; N], rows: usize) -> Vec<[&mut [f32]; N]> {
    debug_assert!(planes.iter().all(|plane| plane.size() == planes[0].size()), "planes of one size");
    let (width, height) = planes.first().map_or((0, 0), |plane| plane.size());
    let mut strips = planes.map(|plane| plane.values_mut().chunks_mut((rows * width).max(1)));
    let count = height.div_ceil(rows.max(1));
    (0..count).map(|_| strips.each_mut().map(|strip| strip.next().unwrap_or_default())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_planes_tell_each_state() {
        let states = [
            (0.3, 0.01, 4.0, StepState::Measured),
            (UNMEASURED, TEXTURELESS, 4.0, StepState::Textureless),
            (UNMEASURED, REFUTED, 4.0, StepState::Refuted),
            (UNMEASURED, REFUTED, UNSEEN, StepState::Unseen),
            (0.3, 0.01, UNSEEN, StepState::Unseen),
        ];
        for (u, uu, residual, expected) in states {
            assert_eq!(StepState::of(u, uu, residual), expected);
        }
    }

    #[test]
    fn strips_cover_the_planes_once() {
        let mut planes = StepPlanes::default();
        planes.resize(5, 7);
        let strips = planes.strips(3);
        assert_eq!(strips.iter().map(|s| s.residual.len()).collect::<Vec<_>>(), [15, 15, 5]);
        for (k, mut strip) in strips.into_iter().enumerate() {
            strip.flow.row(0, 5).u.fill(k as f32);
        }
        assert_eq!([0, 3, 6].map(|y| planes.flow.u.at(4, y)), [0.0, 1.0, 2.0]);
        assert!(planes.flow.u.at(4, 1).is_nan());
    }

    #[test]
    fn the_wider_window_answers_between_its_pixels_but_not_beside_its_holes() {
        let mut wide = FlowPlanes::filled(4, 4, 0.01);
        wide.u = Grid::from_fn(4, 4, |x, _| if x == 3 { f32::NAN } else { x as f32 });
        wide.v = Grid::from_fn(4, 4, |x, _| if x == 3 { f32::NAN } else { -1.0 });
        let PixelFlow { u, v, uu, .. } = wide.at_full_resolution(1, (1, 2)).unwrap();
        assert!((u, v) == (1.0, -2.0) && (uu - 0.04).abs() < 1e-6);
        assert_eq!(wide.at_full_resolution(1, (4, 2)).map(|flow| flow.u), Some(4.0));
        assert!([5, 6, 7].iter().all(|&x| wide.at_full_resolution(1, (x, 2)).is_none()));
    }
}
