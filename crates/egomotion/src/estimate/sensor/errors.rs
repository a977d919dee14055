//! Errors of a sensor that all its observations share, what they do to an observation, and the observation without them.
//!
//! No number of pixels averages out a wrong focal length, nor an image whose last row is taken after its first
//! while the camera turns ever faster. Each such error is a parameter with mean zero and the standard deviation
//! that the [`Tolerance`](super::tolerance::Tolerance) states; observations may tell more of it
//! ([`super::augmented`]). What an error does to an observation is undone by [`SensorErrors::corrected`].

use nalgebra::{Matrix2, SMatrix, SVector, Vector2, Vector3};

use crate::constrain::{LinearisationPoint, predict};
use crate::geometry::{Gaussian, StereoRig, Twist};
use crate::observe::StereoTrack;

/// Number of a sensor's errors: focal length, principal point (2), scale, motion during read-out (6), motion between
/// image and depth (6).
pub(crate) const ERRORS: usize = 16;
/// The first this many of them are the calibration, of which every observation speaks.
pub(crate) const CALIBRATION: usize = 4;

/// What made an observation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrackSource {
    /// The two cameras of a rig.
    Stereo,
    /// The image of a depth camera, with disparity read from its depth image.
    Image,
    /// Its depth image alone.
    Depth,
}

/// A track, and what made it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SensedTrack {
    /// The track.
    pub track: StereoTrack,
    /// What made it.
    pub source: TrackSource,
}

/// Values of the errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SensorErrors {
    /// Relative error of the focal length.
    pub focal: f64,
    /// Error of the principal point, in pixels.
    pub centre_px: (f64, f64),
    /// Relative error of depth.
    pub scale: f64,
    /// By how much the motion that the image's last row sees exceeds that of its first.
    pub during: Twist,
    /// By how much the motion that depth images see exceeds that of images.
    pub apart: Twist,
}

impl SensorErrors {
    /// None.
    pub(crate) fn none() -> Self {
        Self::from_vector(&SVector::zeros())
    }

    pub(crate) fn from_vector(e: &SVector<f64, ERRORS>) -> Self {
        Self {
            focal: e[0],
            centre_px: (e[1], e[2]),
            scale: e[3],
            during: Twist::from_vector(&e.fixed_rows::<6>(4).into()),
            apart: Twist::from_vector(&e.fixed_rows::<6>(10).into()),
        }
    }

    pub(crate) fn vector(&self) -> SVector<f64, ERRORS> {
        let mut e = SVector::<f64, ERRORS>::zeros();
        (e[0], e[1], e[2], e[3]) = (self.focal, self.centre_px.0, self.centre_px.1, self.scale);
        e.fixed_rows_mut::<6>(4).copy_from(&self.during.vector());
        e.fixed_rows_mut::<6>(10).copy_from(&self.apart.vector());
        e
    }

    /// What a sensor without these errors would have observed.
    pub(crate) fn corrected(&self, sensed: &SensedTrack, rig: &StereoRig) -> SensedTrack {
        let mut track = sensed.track;
        let focal = 1.0 + self.focal;
        let depth = (1.0 + self.scale) * if sensed.source == TrackSource::Stereo { focal } else { 1.0 };
        for end in [&mut track.before, &mut track.after] {
            let [x, y, d] = end.mean.into();
            let centred = (x - self.centre_px.0, y - self.centre_px.1 * rig.aspect());
            end.mean = Vector3::new(centred.0 / focal, centred.1 / focal, d / depth);
        }
        let sensed = SensedTrack { track, ..*sensed };
        let rolled = self.during.scaled(sensed.row(rig));
        // Most often there is none, and it costs a projection.
        let moved = |excess: &Twist, xyd: &Vector3<f64>| match *excess == Twist::zero() {
            true => Some(*xyd),
            false => rig.project(&excess.exp().apply(&rig.point(xyd)?)),
        };
        let after = match sensed.source {
            TrackSource::Stereo => None,
            TrackSource::Depth => moved(&self.apart.scaled(-1.0), &track.after.mean),
            TrackSource::Image => moved(&rolled.scaled(-1.0), &track.after.mean)
                .and_then(|place| Some(sensed.read_again(&place, &moved(&self.apart, &place)?))),
        };
        let after = Gaussian { mean: after.unwrap_or(track.after.mean), ..track.after };
        SensedTrack { track: StereoTrack { after, ..track }, ..sensed }
    }
}

impl SensedTrack {
    /// Where in the image's height it begins, −½ … ½.
    pub(crate) fn row(&self, rig: &StereoRig) -> f64 {
        let before = &self.track.before.mean;
        let height = rig.height_px.max(1) as f64;
        (rig.pixel_from_image(before.x, before.y).1 + 0.5) / height - 0.5
    }

    /// The slope of the depth image's disparity along x and y around the later place, of which the covariance of the two
    /// speaks.
    fn slope(&self) -> Vector2<f64> {
        let cov = &self.track.after.cov;
        let place: Matrix2<f64> = cov.fixed_view::<2, 2>(0, 0).into();
        place.try_inverse().map_or_else(Vector2::zeros, |inverse| inverse * Vector2::new(cov.m13, cov.m23))
    }

    /// The later end at another `place`, with the disparity that a depth image would have there in which the point were
    /// not `apart` but at that place.
    fn read_again(&self, place: &Vector3<f64>, apart: &Vector3<f64>) -> Vector3<f64> {
        let after = &self.track.after.mean;
        let d = after.z + self.slope().dot(&(apart - after).xy()) - (apart.z - place.z);
        Vector3::new(place.x, place.y, d)
    }

    /// −∂e/∂(motion during read-out, motion apart), given that by φ.
    pub(crate) fn excess_jacobian(
        &self,
        motion_jacobian: &SMatrix<f64, 3, 6>,
        rig: &StereoRig,
    ) -> SMatrix<f64, 3, { ERRORS - CALIBRATION }> {
        let mut excess_jacobian = SMatrix::<f64, 3, { ERRORS - CALIBRATION }>::zeros();
        match self.source {
            TrackSource::Stereo => {}
            TrackSource::Image => {
                // The image sees the place, the depth image what surface is there.
                let slope = self.slope();
                let along = motion_jacobian.row(0) * slope.x + motion_jacobian.row(1) * slope.y;
                let mut place = *motion_jacobian;
                place.set_row(2, &along);
                excess_jacobian.fixed_columns_mut::<6>(0).copy_from(&(place * self.row(rig)));
                excess_jacobian.fixed_view_mut::<1, 6>(2, 6).copy_from(&(motion_jacobian.row(2) - along));
            }
            TrackSource::Depth => excess_jacobian.fixed_columns_mut::<6>(6).copy_from(motion_jacobian),
        }
        excess_jacobian
    }

    /// −∂e/∂(focal length, principal point, scale) of the misclosure e at a structure.
    ///
    /// At what the motion predicts, not at what was measured: that would shrink residuals by scaling them.
    pub(crate) fn calibration_jacobian(
        &self,
        structure: &Vector3<f64>,
        at: &LinearisationPoint<'_>,
    ) -> Option<SMatrix<f64, 3, CALIBRATION>> {
        let (predicted, structure_jacobian) = predict(structure, at)?;
        let change = |after: Vector3<f64>, before: Vector3<f64>| after - structure_jacobian * before;
        let scaled = Vector3::new(1.0, 1.0, if self.source == TrackSource::Stereo { 1.0 } else { 0.0 });
        let (x, y, d) = (Vector3::x(), Vector3::y() * at.rig().aspect(), Vector3::z());
        Some(SMatrix::from_columns(&[
            change(predicted.component_mul(&scaled), structure.component_mul(&scaled)),
            change(x, x),
            change(y, y),
            change(predicted.component_mul(&d), structure.component_mul(&d)),
        ]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    use crate::constrain::Measurement;

    #[test]
    fn corrections_and_derivatives_agree() {
        let rig = StereoRig::new(400.0, (150.0, 130.0), 0.1, (320, 240)).unwrap();
        let rig = StereoRig { focal_y_px: 410.0, ..rig };
        let phi = Twist { t: Vector3::new(0.03, -0.02, 0.05), omega: Vector3::new(0.01, -0.02, 0.015) };
        let at = LinearisationPoint::new(phi, &rig);
        let before = Vector3::new(-60.0, 45.0, 12.0);
        let after = rig.project(&phi.exp().apply(&rig.point(&before).unwrap())).unwrap();
        // Disparity read at a place that is not certain, on a slanted surface.
        let cov = Matrix3::new(0.1, 0.02, 0.006, 0.02, 0.1, -0.003, 0.006, -0.003, 0.1);
        let end = |mean: Vector3<f64>| Gaussian { mean, cov };
        for source in [TrackSource::Stereo, TrackSource::Image, TrackSource::Depth] {
            let sensed =
                SensedTrack { track: StereoTrack { before: end(before), after: end(after) }, source };
            let exact = sensed.track.linearise(&mut before.clone(), &at).unwrap();
            let mut columns = SMatrix::<f64, 3, ERRORS>::zeros();
            columns.fixed_columns_mut::<4>(0).copy_from(&sensed.calibration_jacobian(&before, &at).unwrap());
            columns
                .fixed_columns_mut::<12>(4)
                .copy_from(&sensed.excess_jacobian(&exact.motion_jacobian, &rig));
            for k in 0..ERRORS {
                let misclosure = |h: f64| {
                    let errors = SensorErrors::from_vector(&(SVector::ith(k, h)));
                    let track = errors.corrected(&sensed, &rig).track;
                    track.linearise(&mut track.before.mean.clone(), &at).unwrap().e
                };
                let h = 1e-5;
                let numeric = (misclosure(-h) - misclosure(h)) / (2.0 * h);
                let error = (numeric - columns.column(k)).amax();
                assert!(
                    error < 1e-5 * (1.0 + numeric.amax()),
                    "{source:?} {k}: {numeric} {}",
                    columns.column(k)
                );
            }
        }
    }
}
