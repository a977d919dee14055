//! The same comparison on a real recording whose camera poses are known.

use nalgebra::Vector3;

use super::estimates::{ImageEstimates, MatchingSettings};
use super::matching::MatchedFrames;
use super::quantity::Quantity;
use super::record::{DrawId, RealRecord};
use super::{RealError, publish};
use crate::Publication;
use crate::synthetic::APPROACHES;
use egomotion::geometry::{Field, RigidMotion, StereoRig, Twist};
use egomotion::pipeline::Approach;
use egomotion::sim::StereoImages;

/// Three stereo frames of a recording, one interval apart, with the true motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Triple {
    /// The pairs at t−1, t, t+1, of the rig's size.
    pub frames: [StereoImages; 3],
    /// True scene motion of the left camera, per interval, from t−1 to t and from t to t+1.
    pub motion: [Twist; 2],
    /// Name of the recording and index of the frame at t.
    pub draw: DrawId,
}

impl Triple {
    /// True φ: at t for the differential approach (half of that between t−1 and t+1), over t to t+1 for the discrete.
    fn truth(&self, approach: Approach) -> Twist {
        let [before, after] = &self.motion;
        match approach {
            Approach::Differential => after.exp().after(&before.exp()).log().scaled(0.5),
            Approach::Discrete => *after,
        }
    }

    /// φ of the left camera by every method against the truth, and VZ of every pixel against what the true φ does to
    /// a still scene of the measured depth: what moves by itself counts as an error of all methods alike.
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
            self.draw.phi(*contender, estimate, &self.truth(contender.approach))
        });
        let mut records: Vec<RealRecord> = phi.collect();
        let still = APPROACHES.map(|approach| self.still_vz_mm(&found.matched, approach));
        for (contender, map) in found.depth_velocities() {
            let truth = &still[usize::from(contender.approach == Approach::Discrete)];
            let values = map.grid().values().iter().zip(truth.grid().values());
            let pairs: Vec<(f64, f64)> = values.map(|(&e, &t)| (1e3 * f64::from(e), f64::from(t))).collect();
            records.extend(self.draw.record(Some(contender), Quantity::VzStill, &pairs));
        }
        Ok(records)
    }

    /// VZ of a still scene under the true φ, in mm per interval, where disparity was matched.
    fn still_vz_mm(&self, matched: &MatchedFrames, approach: Approach) -> Field {
        let rig = &matched.rig;
        let phi = self.truth(approach);
        let motion: RigidMotion = phi.exp();
        let shift = &matched.disparity[1].shift;
        let mut vz = Field::missing(shift.width(), shift.height());
        for v in 0..shift.height() {
            for u in 0..shift.width() {
                let Some(shift) = shift.get(u, v) else { continue };
                let (x, y) = rig.image_from_pixel(u as f64, v as f64);
                let d = rig.disparity_from_shift(shift.into());
                let Some(point) = rig.point(&Vector3::new(x, y, d)) else { continue };
                let rate = match approach {
                    Approach::Differential => phi.velocity(&point).z,
                    Approach::Discrete => motion.apply(&point).z - point.z,
                };
                vz.set(u, v, Some(1e3 * rate as f32));
            }
        }
        vz
    }
}

/// Tables and figures of a recording's records.
pub fn publish_recording(name: &str, records: &[RealRecord]) -> Publication {
    publish::recording(name, records)
}
