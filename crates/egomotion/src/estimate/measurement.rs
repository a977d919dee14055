//! Observations as three equations between what was measured and φ, linearised with their structure eliminated.

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector4};

use crate::geometry::{RigidMotion, StereoRig, Twist};
use crate::observe::{StereoFlow, StereoTrack};

/// The motion about which observations are linearised, with what they share.
#[derive(Debug, Clone, Copy)]
pub struct At<'a> {
    pub(super) phi: Twist,
    motion: RigidMotion,
    left_jacobian: Matrix6<f64>,
    rig: &'a StereoRig,
}

impl<'a> At<'a> {
    /// Linearise about φ.
    pub fn new(phi: Twist, rig: &'a StereoRig) -> Self {
        Self { motion: phi.exp(), left_jacobian: phi.left_jacobian(), phi, rig }
    }
}

/// Misclosure e of an observation, the inverse of its covariance S, and −∂e/∂φ.
#[derive(Debug, Clone, Copy)]
pub struct Linearised {
    pub(super) misclosure: Vector3<f64>,
    pub(super) inverse_cov: Matrix3<f64>,
    pub(super) by_phi: SMatrix<f64, 3, 6>,
}

/// A B, in place of the library's product for matrices of any size, which costs twice as much for those as small as here.
#[inline(always)]
pub(super) fn product<const N: usize, const K: usize, const M: usize>(
    a: &SMatrix<f64, N, K>,
    b: &SMatrix<f64, K, M>,
) -> SMatrix<f64, N, M> {
    let mut out = [[0.0; N]; M];
    // Stored by columns.
    let (a, b) = (&a.data.0, &b.data.0);
    for m in 0..M {
        for k in 0..K {
            for n in 0..N {
                out[m][n] += a[k][n] * b[m][k];
            }
        }
    }
    SMatrix::from_data(nalgebra::ArrayStorage(out))
}

/// S⁻¹ by S = L D Lᵀ; `None` unless S is positive definite, which rounding or a careless caller may break.
///
/// Where one quantity is known far better than another, cofactors would lose it in rounding.
fn inverse(s: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let (l21, l31) = (s.m12 / s.m11, s.m13 / s.m11);
    let d2 = s.m22 - l21 * s.m12;
    let rest = s.m23 - l31 * s.m12;
    let l32 = rest / d2;
    let d3 = s.m33 - l31 * s.m13 - l32 * rest;
    if !(s.m11 > 0.0 && d2 > 0.0 && d3 > 0.0) {
        return None;
    }
    // L⁻¹ has the rows (1), (a, 1), (c, b, 1).
    let (a, b, c) = (-l21, -l32, l21 * l32 - l31);
    let (i1, i2, i3) = (s.m11.recip(), d2.recip(), d3.recip());
    let (m12, m13, m23) = (a * i2 + c * b * i3, c * i3, b * i3);
    Some(Matrix3::new(i1 + a * a * i2 + c * c * i3, m12, m13, m12, i2 + b * b * i3, m23, m13, m23, i3))
}

/// An observation that maximum likelihood can use.
pub trait Measurement: Sync {
    /// Image coordinates (x, y), in pixels, to find the observation's block.
    fn position(&self) -> (f64, f64);
    /// First value (x, y, d) of the structure.
    fn structure(&self) -> Vector3<f64>;
    /// Linearise about a motion and a structure, and improve the structure; `None` behind the camera.
    fn linearise(&self, structure: &mut Vector3<f64>, at: &At<'_>) -> Option<Linearised>;
    /// How far the point moves in the left image, in pixels.
    fn displacement_px(&self) -> f64;
    /// The same observation with every disparity larger by so many pixels.
    fn with_disparity_offset(&self, px: f64) -> Self
    where
        Self: Sized;
}

/// How far a structure may move from where it was measured, in standard deviations.
const MOST_PULL: f64 = 5.0;

/// Factor that holds a structure back when its squared distance from the measured one is `square`.
///
/// An inlier is never pulled so far. An outlier would be pulled to where its derivatives are so
/// large that no robust weight tames them.
fn restraint(square: f64) -> f64 {
    if square > MOST_PULL * MOST_PULL { MOST_PULL / square.sqrt() } else { 1.0 }
}

impl Measurement for StereoTrack {
    fn position(&self) -> (f64, f64) {
        (self.before.mean.x, self.before.mean.y)
    }

    fn structure(&self) -> Vector3<f64> {
        self.before.mean
    }

    fn linearise(&self, s: &mut Vector3<f64>, at: &At<'_>) -> Option<Linearised> {
        let moved = at.motion.apply(&at.rig.point(s)?);
        let by_moved = at.rig.project_jacobian(&moved);
        let by_structure = product(&product(&by_moved, &at.motion.rotation), &at.rig.point_jacobian(s));
        let predicted = at.rig.project(&moved)?;
        let misclosure = self.after.mean - predicted - by_structure * (self.before.mean - *s);
        let gain = product(&self.before.cov, &by_structure.transpose());
        let cov = self.after.cov + product(&by_structure, &gain);
        let inverse_cov = inverse(&cov)?;
        let pull = inverse_cov * misclosure;
        let shift = gain * pull;
        let improved = self.before.mean + shift * restraint(pull.dot(&(by_structure * shift)));
        // A first guess may be wild; a structure must stay in front of the camera.
        if improved.z > 0.1 * s.z {
            *s = improved;
        }
        let by_motion = product(&by_moved, &RigidMotion::point_jacobian(&moved));
        let by_phi = product(&by_motion, &at.left_jacobian);
        Some(Linearised { misclosure, inverse_cov, by_phi })
    }

    fn displacement_px(&self) -> f64 {
        (self.after.mean - self.before.mean).xy().norm()
    }

    fn with_disparity_offset(&self, px: f64) -> Self {
        let mut shifted = *self;
        shifted.before.mean.z += px;
        shifted.after.mean.z += px;
        shifted
    }
}

impl Measurement for StereoFlow {
    fn position(&self) -> (f64, f64) {
        (self.x_px, self.y_px)
    }

    fn structure(&self) -> Vector3<f64> {
        Vector3::new(self.x_px, self.y_px, self.measured.mean[0])
    }

    fn linearise(&self, s: &mut Vector3<f64>, at: &At<'_>) -> Option<Linearised> {
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
        let by_d = scaled + rate;
        let z = bf / d;
        let mut by_phi = SMatrix::<f64, 3, 6>::zeros();
        by_phi.row_mut(0).copy_from_slice(&[f / z, 0.0, -x / z, -x * y / f, f + x * x / f, -y]);
        by_phi.row_mut(1).copy_from_slice(&[0.0, f / z, -y / z, -(f + y * y / f), x * y / f, x]);
        by_phi.row_mut(2).copy_from_slice(&[0.0, 0.0, -d / z, -y * d / f, x * d / f, 0.0]);
        // (d, v_x, v_y, v_x right) → (v_x, v_y, Δv) − prediction's change with d.
        let measured = &self.measured.mean;
        let flow = Vector3::new(measured[1], measured[2], measured[1] - measured[3]);
        let misclosure = flow - predicted - by_d * (measured[0] - d);
        let pick = SMatrix::<f64, 3, 4>::new(
            -by_d.x, 1.0, 0.0, 0.0, //
            -by_d.y, 0.0, 1.0, 0.0, //
            -by_d.z, 1.0, 0.0, -1.0,
        );
        let gain: Vector3<f64> = pick * self.measured.cov * Vector4::x();
        let cov = pick * self.measured.cov * pick.transpose();
        let inverse_cov = inverse(&cov)?;
        let shift = -gain.dot(&(inverse_cov * misclosure));
        let improved = measured[0] + shift * restraint(shift * shift / self.measured.cov[(0, 0)]);
        if improved > 0.1 * d {
            s.z = improved;
        }
        Some(Linearised { misclosure, inverse_cov, by_phi })
    }

    fn displacement_px(&self) -> f64 {
        self.measured.mean.fixed_rows::<2>(1).norm()
    }

    fn with_disparity_offset(&self, px: f64) -> Self {
        let mut shifted = *self;
        shifted.measured.mean[0] += px;
        shifted
    }
}
