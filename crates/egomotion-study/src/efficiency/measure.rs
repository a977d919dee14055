//! Measurements of exact points: which are outliers, and noise.

use nalgebra::Vector3;
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::setting::{Ends, Kind, Setting};
use super::site::Site;
use crate::draw::{Differential, Discrete};
use egomotion::geometry::{Gaussian, StereoRig, Twist};
use egomotion::observe::{DepthFlow, DepthTrack, StereoFlow, StereoTrack};

/// Uniform outliers are found up to so far from the truth in x, y and d: the reach of a matcher.
const REACH_PX: f64 = 16.0;
/// A moving body goes so far in one interval, in a random direction,
const BODY_STEP_M: f64 = 0.1;
/// and turns so far about its middle.
const BODY_TURN_RAD: f64 = 0.02;

/// Points of one draw: inliers first, then outliers.
#[derive(Debug, Clone, PartialEq)]
pub struct Chosen {
    /// The points.
    pub sites: Vec<Site>,
    /// So many of them move with the scene.
    pub inliers: usize,
}

fn normals(rng: &mut Pcg64Mcg) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.sample(StandardNormal))
}

impl Chosen {
    /// The share of outliers that the setting asks for among `sites`.
    pub fn new(
        mut sites: Vec<Site>,
        setting: &Setting,
        rig: &StereoRig,
        phi: &Twist,
        rng: &mut Pcg64Mcg,
    ) -> Self {
        let outliers = (setting.outliers * sites.len() as f64).round() as usize;
        let inliers = sites.len() - outliers.min(sites.len());
        if inliers < sites.len() {
            match setting.kind {
                Kind::Uniform => sites[inliers..].iter_mut().for_each(|site| *site = mismatched(site, rng)),
                Kind::Coherent => one_body(&mut sites, inliers, rig, phi, rng),
            }
        }
        Self { sites, inliers }
    }

    /// Exact structures of the inliers.
    pub fn structures(&self) -> Vec<Vector3<f64>> {
        self.sites[..self.inliers].iter().map(|site| site.xyd).collect()
    }
}

fn mismatched(site: &Site, rng: &mut Pcg64Mcg) -> Site {
    let off = Vector3::from_fn(|_, _| rng.random_range(-REACH_PX..REACH_PX));
    site.carried(site.later + off, site.rate + off)
}

/// All but `inliers` of the sites, those nearest to one of them in the image, move as one body.
fn one_body(sites: &mut [Site], inliers: usize, rig: &StereoRig, phi: &Twist, rng: &mut Pcg64Mcg) {
    let middle = sites[rng.random_range(0..sites.len())].xyd;
    let distance = |site: &Site| (site.xyd - middle).xy().norm_squared();
    sites.sort_by(|a, b| distance(b).total_cmp(&distance(a)));
    let body = &mut sites[inliers..];
    let points = body.iter().filter_map(|site| rig.point(&site.xyd));
    let centre = points.sum::<Vector3<f64>>() / body.len() as f64;
    let omega = normals(rng).normalize() * BODY_TURN_RAD;
    let own = Twist { t: normals(rng).normalize() * BODY_STEP_M - omega.cross(&centre), omega };
    let motion = phi.exp().after(&own.exp());
    let together = phi.vector() + own.vector();
    for site in body {
        let later = rig.point(&site.xyd).and_then(|p| rig.project(&motion.apply(&p)));
        let rate = rig.velocity_jacobian(&site.xyd) * together;
        *site = site.carried(later.unwrap_or(site.later), rate);
    }
}

/// Tracks with noise of the same σ on x, y and d at both ends, or none on (x, y) at t.
pub fn discrete(sites: &[Site], setting: &Setting, rng: &mut Pcg64Mcg) -> Discrete<'static> {
    let sigma = setting.noise_px;
    let variance = sigma * sigma;
    let place = match setting.ends {
        Ends::Both => variance,
        Ends::Later => 0.0,
    };
    let before_sigma = Vector3::new(place.sqrt(), place.sqrt(), sigma);
    let mut draw = empty();
    for site in sites {
        let before = site.xyd + normals(rng).component_mul(&before_sigma);
        let after = site.later + normals(rng) * sigma;
        // At the same place of the later image: its disparity and slope, with noise of their own.
        let here = normals(rng) * sigma;
        let half = std::f64::consts::FRAC_1_SQRT_2;
        draw.changes.push(DepthTrack {
            x_px: before.x,
            y_px: before.y,
            disparity: Gaussian::independent(
                [
                    before.z,
                    site.later_here + here.x,
                    site.slope_later.x + half * here.y,
                    site.slope_later.y + half * here.z,
                ],
                [variance, variance, 0.5 * variance, 0.5 * variance],
            ),
            displacement: Gaussian::independent((after - before).xy().into(), [variance + place; 2]),
        });
        draw.motions.push(StereoTrack {
            before: Gaussian::independent(before.into(), [place, place, variance]),
            after: Gaussian::independent(after.into(), [variance; 3]),
        });
    }
    draw.complete.clone_from(&draw.motions);
    draw
}

/// Velocities at exact pixels with noise of the same σ on d and on every component of both cameras' flow.
pub fn differential(sites: &[Site], setting: &Setting, rng: &mut Pcg64Mcg) -> Differential<'static> {
    let sigma = setting.noise_px;
    let variance = sigma * sigma;
    let mut draw = empty();
    for site in sites {
        let [x_px, y_px, d] = site.xyd.into();
        let noise = normals(rng) * sigma;
        let [vx, vy] = [site.rate.x + noise.x, site.rate.y + noise.y];
        let right: f64 = site.rate.x - site.rate.z + sigma * rng.sample::<f64, _>(StandardNormal);
        let d = d + noise.z;
        let slopes = normals(rng) * (sigma * std::f64::consts::FRAC_1_SQRT_2);
        draw.changes.push(DepthFlow {
            x_px,
            y_px,
            disparity: Gaussian::independent(
                [d, site.slope.x + slopes.x, site.slope.y + slopes.y, site.rate_here + slopes.z],
                [variance, 0.5 * variance, 0.5 * variance, 0.5 * variance],
            ),
            flow: Gaussian::independent([vx, vy], [variance; 2]),
        });
        let measured = Gaussian::independent([d, vx, vy, right], [variance; 4]);
        draw.motions.push(StereoFlow { x_px, y_px, measured });
    }
    draw.complete.clone_from(&draw.motions);
    draw
}

fn empty<'a, Change, Motion>() -> crate::draw::Draw<'a, Change, Motion> {
    crate::draw::Draw { pixels: Vec::new(), changes: Vec::new(), motions: Vec::new(), complete: Vec::new() }
}
