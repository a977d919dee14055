//! Observations as three equations between what was measured and φ, linearised with their structure eliminated.
//!
//! An observation measures a point's structure (x, y, d) and where the point goes. The *misclosure* e is the difference
//! between what was seen after the motion and what the motion predicts of the structure. The structure is eliminated:
//! its noise goes through the prediction into the covariance S of e, so that φ is the only unknown left. A field whose
//! name ends in `_jacobian` is a derivative, whose rows are those of e.

use nalgebra::{ArrayStorage, Matrix3, Matrix6, SMatrix, Vector3, Vector4};

use crate::geometry::gaussian::{accumulate, product};
use crate::geometry::{RIG_ERRORS, RigErrors, RigidMotion, StereoRig, Twist};
use crate::observe::{StereoFlow, StereoTrack};

/// How far a structure may move from where it was measured, in standard deviations.
///
/// An inlier is never pulled so far. An outlier would be pulled to where its derivatives are so large that no robust
/// weight tames them.
const LARGEST_STRUCTURE_SHIFT: f64 = 5.0;
/// A structure keeps its last value when a step would leave it less than this share of its disparity: a first guess may
/// be wild, and a structure must stay in front of the camera.
const LEAST_DISPARITY_SHARE: f64 = 0.1;

/// The motion about which observations are linearised, and the rig that made them.
#[derive(Debug, Clone, Copy)]
pub struct LinearisationPoint<'a> {
    phi: Twist,
    motion: RigidMotion,
    rig: &'a StereoRig,
}

impl<'a> LinearisationPoint<'a> {
    /// The motion φ, per interval, seen by `rig`.
    pub fn new(phi: Twist, rig: &'a StereoRig) -> Self {
        Self { motion: phi.exp(), phi, rig }
    }

    /// The rig.
    pub(crate) fn rig(&self) -> &'a StereoRig {
        self.rig
    }

    /// The motion φ, per interval.
    pub(crate) fn phi(&self) -> &Twist {
        &self.phi
    }

    /// What φ does to points in one interval.
    pub(crate) fn motion(&self) -> &RigidMotion {
        &self.motion
    }
}

/// The misclosure e of an observation, the inverse of its covariance S, and how e changes.
#[derive(Debug, Clone, Copy)]
pub struct Misclosure {
    /// e, in pixels: what was seen after the motion less what the motion predicts.
    pub e: Vector3<f64>,
    /// S⁻¹, in 1/px².
    pub inverse_cov: Matrix3<f64>,
    /// −∂e/∂δ, where δ is the small motion of [`Measurement::small_motion_jacobian`].
    pub motion_jacobian: SMatrix<f64, 3, 6>,
}

/// How the misclosure e of an observation changes with errors that all observations of a pair share.
#[derive(Debug, Clone, Copy)]
pub struct SharedJacobian {
    /// ∂e per pixel of the amplitude by which x, y, and disparity (of flows the right camera's x) err with
    /// their sub-pixel phase, one a column.
    pub(crate) phase: Matrix3<f64>,
    /// ∂e per unit of each of [`RigErrors`].
    pub(crate) rig: SMatrix<f64, 3, RIG_ERRORS>,
}

/// S⁻¹ by S = L D Lᵀ; `None` unless S is positive definite, which rounding or a careless caller may break.
///
/// Where one quantity is known far better than another, cofactors would lose it in rounding.
#[inline(always)]
fn inverse(s: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let i1 = s.m11.recip();
    let (l21, l31) = (s.m12 * i1, s.m13 * i1);
    let d2 = s.m22 - l21 * s.m12;
    let rest = s.m23 - l31 * s.m12;
    let i2 = d2.recip();
    let l32 = rest * i2;
    let d3 = s.m33 - l31 * s.m13 - l32 * rest;
    if !(s.m11 > 0.0 && d2 > 0.0 && d3 > 0.0) {
        return None;
    }
    // L⁻¹ has the rows (1), (a, 1), (c, b, 1).
    let (a, b, c) = (-l21, -l32, l21 * l32 - l31);
    let i3 = d3.recip();
    let (m12, m13, m23) = (a * i2 + c * b * i3, c * i3, b * i3);
    Some(Matrix3::new(i1 + a * a * i2 + c * c * i3, m12, m13, m12, i2 + b * b * i3, m23, m13, m23, i3))
}

/// An observation that is three equations between what was measured and φ.
pub trait Measurement: Copy + Send + Sync {
    /// Image coordinates (x, y), in pixels, to find the observation's block.
    fn position(&self) -> (f64, f64);
    /// First value (x, y, d) of the structure, in pixels.
    fn structure(&self) -> Vector3<f64>;
    /// Linearise about a motion and a structure, and improve the structure; `None` behind the camera.
    fn linearise(&self, structure: &mut Vector3<f64>, at: &LinearisationPoint<'_>) -> Option<Misclosure>;
    /// Image coordinates (x, y) where the point is in the later frame, in pixels.
    fn later_position(&self) -> (f64, f64);
    /// How the misclosure changes with shared errors, at a structure; `None` behind the camera.
    fn shared_jacobian(
        &self,
        structure: &Vector3<f64>,
        at: &LinearisationPoint<'_>,
    ) -> Option<SharedJacobian>;
    /// ∂δ/∂φ of the small motion δ by which observations of this kind are linearised: it is the same for
    /// all of them, so it is applied to sums.
    fn small_motion_jacobian(at: &LinearisationPoint<'_>) -> Matrix6<f64>;
}

/// The wave of period 1 and amplitude 1 that sin 2πu is, by two parabolas.
///
/// So do matches err with the fraction of a pixel by which they are displaced: not at whole pixels, where both
/// images are sampled alike, nor half-way, where either side pulls as much.
#[inline(always)]
pub(crate) fn phase_wave(u: f64) -> f64 {
    let phase = u - u.round();
    8.0 * phase * (1.0 - 2.0 * phase.abs())
}

/// Factor that holds a structure back when its squared distance from the measured one is `square`.
fn restraint(square: f64) -> f64 {
    const LIMIT: f64 = LARGEST_STRUCTURE_SHIFT;
    if square > LIMIT * LIMIT { LIMIT / square.sqrt() } else { 1.0 }
}

/// Where the motion leads a structure (x, y, d), and how that changes with the structure; `None` behind the camera.
#[inline(always)]
pub(crate) fn predict(s: &Vector3<f64>, at: &LinearisationPoint<'_>) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    let point = at.rig.point(s)?;
    let (turn, from) = (&at.motion.rotation, &at.motion.translation);
    let moved = at.motion.apply(&point);
    let predicted = at.rig.project(&moved)?;
    // (X, Y, Z) is (x, y, f) b/d.
    let k = at.rig.baseline_m / s.z;
    let column = |x: f64, y: f64, z: f64| at.rig.projected_change(&moved, &Vector3::new(x, y, z)).into();
    let structure_jacobian = Matrix3::from_data(ArrayStorage([
        column(turn.m11 * k, turn.m21 * k, turn.m31 * k),
        column(turn.m12 * k, turn.m22 * k, turn.m32 * k),
        {
            let per_px = -s.z.recip();
            column((moved.x - from.x) * per_px, (moved.y - from.y) * per_px, (moved.z - from.z) * per_px)
        },
    ]));
    Some((predicted, structure_jacobian))
}

impl Measurement for StereoTrack {
    fn position(&self) -> (f64, f64) {
        (self.before.mean.x, self.before.mean.y)
    }

    fn structure(&self) -> Vector3<f64> {
        self.before.mean
    }

    #[inline(always)]
    fn linearise(&self, s: &mut Vector3<f64>, at: &LinearisationPoint<'_>) -> Option<Misclosure> {
        let (predicted, structure_jacobian) = predict(s, at)?;
        let e = self.after.mean - predicted - product(&structure_jacobian, &(self.before.mean - *s));
        let gain = product(&self.before.cov, &structure_jacobian.transpose());
        let mut cov = self.after.cov;
        accumulate(&mut cov, &structure_jacobian, &gain);
        let inverse_cov = inverse(&cov)?;
        let pull = product(&inverse_cov, &e);
        let change = product(&gain, &pull);
        let improved =
            self.before.mean + change * restraint(pull.dot(&product(&structure_jacobian, &change)));
        if improved.z > LEAST_DISPARITY_SHARE * s.z {
            *s = improved;
        }
        let motion_jacobian = at.rig.velocity_jacobian(&predicted);
        Some(Misclosure { e, inverse_cov, motion_jacobian })
    }

    fn later_position(&self) -> (f64, f64) {
        (self.after.mean.x, self.after.mean.y)
    }

    fn shared_jacobian(&self, s: &Vector3<f64>, at: &LinearisationPoint<'_>) -> Option<SharedJacobian> {
        let (predicted, structure_jacobian) = predict(s, at)?;
        let (before, after) = (&self.before.mean, &self.after.mean);
        // What matching displaces is the shift, of which the disparity is a constant away.
        let shift = |d: f64| at.rig.shift_from_disparity(d);
        let phase = Matrix3::from_data(ArrayStorage([
            [phase_wave(after.x - before.x), 0.0, 0.0],
            [0.0, phase_wave(after.y - before.y), 0.0],
            (Vector3::z() * phase_wave(shift(after.z))
                - structure_jacobian.column(2) * phase_wave(shift(before.z)))
            .into(),
        ]));
        let [early, late] = [s, &predicted].map(|xyd| RigErrors::jacobian(xyd, at.rig));
        Some(SharedJacobian { phase, rig: late - structure_jacobian * early })
    }

    /// Motions are composed: exp(φ + dφ) = exp(δ) exp(φ).
    fn small_motion_jacobian(at: &LinearisationPoint<'_>) -> Matrix6<f64> {
        at.phi.left_jacobian()
    }
}

impl Measurement for StereoFlow {
    fn position(&self) -> (f64, f64) {
        (self.x_px, self.y_px)
    }

    fn structure(&self) -> Vector3<f64> {
        Vector3::new(self.x_px, self.y_px, self.measured.mean[0])
    }

    fn linearise(&self, s: &mut Vector3<f64>, at: &LinearisationPoint<'_>) -> Option<Misclosure> {
        let (x, y, d) = (s.x, s.y, s.z);
        if d <= 0.0 {
            return None;
        }
        let (f, bf) = (at.rig.focal_px, at.rig.depth_disparity_product());
        let (t, w) = (&at.phi.t, &at.phi.omega);
        // (3) for v_x and v_y of the left camera, and disparity's rate Δv = −(d²/(b f)) VZ of (9).
        let scaled = Vector3::new(f * t.x - x * t.z, f * t.y - y * t.z, -d * t.z) / bf;
        let turned = Vector3::new(
            -x * y / f * w.x + (f + x * x / f) * w.y - y * w.z,
            -(f + y * y / f) * w.x + x * y / f * w.y + x * w.z,
            -(y * w.x - x * w.y) * d / f,
        );
        let predicted = scaled * d + turned;
        let rate = Vector3::new(0.0, 0.0, scaled.z + turned.z / d);
        let disparity_jacobian = scaled + rate;
        // (d, v_x, v_y, v_x right) → (v_x, v_y, Δv) − prediction's change with d.
        let measured = &self.measured.mean;
        let flow = Vector3::new(measured[1], measured[2], measured[1] - measured[3]);
        let e = flow - predicted - disparity_jacobian * (measured[0] - d);
        let pick = SMatrix::<f64, 3, 4>::new(
            -disparity_jacobian.x,
            1.0,
            0.0,
            0.0, //
            -disparity_jacobian.y,
            0.0,
            1.0,
            0.0, //
            -disparity_jacobian.z,
            1.0,
            0.0,
            -1.0,
        );
        let gain: Vector3<f64> = pick * self.measured.cov * Vector4::x();
        let cov = pick * self.measured.cov * pick.transpose();
        let inverse_cov = inverse(&cov)?;
        let shift = -gain.dot(&(inverse_cov * e));
        let improved = measured[0] + shift * restraint(shift * shift / self.measured.cov[(0, 0)]);
        if improved > LEAST_DISPARITY_SHARE * d {
            s.z = improved;
        }
        let motion_jacobian = at.rig.velocity_jacobian(&Vector3::new(x, y, d));
        Some(Misclosure { e, inverse_cov, motion_jacobian })
    }

    fn later_position(&self) -> (f64, f64) {
        (self.x_px + self.measured.mean[1], self.y_px + self.measured.mean[2])
    }

    fn shared_jacobian(&self, s: &Vector3<f64>, at: &LinearisationPoint<'_>) -> Option<SharedJacobian> {
        let (x, y, d) = (s.x, s.y, s.z);
        if d <= 0.0 {
            return None;
        }
        let (f, bf) = (at.rig.focal_px, at.rig.depth_disparity_product());
        let (t, w) = (&at.phi.t, &at.phi.omega);
        // ∂(v_x, v_y, Δv)/∂(x, y, d) of what `linearise` predicts.
        let going = -t.z * d / bf;
        let structure_jacobian = Matrix3::new(
            going + (2.0 * x * w.y - y * w.x) / f,
            -x / f * w.x - w.z,
            (f * t.x - x * t.z) / bf,
            y / f * w.y + w.z,
            going + (x * w.y - 2.0 * y * w.x) / f,
            (f * t.y - y * t.z) / bf,
            d / f * w.y,
            -d / f * w.x,
            2.0 * going - (y * w.x - x * w.y) / f,
        );
        let measured = &self.measured.mean;
        let [x_wave, y_wave, right] = [1, 2, 3].map(|i| phase_wave(measured[i]));
        let phase =
            Matrix3::from_data(ArrayStorage([[x_wave, 0.0, x_wave], [0.0, y_wave, 0.0], [0.0, 0.0, -right]]));
        let moved = s + 0.5 * Vector3::new(measured[1], measured[2], measured[1] - measured[3]);
        let [here, early, late] = [*s, 2.0 * s - moved, moved].map(|xyd| RigErrors::jacobian(&xyd, at.rig));
        Some(SharedJacobian { phase, rig: late - early - structure_jacobian * here })
    }

    /// Velocities add up.
    fn small_motion_jacobian(_: &LinearisationPoint<'_>) -> Matrix6<f64> {
        Matrix6::identity()
    }
}
