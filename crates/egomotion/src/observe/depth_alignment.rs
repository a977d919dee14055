//! Observations of shape alone: where depth is measured at both times and flow is not.
//!
//! A point that a motion leads to (x′, y′) should have the disparity that the later map has there. It may lie
//! anywhere nearby as far as the images tell, so its place is all but unknown, and disparity changes with the place
//! along the map's slope: what is left to know is the motion across the surface, which is the depth change
//! constraint (11), n · V(P) = c with n the surface's normal, linearised at the motion instead of at rest.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::observation::StereoTrack;
use super::sample::DensePair;
use crate::geometry::{Gaussian, RigidMotion};

/// Standard deviation of a place that nothing but the motion tells, in pixels.
const ANYWHERE_PX: f64 = 3.0;
/// Noise beside which a disparity may be that of the surface, in standard deviations.
const NOISE: f64 = 3.0;

impl DensePair<'_> {
    /// The point of pixel (u, v) before, and the surface that the later map has where `motion` leads it.
    ///
    /// A disparity further than `reach_px` from the predicted one is of another surface.
    pub fn shape_track(
        &self,
        u: usize,
        v: usize,
        motion: &RigidMotion,
        reach_px: f64,
    ) -> Option<StereoTrack> {
        let before = self.before(u, v)?;
        let variance = before.cov.m33;
        let led = self.rig.project(&motion.apply(&self.rig.point(&before.mean)?))?;
        let (later_u, later_v) = self.rig.pixel_from_image(led.x, led.y);
        let reading = self.after.read(later_u, later_v)?;
        let found = self.rig.disparity_from_shift(reading.shift);
        let surprise = (found - led.z).abs();
        if found <= 0.0 || surprise > reach_px + NOISE * (variance + reading.variance).sqrt() {
            return None;
        }
        let slope = Vector2::new(reading.slope.0, reading.slope.1 / self.rig.aspect());
        let place = Matrix2::identity() * (ANYWHERE_PX * ANYWHERE_PX);
        let cross = place * slope;
        let own = reading.variance + slope.dot(&cross);
        let cov = Matrix3::new(
            place.m11, 0.0, cross.x, //
            0.0, place.m22, cross.y, //
            cross.x, cross.y, own,
        );
        let after = Gaussian { mean: Vector3::new(led.x, led.y, found), cov };
        Some(StereoTrack { before, after })
    }
}
