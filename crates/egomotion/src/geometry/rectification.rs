//! Stereo rectification: the parallel pair of pinholes that a real pair of cameras can be turned into.
//!
//! Both cameras are turned in thought about their own centres, each by half of the rotation between
//! them, then together by the least rotation that puts the baseline along X (as in Bouguet's
//! toolbox). Every point then lies on one row of both images.

use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};
use serde::Serialize;
use thiserror::Error;

use super::camera::Camera;
use super::rig::{RigError, StereoRig};
use super::twist::{RigidMotion, Twist};

/// The rectified focal length is at least this part of the cameras' own. A wide lens would have to be
/// shown with few pixels in its middle, where most is seen, to show its borders.
const LEAST_FOCAL_SHARE: f64 = 0.8;
/// Directions whose tangent with the axis exceeds this, 76°, are never shown: their pixels would be stretched too far.
const LARGEST_TANGENT: f64 = 4.0;
/// An entry of the matrix between the cameras may differ from that of the nearest rotation by this much: calibrations
/// are printed with few digits, and what differs by more is no rotation.
const LARGEST_ROTATION_ERROR: f64 = 1e-3;

/// A pair of cameras and the rectified rig that their images are turned into.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StereoRectification {
    left: Camera,
    right: Camera,
    right_from_left: RigidMotion,
    turn_left: Matrix3<f64>,
    turn_right: Matrix3<f64>,
    rig: StereoRig,
}

/// Why a pair of cameras cannot be rectified.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum RectificationError {
    /// The pose is no rigid motion, or there is no distance between the cameras.
    #[error("the pose between the cameras is no rotation and translation that could be used")]
    Pose,
    /// The right camera does not lie on the right of the left one.
    #[error(
        "the right camera lies at ({0:.3}, {1:.3}, {2:.3}) m from the left one, not on its right; \
         left and right may be swapped"
    )]
    Baseline(f64, f64, f64),
    /// The cameras look in different directions.
    #[error("the cameras have no view in common")]
    View,
    /// The rectified rig cannot measure.
    #[error(transparent)]
    Rig(#[from] RigError),
}

/// A part of the plane of normalised coordinates.
#[derive(Debug, Clone, Copy)]
struct View {
    x: [f64; 2],
    y: [f64; 2],
}

impl StereoRectification {
    /// Rectify a pair into images of `size` (width, height).
    ///
    /// `right_from_left` takes points of the left camera's frame to the right one's, in metres.
    ///
    /// The focal length and principal point, common to both, show the widest view all of whose pixels
    /// both images have, but with no less than 0.8 of the cameras' own focal length: a wide lens loses
    /// its borders.
    ///
    /// # Errors
    /// [`RectificationError`] tells what is wrong with the pose or the view.
    pub fn new(
        left: Camera,
        right: Camera,
        right_from_left: RigidMotion,
        size: (usize, usize),
    ) -> Result<Self, RectificationError> {
        let rotation =
            RigidMotion::nearest_rotation(&right_from_left.rotation).ok_or(RectificationError::Pose)?;
        let off = (rotation - right_from_left.rotation).amax();
        let right_from_left = RigidMotion { rotation, translation: right_from_left.translation };
        let centre = right_from_left.inverse().translation;
        let baseline_m = centre.norm();
        // Written so that NaN is refused too.
        if !(off < LARGEST_ROTATION_ERROR && baseline_m.is_finite() && baseline_m > 0.0) {
            return Err(RectificationError::Pose);
        }
        let half = Twist { t: Vector3::zeros(), omega: 0.5 * right_from_left.log().omega }.exp().rotation;
        let along = half * centre / baseline_m;
        // A right camera more above or before than beside the left one cannot be meant.
        if along.x < std::f64::consts::FRAC_1_SQRT_2 {
            return Err(RectificationError::Baseline(centre.x, centre.y, centre.z));
        }
        let level =
            Rotation3::rotation_between(&along, &Vector3::x()).ok_or(RectificationError::Pose)?.into_inner();
        let (turn_left, turn_right) = (level * half, level * half.transpose());
        let view = View::seen(&left, &turn_left).and_then(|a| a.and(&View::seen(&right, &turn_right)?));
        let view = view.ok_or(RectificationError::View)?;
        let middle = |camera: &Camera, turn: &Matrix3<f64>| {
            let (width, height) = camera.size();
            let centre = Vector2::new(0.5 * (width - 1) as f64, 0.5 * (height - 1) as f64);
            let ray = turn * camera.direction(&centre)?;
            (ray.z > 0.0).then(|| ray.xy() / ray.z)
        };
        let middles = middle(&left, &turn_left).zip(middle(&right, &turn_right));
        let (a, b) = middles.ok_or(RectificationError::View)?;
        let (focal_px, (cx_px, cy_px)) = view.shown([&left, &right], 0.5 * (a + b), size);
        let rig = StereoRig::new(focal_px, (cx_px, cy_px), baseline_m, size)?;
        Ok(Self { left, right, right_from_left, turn_left, turn_right, rig })
    }

    /// The rectified rig, on whose left pixel grid all results lie.
    pub fn rig(&self) -> &StereoRig {
        &self.rig
    }

    /// The left camera as it is.
    pub fn left(&self) -> &Camera {
        &self.left
    }

    /// The right camera as it is.
    pub fn right(&self) -> &Camera {
        &self.right
    }

    /// Points of the left camera's frame in the right one's, before rectification.
    pub fn right_from_left(&self) -> &RigidMotion {
        &self.right_from_left
    }

    /// Rotation from the left camera's frame to that of the rectified left camera.
    pub fn rectified_left_from_left(&self) -> &Matrix3<f64> {
        &self.turn_left
    }

    /// Rotation from the right camera's frame to that of the rectified right camera.
    pub fn rectified_right_from_right(&self) -> &Matrix3<f64> {
        &self.turn_right
    }

    /// The pose of the rectified left camera, given that of the left one, `world_from_left`.
    pub fn world_from_rectified(&self, world_from_left: &RigidMotion) -> RigidMotion {
        let turn = RigidMotion { rotation: self.turn_left.transpose(), translation: Vector3::zeros() };
        world_from_left.after(&turn)
    }

    /// Where the left image shows what the rectified one has at pixel (u, v); `None` where the lens model
    /// ends. The place may lie outside the image.
    pub(crate) fn raw_left(&self, u: f64, v: f64) -> Option<Vector2<f64>> {
        self.left.project(&self.turn_left.tr_mul(&self.ray(u, v)))
    }

    /// The same for the right image.
    pub(crate) fn raw_right(&self, u: f64, v: f64) -> Option<Vector2<f64>> {
        self.right.project(&self.turn_right.tr_mul(&self.ray(u, v)))
    }

    fn ray(&self, u: f64, v: f64) -> Vector3<f64> {
        let rig = &self.rig;
        Vector3::new((u - rig.cx_px) / rig.focal_px, (v - rig.cy_px) / rig.focal_y_px, 1.0)
    }
}

impl View {
    /// The largest upright rectangle, turned as `turn` says, whose sides no border of the image crosses.
    fn seen(camera: &Camera, turn: &Matrix3<f64>) -> Option<Self> {
        let (width, height) = camera.size();
        let (right, bottom) = ((width - 1) as f64, (height - 1) as f64);
        // Directions behind the camera bound nothing.
        let direction = |u: f64, v: f64| {
            let ray = turn * camera.direction(&Vector2::new(u, v))?;
            (ray.z > 0.0).then(|| ray.xy() / ray.z)
        };
        let upright = |u: f64| (0..height).filter_map(move |v| Some(direction(u, v as f64)?.x));
        let level = |v: f64| (0..width).filter_map(move |u| Some(direction(u as f64, v)?.y));
        let x =
            [upright(0.0).fold(-LARGEST_TANGENT, f64::max), upright(right).fold(LARGEST_TANGENT, f64::min)];
        let y = [level(0.0).fold(-LARGEST_TANGENT, f64::max), level(bottom).fold(LARGEST_TANGENT, f64::min)];
        (x[0] < x[1] && y[0] < y[1]).then_some(Self { x, y })
    }

    /// What both show.
    fn and(&self, other: &Self) -> Option<Self> {
        let both = |a: [f64; 2], b: [f64; 2]| [a[0].max(b[0]), a[1].min(b[1])];
        let (x, y) = (both(self.x, other.x), both(self.y, other.y));
        (x[0] < x[1] && y[0] < y[1]).then_some(Self { x, y })
    }

    /// Focal length and principal point that show it in an image of `size`, as near to `middle` as it reaches.
    fn shown(
        &self,
        cameras: [&Camera; 2],
        middle: Vector2<f64>,
        (width, height): (usize, usize),
    ) -> (f64, (f64, f64)) {
        let span = |[low, high]: [f64; 2], pixels: usize| (pixels.max(1) - 1) as f64 / (high - low);
        let fills = span(self.x, width).max(span(self.y, height));
        let own = cameras.iter().flat_map(|c| [c.focal_px().0, c.focal_px().1]).product::<f64>().powf(0.25);
        let focal = fills.max(LEAST_FOCAL_SHARE * own);
        // The middle of the raw images in the middle, as far as the view reaches.
        let principal = |[low, high]: [f64; 2], middle: f64, pixels: usize| {
            let half = 0.5 * (pixels.max(1) - 1) as f64;
            let (first, last) = (low + half / focal, high - half / focal);
            half - focal * if first < last { middle.clamp(first, last) } else { 0.5 * (low + high) }
        };
        (focal, (principal(self.x, middle.x, width), principal(self.y, middle.y, height)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Distortion;

    /// The drone of EuRoC: two cameras, slightly turned, 0.11 m apart.
    fn drone() -> StereoRectification {
        let lens = |k1, k2, p1, p2| Distortion::RadialTangential { k: [k1, k2, 0.0], p: [p1, p2] };
        let camera = |f, c, d| Camera::new(f, c, d, (752, 480)).unwrap();
        let left = camera(
            (458.654, 457.296),
            (367.215, 248.375),
            lens(-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05),
        );
        let right = camera(
            (457.587, 456.134),
            (379.999, 255.238),
            lens(-0.28368365, 0.07451284, -0.00010473, -3.555907e-05),
        );
        let turn =
            Twist { t: Vector3::new(-0.11, 0.0004, -0.0008), omega: Vector3::new(0.0071, -0.014, -0.0023) };
        StereoRectification::new(left, right, turn.exp(), (752, 480)).unwrap()
    }

    #[test]
    fn a_point_lies_on_one_row_at_its_disparity() {
        let pair = drone();
        let rig = pair.rig();
        for (u, v, d) in [(40.0, 30.0, 12.0), (700.0, 450.0, 60.0), (376.0, 240.0, 1.0)] {
            let (x, y) = rig.image_from_pixel(u, v);
            let rectified = rig.point(&Vector3::new(x, y, d)).unwrap();
            let point = pair.rectified_left_from_left().transpose() * rectified;
            let raw = pair.left().project(&point).unwrap();
            assert!((raw - pair.raw_left(u, v).unwrap()).norm() < 1e-9);
            // The right camera shows the same point where its rectified image has it, d further left.
            let raw = pair.right().project(&pair.right_from_left().apply(&point)).unwrap();
            assert!((raw - pair.raw_right(u - d, v).unwrap()).norm() < 1e-9, "{u} {v}");
        }
    }

    #[test]
    fn every_pixel_of_a_moderate_lens_is_seen_and_the_view_is_wide() {
        let pair = drone();
        let inside = |raw: Option<Vector2<f64>>| {
            raw.is_some_and(|p| p.x > -0.01 && p.x < 751.01 && p.y > -0.01 && p.y < 479.01)
        };
        let (mut least_x, mut least_y) = (f64::MAX, f64::MAX);
        for v in 0..480 {
            for u in 0..752 {
                let (left, right) = (pair.raw_left(u as f64, v as f64), pair.raw_right(u as f64, v as f64));
                assert!(inside(left) && inside(right), "{u} {v}");
                for raw in [left.unwrap(), right.unwrap()] {
                    least_x = least_x.min(raw.x).min(751.0 - raw.x);
                    least_y = least_y.min(raw.y).min(479.0 - raw.y);
                }
            }
        }
        assert!(least_x < 0.5 || least_y < 0.5, "{least_x} {least_y}");
    }

    #[test]
    fn an_ideal_pair_stays_as_it_is() {
        let camera = Camera::new((400.0, 400.0), (159.5, 119.5), Distortion::None, (320, 240)).unwrap();
        let apart = RigidMotion { rotation: Matrix3::identity(), translation: Vector3::new(-0.2, 0.0, 0.0) };
        let pair = StereoRectification::new(camera, camera, apart, (320, 240)).unwrap();
        let ideal = StereoRig::new(400.0, (159.5, 119.5), 0.2, (320, 240)).unwrap();
        assert!((pair.rig().focal_px - ideal.focal_px).abs() < 1e-9);
        assert!((pair.rig().cx_px - 159.5).abs() < 1e-9 && (pair.rig().cy_px - 119.5).abs() < 1e-9);
        assert!((pair.raw_left(17.0, 203.0).unwrap() - Vector2::new(17.0, 203.0)).norm() < 1e-9);
    }

    #[test]
    fn a_fisheye_keeps_its_resolution() {
        let lens = Distortion::Equidistant { k: [0.0034, 0.0007, -0.0020, 0.0002] };
        let camera = Camera::new((190.0, 190.0), (255.5, 255.5), lens, (512, 512)).unwrap();
        let apart = RigidMotion { rotation: Matrix3::identity(), translation: Vector3::new(-0.1, 0.0, 0.0) };
        let pair = StereoRectification::new(camera, camera, apart, (512, 512)).unwrap();
        assert!((pair.rig().focal_px - 0.8 * 190.0).abs() < 1e-9);
        let corner = pair.raw_left(0.0, 0.0).unwrap();
        assert!(corner.x > 0.0 && corner.y > 0.0);
    }

    #[test]
    fn impossible_pairs_are_refused() {
        let camera = Camera::new((400.0, 400.0), (159.5, 119.5), Distortion::None, (320, 240)).unwrap();
        let refused = |rotation: Vector3<f64>, translation: Vector3<f64>| {
            let rotation = Twist { t: Vector3::zeros(), omega: rotation }.exp().rotation;
            StereoRectification::new(camera, camera, RigidMotion { rotation, translation }, (320, 240))
                .unwrap_err()
        };
        let none = Vector3::zeros();
        assert_eq!(refused(none, none), RectificationError::Pose);
        assert_eq!(refused(none, Vector3::new(f64::NAN, 0.0, 0.0)), RectificationError::Pose);
        assert!(refused(none, Vector3::new(0.2, 0.0, 0.0)).to_string().contains("swapped"));
        assert!(matches!(refused(none, Vector3::new(0.0, -0.2, 0.0)), RectificationError::Baseline(..)));
        assert_eq!(
            refused(Vector3::new(0.0, 1.5, 0.0), Vector3::new(-0.2, 0.0, 0.14)),
            RectificationError::View
        );
    }
}
