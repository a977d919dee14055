//! Observations from dense fields: disparity of two frames and the flow between them.

use nalgebra::{Matrix2, Matrix3, Matrix4, Vector2, Vector3, Vector4};
use rayon::prelude::*;

use super::disparity::{DisparityMap, GUESS_SIGMA_PX};
use super::flow::FlowField;
use super::observation::{DepthFlow, DepthTrack, StereoFlow, StereoTrack};
use crate::geometry::{Gaussian, RigidMotion, StereoRig};

/// Standard deviation of a place that nothing but the motion tells, in pixels: a larger one lets the surface slide
/// further under a point.
const SLIDING_SIGMA_PX: f64 = 3.0;
/// Noise beside which a disparity may be that of the surface, in standard deviations.
const SURFACE_NOISE_SIGMAS: f64 = 3.0;
/// Slope of disparity, in pixels per pixel, from which on the stencil of a gradient straddles a depth edge.
const EDGE_SLOPE: f64 = 1.0;

/// What a gradient of disparity is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GradientStencil {
    /// The two neighbours, as the paper has it: σ² of each coordinate is ½ σ²_d, as though their noise were independent.
    CentralDifference,
    /// A plane through 9 × 9 pixels: little noise, and that of the window.
    Plane,
}

/// The dense fields of one pair of frames.
#[derive(Debug, Clone, Copy)]
pub struct DensePair<'a> {
    /// The rig.
    pub rig: &'a StereoRig,
    /// Disparity at t.
    pub before: &'a DisparityMap,
    /// Disparity at t′.
    pub after: &'a DisparityMap,
    /// Flow of the left camera from t to t′.
    pub flow: &'a FlowField,
    /// Flow of the right camera from t to t′; only the differential binocular flow needs it.
    pub flow_right: Option<&'a FlowField>,
    /// Whether disparity was handed in by somebody else, as by a depth camera, and not matched: its errors are then no
    /// part of those of places in the images.
    pub external_disparity: bool,
}

impl DensePair<'_> {
    /// An observation of every `step`-th pixel in both directions, in row-major order.
    pub fn every<T: Send>(
        &self,
        step: usize,
        observe: impl Fn(&Self, usize, usize) -> Option<T> + Sync,
    ) -> Vec<T> {
        let (width, height) = self.flow.size();
        let step = step.max(1);
        let rows: Vec<usize> = (step / 2..height).step_by(step).collect();
        let found: Vec<Vec<T>> = rows
            .into_par_iter()
            .map(|v| {
                let mut row = Vec::with_capacity(width.div_ceil(step));
                row.extend((step / 2..width).step_by(step).filter_map(|u| observe(self, u, v)));
                row
            })
            .collect();
        let mut all = Vec::with_capacity(found.iter().map(Vec::len).sum());
        found.into_iter().for_each(|row| all.extend(row));
        all
    }

    /// d at t with its variance where it is measured.
    #[inline(always)]
    pub(crate) fn disparity(&self, u: usize, v: usize) -> Option<(f64, f64)> {
        let d = self.rig.disparity_from_shift(f64::from(self.before.shift.get(u, v)?));
        let sigma = f64::from(self.before.sigma.get(u, v).filter(|&sigma| sigma < GUESS_SIGMA_PX)?);
        (d > 0.0).then_some((d, sigma * sigma))
    }

    /// (x, y, d) at t with its covariance: the pixel is exact, disparity is measured.
    pub(super) fn before(&self, u: usize, v: usize) -> Option<Gaussian<3>> {
        let (mut d, mut variance) = self.disparity(u, v)?;
        let (x, y) = self.rig.image_from_pixel(u as f64, v as f64);
        if self.external_disparity {
            let (surface, _) = surface_at(self.rig, self.before, x, y)?;
            (d, variance) = (surface.value(), surface.variance());
        }
        Some(Gaussian::independent([x, y, d], [0.0, 0.0, variance]))
    }

    /// The flow at a pixel in image coordinates.
    #[inline(always)]
    pub(crate) fn displacement(&self, u: usize, v: usize) -> Option<Gaussian<2>> {
        let Gaussian { mean, cov } = self.flow.get(u, v)?;
        let aspect = self.rig.aspect();
        let cross = aspect * cov.m12;
        Some(Gaussian {
            mean: Vector2::new(mean.x, aspect * mean.y),
            cov: Matrix2::new(cov.m11, cross, cross, aspect * aspect * cov.m22),
        })
    }

    /// The tracked point of a pixel: (x, y, d) before, and where flow and the later map put it after.
    ///
    /// Each image localises the point with noise of its own: half of flow's covariance is that of the
    /// earlier image, half that of the later one, and the left image's share is in x and in d alike.
    pub fn stereo_track(&self, u: usize, v: usize) -> Option<StereoTrack> {
        let mut before = self.before(u, v)?;
        let moved = self.displacement(u, v)?;
        let (x, y) = (before.mean.x + moved.mean.x, before.mean.y + moved.mean.y);
        if self.external_disparity {
            let (later, cross) = self.later(x, y, &moved.cov)?;
            let mean = Vector3::new(x, y, later.value());
            return Some(StereoTrack {
                before,
                after: Gaussian { mean, cov: joint(&moved.cov, cross, later.variance()) },
            });
        }
        let half = 0.5 * moved.cov;
        let own = Vector2::new(shared_variance(&half, before.cov[(2, 2)]), 0.0);
        before.cov = joint(&half, own, before.cov[(2, 2)]);
        let (later, cross) = self.later(x, y, &half)?;
        let after =
            Gaussian { mean: Vector3::new(x, y, later.value()), cov: joint(&half, cross, later.variance()) };
        Some(StereoTrack { before, after })
    }

    /// d and d′ of a pixel, as [`DensePair::stereo_track`] has them.
    #[inline(always)]
    pub fn disparities(&self, u: usize, v: usize) -> Option<Gaussian<2>> {
        let (d, variance) = self.disparity(u, v)?;
        let moved = self.displacement(u, v)?;
        let (x, y) = self.rig.image_from_pixel(u as f64, v as f64);
        let place = if self.external_disparity { moved.cov } else { 0.5 * moved.cov };
        let (later, _) = self.later(x + moved.mean.x, y + moved.mean.y, &place)?;
        Some(Gaussian::independent([d, later.value()], [variance, later.variance()]))
    }

    /// d′ at (x, y), a place known with the covariance `place`, and its covariance with that place.
    ///
    /// d′ is read where flow says, so an error of flow moves it along the map's slope.
    #[inline(always)]
    fn later(&self, x: f64, y: f64, place: &Matrix2<f64>) -> Option<(Gaussian<1>, Vector2<f64>)> {
        let (later, gradient) = match self.external_disparity {
            true => surface_at(self.rig, self.after, x, y)?,
            false => disparity_at(self.rig, self.after, x, y)?,
        };
        let shared = if self.external_disparity { 0.0 } else { shared_variance(place, later.variance()) };
        let own = Vector2::new(shared, 0.0);
        let slope = place * gradient;
        let variance = later.variance() + gradient.dot(&slope) + 2.0 * own.dot(&gradient);
        Some((Gaussian::scalar(later.value(), variance), own + slope))
    }

    /// The point of pixel (u, v) before, and the surface that the later map has where `motion` leads it.
    ///
    /// Where depth is measured at both times and flow is not, shape alone tells of motion. The point may lie anywhere
    /// near where `motion` leads it as far as the images tell, so its place is all but unknown, and disparity changes
    /// with the place along the map's slope. What is left to know is the motion across the surface, which is the depth
    /// change constraint (11), n · V(P) = c with n the surface's normal, linearised at the motion instead of at rest.
    /// A disparity further than `reach_px` from the predicted one is of another surface.
    pub(crate) fn shape_track(
        &self,
        u: usize,
        v: usize,
        motion: &RigidMotion,
        reach_px: f64,
    ) -> Option<StereoTrack> {
        let before = self.before(u, v)?;
        let variance = before.cov.m33;
        let led = self.rig.project(&motion.apply(&self.rig.point(&before.mean)?))?;
        let (later_u, later_v) = self.rig.pixel_from_image(led.x, led.y);
        let reading = self.after.read(later_u, later_v)?;
        let found = self.rig.disparity_from_shift(reading.shift);
        let surprise = (found - led.z).abs();
        if found <= 0.0 || surprise > reach_px + SURFACE_NOISE_SIGMAS * (variance + reading.variance).sqrt() {
            return None;
        }
        let slope = Vector2::new(reading.slope.0, reading.slope.1 / self.rig.aspect());
        let place = Matrix2::identity() * (SLIDING_SIGMA_PX * SLIDING_SIGMA_PX);
        let cross = place * slope;
        let own = reading.variance + slope.dot(&cross);
        let cov = Matrix3::new(
            place.m11, 0.0, cross.x, //
            0.0, place.m22, cross.y, //
            cross.x, cross.y, own,
        );
        let after = Gaussian { mean: Vector3::new(led.x, led.y, found), cov };
        Some(StereoTrack { before, after })
    }

    /// Discrete DCCE: disparity at the pixel at t and t′, its gradient at t′, and the displacement.
    pub fn depth_track(&self, u: usize, v: usize, stencil: GradientStencil) -> Option<DepthTrack> {
        let before = self.before(u, v)?;
        let [x, y, d] = before.mean.into();
        let (after, central) = disparity_at(self.rig, self.after, x, y)?;
        let gradient = self.gradient(self.after, stencil, (x, y), (central, after.variance()))?;
        let mut cov = Matrix4::from_diagonal(&Vector4::new(before.cov[(2, 2)], after.variance(), 0.0, 0.0));
        cov.fixed_view_mut::<2, 2>(2, 2).copy_from(&gradient.cov);
        let mean = Vector4::new(d, after.value(), gradient.mean.x, gradient.mean.y);
        Some(DepthTrack {
            x_px: x,
            y_px: y,
            disparity: Gaussian { mean, cov },
            displacement: self.displacement(u, v)?,
        })
    }

    /// Differential DCCE at the middle of the interval, half-way along the flow of the pixel.
    ///
    /// There the differences of one interval are central ones, so that the error of taking them for
    /// derivatives is of third order in the motion.
    pub fn depth_flow(&self, u: usize, v: usize, stencil: GradientStencil) -> Option<DepthFlow> {
        // A pixel without disparity of its own (masked, hidden) is none, whatever lies half-way.
        self.before.shift.get(u, v)?;
        let flow = self.displacement(u, v)?;
        let (x, y) = self.rig.image_from_pixel(u as f64, v as f64);
        let (x, y) = (x + 0.5 * flow.mean.x, y + 0.5 * flow.mean.y);
        let (a, central_a) = disparity_at(self.rig, self.before, x, y)?;
        let (b, central_b) = disparity_at(self.rig, self.after, x, y)?;
        let slope_a = self.gradient(self.before, stencil, (x, y), (central_a, a.variance()))?;
        let slope_b = self.gradient(self.after, stencil, (x, y), (central_b, b.variance()))?;
        let slope = 0.5 * (slope_a.mean + slope_b.mean);
        let (sum, difference) = (a.variance() + b.variance(), b.variance() - a.variance());
        let mut cov = Matrix4::from_diagonal(&Vector4::new(0.25 * sum, 0.0, 0.0, sum));
        cov.fixed_view_mut::<2, 2>(1, 1).copy_from(&(0.25 * (slope_a.cov + slope_b.cov)));
        cov[(0, 3)] = 0.5 * difference;
        cov[(3, 0)] = 0.5 * difference;
        let mean = Vector4::new(0.5 * (a.value() + b.value()), slope.x, slope.y, b.value() - a.value());
        Some(DepthFlow { x_px: x, y_px: y, disparity: Gaussian { mean, cov }, flow })
    }

    /// The gradient of a map's disparity at image coordinates, of which the `central` one is given with the variance of
    /// disparity.
    fn gradient(
        &self,
        map: &DisparityMap,
        stencil: GradientStencil,
        (x, y): (f64, f64),
        (central, variance): (Vector2<f64>, f64),
    ) -> Option<Gaussian<2>> {
        // Vertical ones are per image coordinate.
        let aspect = self.rig.aspect();
        match stencil {
            GradientStencil::CentralDifference => {
                let variances = Vector2::new(0.5 * variance, 0.5 * variance / (aspect * aspect));
                Some(Gaussian { mean: central, cov: Matrix2::from_diagonal(&variances) })
            }
            GradientStencil::Plane => {
                let (u, v) = self.rig.pixel_from_image(x, y);
                let scale = Matrix2::from_diagonal(&Vector2::new(1.0, aspect.recip()));
                let slope = map.slope(u, v)?;
                Some(slope.propagate(scale * slope.mean, &scale))
            }
        }
    }

    /// Differential DV at the middle of the interval, from the flows of both cameras; without the right one's,
    /// from the change of disparity.
    pub fn stereo_flow(&self, u: usize, v: usize) -> Option<StereoFlow> {
        let Some(right) = self.flow_right else { return Some(self.stereo_track(u, v)?.midpoint_flow()) };
        let before = self.before(u, v)?;
        let left = self.displacement(u, v)?;
        let at = u as f64 - self.rig.shift_from_disparity(before.mean.z);
        let right_x = right.u.sample(at, v as f64)?;
        let right_var = f64::from(right.cov_uu.at((at.round() as usize).min(right.size().0 - 1), v));
        let rate = left.mean.x - right_x;
        let (x, y) = (before.mean.x + 0.5 * left.mean.x, before.mean.y + 0.5 * left.mean.y);
        let d = before.mean.z + 0.5 * rate;
        let (l, r) = (&left.cov, right_var);
        let (dx, dy) = (0.5 * l[(0, 0)], 0.5 * l[(0, 1)]);
        let cov = Matrix4::new(
            before.cov[(2, 2)] + 0.25 * (l[(0, 0)] + r),
            dx,
            dy,
            -0.5 * r, //
            dx,
            l[(0, 0)],
            l[(0, 1)],
            0.0, //
            dy,
            l[(0, 1)],
            l[(1, 1)],
            0.0, //
            -0.5 * r,
            0.0,
            0.0,
            r,
        );
        let mean = Vector4::new(d, left.mean.x, left.mean.y, right_x);
        (d > 0.0).then_some(StereoFlow { x_px: x, y_px: y, measured: Gaussian { mean, cov } })
    }
}

/// The covariance of x and d in one image: half of the lesser of d's variance and the window's along its row.
///
/// Along its row a window is located by 1/G_xx, which is less than (G⁻¹)_xx; see [`super::tracks`].
#[inline(always)]
fn shared_variance(place: &Matrix2<f64>, d_variance: f64) -> f64 {
    0.5 * d_variance.min(place.determinant() / place[(1, 1)]).max(0.0)
}

/// The covariance of (x, y, d) from that of (x, y), its covariance with d, and the variance of d.
fn joint(place: &Matrix2<f64>, cross: Vector2<f64>, variance: f64) -> Matrix3<f64> {
    Matrix3::new(
        place[(0, 0)],
        place[(0, 1)],
        cross.x, //
        place[(0, 1)],
        place[(1, 1)],
        cross.y, //
        cross.x,
        cross.y,
        variance,
    )
}

/// Disparity measured at image coordinates (x, y) with its variance, and its gradient there by central
/// differences.
#[inline(always)]
fn disparity_at(rig: &StereoRig, map: &DisparityMap, x: f64, y: f64) -> Option<(Gaussian<1>, Vector2<f64>)> {
    let (u, v) = rig.pixel_from_image(x, y);
    let (shift, (du, dv)) = map.shift.sample_with_gradient(u, v)?;
    let d = rig.disparity_from_shift(shift);
    let sigma = map.sigma.sample(u, v)?;
    let gradient = Vector2::new(du, dv / rig.aspect());
    let on_surface = gradient.amax() < EDGE_SLOPE;
    let measured = sigma < f64::from(GUESS_SIGMA_PX);
    (d > 0.0 && on_surface && measured).then(|| (Gaussian::scalar(d, sigma * sigma), gradient))
}

/// The same of an external map, by the surface around: such a map need not be smooth.
fn surface_at(rig: &StereoRig, map: &DisparityMap, x: f64, y: f64) -> Option<(Gaussian<1>, Vector2<f64>)> {
    let (u, v) = rig.pixel_from_image(x, y);
    let reading = map.read(u, v)?;
    let d = rig.disparity_from_shift(reading.shift);
    let measured = reading.variance < f64::from(GUESS_SIGMA_PX).powi(2);
    let gradient = Vector2::new(reading.slope.0, reading.slope.1 / rig.aspect());
    (d > 0.0 && measured).then(|| (Gaussian::scalar(d, reading.variance), gradient))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Field, Grid};

    #[test]
    fn covariances_of_a_track_are_positive_where_flow_knows_one_direction_only() {
        let (width, height) = (12, 10);
        let plane = |f: fn(usize, usize) -> f32| Field::from_grid(Grid::from_fn(width, height, f));
        let slanted = DisparityMap {
            shift: plane(|u, v| 20.0 + 0.3 * u as f32 - 0.5 * v as f32),
            sigma: plane(|_, _| 0.2),
        };
        let mut flow = FlowField::prediction(plane(|_, _| 0.4), plane(|_, _| -0.3));
        // An edge: along it nothing is known, across it much.
        flow.cov_uu = Grid::filled(width, height, 0.25);
        flow.cov_uv = Grid::filled(width, height, 0.2499);
        flow.cov_vv = Grid::filled(width, height, 0.25);
        let rig = StereoRig::new(300.0, (5.5, 4.5), 0.1, (width, height)).unwrap();
        let pair = DensePair {
            rig: &rig,
            before: &slanted,
            after: &slanted,
            flow: &flow,
            flow_right: None,
            external_disparity: false,
        };
        let tracks = pair.every(1, DensePair::stereo_track);
        assert!(tracks.len() > 40);
        for track in tracks {
            for end in [track.before, track.after] {
                assert!(end.cov.cholesky().is_some(), "{}", end.cov);
            }
        }
    }
}
