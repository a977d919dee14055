//! What moves by itself: connected cells that contradict the rigid scene, each group with a motion of its own.

use std::cmp::Reverse;

use nalgebra::{Vector3, Vector6};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::moving::Moving;
use crate::estimate::robust_start;
use crate::estimate::{Blocks, MotionEstimate};
use crate::geometry::distribution::{CHI2_1_P50, CHI2_6_P999};
use crate::geometry::median;
use crate::geometry::{Cells, Gaussian, PixelBounds, StereoRig, upper_median};
use crate::motion::TimeToImpact;
use crate::motion::depth_velocity::contradict;
use crate::motion::{DepthVelocity, RigidPrediction};
use crate::observe::{DensePair, StereoTrack};
use crate::pipeline::config::Config;
use crate::pipeline::plan::Interval;
use crate::pipeline::solve::Solver;

/// Fewest cells of a group. Smaller regions are most often mismatches.
const LEAST_CELLS: usize = 12;
/// Fewest cells of a group that have all four neighbours in it. At depth edges wrong disparities make seams two or three
/// cells wide, which have none.
const LEAST_ENCLOSED: usize = 4;
/// Least share of a group's cells whose patch was found again in all four images. Wrong flow and hidden places are not.
const LEAST_CONFIRMED_SHARE: f64 = 0.3;
/// Distance of the pixels that observe a group's motion, in both directions.
const SAMPLE_STEP_PX: usize = 2;
/// Side of the blocks that count as independent in a group's covariance, in pixels. The scene's blocks are larger; a group
/// covers too few of those.
const BLOCK_PX: f64 = 24.0;
/// Motions whose squared Mahalanobis distance is less than this are the same: χ²₆(0.999).
const SAME_MOTION_CHI2: f64 = CHI2_6_P999;

/// Something that moves by itself, between two frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
    /// Group the moving cells, the largest group first; `still` is the rigid scene's motion, and `predict` makes of
    /// a group's motion what its pixels do.
    pub(super) fn find(
        pair: &DensePair<'_>,
        moving: Moving,
        interval: &Interval<'_>,
        still: &MotionEstimate,
        predict: impl Fn(&[StereoTrack], &MotionEstimate) -> Option<RigidPrediction<'a>>,
    ) -> Self {
        let surface = |cell| moving.disparity(cell);
        let joined = |a, b| surface(a).zip(surface(b)).is_some_and(|(a, b)| Moving::same_surface(a, b));
        let mut regions = moving.layout().regions(|cell| surface(cell).is_some(), joined);
        regions.retain(|region| is_believed(region, &moving));
        regions.sort_by_key(|region| Reverse(region.len()));
        let config = &Config { block_px: BLOCK_PX, ..interval.config.clone() };
        let mut groups = Self { of_cell: vec![None; moving.layout().count()], moving, bodies: Vec::new() };
        let moves = |region: &Vec<usize>| {
            let sampled = Sampled::of(pair, &groups.moving, region);
            let motion = sampled.motion(pair.rig, config);
            (sampled, motion)
        };
        let found: Vec<(Sampled, Option<MotionEstimate>)> = regions.par_iter().map(moves).collect();
        for (mut region, (sampled, motion)) in regions.into_iter().zip(found) {
            if motion.as_ref().is_some_and(|motion| is_still(motion, still)) {
                continue;
            }
            let rigid = motion.filter(MotionEstimate::is_complete).and_then(|m| predict(&sampled.tracks, &m));
            if let Some(rigid) = &rigid {
                region.extend(groups.gaps(pair, &region, rigid));
            }
            let layout = groups.moving.layout();
            let Some(body) = sampled.body(pair.rig, layout, &region, motion, rigid, interval.dt_s) else {
                continue;
            };
            region.iter().for_each(|&cell| groups.of_cell[cell] = Some(groups.bodies.len()));
            groups.bodies.push(body);
        }
        groups
    }

    /// Cells between those of a region in their row or column that may show its surface and move as it does:
    /// where there is no texture, nothing contradicts the still world either.
    fn gaps(&self, pair: &DensePair<'_>, region: &[usize], rigid: &RigidPrediction<'_>) -> Vec<usize> {
        let layout = self.moving.layout();
        let columns = layout.columns();
        let transposed = |cell: usize| (cell % columns, cell / columns);
        let mut rows = region.to_vec();
        rows.sort_unstable();
        let mut found = self.between(pair, &rows, rigid, 1, |a, b| a / columns == b / columns);
        rows.sort_unstable_by_key(|&cell| transposed(cell));
        found.extend(self.between(pair, &rows, rigid, columns, |a, b| a % columns == b % columns));
        found.sort_unstable();
        found.dedup();
        found
    }

    /// The fitting cells between consecutive ones of `sorted` in one `line`, which lie `step` apart there.
    fn between(
        &self,
        pair: &DensePair<'_>,
        sorted: &[usize],
        rigid: &RigidPrediction<'_>,
        step: usize,
        line: impl Fn(usize, usize) -> bool,
    ) -> Vec<usize> {
        let fits = |cell: usize, ends: [usize; 2]| {
            let surfaces = ends.map(|end| self.moving.disparity(end));
            self.fits(pair, cell, rigid, |d| {
                surfaces.iter().flatten().any(|&end| Moving::same_surface(d, end))
            })
        };
        let ends = sorted.windows(2).map(|ends| [ends[0], ends[1]]).filter(|ends| line(ends[0], ends[1]));
        ends.flat_map(|ends| (ends[0]..ends[1]).step_by(step).skip(1).filter(move |&cell| fits(cell, ends)))
            .collect()
    }

    /// Whether the middle of a cell may show a surface, its disparity on it or only guessed, and its flow may be
    /// that of a motion.
    fn fits(
        &self,
        pair: &DensePair<'_>,
        cell: usize,
        rigid: &RigidPrediction<'_>,
        surface: impl Fn(f64) -> bool,
    ) -> bool {
        let layout = self.moving.layout();
        let ((left, top), (width, height)) = (layout.corner(cell), pair.flow.size());
        let (u, v) = (left + layout.size_px() / 2, top + layout.size_px() / 2);
        if self.of_cell[cell].is_some() || u >= width || v >= height {
            return false;
        }
        let known = pair.before.shift.get(u, v).zip(pair.before.sigma.get(u, v)).zip(pair.displacement(u, v));
        let Some(((shift, sigma), flow)) = known else { return false };
        let d = pair.rig.disparity_from_shift(f64::from(shift));
        let (x, y) = pair.rig.image_from_pixel(u as f64, v as f64);
        (surface(d) || pair.disparity(u, v).is_none())
            && !rigid.contradicts_flow(&Vector3::new(x, y, d), f64::from(sigma).powi(2), &flow)
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

/// Whether a region is large enough, and more than a patch of wrong flow or the seam of a depth edge.
fn is_believed(region: &[usize], moving: &Moving) -> bool {
    let confirmed = region.iter().filter(|&&cell| moving.is_confirmed(cell)).count();
    region.len() >= LEAST_CELLS
        && confirmed as f64 >= LEAST_CONFIRMED_SHARE * region.len() as f64
        && moving.layout().enclosed(region) >= LEAST_ENCLOSED
}

/// Whether a motion is known and yet not unlike the rigid scene's.
fn is_still(motion: &MotionEstimate, still: &MotionEstimate) -> bool {
    let apart =
        Gaussian { mean: motion.theta.mean - still.theta.mean, cov: motion.theta.cov + still.theta.cov };
    motion.is_complete()
        && apart.mahalanobis2(&Vector6::zeros()).is_some_and(|square| square < SAME_MOTION_CHI2)
}

impl Body<'_> {
    /// Z and VZ by the body's own motion of a pixel with disparity (x, y, d) and the variance of d; `None` where
    /// what was measured contradicts it.
    pub(super) fn depth_velocity(
        &self,
        measured: &DepthVelocity,
        xyd: &Vector3<f64>,
        variance: f64,
    ) -> Option<DepthVelocity> {
        let predicted = self.scaled(&self.rigid.as_ref()?.depth_velocity(xyd, variance.sqrt())?);
        (!contradict(&self.scaled(measured), &predicted)).then_some(predicted)
    }

    /// What was measured, or predicted by the body's motion, with the scatter of the body's pixels.
    pub(super) fn scaled(&self, stated: &DepthVelocity) -> DepthVelocity {
        widened(stated, self.scale2)
    }
}

/// The same Z and VZ with `scale2` times the covariance.
fn widened(stated: &DepthVelocity, scale2: f64) -> DepthVelocity {
    let Gaussian { mean, cov } = stated.z_vz;
    DepthVelocity { z_vz: Gaussian { mean, cov: cov * scale2 } }
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
            let rows = (top + SAMPLE_STEP_PX / 2..(top + side).min(height)).step_by(SAMPLE_STEP_PX);
            let pixels = rows.flat_map(|v| {
                (left + SAMPLE_STEP_PX / 2..(left + side).min(width))
                    .step_by(SAMPLE_STEP_PX)
                    .map(move |u| (u, v))
            });
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
        rig: &StereoRig,
        layout: &Cells,
        region: &[usize],
        motion: Option<MotionEstimate>,
        rigid: Option<RigidPrediction<'a>>,
        dt_s: f64,
    ) -> Option<Body<'a>> {
        let count = self.places.len().max(1) as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| self.places.iter().map(of).sum::<f64>() / count;
        let centre_px = (mean(|place| place.0), mean(|place| place.1));
        let (d, variance) = upper_median(&mut self.disparities.clone(), |a, b| a.0.total_cmp(&b.0))?;
        let (x, y) = rig.image_from_pixel(centre_px.0, centre_px.1);
        let centre = Vector3::new(x, y, d);
        let scale2 = rigid.as_ref().map_or(1.0, |rigid| self.scale2(rigid));
        let by_motion = rigid.as_ref().and_then(|rigid| rigid.depth_velocity(&centre, variance.sqrt()));
        let by_motion = by_motion.map(|predicted| widened(&predicted, scale2));
        let by_vz = |a: &DepthVelocity, b: &DepthVelocity| a.vz().value().total_cmp(&b.vz().value());
        let measured = || upper_median(&mut self.velocities.iter().map(|m| m.2).collect::<Vec<_>>(), by_vz);
        let velocity = by_motion.or_else(measured)?;
        let group = MovingGroup {
            pixels: region.len() * layout.size_px().pow(2),
            bounds: layout.bounds(region)?,
            centre_px,
            depth_m: rig.depth(d)?,
            motion,
            depth_velocity: velocity.vz(),
            impact: velocity.looming(dt_s).map(|looming| TimeToImpact { looming }),
        };
        Some(Body { group, rigid, scale2 })
    }

    /// The motion of most of the pixels.
    ///
    /// Its covariance is itself estimated from few blocks: it is widened to that of Student's t with one degree of
    /// freedom fewer than blocks, which with three blocks has none.
    fn motion(&self, rig: &StereoRig, config: &Config) -> Option<MotionEstimate> {
        let start = robust_start(&self.tracks, rig, None, &config.seeded_likelihood()).ok()?;
        let found = Solver::new(rig, &start, config).likelihood(&self.tracks).ok()?;
        let layout = Blocks::tiling(rig, config.block_px);
        let mut blocks: Vec<usize> =
            self.tracks.iter().map(|track| layout.index(track.before.mean.x, track.before.mean.y)).collect();
        blocks.sort_unstable();
        blocks.dedup();
        let freedom = blocks.len() as f64 - 1.0;
        let mut motion = found.with_exact_rig();
        motion.theta.cov *= if freedom > 2.0 { freedom / (freedom - 2.0) } else { f64::INFINITY };
        motion.with_unbounded_unobserved().ok()
    }

    /// Squared scale of the measured VZ about those of the body's motion, in units of their variance; at least 1.
    fn scale2(&self, rigid: &RigidPrediction<'_>) -> f64 {
        let square = |(xyd, variance, measured): &(Vector3<f64>, f64, DepthVelocity)| {
            let predicted = rigid.depth_velocity(xyd, variance.sqrt())?;
            Some((measured.vz().value() - predicted.vz().value()).powi(2) / measured.vz().variance())
        };
        let mut squares: Vec<f64> = self.velocities.iter().filter_map(square).collect();
        // No square is NaN of nothing.
        (median(&mut squares) / CHI2_1_P50).max(1.0)
    }
}
