//! The dense maps of a frame pair: depth velocity and time to impact of every pixel, each with its σ.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::groups::Groups;
use super::map_row::{MapRow, PairToMap};
use crate::geometry::{Cells, Field, Gaussian, Grid};
use crate::motion::RigidPrediction;
use crate::motion::TimeToImpact;
use crate::motion::depth_velocity::{self, rigid_unless_moving};
use crate::motion::{ObstacleCriteria, Sightings};
use crate::observe::{DensePair, StereoTrack};
use crate::pipeline::plan::Interval;

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

/// VZ and time to impact of every pixel, and what was seen for the nearest obstacle in each cell of
/// [`ObstacleCriteria::DENSE`].
///
/// With `dcce` and `dv` VZ is that method's own measurement at each pixel; with the others it is
/// the rigid scene's, except where flow or the measured change of disparity contradicts it: there it
/// follows from the motion of the group that it belongs to, or else from the change of disparity.
pub fn motion_maps(
    pair: &DensePair<'_>,
    rigid: Option<&RigidPrediction<'_>>,
    groups: Option<&Groups<'_>>,
    interval: &Interval<'_>,
) -> (MotionMaps, Vec<Sightings>) {
    let (width, height) = pair.flow.size();
    let cell_px = ObstacleCriteria::DENSE.cell_px;
    let pair = PairToMap { pair, rigid, groups, interval };
    let mut planes: [Grid<f32>; 4] = std::array::from_fn(|_| Grid::filled(width, height, 0.0));
    let [vz, sigma, looming, looming_sigma] =
        planes.each_mut().map(|plane| plane.values_mut().par_chunks_mut((width * cell_px).max(1)));
    let strips: Vec<Vec<Sightings>> = (vz, sigma, looming, looming_sigma)
        .into_par_iter()
        .enumerate()
        .map_init(
            || MapRow::new(width),
            |row, (strip, (vz, sigma, looming, looming_sigma))| {
                let rows = vz.chunks_mut(width).zip(sigma.chunks_mut(width));
                let rates = looming.chunks_mut(width).zip(looming_sigma.chunks_mut(width));
                let mut seen = vec![Sightings::default(); width.div_ceil(cell_px)];
                for (v, ((vz, sigma), (looming, looming_sigma))) in rows.zip(rates).enumerate() {
                    row.fill(&pair, strip * cell_px + v, [vz, sigma, looming, looming_sigma]);
                    for u in 0..width {
                        if let Some((impact, crosses)) = row.seen(u) {
                            seen[u / cell_px].add(impact, crosses);
                        }
                    }
                }
                seen
            },
        )
        .collect();
    let seen = strips.into_iter().flatten().collect();
    let [vz, sigma, looming, looming_sigma] = planes;
    let fields = |a, b| rayon::join(|| Field::from_grid(a), || Field::from_grid(b));
    let ((depth_velocity, depth_velocity_sigma), (looming, looming_sigma)) =
        rayon::join(|| fields(vz, sigma), || fields(looming, looming_sigma));
    let maps = MotionMaps { depth_velocity, depth_velocity_sigma, looming, looming_sigma };
    (maps, seen)
}

/// Whether a point will pass through the vehicle's window.
fn crosses(
    rigid: &RigidPrediction<'_>,
    before: &Vector3<f64>,
    impact: &TimeToImpact,
    interval: &Interval<'_>,
) -> bool {
    impact.seconds().is_some_and(|seconds| {
        let later = rigid.motion().apply(before);
        let velocity = (later - before) / interval.dt_s;
        interval.config.vehicle.is_crossed_by(&later, &velocity, seconds)
    })
}

/// What tracks show of the nearest obstacle, in each cell of [`ObstacleCriteria::SPARSE`].
pub(super) fn track_sightings(
    tracks: &[StereoTrack],
    rigid: &RigidPrediction<'_>,
    interval: &Interval<'_>,
) -> Vec<Sightings> {
    let rig = interval.rig;
    let (width, height) = (rig.width_px, rig.height_px);
    let cells = Cells::tiling((width, height), ObstacleCriteria::SPARSE.cell_px);
    let mut seen = vec![Sightings::default(); cells.count()];
    // The conversion takes what is negative to zero.
    let pixel = |c: f64, n: usize| (c.round() as usize).min(n.saturating_sub(1));
    for track in tracks {
        let xyd = &track.before.mean;
        let measured = depth_velocity::dv_discrete(track, rig.depth_disparity_product());
        let predicted = rigid.depth_velocity(xyd, track.before.sigma(2));
        let velocity = rigid_unless_moving(Some(measured), predicted);
        let looming = velocity.and_then(|velocity| velocity.looming(interval.dt_s));
        let Some((before, looming)) = rig.point(xyd).zip(looming) else { continue };
        let impact = TimeToImpact { looming };
        let (u, v) = rig.pixel_from_image(xyd.x, xyd.y);
        let cell = cells.index(pixel(u, width), pixel(v, height));
        seen[cell].add(impact, crosses(rigid, &before, &impact, interval));
    }
    seen
}
