//! The dense maps of a frame pair: depth velocity and time to impact of every pixel, each with its σ.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::config::{Config, Method};
use super::map_row::{MapRow, Scene};
use super::moving::Moving;
use crate::estimate::Blocks;
use crate::geometry::{Field, Gaussian, Grid, StereoRig};
use crate::motion::depth_velocity::{self, RigidPrediction, rigid_unless_moving};
use crate::motion::impact::{Neighbourhood, TimeToImpact};
use crate::observe::{DensePair, StereoPyramid, StereoTrack};

/// Per-pixel results on the pixel grid of the earlier frame; missing pixels are NaN.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionMaps {
    /// VZ, in metres per interval.
    pub depth_velocity: Field,
    /// Standard deviation of VZ.
    pub depth_velocity_sigma: Field,
    /// Looming in 1/s, positive where the point approaches: time to impact is its inverse.
    pub looming: Field,
    /// Standard deviation of looming.
    pub looming_sigma: Field,
}

impl MotionMaps {
    /// Time to impact of a pixel; `None` without an answer.
    pub fn impact(&self, u: usize, v: usize) -> Option<TimeToImpact> {
        let (looming, sigma) = (self.looming.get(u, v)?, self.looming_sigma.get(u, v)?);
        Some(TimeToImpact { looming: Gaussian::scalar(looming.into(), f64::from(sigma).powi(2)) })
    }

    /// A quantity of every pixel that approaches, in seconds; NaN elsewhere.
    pub fn seconds(&self, quantity: impl Fn(&TimeToImpact) -> Option<f64>) -> Grid<f32> {
        let approaches = |impact: &TimeToImpact| impact.looming.value() > 0.0;
        let value = |u, v| quantity(&self.impact(u, v).filter(approaches)?);
        let (width, height) = self.looming.size();
        Grid::from_fn(width, height, |u, v| value(u, v).map_or(f32::NAN, |seconds| seconds as f32))
    }
}

/// Side of the blocks in which dense points make an obstacle, in pixels.
const DENSE_OBSTACLE_PX: f64 = 32.0;
/// The same for tracks, which are about thirty pixels apart.
const SPARSE_OBSTACLE_PX: f64 = 96.0;

/// VZ and time to impact of every pixel, and the nearest obstacle's points by block.
///
/// With `dcce` and `dv` VZ is that method's own measurement at each pixel; with the others it is
/// the rigid scene's, except where flow or the measured change of disparity contradicts it: there it
/// follows from the change of disparity. `images` are the two frames.
pub fn motion_maps(
    pair: &DensePair<'_>,
    images: (&StereoPyramid, &StereoPyramid),
    rigid: Option<&RigidPrediction<'_>>,
    config: &Config,
    dt_s: f64,
) -> (MotionMaps, Vec<Neighbourhood>) {
    let (width, height) = pair.flow.size();
    let blocks = Blocks::over(pair.rig, DENSE_OBSTACLE_PX);
    let own = matches!(config.method, Method::Dcce | Method::Dv);
    let moving = rigid.filter(|_| !own).map(|rigid| Moving::find(pair, images, rigid));
    let scene = Scene { pair, rigid, moving: moving.as_ref(), config, dt_s };
    let mut planes: [Grid<f32>; 4] = std::array::from_fn(|_| Grid::filled(width, height, 0.0));
    let [vz, sigma, looming, looming_sigma] =
        planes.each_mut().map(|plane| plane.values_mut().par_chunks_mut(width.max(1)));
    let rows: Vec<Vec<(usize, Neighbourhood)>> = (vz, sigma, looming, looming_sigma)
        .into_par_iter()
        .enumerate()
        .map_init(
            || MapRow::new(width),
            |row, (v, (vz, sigma, looming, looming_sigma))| {
                row.fill(&scene, v, [vz, sigma, looming, looming_sigma]);
                neighbourhoods(row, pair.rig, &blocks, v)
            },
        )
        .collect();
    let mut seen = vec![Neighbourhood::default(); blocks.count()];
    for (block, part) in rows.into_iter().flatten() {
        seen[block].seen += part.seen;
        seen[block].crossing.extend(part.crossing);
    }
    let [vz, sigma, looming, looming_sigma] = planes;
    let fields = |a, b| rayon::join(|| Field::from_grid(a), || Field::from_grid(b));
    let ((depth_velocity, depth_velocity_sigma), (looming, looming_sigma)) =
        rayon::join(|| fields(vz, sigma), || fields(looming, looming_sigma));
    let maps = MotionMaps { depth_velocity, depth_velocity_sigma, looming, looming_sigma };
    (maps, seen)
}

/// The points of row `v` by block.
fn neighbourhoods(row: &MapRow, rig: &StereoRig, blocks: &Blocks, v: usize) -> Vec<(usize, Neighbourhood)> {
    let mut seen: Vec<(usize, Neighbourhood)> = Vec::new();
    for u in 0..row.width() {
        let Some(crossing) = row.seen(u) else { continue };
        let (x, y) = rig.image_from_pixel(u as f64, v as f64);
        let block = blocks.index(x, y);
        match seen.last_mut() {
            Some((last, points)) if *last == block => points.add(crossing),
            _ => {
                let mut points = Neighbourhood::default();
                points.add(crossing);
                seen.push((block, points));
            }
        }
    }
    seen
}

/// Whether a point will pass through the vehicle's window.
fn crosses(
    rigid: &RigidPrediction<'_>,
    before: &Vector3<f64>,
    impact: &TimeToImpact,
    config: &Config,
    dt_s: f64,
) -> bool {
    impact.seconds().is_some_and(|seconds| {
        let later = rigid.motion().apply(before);
        let velocity = (later - before) / dt_s;
        config.window.is_crossed_by(&later, &velocity, seconds)
    })
}

/// The nearest obstacle's points among tracks, by block.
pub fn track_neighbourhoods(
    tracks: &[StereoTrack],
    rigid: &RigidPrediction<'_>,
    rig: &StereoRig,
    config: &Config,
    dt_s: f64,
) -> Vec<Neighbourhood> {
    let blocks = Blocks::over(rig, SPARSE_OBSTACLE_PX);
    let mut seen = vec![Neighbourhood::default(); blocks.count()];
    for track in tracks {
        let xyd = &track.before.mean;
        let measured = depth_velocity::dv_discrete(track, rig.depth_disparity_product());
        let predicted = rigid.depth_velocity(xyd, track.before.sigma(2));
        let Some(velocity) = rigid_unless_moving(Some(measured), predicted) else { continue };
        let impact = velocity.looming(dt_s).map(|looming| TimeToImpact { looming });
        let crossing = rig
            .point(xyd)
            .zip(impact)
            .filter(|(before, impact)| crosses(rigid, before, impact, config, dt_s));
        seen[blocks.index(xyd.x, xyd.y)].add(crossing.map(|(_, impact)| impact));
    }
    seen
}
