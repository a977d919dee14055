//! The dense maps of a frame pair: depth velocity and time to impact of every pixel, each with its σ.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::config::{Approach, Config, Method};
use crate::estimate::Blocks;
use crate::geometry::{Field, Grid, StereoRig};
use crate::motion::DepthVelocity;
use crate::motion::depth_velocity::{self, RigidPrediction, rigid_unless_moving};
use crate::motion::impact::{Neighbourhood, TimeToImpact};
use crate::observe::{DensePair, StereoTrack};

/// Per-pixel results on the pixel grid of the earlier frame; missing pixels are NaN.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionMaps {
    /// VZ, in metres per interval.
    pub depth_velocity: Field,
    /// Standard deviation of VZ.
    pub depth_velocity_sigma: Field,
    /// Time to impact in seconds, where the point approaches.
    pub impact: Field,
    /// Near end of its 95 % interval.
    pub impact_lo: Field,
    /// Far end, which may be infinite.
    pub impact_hi: Grid<f32>,
}

/// Side of the blocks in which dense points make an obstacle, in pixels.
const DENSE_OBSTACLE_PX: f64 = 32.0;
/// The same for tracks, which are about thirty pixels apart.
const SPARSE_OBSTACLE_PX: f64 = 96.0;

/// What one pixel shows.
struct Pixel {
    velocity: DepthVelocity,
    impact: Option<TimeToImpact>,
    /// Whether it will pass through the vehicle's window.
    crosses: bool,
}

/// VZ and time to impact of every pixel, and the nearest obstacle's points by block.
///
/// With `dcce` and `dv` VZ is that method's own measurement at each pixel; with the others it is
/// the rigid scene's, except where the measured change of disparity contradicts it.
pub fn motion_maps(
    pair: &DensePair<'_>,
    rigid: Option<&RigidPrediction<'_>>,
    config: &Config,
    dt_s: f64,
) -> (MotionMaps, Vec<Neighbourhood>) {
    let (width, height) = pair.flow.size();
    let blocks = Blocks::over(pair.rig, DENSE_OBSTACLE_PX);
    let rows: Vec<Vec<Option<Pixel>>> = (0..height)
        .into_par_iter()
        .map(|v| (0..width).map(|u| pixel_at(pair, rigid, config, (u, v), dt_s)).collect())
        .collect();
    let mut seen = vec![Neighbourhood::default(); blocks.count()];
    for (v, row) in rows.iter().enumerate() {
        for (u, pixel) in row.iter().enumerate() {
            let (x, y) = pair.rig.image_from_pixel(u as f64, v as f64);
            if let Some(pixel) = pixel {
                seen[blocks.index(x, y)].add(pixel.impact.filter(|_| pixel.crosses));
            }
        }
    }
    (fill(width, height, &rows), seen)
}

fn pixel_at(
    pair: &DensePair<'_>,
    rigid: Option<&RigidPrediction<'_>>,
    config: &Config,
    (u, v): (usize, usize),
    dt_s: f64,
) -> Option<Pixel> {
    let velocity = velocity_at(pair, rigid, config, u, v)?;
    let impact = velocity.looming(dt_s).map(|looming| TimeToImpact { looming });
    let (x, y) = pair.rig.image_from_pixel(u as f64, v as f64);
    let before = Vector3::new(x, y, pair.rig.focal_px) * (velocity.z_vz.mean.x / pair.rig.focal_px);
    let crosses =
        rigid.zip(impact).is_some_and(|(rigid, impact)| crosses(rigid, &before, &impact, config, dt_s));
    Some(Pixel { velocity, impact, crosses })
}

/// Whether a point will pass through the vehicle's window.
fn crosses(
    rigid: &RigidPrediction<'_>,
    before: &Vector3<f64>,
    impact: &TimeToImpact,
    config: &Config,
    dt_s: f64,
) -> bool {
    let later = rigid.motion().apply(before);
    let velocity = (later - before) / dt_s;
    impact.seconds().is_some_and(|seconds| config.window.is_crossed_by(&later, &velocity, seconds))
}

fn velocity_at(
    pair: &DensePair<'_>,
    rigid: Option<&RigidPrediction<'_>>,
    config: &Config,
    u: usize,
    v: usize,
) -> Option<DepthVelocity> {
    let bf = pair.rig.depth_disparity_product();
    match (config.method, config.approach) {
        (Method::Dcce, Approach::Discrete) => {
            Some(depth_velocity::dcce(&pair.depth_track(u, v)?.depth_change(bf)))
        }
        (Method::Dcce, Approach::Differential) => {
            Some(depth_velocity::dcce(&pair.depth_flow(u, v)?.depth_change(bf)).from_middle())
        }
        (Method::Dv, Approach::Differential) => {
            Some(depth_velocity::dv(&pair.stereo_flow(u, v)?, bf).from_middle())
        }
        (Method::Dv, Approach::Discrete) => Some(depth_velocity::dv_discrete(&pair.stereo_track(u, v)?, bf)),
        _ => {
            let measured = pair.stereo_track(u, v).map(|track| depth_velocity::dv_discrete(&track, bf));
            let predicted = rigid.and_then(|rigid| {
                let sigma = f64::from(pair.before.sigma.get(u, v)?);
                let d = pair.rig.disparity_from_shift(f64::from(pair.before.shift.get(u, v)?));
                let (x, y) = pair.rig.image_from_pixel(u as f64, v as f64);
                rigid.depth_velocity(&Vector3::new(x, y, d), sigma)
            });
            rigid_unless_moving(measured, predicted)
        }
    }
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

fn fill(width: usize, height: usize, rows: &[Vec<Option<Pixel>>]) -> MotionMaps {
    let empty = || Field::missing(width, height);
    let mut maps = MotionMaps {
        depth_velocity: empty(),
        depth_velocity_sigma: empty(),
        impact: empty(),
        impact_lo: empty(),
        impact_hi: Grid::filled(width, height, f32::NAN),
    };
    for (v, row) in rows.iter().enumerate() {
        for (u, pixel) in row.iter().enumerate() {
            let Some(pixel) = pixel else { continue };
            let vz = pixel.velocity.vz();
            maps.depth_velocity.set(u, v, Some(vz.value() as f32));
            maps.depth_velocity_sigma.set(u, v, Some(vz.sigma(0) as f32));
            let Some(impact) = pixel.impact else { continue };
            if let (Some(seconds), Some((lo, hi))) = (impact.seconds(), impact.interval95_s()) {
                maps.impact.set(u, v, Some(seconds as f32));
                maps.impact_lo.set(u, v, Some(lo as f32));
                maps.impact_hi.set(u, v, hi as f32);
            }
        }
    }
    maps
}
