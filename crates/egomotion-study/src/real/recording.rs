//! The same comparison on a real recording, with its true poses or without.

use nalgebra::{Vector2, Vector3};

use super::contender::ImageContender;
use super::estimates::{ImageEstimates, MatchingSettings};
use super::matching::MatchedFrames;
use super::quantity::Quantity;
use super::record::{DrawId, RealRecord};
use super::{RealError, publish};
use crate::Publication;
use crate::synthetic::APPROACHES;
use egomotion::geometry::{Field, StereoRig, Twist, image_flow};
use egomotion::pipeline::Approach;
use egomotion::sim::StereoImages;

/// Three stereo frames of a recording, one interval apart, with the true motion where it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Triple {
    /// The pairs at t−1, t, t+1, of the rig's size.
    pub frames: [StereoImages; 3],
    /// True scene motion of the left camera, per interval, from t−1 to t and from t to t+1; `None` without true poses.
    pub motion: Option<[Twist; 2]>,
    /// Name of the recording and index of the frame at t.
    pub draw: DrawId,
}

impl Triple {
    /// True φ: at t for the differential approach (half of that between t−1 and t+1), over t to t+1 for the discrete.
    fn truth(&self, approach: Approach) -> Option<Twist> {
        let [before, after] = self.motion.as_ref()?;
        Some(match approach {
            Approach::Differential => after.exp().after(&before.exp()).log().scaled(0.5),
            Approach::Discrete => *after,
        })
    }

    /// φ of the left camera by every method against the truth, and VZ of every pixel against what the true φ does to
    /// a still scene of the measured depth: what moves by itself counts as an error of all methods alike.
    ///
    /// Without a true motion the records hold estimates and no errors.
    ///
    /// # Errors
    /// [`RealError`] when the images differ in size or the rig cannot measure.
    pub fn records(
        &self,
        rig: &StereoRig,
        settings: &MatchingSettings,
    ) -> Result<Vec<RealRecord>, RealError> {
        let (found, expected) = (self.frames[1].left.size(), (rig.width_px, rig.height_px));
        if found != expected {
            return Err(RealError::Size { found, expected });
        }
        let found = ImageEstimates::of(&self.frames, rig, settings)?;
        let phi = found.motions.iter().flat_map(|(contender, estimate)| {
            self.draw.phi(*contender, estimate, self.truth(contender.approach).as_ref())
        });
        let mut records: Vec<RealRecord> = phi.collect();
        let still = APPROACHES
            .map(|approach| self.truth(approach).map(|phi| still_vz_mm(&found.matched, &phi, approach)));
        for (contender, map) in found.depth_velocities() {
            let truth = &still[usize::from(contender.approach == Approach::Discrete)];
            records.extend(self.vz_record(contender, &map, truth.as_ref()));
        }
        let best = found.motions.iter().find(|(contender, _)| *contender == ImageContender::BEST);
        let motion = self.truth(Approach::Discrete).or(best.map(|(_, estimate)| estimate.phi_or_zero()));
        let share = motion.and_then(|phi| turn_share(&found.matched, &phi));
        records.extend(share.and_then(|s| self.draw.without_truth(None, Quantity::TurnShare, &[s])));
        Ok(records)
    }

    /// A map of VZ in metres per interval against that of a still scene in mm.
    fn vz_record(
        &self,
        contender: ImageContender,
        map: &Field,
        still_mm: Option<&Field>,
    ) -> Option<RealRecord> {
        let found = map.grid().values().iter().map(|&vz_m| 1e3 * f64::from(vz_m));
        match still_mm {
            Some(truth) => {
                let truth = truth.grid().values().iter().map(|&vz_mm| f64::from(vz_mm));
                let pairs: Vec<(f64, f64)> = found.zip(truth).collect();
                self.draw.record(Some(contender), Quantity::VzStill, &pairs)
            }
            None => {
                let found: Vec<f64> = found.collect();
                self.draw.without_truth(Some(contender), Quantity::VzStill, &found)
            }
        }
    }
}

/// VZ of a still scene under φ, in mm per interval, where disparity was matched.
fn still_vz_mm(matched: &MatchedFrames, phi: &Twist, approach: Approach) -> Field {
    let motion = phi.exp();
    let mut vz = Field::missing(matched.rig.width_px, matched.rig.height_px);
    for (u, v, point) in points(matched) {
        let rate = match approach {
            Approach::Differential => phi.velocity(&point).z,
            Approach::Discrete => motion.apply(&point).z - point.z,
        };
        vz.set(u, v, Some(1e3 * rate as f32));
    }
    vz
}

/// Share of the image motion under φ that its rotation makes, from 0 to 1; `None` without motion or matched point.
fn turn_share(matched: &MatchedFrames, phi: &Twist) -> Option<f64> {
    let focal_px = matched.rig.focal_px;
    let still = Vector3::zeros();
    let parts = [Twist { t: still, ..*phi }, Twist { omega: still, ..*phi }];
    let flows = points(matched).map(|(_, _, p)| {
        let (x, y) = (focal_px * p.x / p.z, focal_px * p.y / p.z);
        Vector2::from(parts.map(|part| image_flow(&part, x, y, p.z, focal_px).norm()))
    });
    let sum = flows.fold(Vector2::zeros(), |sum: Vector2<f64>, flow| sum + flow);
    let share = sum.x / (sum.x + sum.y);
    share.is_finite().then_some(share)
}

/// Pixels whose disparity was matched at t, and their points.
fn points(matched: &MatchedFrames) -> impl Iterator<Item = (usize, usize, Vector3<f64>)> {
    let (rig, shift) = (&matched.rig, &matched.disparity[1].shift);
    let pixels = (0..shift.height()).flat_map(|v| (0..shift.width()).map(move |u| (u, v)));
    pixels.filter_map(|(u, v)| {
        let (x, y) = rig.image_from_pixel(u as f64, v as f64);
        let d = rig.disparity_from_shift(shift.get(u, v)?.into());
        Some((u, v, rig.point(&Vector3::new(x, y, d))?))
    })
}

/// Three frames of a recording whose images Figure 11 shows, with the rig and the settings of the study.
#[derive(Debug, Clone, Copy)]
pub struct ShownFrames<'a> {
    /// The frames.
    pub frames: &'a [StereoImages; 3],
    /// The rig.
    pub rig: &'a StereoRig,
    /// How they are matched.
    pub settings: &'a MatchingSettings,
}

/// Tables 3 to 7 and Figures 11 to 14 of a recording's records, in the paper's form.
///
/// Without `shown` there is no Figure 11; without true poses there are no errors, and so neither Figures 12 to 14.
pub fn publish_recording(name: &str, records: &[RealRecord], shown: Option<ShownFrames<'_>>) -> Publication {
    let matched = shown
        .and_then(|shown| MatchedFrames::new(shown.frames, shown.rig, shown.settings.levels as f32).ok());
    let example = shown.zip(matched.as_ref()).map(|(shown, matched)| (shown.frames, matched));
    publish::recording(name, records, example)
}
