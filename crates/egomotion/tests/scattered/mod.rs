//! Points scattered in front of the paper's rig, observed without error.
#![allow(dead_code, reason = "each test program uses a part of it")]

use egomotion::geometry::{Gaussian, StereoRig, Twist, image_flow};
use egomotion::observe::{DepthFlow, StereoFlow, StereoTrack};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

pub fn rig() -> StereoRig {
    StereoRig::new(5.0 / 0.012, (159.5, 119.5), 0.13, (320, 240)).unwrap()
}

pub fn random(seed: u64) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(seed)
}

/// A motion with all six components, a few pixels of flow.
pub fn phi() -> Twist {
    Twist::from_vector(&Vector6::new(0.012, -0.009, -0.03, 0.004, -0.006, 0.003))
}

/// N independent unit normals.
pub fn normals<const N: usize>(rng: &mut Pcg64Mcg) -> SVector<f64, N> {
    SVector::from_fn(|_, _| StandardNormal.sample(rng))
}

/// (x, y, d) all over the image, 1 to 8 m away.
pub fn places(count: usize, rng: &mut Pcg64Mcg) -> Vec<Vector3<f64>> {
    (0..count)
        .map(|_| {
            let (x, y) = (rng.random_range(-159.5..159.5), rng.random_range(-119.5..119.5));
            Vector3::new(x, y, rng.random_range(7.0..54.0))
        })
        .collect()
}

/// A covariance with every correlation, of about the size `sigma`².
pub fn correlated<const N: usize>(sigma: f64, rng: &mut Pcg64Mcg) -> SMatrix<f64, N, N> {
    let root =
        SMatrix::<f64, N, N>::from_fn(|i, j| f64::from(u8::from(i == j)) + rng.random_range(-0.5..0.5));
    root * root.transpose() * (sigma * sigma)
}

/// Where (x, y, d) goes.
pub fn moved(xyd: &Vector3<f64>, phi: &Twist, rig: &StereoRig) -> Vector3<f64> {
    rig.project(&phi.exp().apply(&rig.point(xyd).unwrap())).unwrap()
}

/// The discrete observation of a point, ends of equal covariance.
pub fn track(xyd: &Vector3<f64>, phi: &Twist, rig: &StereoRig, cov: Matrix3<f64>) -> StereoTrack {
    StereoTrack { before: Gaussian { mean: *xyd, cov }, after: Gaussian { mean: moved(xyd, phi, rig), cov } }
}

/// The binocular flow of a point by (3) in both cameras.
pub fn stereo_flow(xyd: &Vector3<f64>, phi: &Twist, rig: &StereoRig, variances: [f64; 4]) -> StereoFlow {
    let [x, y, d] = (*xyd).into();
    let z = rig.depth(d).unwrap();
    let left = image_flow(phi, x, y, z, rig.focal_px);
    let right = phi.seen_from(&Vector3::new(rig.baseline_m, 0.0, 0.0));
    let right = image_flow(&right, x - d, y, z, rig.focal_px);
    StereoFlow { x_px: x, y_px: y, measured: Gaussian::independent([d, left.x, left.y, right.x], variances) }
}

/// The depth change at a place where disparity has the gradient `slope`: d_t follows from ḋ = d_x v_x + d_y v_y + d_t.
pub fn depth_flow(xyd: &Vector3<f64>, slope: [f64; 2], phi: &Twist, rig: &StereoRig) -> DepthFlow {
    let flow = stereo_flow(xyd, phi, rig, [1.0; 4]);
    let [d, vx, vy, _] = flow.measured.mean.into();
    let rate = flow.disparity_rate() - slope[0] * vx - slope[1] * vy;
    DepthFlow {
        x_px: xyd.x,
        y_px: xyd.y,
        disparity: Gaussian::independent([d, slope[0], slope[1], rate], [1.0; 4]),
        flow: Gaussian::independent([vx, vy], [1.0; 2]),
    }
}

/// Places on the plane n · P = distance that an even grid of pixels sees, with the gradient of disparity there.
pub fn plane(n: &Vector3<f64>, distance: f64, step: usize, rig: &StereoRig) -> Vec<(Vector3<f64>, [f64; 2])> {
    let (f, b) = (rig.focal_px, rig.baseline_m);
    let slope = [n.x, n.y].map(|c| c * b / distance);
    let mut seen = Vec::new();
    for v in (step / 2..rig.height_px).step_by(step) {
        for u in (step / 2..rig.width_px).step_by(step) {
            let (x, y) = rig.image_from_pixel(u as f64, v as f64);
            // Z n · (x, y, f) / f = distance, so that d is linear in (x, y).
            let d = b * (n.x * x + n.y * y + n.z * f) / distance;
            if d > 3.0 {
                seen.push((Vector3::new(x, y, d), slope));
            }
        }
    }
    seen
}
