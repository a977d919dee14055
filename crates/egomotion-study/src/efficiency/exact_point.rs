//! Exact points, and what one motion does to each: the truth to which noise is added.

use nalgebra::{Vector2, Vector3};

use crate::synthetic::{FrameTime, SyntheticWorld, UsablePixel};
use egomotion::geometry::{StereoRig, Twist};

/// An exact point of the left image. Disparities and their slopes are in pixels and pixels per pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ExactPoint {
    /// (x, y, d) at t.
    pub(super) xyd: Vector3<f64>,
    /// (x, y, d) at t′.
    pub(super) later: Vector3<f64>,
    /// (vx, vy, ḋ) at t, of the point, per interval.
    pub(super) rate: Vector3<f64>,
    /// Slope (d_x, d_y) of the surface's disparity at t.
    pub(super) slope: Vector2<f64>,
    /// The same at t′.
    pub(super) slope_later: Vector2<f64>,
    /// Disparity at t′ at the same place of the image.
    pub(super) later_here: f64,
    /// Its rate d_t at the same place of the image.
    pub(super) rate_here: f64,
}

impl ExactPoint {
    /// A pixel of the synthetic world.
    pub(super) fn of_world(world: &SyntheticWorld, pixel: &UsablePixel) -> Self {
        let width = world.rig.width_px;
        let at =
            |when: FrameTime, index: usize| world.disparity(when).get(index).copied().unwrap_or(f64::NAN);
        let i = pixel.index;
        let slope = |when| {
            let half = |a: usize, b: usize| 0.5 * (at(when, a) - at(when, b));
            Vector2::new(half(i + 1, i - 1), half(i + width, i - width))
        };
        let flow = pixel.flow_left;
        Self {
            xyd: pixel.xyd,
            later: pixel.later_xyd,
            rate: Vector3::new(flow.x, flow.y, flow.x - pixel.flow_right_x),
            slope: slope(FrameTime::Now),
            slope_later: slope(FrameTime::After),
            later_here: at(FrameTime::After, i),
            rate_here: 0.5 * (at(FrameTime::After, i) - at(FrameTime::Before, i)),
        }
    }

    /// The point of the plane `normal` · P = `offset_m` that is seen at (x, y); `None` behind the camera.
    ///
    /// The disparity of a plane is linear in the image: d = b (normal · (x, y, f))/`offset_m`.
    pub(super) fn of_plane(
        rig: &StereoRig,
        phi: &Twist,
        normal: &Vector3<f64>,
        offset_m: f64,
        (x, y): (f64, f64),
    ) -> Option<Self> {
        let motion = phi.exp();
        let moved = motion.rotation * normal;
        let plane = |normal: &Vector3<f64>, offset: f64| {
            let slope = normal.xy() * (rig.baseline_m / offset);
            let d = rig.baseline_m * normal.dot(&Vector3::new(x, y, rig.focal_px)) / offset;
            (slope, d)
        };
        let (slope, d) = plane(normal, offset_m);
        let (slope_later, later_here) = plane(&moved, offset_m + moved.dot(&motion.translation));
        let xyd = Vector3::new(x, y, d);
        let rate = rig.velocity_jacobian(&xyd) * phi.vector();
        Some(Self {
            xyd,
            later: rig.project(&motion.apply(&rig.point(&xyd)?))?,
            rate,
            slope,
            slope_later,
            later_here,
            rate_here: rate.z - slope.dot(&rate.xy()),
        })
    }

    /// The same point found somewhere else at t′, and with another rate; its surface as steep as it was.
    pub(super) fn carried(mut self, later: Vector3<f64>, rate: Vector3<f64>) -> Self {
        self.later_here = later.z - self.slope_later.dot(&(later - self.xyd).xy());
        self.rate_here = rate.z - self.slope.dot(&rate.xy());
        Self { later, rate, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_moves_as_its_points_do() {
        let rig = StereoRig::new(400.0, (159.5, 119.5), 0.13, (320, 240)).unwrap();
        let phi = Twist { t: Vector3::new(0.01, -0.02, -0.05), omega: Vector3::new(0.004, -0.006, 0.002) };
        let (normal, offset) = (Vector3::new(0.2, -0.3, 1.0), 3.0);
        let point = |x, y| ExactPoint::of_plane(&rig, &phi, &normal, offset, (x, y)).unwrap();
        let found = point(40.0, -25.0);
        assert!((normal.dot(&rig.point(&found.xyd).unwrap()) - offset).abs() < 1e-12);
        // The place at t′ lies on the moved plane, whose disparity here and slope tell its own.
        let step = (found.later - found.xyd).xy();
        assert!((found.later_here + found.slope_later.dot(&step) - found.later.z).abs() < 1e-12);
        // For a hundredth of the motion, displacement is velocity.
        let little = ExactPoint::of_plane(&rig, &phi.scaled(1e-6), &normal, offset, (40.0, -25.0)).unwrap();
        assert!((little.later - little.xyd - little.rate).norm() < 1e-9);
        assert!((little.later_here - little.xyd.z - little.rate_here).abs() < 1e-9);
        // Carried to where it goes anyway, nothing changes.
        let same = found.carried(found.later, found.rate);
        assert!((same.later_here - found.later_here).abs() < 1e-12);
        assert!((same.rate_here - found.rate_here).abs() < 1e-12);
    }
}
