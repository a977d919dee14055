//! One row of pixels from disparities to VZ and time to impact, by kernels that run on many pixels at once.
//!
//! The formulas are those of [`crate::motion`]; here they meet planes of numbers, in which what is
//! missing is NaN and goes through as NaN.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::groups::Groups;
use crate::geometry::{Gaussian, StereoRig};
use crate::motion::depth_velocity::{self, contradict};
use crate::motion::{DepthVelocity, RigidPrediction, TimeToImpact, Vehicle};
use crate::observe::{DensePair, GradientStencil};
use crate::pipeline::plan::{Interval, PixelVelocity};
use crate::simd::vectorised;

/// What the rows of a pair of frames share.
#[derive(Debug, Clone, Copy)]
pub(super) struct PairToMap<'a> {
    pub(super) pair: &'a DensePair<'a>,
    pub(super) rigid: Option<&'a RigidPrediction<'a>>,
    pub(super) groups: Option<&'a Groups<'a>>,
    pub(super) interval: &'a Interval<'a>,
}

/// The rays of a row's pixels.
#[derive(Debug, Clone, Copy)]
struct Rays<'a> {
    rig: &'a StereoRig,
    /// Image coordinates of the row's first pixel.
    start: (f64, f64),
}

impl Rays<'_> {
    /// (x, y, f) of pixel `u`.
    #[inline(always)]
    fn at(&self, u: usize) -> Vector3<f64> {
        Vector3::new(self.start.0 + u as f64, self.start.1, self.rig.focal_px)
    }
}

/// What is known of the pixels of a row, one plane a quantity.
#[derive(Debug, Clone)]
pub(super) struct MapRow {
    /// d, its σ², d′, its σ², their covariance.
    disparities: [Vec<f64>; 5],
    /// σ of d where it may be a guess: what the rigid prediction goes by.
    sigma: Vec<f64>,
    /// Z, VZ, their variances and their covariance.
    velocity: [Vec<f64>; 5],
    /// Looming, its variance.
    looming: [Vec<f64>; 2],
    /// Whether the pixel will pass through the vehicle's window.
    crosses: Vec<bool>,
}

/// The values of a row that leave it: VZ, its σ, looming, and its σ.
pub(super) type Output<'a> = [&'a mut [f32]; 4];

impl MapRow {
    /// A row of so many pixels.
    pub(super) fn new(width: usize) -> Self {
        let plane = || vec![f64::NAN; width];
        Self {
            disparities: std::array::from_fn(|_| plane()),
            sigma: plane(),
            velocity: std::array::from_fn(|_| plane()),
            looming: std::array::from_fn(|_| plane()),
            crosses: vec![false; width],
        }
    }

    /// Row `v` of a pair of frames.
    pub(super) fn fill(&mut self, all: &PairToMap<'_>, v: usize, out: Output<'_>) {
        let &PairToMap { pair, rigid, groups, interval } = all;
        let (by, dt_s) = (interval.plan.pixel_velocity, interval.dt_s);
        let rays = Rays { rig: pair.rig, start: pair.rig.image_from_pixel(0.0, v as f64) };
        match rigid.filter(|_| by == PixelVelocity::RigidScene) {
            None => {
                for u in 0..self.width() {
                    self.set_velocity(u, measured_velocity(pair, by, u, v));
                }
            }
            Some(rigid) => {
                for u in 0..self.width() {
                    self.observe(pair, groups, u, v);
                }
                unless_moving(rigid, rays, &self.disparities, &self.sigma, &mut self.velocity);
                if let Some(groups) = groups {
                    self.follow_bodies(groups, rays, v);
                }
            }
        }
        loomings(&self.velocity, dt_s, &mut self.looming, out);
        match rigid {
            Some(rigid) => {
                let when = (&interval.config.vehicle, dt_s);
                crossings(rigid, rays, when, &self.velocity[0], &self.looming[0], &mut self.crosses);
                if let Some(groups) = groups {
                    self.bodies_cross(groups, rays, when, v);
                }
            }
            None => self.crosses.fill(false),
        }
    }

    /// The disparities of one pixel.
    #[inline(always)]
    fn observe(&mut self, pair: &DensePair<'_>, groups: Option<&Groups<'_>>, u: usize, v: usize) {
        self.disparities[0][u] = pair.rig.disparity_from_shift(f64::from(pair.before.shift.row(v)[u]));
        self.sigma[u] = f64::from(pair.before.sigma.row(v)[u]);
        match groups.and_then(|groups| groups.moving.disparities(pair, u, v)) {
            // Then the rigid motion says nothing.
            Some(own) => {
                self.sigma[u] = f64::NAN;
                self.set_disparities(u, own);
            }
            None => self.set_disparities(u, pair.disparities(u, v)),
        }
    }

    /// The pixels of bodies that move by themselves move as their bodies do.
    fn follow_bodies(&mut self, groups: &Groups<'_>, rays: Rays<'_>, v: usize) {
        let bf = rays.rig.depth_disparity_product();
        for u in 0..self.width() {
            let Some(body) = groups.body(u, v) else { continue };
            let [d, variance, later, later_variance, shared] =
                self.disparities.each_ref().map(|plane| plane[u]);
            let xyd = Vector3::new(rays.at(u).x, rays.at(u).y, d);
            if later.is_nan() {
                // Disparity is a guess: the body's motion must do, as the scene's does elsewhere.
                let own = body.rigid.as_ref().and_then(|rigid| rigid.depth_velocity(&xyd, self.sigma[u]));
                if own.is_some_and(|own| !own.z_vz.cov.m22.is_nan()) {
                    self.set_velocity(u, own);
                }
                continue;
            }
            let cov = Matrix2::new(variance, shared, shared, later_variance);
            let measured =
                DepthVelocity::from_disparities(&Gaussian { mean: Vector2::new(d, later), cov }, bf);
            if let Some(own) = body.depth_velocity(&measured, &xyd, variance) {
                self.set_velocity(u, Some(own));
            } else if groups.moving.is_moving(u, v) {
                self.set_velocity(u, Some(body.scaled(&measured)));
            }
        }
    }

    /// Whether pixels that move by themselves cross the window: as their bodies move, and never where they make none.
    fn bodies_cross(&mut self, groups: &Groups<'_>, rays: Rays<'_>, when: (&Vehicle, f64), v: usize) {
        for u in 0..self.width() {
            let Some(body) = groups.body(u, v) else {
                self.crosses[u] &= !groups.moving.is_moving(u, v);
                continue;
            };
            if let Some(rigid) = &body.rigid {
                let own = (&self.velocity[0][u..=u], &self.looming[0][u..=u]);
                let ray = Rays { start: (rays.at(u).x, rays.start.1), ..rays };
                crossings(rigid, ray, when, own.0, own.1, &mut self.crosses[u..=u]);
            }
        }
    }

    fn set_disparities(&mut self, u: usize, disparities: Option<Gaussian<2>>) {
        let Some(Gaussian { mean, cov }) = disparities else {
            self.disparities[2][u] = f64::NAN;
            return;
        };
        let values = [mean.x, cov.m11, mean.y, cov.m22, cov.m12];
        for (plane, value) in self.disparities.iter_mut().zip(values) {
            plane[u] = value;
        }
    }

    fn set_velocity(&mut self, u: usize, velocity: Option<DepthVelocity>) {
        let values = velocity.map_or([f64::NAN; 5], |velocity| parts(&velocity));
        for (plane, value) in self.velocity.iter_mut().zip(values) {
            plane[u] = value;
        }
    }

    /// Number of pixels.
    pub(super) fn width(&self) -> usize {
        self.sigma.len()
    }

    /// Of pixel `u`, if it has an answer: its time to impact, and whether it will cross the window.
    pub(super) fn seen(&self, u: usize) -> Option<(TimeToImpact, bool)> {
        let [looming, variance] = &self.looming;
        let impact = TimeToImpact { looming: Gaussian::scalar(looming[u], variance[u]) };
        (!looming[u].is_nan()).then(|| (impact, self.crosses[u]))
    }
}

/// VZ of a pixel as it is measured there. Without a motion of the scene the change of disparity answers.
fn measured_velocity(pair: &DensePair<'_>, by: PixelVelocity, u: usize, v: usize) -> Option<DepthVelocity> {
    let bf = pair.rig.depth_disparity_product();
    match by {
        PixelVelocity::DepthTrack => Some(depth_velocity::dcce(
            &pair.depth_track(u, v, GradientStencil::CentralDifference)?.depth_change(bf),
        )),
        PixelVelocity::DepthFlow => Some(
            depth_velocity::dcce(
                &pair.depth_flow(u, v, GradientStencil::CentralDifference)?.depth_change(bf),
            )
            .at_interval_start(),
        ),
        PixelVelocity::StereoFlow => {
            Some(depth_velocity::dv(&pair.stereo_flow(u, v)?, bf).at_interval_start())
        }
        PixelVelocity::Disparities | PixelVelocity::RigidScene => {
            Some(DepthVelocity::from_disparities(&pair.disparities(u, v)?, bf))
        }
    }
}

/// The planes' values of one pixel, as in [`MapRow`].
#[inline(always)]
fn parts(velocity: &DepthVelocity) -> [f64; 5] {
    let Gaussian { mean, cov } = &velocity.z_vz;
    [mean.x, mean.y, cov.m11, cov.m22, cov.m12]
}

#[inline(always)]
fn whole([z, vz, z_variance, vz_variance, covariance]: [f64; 5]) -> DepthVelocity {
    let cov = Matrix2::new(z_variance, covariance, covariance, vz_variance);
    DepthVelocity { z_vz: Gaussian { mean: Vector2::new(z, vz), cov } }
}

vectorised! {
/// The rigid prediction except where the measured change contradicts it.
unless_moving(
    rigid: &RigidPrediction<'_>,
    rays: Rays<'_>,
    disparities: &[Vec<f64>; 5],
    sigma: &[f64],
    out: &mut [Vec<f64>; 5],
) {
    let n = sigma.len();
    let (baseline, bf) = (rays.rig.baseline_m, rays.rig.depth_disparity_product());
    let [d, variance, later, later_variance, shared] = disparities.each_ref().map(|plane| &plane[..n]);
    let [z, vz, z_variance, vz_variance, covariance] = out.each_mut().map(|plane| &mut plane[..n]);
    for u in 0..n {
        let point = rays.at(u) * (baseline / d[u]);
        let still = rigid.depth_velocity_of(&point, d[u], sigma[u]);
        let both = Gaussian { mean: Vector2::new(d[u], later[u]), cov: Matrix2::new(variance[u], shared[u], shared[u], later_variance[u]) };
        let measured = DepthVelocity::from_disparities(&both, bf);
        let (m, r) = (parts(&measured), parts(&still));
        let predicted = (r[0] + r[1] > 0.0) & !r[3].is_nan();
        let take = contradict(&measured, &still) | !predicted;
        let known = (d[u] > 0.0) & !(if take { m[1] } else { r[1] }).is_nan();
        let pick = |k: usize| {
            let value = if take { m[k] } else { r[k] };
            if known { value } else { f64::NAN }
        };
        (z[u], vz[u], z_variance[u], vz_variance[u], covariance[u]) =
            (pick(0), pick(1), pick(2), pick(3), pick(4));
    }
}
}

vectorised! {
/// VZ and looming with their σ.
loomings(velocity: &[Vec<f64>; 5], dt_s: f64, looming: &mut [Vec<f64>; 2], out: Output<'_>) {
    let [a, b, c, d, e] = velocity.each_ref().map(Vec::as_slice);
    let n = a.len();
    let (a, b, c, d, e) = (&a[..n], &b[..n], &c[..n], &d[..n], &e[..n]);
    let [rate, rate_variance] = looming.each_mut().map(|plane| &mut plane[..n]);
    let [vz, sigma, out_rate, out_sigma] = out;
    let (vz, sigma) = (&mut vz[..n], &mut sigma[..n]);
    let (out_rate, out_sigma) = (&mut out_rate[..n], &mut out_sigma[..n]);
    for u in 0..n {
        let looming = whole([a[u], b[u], c[u], d[u], e[u]]).looming_in_front(dt_s);
        let ahead = a[u] + b[u] > 0.0;
        vz[u] = b[u] as f32;
        sigma[u] = d[u].sqrt() as f32;
        rate[u] = if ahead { looming.value() } else { f64::NAN };
        rate_variance[u] = looming.variance();
        out_rate[u] = rate[u] as f32;
        out_sigma[u] = looming.variance().sqrt() as f32;
    }
}
}

vectorised! {
/// Which points will pass through the vehicle's window.
crossings(
    rigid: &RigidPrediction<'_>,
    rays: Rays<'_>,
    when: (&Vehicle, f64),
    z: &[f64],
    looming: &[f64],
    out: &mut [bool],
) {
    let n = z.len();
    let ((window, dt_s), looming, out) = (when, &looming[..n], &mut out[..n]);
    let (motion, per_focal, per_s) = (*rigid.motion(), rays.rig.focal_px.recip(), dt_s.recip());
    for u in 0..n {
        let before = rays.at(u) * (z[u] * per_focal);
        let later = motion.apply(&before);
        let velocity = (later - before) * per_s;
        out[u] = (looming[u] > 0.0) & window.is_crossed_by(&later, &velocity, looming[u].recip());
    }
}
}
