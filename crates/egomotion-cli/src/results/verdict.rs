//! Estimates against the truth, where there is one.

use anyhow::Result;
use egomotion::geometry::{Field, StereoRig};
use egomotion::metrics::{self, Nees};
use egomotion::observe::DisparityMap;
use egomotion::pipeline::DenseResults;
use egomotion_io::source::TruthFiles;
use serde::{Deserialize, Serialize};

use crate::session::Outcome;

/// Motion against true poses.
#[derive(Debug, Clone, Serialize)]
pub struct MotionVerdict {
    pub t_rmse_m: f64,
    pub r_rmse_deg: f64,
    /// Mean NEES over its six degrees of freedom: 1 if the covariances are true and the truth exact.
    pub nees_per_component: Option<f64>,
    /// Share of the components within twice their own σ of the truth.
    pub within_2_sigma: f64,
    pub components: usize,
}

impl MotionVerdict {
    /// `None` without true poses or without any complete answer.
    pub fn of(outcome: &Outcome) -> Option<Self> {
        let errors = metrics::relative_pose_error(outcome.trajectory.poses(), outcome.truth.as_deref()?)?;
        let mut nees = Nees::default();
        let (mut inside, mut components) = (0, 0);
        for frame in &outcome.frames {
            let (Ok(motion), Some(truth)) = (&frame.motion.motion, frame.truth) else { continue };
            if !motion.is_complete() {
                continue;
            }
            nees.add(&motion.theta, &truth.vector());
            components += 6;
            inside += (0..6)
                .filter(|&i| (motion.theta.mean[i] - truth.vector()[i]).abs() <= 2.0 * motion.theta.sigma(i))
                .count();
        }
        (components > 0).then(|| Self {
            t_rmse_m: errors.t_rmse_m,
            r_rmse_deg: errors.r_rmse_deg,
            nees_per_component: nees.per_degree(),
            within_2_sigma: inside as f64 / f64::from(components),
            components: components as usize,
        })
    }
}

/// Maps against true ones, over the pixels that have both.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct MapVerdict {
    /// Share of the true pixels that have an answer.
    pub answered: f64,
    pub vz_median_abs_error_m: f64,
    /// Share of the answered pixels whose true VZ lies within 2σ.
    pub vz_within_2_sigma: f64,
    /// Share of all true pixels off by more than 3 px or without disparity.
    pub disparity_bad_3px: f64,
    pub disparity_median_abs_error_px: f64,
    pub pixels: usize,
}

/// Sums over pixels that lead to a [`MapVerdict`].
#[derive(Debug, Default)]
pub struct MapErrors {
    vz_errors: Vec<f64>,
    disparity_errors: Vec<f64>,
    within: usize,
    bad: usize,
    pixels: usize,
}

impl MapErrors {
    /// Count one pixel: true shift in pixels and true VZ in metres.
    pub fn add(&mut self, dense: &DenseResults, (u, v): (usize, usize), shift_px: f64, vz_m: f64) {
        self.pixels += 1;
        let found = dense.disparity.shift.get(u, v).map(|d| (f64::from(d) - shift_px).abs());
        self.disparity_errors.extend(found);
        self.bad += usize::from(found.is_none_or(|e| e > 3.0));
        let maps = &dense.motion;
        if let (Some(vz), Some(sigma)) = (maps.depth_velocity.get(u, v), maps.depth_velocity_sigma.get(u, v))
        {
            let error = (f64::from(vz) - vz_m).abs();
            self.within += usize::from(error <= 2.0 * f64::from(sigma));
            self.vz_errors.push(error);
        }
    }

    /// `None` when no pixel had both an answer and the truth.
    pub fn verdict(&self) -> Option<MapVerdict> {
        let answered = self.vz_errors.len();
        Some(MapVerdict {
            answered: answered as f64 / self.pixels.max(1) as f64,
            vz_median_abs_error_m: metrics::quantile(&self.vz_errors, 0.5)?,
            vz_within_2_sigma: self.within as f64 / answered as f64,
            disparity_bad_3px: self.bad as f64 / self.pixels as f64,
            disparity_median_abs_error_px: metrics::quantile(&self.disparity_errors, 0.5)?,
            pixels: self.pixels,
        })
    }
}

/// Compare with the disparities that a scene knows at both times of the earlier frame's pixels.
pub fn scene_maps(rig: &StereoRig, dense: &DenseResults, truth: &TruthFiles) -> Result<Option<MapVerdict>> {
    let (Some(now), Some(next)) = (&truth.disparity, &truth.next_disparity) else { return Ok(None) };
    let (now, next): (Field, Field) = (now.read()?, next.read()?);
    if now.size() != dense.disparity.shift.size() || next.size() != now.size() {
        return Ok(None);
    }
    let mut tally = MapErrors::default();
    for v in 0..now.height() {
        for u in 0..now.width() {
            let (Some(a), Some(b)) = (now.get(u, v), next.get(u, v)) else { continue };
            let depth = |shift: f32| rig.depth(rig.disparity_from_shift(f64::from(shift)));
            if let (Some(z), Some(z_next)) = (depth(a), depth(b)) {
                tally.add(dense, (u, v), f64::from(a), z_next - z);
            }
        }
    }
    Ok(tally.verdict())
}

/// Disparity against the true one, over the pixels that have a truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DisparityVerdict {
    /// Share of them with an answer.
    pub answered: f64,
    /// Share off by more than 1 px, or without an answer.
    pub bad_1px: f64,
    /// The same with 3 px.
    pub bad_3px: f64,
    pub median_abs_error_px: f64,
    /// Share of the answers within 2σ of the truth.
    pub within_2_sigma: f64,
    pub pixels: usize,
}

impl DisparityVerdict {
    /// `None` where the sizes differ or nothing has both a truth and an answer.
    pub fn of(map: &DisparityMap, truth: &Field) -> Option<Self> {
        if truth.size() != map.shift.size() {
            return None;
        }
        let (mut errors, mut within, mut pixels) = (Vec::new(), 0, 0);
        let (width, height) = truth.size();
        for (u, v) in (0..height).flat_map(|v| (0..width).map(move |u| (u, v))) {
            let Some(truth) = truth.get(u, v) else { continue };
            pixels += 1;
            let (Some(found), Some(sigma)) = (map.shift.get(u, v), map.sigma.get(u, v)) else { continue };
            let error = f64::from((found - truth).abs());
            within += usize::from(error <= 2.0 * f64::from(sigma));
            errors.push(error);
        }
        let share = |count: usize| count as f64 / pixels.max(1) as f64;
        let good = |limit: f64| errors.iter().filter(|&&error| error <= limit).count();
        Some(Self {
            answered: share(errors.len()),
            bad_1px: 1.0 - share(good(1.0)),
            bad_3px: 1.0 - share(good(3.0)),
            median_abs_error_px: metrics::quantile(&errors, 0.5)?,
            within_2_sigma: within as f64 / errors.len() as f64,
            pixels,
        })
    }
}
