//! Exact truth at pixel centres of the left camera: structure, and what a motion does to it.

use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;

use super::render::View;
use crate::geometry::{Field, Grid, RigidMotion, StereoRig, Twist, image_flow};

/// What a pixel of the left camera sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointTruth {
    /// The point P in metres, left camera's frame; its Z is the depth.
    pub point: Vector3<f64>,
    /// Image coordinates and disparity (x, y, d), in pixels.
    pub xyd: Vector3<f64>,
    /// Surface id, as in [`super::Hit`].
    pub surface: u16,
    /// Whether the right camera sees the point too: inside its image and not hidden.
    pub in_right: bool,
}

/// What a motion φ does to a point of the left camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionTruth {
    /// Velocity V = t + Ω × P, in metres per interval, equation (1); its Z is the instantaneous VZ.
    pub velocity: Vector3<f64>,
    /// Differential flow (vx, vy) in the left image, in pixels per interval, equation (3).
    pub flow_left: Vector2<f64>,
    /// Differential flow in the right image of the same point, in pixels per interval.
    pub flow_right: Vector2<f64>,
    /// The point after the motion, P′ = R P + T, in metres.
    pub later: Vector3<f64>,
    /// (x′, y′, d′) after the motion, in pixels; `None` behind the camera.
    pub later_xyd: Option<Vector3<f64>>,
    /// Whether the later left image shows the point: inside it and not hidden.
    pub in_later: bool,
}

impl PointTruth {
    /// Depth Z, in metres.
    pub fn depth_m(&self) -> f64 {
        self.point.z
    }

    /// Disparity d, in pixels.
    pub fn disparity_px(&self) -> f64 {
        self.xyd.z
    }
}

impl MotionTruth {
    /// Discrete change of depth Z′ − Z, in metres per interval, from the earlier truth of the same pixel.
    pub fn depth_change_m(&self, earlier: &PointTruth) -> f64 {
        self.later.z - earlier.point.z
    }

    /// Discrete displacement (x′ − x, y′ − y), in pixels; `None` behind the camera.
    pub fn displacement_px(&self, earlier: &PointTruth) -> Option<Vector2<f64>> {
        self.later_xyd.map(|later| (later - earlier.xyd).xy())
    }
}

impl View<'_> {
    /// Pose of the left camera, on which the truth stands.
    pub fn world_from_left(&self) -> RigidMotion {
        let translation = self.world_from_cyclopean.apply(&self.rig.left_from_cyclopean());
        RigidMotion { rotation: self.world_from_cyclopean.rotation, translation }
    }

    /// Position (x, y, d) in pixels and surface id at any place (u, v) of the left image; `None` where it sees nothing.
    pub fn structure_at(&self, u: f64, v: f64) -> Option<(Vector3<f64>, u16)> {
        let (left, _) = self.eyes();
        let hit = self.scene.cast(&left.origin, &left.direction(u, v))?;
        let (x, y) = self.rig.image_from_pixel(u, v);
        Some((Vector3::new(x, y, self.rig.disparity(hit.s)?), hit.surface))
    }

    /// Truth at any place (u, v) of the left image, in pixels; `None` where it sees nothing.
    pub fn truth_at(&self, u: f64, v: f64) -> Option<PointTruth> {
        let (xyd, surface) = self.structure_at(u, v)?;
        let (_, right) = self.eyes();
        let point = self.rig.point(&xyd)?;
        let shift = self.rig.shift_from_disparity(xyd.z);
        let seen = || self.scene.sees(&right.origin, &self.world_from_left().apply(&point));
        let in_right = inside(self.rig, u - shift, v) && seen();
        Some(PointTruth { point, xyd, surface, in_right })
    }

    /// Truth of every pixel centre of the left image.
    pub fn truth(&self) -> Grid<Option<PointTruth>> {
        let width = self.rig.width_px;
        let mut grid = Grid::filled(width, self.rig.height_px, None);
        let at = |i: usize| self.truth_at((i % width) as f64, (i / width) as f64);
        grid.values_mut().par_iter_mut().with_min_len(width).enumerate().for_each(|(i, t)| *t = at(i));
        grid
    }

    /// What φ (scene motion, *left* camera) does to a point of [`View::truth_at`].
    ///
    /// For a φ of the cyclopean camera pass `phi.seen_from(&rig.left_from_cyclopean())`.
    pub fn motion_at(&self, earlier: &PointTruth, phi: &Twist) -> MotionTruth {
        let (p, rig) = (&earlier.point, self.rig);
        let baseline = Vector3::new(rig.baseline_m, 0.0, 0.0);
        let [x, y, d] = [earlier.xyd.x, earlier.xyd.y, earlier.xyd.z];
        let next_from_prev = phi.exp();
        let later = next_from_prev.apply(p);
        let later_xyd = rig.project(&later);
        let world_from_left = self.world_from_left();
        let later_eye = world_from_left.after(&next_from_prev.inverse()).translation;
        let in_later = later_xyd.is_some_and(|xyd| {
            let (u, v) = rig.pixel_from_image(xyd.x, xyd.y);
            inside(rig, u, v) && self.scene.sees(&later_eye, &world_from_left.apply(p))
        });
        MotionTruth {
            velocity: phi.velocity(p),
            flow_left: image_flow(phi, x, y, p.z, rig.focal_px),
            flow_right: image_flow(&phi.seen_from(&baseline), x - d, y, p.z, rig.focal_px),
            later,
            later_xyd,
            in_later,
        }
    }

    /// [`View::motion_at`] for every pixel of [`View::truth`].
    pub fn motion(&self, truth: &Grid<Option<PointTruth>>, phi: &Twist) -> Grid<Option<MotionTruth>> {
        let mut grid = Grid::filled(truth.width(), truth.height(), None);
        let pixels = grid.values_mut().par_iter_mut().zip(truth.values()).with_min_len(256);
        pixels.for_each(|(m, t)| *m = t.as_ref().map(|t| self.motion_at(t, phi)));
        grid
    }
}

/// One quantity of a truth as a field; missing where the truth is missing or the quantity is.
pub fn field_of<T: Copy>(truth: &Grid<Option<T>>, quantity: impl Fn(&T) -> Option<f64>) -> Field {
    let value =
        |u: usize, v: usize| truth.at(u, v).as_ref().and_then(&quantity).map_or(f32::NAN, |q| q as f32);
    Field::from_grid(Grid::from_fn(truth.width(), truth.height(), value))
}

/// Whether (u, v) lies between the centres of the image's border pixels.
fn inside(rig: &StereoRig, u: f64, v: f64) -> bool {
    let within = |c: f64, n: usize| c >= 0.0 && c <= n as f64 - 1.0;
    within(u, rig.width_px) && within(v, rig.height_px)
}
