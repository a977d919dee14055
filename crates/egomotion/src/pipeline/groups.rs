//! What moves by itself: connected cells that contradict the rigid scene, each group with a motion of its own.

use std::cmp::Reverse;

use nalgebra::Vector3;

use super::config::Config;
use super::moving::Moving;
use super::solve::Solver;
use crate::estimate::maximum_likelihood::{MaximumLikelihoodOptions, robust_start};
use crate::estimate::{MotionEstimate, median};
use crate::geometry::{Gaussian, PixelBounds, StereoRig, upper_median};
use crate::motion::TimeToImpact;
use crate::motion::depth_velocity::{DepthVelocity, RigidPrediction};
use crate::observe::{DensePair, StereoTrack};

/// Fewest cells of a group: single mismatches are none.
const LEAST_CELLS: usize = 12;
/// Least share of them whose patch was found again in all four images: wrong flow and hidden places are not.
const LEAST_CONFIRMED: f64 = 0.3;
/// Every so many pixels in both directions observe the group's motion.
const STEP: usize = 2;
/// Side of the blocks of pixels that count as independent: a group has few of the scene's larger ones.
const BLOCK_PX: f64 = 24.0;
/// Median of χ²₁.
const MEDIAN_CHI2: f64 = 0.454_94;

/// Something that moves by itself, between two frames.
#[derive(Debug, Clone, PartialEq)]
pub struct MovingGroup {
    /// Pixels of the earlier left image that it covers.
    pub pixels: usize,
    /// The least rectangle around them.
    pub bounds: PixelBounds,
    /// Their mean (u, v).
    pub centre_px: (f64, f64),
    /// Median depth Z at the earlier frame, in metres.
    pub depth_m: f64,
    /// Its motion relative to the left camera, φ over the interval as that of the scene; `None` where its pixels
    /// determine none.
    pub motion: Option<MotionEstimate>,
    /// VZ at its centre by its motion, in metres per interval; the median of what was measured where the motion is
    /// not known completely.
    pub depth_velocity: Gaussian<1>,
    /// Time to impact of its centre; `None` where it gets behind the camera.
    pub impact: Option<TimeToImpact>,
}

/// A group with what its pixels ask of it.
#[derive(Debug)]
pub(super) struct Body<'a> {
    group: MovingGroup,
    /// What its pixels do by its own motion, if that is known.
    pub(super) rigid: Option<RigidPrediction<'a>>,
    /// By how much its pixels scatter more than their variance says.
    scale2: f64,
}

/// The moving cells of a pair of frames, and the groups they make.
#[derive(Debug)]
pub struct Groups<'a> {
    pub(super) moving: Moving,
    /// The group of each cell.
    of_cell: Vec<Option<usize>>,
    bodies: Vec<Body<'a>>,
}

impl<'a> Groups<'a> {
    /// Group the moving cells, the largest group first; `predict` makes of a group's motion what its pixels do.
    pub(super) fn find(
        pair: &DensePair<'_>,
        moving: Moving,
        config: &Config,
        dt_s: f64,
        predict: impl Fn(&[StereoTrack], &MotionEstimate) -> Option<RigidPrediction<'a>>,
    ) -> Self {
        let surface = |cell| moving.disparity(cell);
        let joined = |a, b| surface(a).zip(surface(b)).is_some_and(|(a, b)| Moving::same_surface(a, b));
        let mut regions = moving.layout().regions(|cell| surface(cell).is_some(), joined);
        regions.retain(|region| is_believed(region, &moving));
        regions.sort_by_key(|region| Reverse(region.len()));
        let config = Config { block_px: BLOCK_PX, ..config.clone() };
        let (mut of_cell, mut bodies) = (vec![None; moving.layout().count()], Vec::new());
        for region in regions {
            let sampled = Sampled::of(pair, &moving, &region);
            let Some(body) = sampled.body(&moving, &region, pair.rig, &config, dt_s, &predict) else {
                continue;
            };
            region.iter().for_each(|&cell| of_cell[cell] = Some(bodies.len()));
            bodies.push(body);
        }
        Self { moving, of_cell, bodies }
    }

    /// The body that a pixel of a moving cell belongs to, if any.
    #[inline(always)]
    pub(super) fn body(&self, u: usize, v: usize) -> Option<&Body<'a>> {
        self.bodies.get(self.of_cell[self.moving.index(u, v)]?)
    }

    /// The groups.
    pub(super) fn into_groups(self) -> Vec<MovingGroup> {
        self.bodies.into_iter().map(|body| body.group).collect()
    }
}

/// Whether a region is large enough, and more than a patch of wrong flow.
fn is_believed(region: &[usize], moving: &Moving) -> bool {
    let confirmed = region.iter().filter(|&&cell| moving.is_confirmed(cell)).count();
    region.len() >= LEAST_CELLS && confirmed as f64 >= LEAST_CONFIRMED * region.len() as f64
}

impl Body<'_> {
    /// Z and VZ of one of its pixels from what was measured there, of disparity (x, y, d) with the variance of d:
    /// by the body's own motion unless the measurement contradicts it.
    pub(super) fn depth_velocity(
        &self,
        measured: &DepthVelocity,
        xyd: &Vector3<f64>,
        variance: f64,
    ) -> DepthVelocity {
        let mut measured = *measured;
        measured.z_vz.cov *= self.scale2;
        let predicted = self.rigid.as_ref().and_then(|rigid| rigid.depth_velocity(xyd, variance.sqrt()));
        match predicted {
            Some(predicted) if !crate::motion::depth_velocity::contradict(&measured, &predicted) => predicted,
            _ => measured,
        }
    }
}

/// What the pixels of a region show.
struct Sampled {
    /// Where, in pixels.
    places: Vec<(f64, f64)>,
    /// d with its variance.
    disparities: Vec<(f64, f64)>,
    tracks: Vec<StereoTrack>,
    /// (x, y, d), the variance of d, and what was measured of Z and VZ.
    velocities: Vec<(Vector3<f64>, f64, DepthVelocity)>,
}

impl Sampled {
    fn of(pair: &DensePair<'_>, moving: &Moving, region: &[usize]) -> Self {
        let mut sampled =
            Self { places: Vec::new(), disparities: Vec::new(), tracks: Vec::new(), velocities: Vec::new() };
        let (width, height) = pair.flow.size();
        let side = moving.layout().size_px();
        let bf = pair.rig.depth_disparity_product();
        for &cell in region {
            let (left, top) = moving.layout().corner(cell);
            let rows = (top + STEP / 2..(top + side).min(height)).step_by(STEP);
            let pixels = rows
                .flat_map(|v| (left + STEP / 2..(left + side).min(width)).step_by(STEP).map(move |u| (u, v)));
            for (u, v) in pixels {
                // A cell at the body's edge shows what is behind it as well.
                let on_body = |d: &(f64, f64)| {
                    moving.disparity(cell).is_some_and(|cell| Moving::same_surface(d.0, cell))
                };
                let Some(d) = pair.disparity(u, v).filter(on_body) else { continue };
                sampled.places.push((u as f64, v as f64));
                sampled.disparities.push(d);
                sampled.tracks.extend(pair.stereo_track(u, v));
                if let Some(both) = moving.disparities(pair, u, v).flatten() {
                    let (x, y) = pair.rig.image_from_pixel(u as f64, v as f64);
                    let velocity = DepthVelocity::from_disparities(&both, bf);
                    sampled.velocities.push((Vector3::new(x, y, d.0), d.1, velocity));
                }
            }
        }
        sampled
    }

    /// The group; `None` where nothing was measured.
    fn body<'a>(
        &self,
        moving: &Moving,
        region: &[usize],
        rig: &StereoRig,
        config: &Config,
        dt_s: f64,
        predict: impl Fn(&[StereoTrack], &MotionEstimate) -> Option<RigidPrediction<'a>>,
    ) -> Option<Body<'a>> {
        let motion = self.motion(rig, config);
        let complete = motion.as_ref().filter(|motion| motion.is_complete());
        let rigid = complete.and_then(|motion| predict(&self.tracks, motion));
        let count = self.places.len().max(1) as f64;
        let centre_px = (
            self.places.iter().map(|p| p.0).sum::<f64>() / count,
            self.places.iter().map(|p| p.1).sum::<f64>() / count,
        );
        let (d, variance) = upper_median(&mut self.disparities.clone(), |a, b| a.0.total_cmp(&b.0))?;
        let (x, y) = rig.image_from_pixel(centre_px.0, centre_px.1);
        let by_motion =
            rigid.as_ref().and_then(|rigid| rigid.depth_velocity(&Vector3::new(x, y, d), variance.sqrt()));
        let scale2 = rigid.as_ref().map_or(1.0, |rigid| self.scale2(rigid));
        let by_vz = |a: &DepthVelocity, b: &DepthVelocity| a.vz().value().total_cmp(&b.vz().value());
        let measured = || upper_median(&mut self.velocities.iter().map(|m| m.2).collect::<Vec<_>>(), by_vz);
        let velocity = by_motion.or_else(measured)?;
        let group = MovingGroup {
            pixels: region.len() * moving.layout().size_px().pow(2),
            bounds: moving.layout().bounds(region)?,
            centre_px,
            depth_m: rig.depth(d)?,
            motion,
            depth_velocity: velocity.vz(),
            impact: velocity.looming(dt_s).map(|looming| TimeToImpact { looming }),
        };
        Some(Body { group, rigid, scale2 })
    }

    /// The motion of most of the pixels.
    fn motion(&self, rig: &StereoRig, config: &Config) -> Option<MotionEstimate> {
        let own = &config.maximum_likelihood;
        let options = MaximumLikelihoodOptions { seed: own.seed ^ config.seed, ..*own };
        let start = robust_start(&self.tracks, rig, None, &options).ok()?;
        Solver::new(rig, &start, config).likelihood(&self.tracks).and_then(MotionEstimate::known).ok()
    }

    /// Squared scale of the measured VZ about those of the body's motion, in units of their variance; at least 1.
    fn scale2(&self, rigid: &RigidPrediction<'_>) -> f64 {
        let square = |(xyd, variance, measured): &(Vector3<f64>, f64, DepthVelocity)| {
            let predicted = rigid.depth_velocity(xyd, variance.sqrt())?;
            Some((measured.vz().value() - predicted.vz().value()).powi(2) / measured.vz().variance())
        };
        let mut squares: Vec<f64> = self.velocities.iter().filter_map(square).collect();
        // No square is NaN of nothing.
        (median(&mut squares) / MEDIAN_CHI2).max(1.0)
    }
}
