//! Errors of a sensor that all its observations share, what they do to an observation, and the observation without them.
//!
//! No number of pixels averages out a wrong focal length, nor an image whose last row is taken after its first
//! while the camera moves. Each such error is a parameter with the mean and the standard deviation
//! that the [`Tolerance`](super::tolerance::Tolerance) states; observations may tell more of it
//! ([`super::augmented`]). What an error does to an observation is undone by [`SensorErrors::corrected`].
//!
//! A rolling shutter sees a point on row r (−½ … ½ of the image's height) by r times the read-out later than the middle
//! row. So the point of a track has moved for the interval and the read-out times (r′ − r), and its depth, which the depth
//! image shows at one time for all rows, is that of another time than its place. Both ends are led to the time of the
//! middle row, by the motion φ itself and by its change (Meilland, Drummond and Comport 2013; Kerl, Stückler and
//! Cremers 2015).

use nalgebra::{Matrix2, SMatrix, SVector, Vector2, Vector3};

use crate::constrain::{LinearisationPoint, predict};
use crate::geometry::{Gaussian, RIG_ERRORS, RigErrors, StereoRig, Twist};
use crate::observe::StereoTrack;

/// Number of a sensor's errors: the rig's, read-out, change of motion during read-out (6), motion between image and
/// depth (6).
pub(crate) const ERRORS: usize = RIG_ERRORS + SHUTTER + 6;
/// The first this many of the rig's errors are of its right camera, which a depth camera does not have.
pub(crate) const RIGHT_CAMERA: usize = 4;
/// The next this many are of the image's shutter.
pub(crate) const SHUTTER: usize = 7;

/// A plane of which a motion leaves less than this share of its distance is one that passes by the camera.
const LEAST_PLANE_SHARE: f64 = 0.5;

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
    /// On which rows of the image it begins and ends, −½ … ½ of the height from the middle, as measured.
    pub rows: [f64; 2],
}

/// Values of the errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SensorErrors {
    /// Errors of the calibration; of a depth camera, the baseline's is that of the scale of depth.
    pub rig: RigErrors,
    /// Time from the image's first row to its last, in intervals.
    pub readout: f64,
    /// By how much the motion that the image's last row sees exceeds that of its first.
    pub during: Twist,
    /// By how much the motion that depth images see exceeds that of images.
    pub apart: Twist,
}

impl SensorErrors {
    pub(crate) fn from_vector(e: &SVector<f64, ERRORS>) -> Self {
        Self {
            rig: RigErrors::from_vector(&e.fixed_rows::<RIG_ERRORS>(0).into()),
            readout: e[RIG_ERRORS],
            during: Twist::from_vector(&e.fixed_rows::<6>(RIG_ERRORS + 1).into()),
            apart: Twist::from_vector(&e.fixed_rows::<6>(RIG_ERRORS + SHUTTER).into()),
        }
    }

    pub(crate) fn vector(&self) -> SVector<f64, ERRORS> {
        let mut e = SVector::<f64, ERRORS>::zeros();
        e.fixed_rows_mut::<RIG_ERRORS>(0).copy_from(&self.rig.vector());
        e[RIG_ERRORS] = self.readout;
        e.fixed_rows_mut::<6>(RIG_ERRORS + 1).copy_from(&self.during.vector());
        e.fixed_rows_mut::<6>(RIG_ERRORS + SHUTTER).copy_from(&self.apart.vector());
        e
    }

    /// What a sensor without these errors would have observed where the scene moves as `at` says.
    pub(crate) fn corrected(&self, sensed: &SensedTrack, at: &LinearisationPoint<'_>) -> SensedTrack {
        let sensed = self.calibrated(sensed, at.rig());
        let StereoTrack { before, after } = sensed.track;
        let (before_mean, after_mean) = match sensed.source {
            TrackSource::Stereo => return sensed,
            TrackSource::Depth => (before.mean, led(&self.apart.scaled(-1.0), &after.mean, at.rig())),
            TrackSource::Image => self.at_the_middle_row(&sensed, at),
        };
        let track = StereoTrack {
            before: Gaussian { mean: before_mean, ..before },
            after: Gaussian { mean: after_mean, ..after },
        };
        SensedTrack { track, ..sensed }
    }

    /// Without the errors of the calibration.
    fn calibrated(&self, sensed: &SensedTrack, rig: &StereoRig) -> SensedTrack {
        let mut track = sensed.track;
        let errors = self.rig.vector();
        for end in [&mut track.before, &mut track.after] {
            end.mean -= sensed.source.calibration_jacobian(&end.mean, rig) * errors;
        }
        SensedTrack { track, ..*sensed }
    }

    /// The two ends where the image had them when its middle rows were taken, with depth read there.
    fn at_the_middle_row(
        &self,
        sensed: &SensedTrack,
        at: &LinearisationPoint<'_>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let rig = at.rig();
        let (before, after) = (&sensed.track.before.mean, &sensed.track.after.mean);
        let [slope, later_slope] = sensed.slopes(at);
        let [moved, later_moved] = self.since_the_middle_row(sensed.rows, at.phi());
        let place = led(&moved.scaled(-1.0), before, rig);
        let read = before.z + slope.dot(&(place - before).xy());
        let later_place = led(&later_moved.scaled(-1.0), after, rig);
        // The depth image has the point apart from there: its disparity there, less what it is by being apart.
        let apart = led(&self.apart, &later_place, rig);
        let later_read = after.z + later_slope.dot(&(apart - after).xy()) - (apart.z - later_place.z);
        (Vector3::new(place.x, place.y, read), Vector3::new(later_place.x, later_place.y, later_read))
    }

    /// How far the scene has moved, since the middle row was taken, when rows of the earlier and of the later image were.
    ///
    /// At t it moves by φ less half of its change in the interval, at t′ by as much more.
    fn since_the_middle_row(&self, rows: [f64; 2], phi: &Twist) -> [Twist; 2] {
        [(rows[0], -1.0), (rows[1], 1.0)].map(|(row, end)| {
            let time = self.readout * row;
            let changed = self.during.scaled(0.5 * row * (time + end));
            Twist::from_vector(&(phi.scaled(time).vector() + changed.vector()))
        })
    }
}

/// Where a small motion leads (x, y, d); the same where that is behind the camera.
fn led(motion: &Twist, xyd: &Vector3<f64>, rig: &StereoRig) -> Vector3<f64> {
    // Most often there is none, and it costs a projection.
    if *motion == Twist::zero() {
        return *xyd;
    }
    rig.point(xyd).and_then(|point| rig.project(&motion.exp().apply(&point))).unwrap_or(*xyd)
}

impl SensedTrack {
    /// A track as measured.
    pub(crate) fn new(track: StereoTrack, source: TrackSource, rig: &StereoRig) -> Self {
        let height = rig.height_px.max(1) as f64;
        let rows = [&track.before.mean, &track.after.mean]
            .map(|end| (rig.pixel_from_image(end.x, end.y).1 + 0.5) / height - 0.5);
        Self { track, source, rows }
    }

    /// The slopes of the depth images' disparity along x and y around the two places.
    ///
    /// The later one is in the covariance of the two. It makes a plane m · P = b with d = m · (x, y, f), which was at
    /// m₀ = Rᵀm b/(b − m · t) before the motion.
    fn slopes(&self, at: &LinearisationPoint<'_>) -> [Vector2<f64>; 2] {
        let (rig, after) = (at.rig(), &self.track.after);
        let place: Matrix2<f64> = after.cov.fixed_view::<2, 2>(0, 0).into();
        let cross = Vector2::new(after.cov.m13, after.cov.m23);
        let slope = place.try_inverse().map_or_else(Vector2::zeros, |inverse| inverse * cross);
        let depth = (after.mean.z - slope.dot(&after.mean.xy())) / rig.focal_px;
        let plane = Vector3::new(slope.x, slope.y, depth);
        let motion = at.motion();
        let left = 1.0 - plane.dot(&motion.translation) / rig.baseline_m;
        // A plane that the motion brings so much nearer passes by the camera, and its slope is unknown.
        let earlier =
            if left > LEAST_PLANE_SHARE { motion.rotation.transpose() * plane / left } else { plane };
        [earlier.xy(), slope]
    }

    /// −∂e/∂u of the misclosure e at a structure, u being the errors around `errors`.
    pub(crate) fn error_jacobian(
        &self,
        errors: &SensorErrors,
        structure: &Vector3<f64>,
        motion_jacobian: &SMatrix<f64, 3, 6>,
        at: &LinearisationPoint<'_>,
    ) -> Option<SMatrix<f64, 3, ERRORS>> {
        let (predicted, structure_jacobian) = predict(structure, at)?;
        let mut jacobian = SMatrix::<f64, 3, ERRORS>::zeros();
        // At what the motion predicts, not at what was measured: that would shrink residuals by scaling them.
        let [before, after] =
            [structure, &predicted].map(|xyd| self.source.calibration_jacobian(xyd, at.rig()));
        jacobian.fixed_columns_mut::<RIG_ERRORS>(0).copy_from(&(after - structure_jacobian * before));
        match self.source {
            TrackSource::Stereo => {}
            TrackSource::Depth => {
                jacobian.fixed_columns_mut::<6>(RIG_ERRORS + SHUTTER).copy_from(motion_jacobian);
            }
            TrackSource::Image => {
                // The image sees the place, the depth image what surface is there.
                let [slope, later_slope] = self.slopes(at);
                let later = along_surface(motion_jacobian, &later_slope);
                let earlier =
                    structure_jacobian * along_surface(&at.rig().velocity_jacobian(structure), &slope);
                let [row, later_row] = self.rows;
                let [time, later_time] = self.rows.map(|row| errors.readout * row);
                let (phi, change) = (at.phi().vector(), errors.during.vector());
                let velocity = |row: f64| (phi + change * (0.5 * row)) * row;
                let readout = later * velocity(later_row) - earlier * velocity(row);
                let during =
                    later * (0.5 * later_row * (later_time + 1.0)) - earlier * (0.5 * row * (time - 1.0));
                jacobian.set_column(RIG_ERRORS, &readout);
                jacobian.fixed_columns_mut::<6>(RIG_ERRORS + 1).copy_from(&during);
                let across = motion_jacobian.row(2) - later.row(2);
                jacobian.fixed_view_mut::<1, 6>(2, RIG_ERRORS + SHUTTER).copy_from(&across);
            }
        }
        Some(jacobian)
    }
}

impl TrackSource {
    /// ∂(x, y, d)/∂(errors of the calibration) of what is measured as (x, y, d).
    ///
    /// A depth camera measures depth by itself: its focal length scales places alone.
    fn calibration_jacobian(self, xyd: &Vector3<f64>, rig: &StereoRig) -> SMatrix<f64, 3, RIG_ERRORS> {
        let mut jacobian = RigErrors::jacobian(xyd, rig);
        if self != Self::Stereo {
            jacobian.fixed_columns_mut::<RIGHT_CAMERA>(0).fill(0.0);
            jacobian[(2, RIGHT_CAMERA)] = 0.0;
        }
        jacobian
    }
}

/// The derivative of a place with the disparity that its surface has there, of `slope`, from that of a point (x, y, d).
fn along_surface(of_point: &SMatrix<f64, 3, 6>, slope: &Vector2<f64>) -> SMatrix<f64, 3, 6> {
    let mut place = *of_point;
    place.set_row(2, &(of_point.row(0) * slope.x + of_point.row(1) * slope.y));
    place
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;

    use super::*;

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
            let track = StereoTrack { before: end(before), after: end(after) };
            let sensed = SensedTrack::new(track, source, &rig);
            let none = SensorErrors::from_vector(&SVector::zeros());
            let exact = sensed.track.linearise(&mut before.clone(), &at).unwrap();
            let columns = sensed.error_jacobian(&none, &before, &exact.motion_jacobian, &at).unwrap();
            for k in 0..ERRORS {
                let misclosure = |h: f64| {
                    let errors = SensorErrors::from_vector(&(SVector::ith(k, h)));
                    let track = errors.corrected(&sensed, &at).track;
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
