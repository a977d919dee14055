//! One draw: measurements of the synthetic world, exact values plus noise, then rounded.

use rand::SeedableRng;
use rand::seq::index::sample;
use rand_pcg::Pcg64Mcg;

use super::measurement::{MeasurementModel, UnitNormals};
use super::world::{FrameTime, SyntheticWorld, UsablePixel};
use egomotion::geometry::Gaussian;
use egomotion::observe::{DepthFlow, DepthTrack, StereoFlow, StereoTrack};
use egomotion::pipeline::Approach;

/// Least standard deviation that a measurement is stated with, in pixels.
///
/// An exact measurement would have an infinite weight. A value far below every noise of the sweeps keeps weights
/// finite and changes no answer that has noise.
const LEAST_SIGMA_PX: f64 = 1e-4;

/// One draw: pixels of the world, and the measurements at each.
#[derive(Debug, Clone, PartialEq)]
pub struct Draw<'a, Change, Motion> {
    /// The truth of each pixel.
    pub pixels: Vec<&'a UsablePixel>,
    /// Measurements for the depth change constraint.
    pub changes: Vec<Change>,
    /// Measurements for binocular flow.
    pub motions: Vec<Motion>,
    /// All measurements, for maximum likelihood.
    pub complete: Vec<Motion>,
}

impl<'a, Change, Motion> Draw<'a, Change, Motion> {
    /// A draw at these pixels that holds no measurement yet.
    pub(crate) fn at(pixels: Vec<&'a UsablePixel>) -> Self {
        Self { pixels, changes: Vec::new(), motions: Vec::new(), complete: Vec::new() }
    }
}

/// Every usable pixel with its velocities.
pub type DifferentialDraw<'a> = Draw<'a, DepthFlow, StereoFlow>;
/// Random features with their displacements.
pub type DiscreteDraw<'a> = Draw<'a, DepthTrack, StereoTrack>;

/// The variance that a measurement is stated with, in pixels²: never zero.
fn stated(variance: f64) -> f64 {
    variance.max(LEAST_SIGMA_PX * LEAST_SIGMA_PX)
}

/// Half the difference of the neighbours along x and along y, central differences of 1 px.
fn gradient(disparity: &[f64], index: usize, width: usize) -> [f64; 2] {
    let half = |a: usize, b: usize| 0.5 * (disparity[a] - disparity[b]);
    [half(index + 1, index - 1), half(index + width, index - width)]
}

impl<'a> DifferentialDraw<'a> {
    /// Dense measurements of the differential form, with the noise of `seed`.
    ///
    /// Each pixel of the three disparity maps has noise of its own; d_t is half the difference of t + 1 and t − 1.
    /// The right camera's flow is that of the same point; its v_y, which is the left one's, is a second measurement
    /// that the paper's methods do not use.
    pub fn new(world: &'a SyntheticWorld, model: &MeasurementModel, seed: u64) -> Self {
        let mut normals = UnitNormals::of_seed(seed);
        let maps = [FrameTime::Before, FrameTime::Now, FrameTime::After]
            .map(|when| model.disparities(world.disparity(when), &mut normals));
        let (var_d, var_v) = (stated(model.disparity_variance()), stated(model.std_vel_px.powi(2)));
        let pixels: Vec<&UsablePixel> = world.usable_in(Approach::Differential).collect();
        let mut draw = Self::at(pixels);
        for p in &draw.pixels {
            let [dx, dy] = gradient(&maps[1], p.index, world.rig.width_px);
            let (d, dt) = (maps[1][p.index], 0.5 * (maps[2][p.index] - maps[0][p.index]));
            let mut velocity = |exact: f64| exact + model.std_vel_px * normals.next();
            let [vx, vy, right_x] = [p.flow_left.x, p.flow_left.y, p.flow_right_x].map(&mut velocity);
            let right_y = velocity(p.flow_left.y);
            let (x_px, y_px) = (p.xyd.x, p.xyd.y);
            let half = 0.5 * var_d;
            draw.changes.push(DepthFlow {
                x_px,
                y_px,
                disparity: Gaussian::independent([d, dx, dy, dt], [var_d, half, half, half]),
                flow: Gaussian::independent([vx, vy], [var_v; 2]),
            });
            let flow = |vy: f64, var_vy: f64| StereoFlow {
                x_px,
                y_px,
                measured: Gaussian::independent([d, vx, vy, right_x], [var_d, var_v, var_vy, var_v]),
            };
            draw.motions.push(flow(vy, var_v));
            draw.complete.push(flow(0.5 * (vy + right_y), 0.5 * var_v));
        }
        draw
    }

    /// The exact flows of the same pixels with the same covariances: where the bound is taken.
    pub(crate) fn exact(&self) -> Vec<StereoFlow> {
        let truth = |(p, flow): (&&UsablePixel, &StereoFlow)| {
            let mean = [p.xyd.z, p.flow_left.x, p.flow_left.y, p.flow_right_x].into();
            StereoFlow { measured: Gaussian { mean, cov: flow.measured.cov }, ..*flow }
        };
        self.pixels.iter().zip(&self.complete).map(truth).collect()
    }
}

impl<'a> DiscreteDraw<'a> {
    /// Random features of the discrete form, without replacement, with the noise of `seed`.
    ///
    /// A feature is an integer pixel at t, so that (x, y) is exact there; STD_TRACK is added to the later end; its
    /// d′ is its own disparity at t′.
    pub fn new(world: &'a SyntheticWorld, model: &MeasurementModel, seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let all: Vec<&UsablePixel> = world.usable_in(Approach::Discrete).collect();
        let chosen = sample(&mut rng, all.len(), model.features.min(all.len()));
        let pixels: Vec<&UsablePixel> = chosen.iter().map(|i| all[i]).collect();
        let mut normals = UnitNormals::from_generator(rng);
        let maps = [FrameTime::Now, FrameTime::After]
            .map(|when| model.disparities(world.disparity(when), &mut normals));
        let mut draw = Self::at(pixels);
        for p in &draw.pixels {
            let later = [
                p.later_xyd.x + model.std_track_px * normals.next(),
                p.later_xyd.y + model.std_track_px * normals.next(),
                model.disparity(p.later_xyd.z, &mut normals),
            ];
            let [dx, dy] = gradient(&maps[1], p.index, world.rig.width_px);
            let (d, after) = (maps[0][p.index], maps[1][p.index]);
            let track = track(p, d, later, model);
            let var_d = track.after.cov[(2, 2)];
            draw.changes.push(DepthTrack {
                x_px: p.xyd.x,
                y_px: p.xyd.y,
                disparity: Gaussian::independent(
                    [d, after, dx, dy],
                    [var_d, var_d, 0.5 * var_d, 0.5 * var_d],
                ),
                displacement: Gaussian {
                    mean: (track.after.mean - track.before.mean).xy(),
                    cov: track.after.cov.fixed_view::<2, 2>(0, 0).into(),
                },
            });
            draw.motions.push(track);
        }
        draw.complete.clone_from(&draw.motions);
        draw
    }

    /// The exact tracks of the same features with the same covariances: where the bound is taken.
    pub fn exact(&self, model: &MeasurementModel) -> Vec<StereoTrack> {
        self.pixels.iter().map(|p| track(p, p.xyd.z, p.later_xyd.into(), model)).collect()
    }
}

fn track(p: &UsablePixel, d: f64, later: [f64; 3], model: &MeasurementModel) -> StereoTrack {
    let (var_d, var_t) = (stated(model.disparity_variance()), stated(model.std_track_px.powi(2)));
    StereoTrack {
        before: Gaussian::independent([p.xyd.x, p.xyd.y, d], [0.0, 0.0, var_d]),
        after: Gaussian::independent(later, [var_t, var_t, var_d]),
    }
}
