//! The flow of the still world, from disparity and the camera's motion.
//!
//! A point at (x, y, d) is P = (x, y, f) b/d; after the motion (R, t) it is seen where
//! q = R (x, y, f) + t d/b points: x′ = f q_x/q_z, y′ = f q_y/q_z, d′ = f d/q_z. All of it is linear in x
//! and d but for one division.

use super::FlowField;
use super::step_planes::{FlowPlanes, FlowRows};
use crate::geometry::{RigidMotion, StereoRig, Twist};
use crate::observe::disparity::{DisparityMap, GUESS_SIGMA_PX};
use crate::simd::vectorised;
use rayon::prelude::*;

/// Standard deviation of the prediction for what disparity does not tell (the motion's own error), in pixels.
const MOTION_SIGMA_PX: f32 = 0.1;
/// Growth of a bridged disparity's standard deviation with the difference of the ends of its gap: it holds either end.
const BRIDGE_SIGMA_PER_STEP: f32 = 0.3;
/// Rows handled by one task: more make the work of tasks uneven, fewer cost time to start them.
const STRIP_ROWS: usize = 16;

/// Which camera's flow is predicted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The left one, which disparity belongs to.
    Left,
    /// The right one.
    Right,
}

/// What every pixel of a camera does if the world stands still and points move by `phi` in the camera's
/// frame, with the covariance that comes from disparity's.
///
/// Where disparity is missing it is bridged along the row, and rows without any take the nearest row's;
/// such values are guesses, and so is their covariance. Pixels that end up behind the camera are missing.
pub fn rigid_flow(disparity: &DisparityMap, rig: &StereoRig, phi: &Twist, side: Side) -> FlowField {
    let (width, height) = disparity.shift.size();
    let motion = phi.exp();
    let rows = nearest_rows(disparity);
    let mut planes = FlowPlanes::filled(width, height, f32::NAN);
    planes.strips(STRIP_ROWS).into_par_iter().enumerate().for_each_init(
        || (vec![0.0_f32; width], vec![0.0_f32; width]),
        |(shift, sigma), (strip, mut out)| {
            for k in 0..out.u.len() / width.max(1) {
                let v = strip * STRIP_ROWS + k;
                let Some(&Some(source)) = rows.get(v) else { continue };
                let (from_shift, from_sigma) = (disparity.shift.row(source), disparity.sigma.row(source));
                match side {
                    Side::Left => {
                        shift.copy_from_slice(from_shift);
                        sigma.copy_from_slice(from_sigma);
                    }
                    Side::Right => seen_from_right(from_shift, from_sigma, shift, sigma),
                }
                bridge(shift, sigma, side);
                predict(&RowTerms::new(rig, &motion, v, side), shift, sigma, out.row(k, width));
            }
        },
    );
    planes.into_field()
}

/// For each row the nearest one that has any disparity.
fn nearest_rows(disparity: &DisparityMap) -> Vec<Option<usize>> {
    let height = disparity.shift.height();
    let known = |v: usize| disparity.shift.row(v).iter().any(|d| !d.is_nan());
    let known: Vec<usize> = (0..height).into_par_iter().filter(|&v| known(v)).collect();
    let nearest = |v: usize| {
        let next = known.partition_point(|&row| row < v);
        let around = [next.checked_sub(1), Some(next)].into_iter().flatten();
        around.filter_map(|i| known.get(i)).copied().min_by_key(|row| row.abs_diff(v))
    };
    (0..height).map(nearest).collect()
}

/// A row of disparity on the right camera's pixels; of two points at one pixel the nearer hides the other.
fn seen_from_right(shift: &[f32], sigma: &[f32], to_shift: &mut [f32], to_sigma: &mut [f32]) {
    to_shift.fill(f32::NAN);
    to_sigma.fill(f32::NAN);
    for (u, (&d, &s)) in shift.iter().zip(sigma).enumerate() {
        let at = (u as f32 - d).round();
        if at >= 0.0
            && let Some(there) = to_shift.get_mut(at as usize)
            && (there.is_nan() || d > *there)
        {
            *there = d;
            to_sigma[at as usize] = s;
        }
    }
}

/// Fill the gaps of a row from their ends: linearly in the left camera; in the right one with the farther
/// end, for there a gap is what the left camera does not see.
fn bridge(shift: &mut [f32], sigma: &mut [f32], side: Side) {
    let mut last: Option<usize> = None;
    for u in 0..=shift.len() {
        if shift.get(u).is_some_and(|d| d.is_nan()) {
            continue;
        }
        let gap = last.map_or(0, |l| l + 1)..u.min(shift.len());
        if !gap.is_empty() {
            let before = last.map(|l| shift[l]);
            let (a, b) = match (before, shift.get(u).copied()) {
                (Some(a), Some(b)) if side == Side::Left => (a, b),
                (Some(a), Some(b)) => (a.min(b), a.min(b)),
                (Some(a), None) | (None, Some(a)) => (a, a),
                (None, None) => return,
            };
            let step = (b - a) / (gap.len() + 1) as f32;
            for (k, u) in gap.enumerate() {
                shift[u] = a + step * (k + 1) as f32;
                sigma[u] = GUESS_SIGMA_PX + BRIDGE_SIGMA_PER_STEP * (b - a).abs();
            }
        }
        last = Some(u);
    }
}

/// What is the same along a row.
struct RowTerms {
    /// x of the first pixel, and f.
    x: f32,
    focal: f32,
    /// q of the first pixel at infinity, and its growth with x and with d.
    q: [f32; 3],
    by_x: [f32; 3],
    by_d: [f32; 3],
    y: f32,
    aspect: f32,
    doffs: f32,
    /// 1 for the right camera: its x is that of the left one less d.
    right: f32,
}

impl RowTerms {
    fn new(rig: &StereoRig, motion: &RigidMotion, v: usize, side: Side) -> Self {
        let (x, y) = rig.image_from_pixel(0.0, v as f64);
        let r = &motion.rotation;
        Self {
            x: x as f32,
            focal: rig.focal_px as f32,
            q: [0, 1, 2].map(|i| (r[(i, 1)] * y + r[(i, 2)] * rig.focal_px) as f32),
            by_x: [0, 1, 2].map(|i| r[(i, 0)] as f32),
            by_d: [0, 1, 2].map(|i| (motion.translation[i] / rig.baseline_m) as f32),
            y: y as f32,
            aspect: rig.aspect() as f32,
            doffs: rig.doffs_px as f32,
            right: if side == Side::Right { 1.0 } else { 0.0 },
        }
    }
}

vectorised! {
/// Flow and covariance of a row.
predict(terms: &RowTerms, shift: &[f32], sigma: &[f32], out: FlowRows<'_>) {
    let n = shift.len();
    let sigma = &sigma[..n];
    let FlowRows { u, v, uu, uv, vv } = out;
    let (u, v) = (&mut u[..n], &mut v[..n]);
    let (uu, uv, vv) = (&mut uu[..n], &mut uv[..n], &mut vv[..n]);
    let RowTerms { focal, q, by_x, by_d, right, .. } = *terms;
    for i in 0..n {
        let d = shift[i] + terms.doffs;
        let d = if d < 0.0 { 0.0 } else { d };
        let x = terms.x + i as f32 + right * shift[i];
        let q0 = q[0] + by_x[0] * x + by_d[0] * d;
        let q1 = q[1] + by_x[1] * x + by_d[1] * d;
        let q2 = q[2] + by_x[2] * x + by_d[2] * d;
        let scale = focal / q2;
        let (x1, y1) = (q0 * scale, q1 * scale);
        let per_d = scale / focal;
        // d′ − d = d (f/q_z − 1), and its growth with d.
        let change = right * d * (scale - 1.0);
        let change_by_d = right * (scale - 1.0 - d * scale * per_d * by_d[2]);
        let u_by_d = (by_d[0] * focal - x1 * by_d[2]) * per_d - change_by_d;
        let v_by_d = (by_d[1] * focal - y1 * by_d[2]) * per_d / terms.aspect;
        let variance = sigma[i] * sigma[i];
        let ahead = if q2 > 0.0 { 0.0 } else { f32::NAN };
        u[i] = x1 - x - change + ahead;
        v[i] = (y1 - terms.y) / terms.aspect + ahead;
        uu[i] = u_by_d * u_by_d * variance + MOTION_SIGMA_PX * MOTION_SIGMA_PX;
        uv[i] = u_by_d * v_by_d * variance;
        vv[i] = v_by_d * v_by_d * variance + MOTION_SIGMA_PX * MOTION_SIGMA_PX;
    }
}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Field, Grid};
    use nalgebra::Vector3;

    #[test]
    fn the_prediction_is_the_projection_of_the_moved_points_in_both_cameras() {
        let mut rig = StereoRig::new(420.0, (31.2, 22.7), 0.21, (64, 48)).unwrap();
        (rig.focal_y_px, rig.doffs_px) = (400.0, 1.5);
        let phi = Twist { t: Vector3::new(0.1, -0.03, -0.6), omega: Vector3::new(0.01, -0.02, 0.015) };
        // Whole pixels of disparity: the right camera's pixels are hit in the middle.
        let shift = Grid::from_fn(64, 48, |_, v| (4 + v / 12) as f32);
        let map = DisparityMap {
            sigma: Field::from_grid(Grid::filled(64, 48, 0.0)),
            shift: Field::from_grid(shift),
        };
        for side in [Side::Left, Side::Right] {
            let flow = rigid_flow(&map, &rig, &phi, side);
            for (u, v) in [(10, 3), (40, 20), (50, 47)] {
                let s = f64::from(map.shift.get(u, v).unwrap());
                let (x, y) = rig.image_from_pixel(u as f64, v as f64);
                let before = Vector3::new(x, y, rig.disparity_from_shift(s));
                let after = rig.project(&phi.exp().apply(&rig.point(&before).unwrap())).unwrap();
                let (mut u1, v1) = rig.pixel_from_image(after.x, after.y);
                let mut from = u as f64;
                if side == Side::Right {
                    from -= s;
                    u1 -= rig.shift_from_disparity(after.z);
                }
                let at = (from as usize, v);
                assert!((f64::from(flow.u.get(at.0, at.1).unwrap()) - (u1 - from)).abs() < 1e-3);
                assert!((f64::from(flow.v.get(at.0, at.1).unwrap()) - (v1 - v as f64)).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn gaps_are_bridged_and_say_so() {
        let nan = f32::NAN;
        for (side, expected) in
            [(Side::Left, [2.0, 2.0, 3.0, 4.0, 5.0, 5.0]), (Side::Right, [2.0, 2.0, 2.0, 2.0, 5.0, 5.0])]
        {
            let mut shift = [nan, 2.0, nan, nan, 5.0, nan];
            let mut sigma = shift.map(|d: f32| if d.is_nan() { nan } else { 0.1 });
            bridge(&mut shift, &mut sigma, side);
            assert_eq!(shift, expected);
            assert!(sigma[0] >= 1.0 && sigma[1] == 0.1 && sigma[2] >= 1.0 && sigma[5] >= 1.0);
        }
        let mut none = [nan; 3];
        bridge(&mut none, &mut [nan; 3], Side::Left);
        assert!(none.iter().all(|d| d.is_nan()));
    }
}
