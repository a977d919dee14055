//! Images of a scene: one pose of a stereo rig, both cameras, anti-aliased.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::scene::{Hit, Scene};
use crate::geometry::{Grid, Image, RigErrors, RigidMotion, StereoRig};

/// Surface id of a pixel that sees nothing.
pub(super) const NOTHING: u16 = u16::MAX;

/// A scene seen by a stereo rig at one pose. The left camera stands at (−b/2, 0, 0) of the cyclopean frame.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// What is seen.
    pub scene: &'a Scene,
    /// What sees it.
    pub rig: &'a StereoRig,
    /// Pose of the cyclopean camera.
    pub world_from_cyclopean: RigidMotion,
    /// By how much what takes the images differs from `rig`.
    pub rig_errors: RigErrors,
}

/// A stereo pair of grey levels 0 … 255, not rounded.
#[derive(Debug, Clone, PartialEq)]
pub struct StereoImages {
    /// Left image.
    pub left: Image,
    /// Right image.
    pub right: Image,
}

/// One pinhole camera in the world.
#[derive(Debug, Clone, Copy)]
pub(super) struct Eye {
    /// Optical centre, in metres.
    pub(super) origin: Vector3<f64>,
    world_from_camera: Matrix3<f64>,
    /// Image coordinates (x, y) of the pixel (u, v) are (u − cx, (v − cy) · aspect).
    cx_px: f64,
    cy_px: f64,
    aspect: f64,
    focal_px: f64,
}

impl<'a> View<'a> {
    /// The scene from a pose of the cyclopean camera.
    pub fn new(scene: &'a Scene, rig: &'a StereoRig, world_from_cyclopean: RigidMotion) -> Self {
        Self { scene, rig, world_from_cyclopean, rig_errors: RigErrors::default() }
    }

    /// The same, taken by a rig that differs from the stated one.
    ///
    /// The left camera stays where it is. Truth is that of the stated rig.
    #[must_use]
    pub fn with_rig_errors(self, rig_errors: RigErrors) -> Self {
        Self { rig_errors, ..self }
    }

    /// Both images, with `samples` × `samples` rays through every pixel at an edge between surfaces.
    ///
    /// Inside a surface the texture is averaged over the pixel's footprint in closed form, so one ray is
    /// enough there. Rows are rendered in parallel; the result does not depend on the number of threads.
    pub fn render(&self, samples: usize) -> StereoImages {
        let (left, right) = self.real_eyes();
        StereoImages { left: self.image(&left, samples), right: self.image(&right, samples) }
    }

    /// Left and right camera in the world, as they are stated.
    pub(super) fn eyes(&self) -> (Eye, Eye) {
        let left = self.rig.left_from_cyclopean();
        let eye = |centre: Vector3<f64>, cx_px: f64| Eye {
            origin: self.world_from_cyclopean.apply(&centre),
            world_from_camera: self.world_from_cyclopean.rotation,
            cx_px,
            cy_px: self.rig.cy_px,
            aspect: self.rig.aspect(),
            focal_px: self.rig.focal_px,
        };
        (eye(left, self.rig.cx_px), eye(-left, self.rig.cx_px + self.rig.doffs_px))
    }

    /// Left and right camera in the world, as they are.
    fn real_eyes(&self) -> (Eye, Eye) {
        let (left, right) = self.eyes();
        let errors = &self.rig_errors;
        if errors.is_none() {
            return (left, right);
        }
        let real = |eye: Eye| Eye {
            cx_px: eye.cx_px + errors.centre_x_px,
            cy_px: eye.cy_px + errors.centre_y_px,
            focal_px: eye.focal_px * (1.0 + errors.focal),
            ..eye
        };
        let (left, right) = (real(left), real(right));
        let right = Eye {
            origin: left.origin + (right.origin - left.origin) * (1.0 + errors.baseline),
            world_from_camera: right.world_from_camera * errors.right_from_stated().transpose(),
            focal_px: right.focal_px * (1.0 + errors.focal_ratio),
            ..right
        };
        (left, right)
    }

    fn image(&self, eye: &Eye, samples: usize) -> Image {
        let (width, height) = (self.rig.width_px, self.rig.height_px);
        let centres: Vec<(f32, u16)> =
            (0..width * height).into_par_iter().with_min_len(width).map(|i| self.centre(eye, i)).collect();
        let grey = |i: usize| {
            let (u, v) = (i % width, i / width);
            let (grey, surface) = centres[i];
            let rows = v.saturating_sub(1)..=(v + 1).min(height - 1);
            let columns = u.saturating_sub(1)..=(u + 1).min(width - 1);
            let same = |w: usize| centres[w * width..][columns.clone()].iter().all(|c| c.1 == surface);
            if samples < 2 || rows.into_iter().all(same) { grey } else { self.mean(eye, u, v, samples) }
        };
        let mut image = Grid::filled(width, height, 0.0);
        image.values_mut().par_iter_mut().with_min_len(width).enumerate().for_each(|(i, g)| *g = grey(i));
        image
    }

    /// Grey level and surface at the centre of the pixel with row-major index `i`.
    fn centre(&self, eye: &Eye, i: usize) -> (f32, u16) {
        let (u, v) = ((i % self.rig.width_px) as f64, (i / self.rig.width_px) as f64);
        let direction = eye.direction(u, v);
        let hit = self.scene.cast(&eye.origin, &direction);
        (self.grey(eye, &direction, hit.as_ref()) as f32, hit.map_or(NOTHING, |h| h.surface))
    }

    /// Mean grey level over a regular grid of rays through a pixel.
    fn mean(&self, eye: &Eye, u: usize, v: usize, samples: usize) -> f32 {
        let offset = |i: usize| (i as f64 + 0.5) / samples as f64 - 0.5;
        let mut sum = 0.0;
        for i in 0..samples * samples {
            let direction = eye.direction(u as f64 + offset(i % samples), v as f64 + offset(i / samples));
            let hit = self.scene.cast(&eye.origin, &direction);
            sum += self.grey(eye, &direction, hit.as_ref());
        }
        (sum / (samples * samples) as f64) as f32
    }

    fn grey(&self, eye: &Eye, direction: &Vector3<f64>, hit: Option<&Hit>) -> f64 {
        let Some(hit) = hit else { return 0.0 };
        let (du, dv) = eye.footprint(direction, hit);
        self.scene.grey(hit, &du, &dv)
    }
}

impl Eye {
    /// Direction in the world, of depth Z = 1, through the pixel (u, v).
    pub(super) fn direction(&self, u: f64, v: f64) -> Vector3<f64> {
        let (x, y) = (u - self.cx_px, (v - self.cy_px) * self.aspect);
        self.world_from_camera * Vector3::new(x / self.focal_px, y / self.focal_px, 1.0)
    }

    /// ∂P/∂u and ∂P/∂v, in metres per pixel, of the point on the hit's tangent plane.
    fn footprint(&self, direction: &Vector3<f64>, hit: &Hit) -> (Vector3<f64>, Vector3<f64>) {
        let along = hit.normal.dot(direction);
        let slide = |step: Vector3<f64>| hit.s * (step - direction * (hit.normal.dot(&step) / along));
        let right: Vector3<f64> = self.world_from_camera.column(0) / self.focal_px;
        let down: Vector3<f64> = self.world_from_camera.column(1) * (self.aspect / self.focal_px);
        (slide(right), slide(down))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn footprint_is_the_step_of_the_point() {
        let (scene, rig) =
            (Scene::paper_room(), StereoRig::new(416.0, (159.5, 119.5), 0.13, (320, 240)).unwrap());
        let view = View::new(&scene, &rig, RigidMotion::identity());
        let (eye, _) = view.eyes();
        let cast = |u: f64, v: f64| scene.cast(&eye.origin, &eye.direction(u, v)).unwrap();
        for (u, v) in [(160.0, 220.0), (20.0, 60.0), (160.0, 30.0), (265.0, 175.0)] {
            let (du, dv) = eye.footprint(&eye.direction(u, v), &cast(u, v));
            let step = 1e-4;
            let along = |a: f64, b: f64| (cast(u + a, v + b).point - cast(u - a, v - b).point) / (2.0 * step);
            assert!((du - along(step, 0.0)).norm() < 1e-7, "{u} {v}");
            assert!((dv - along(0.0, step)).norm() < 1e-7, "{u} {v}");
        }
    }

    #[test]
    fn the_same_image_on_any_number_of_threads() {
        let (scene, rig) = (Scene::demo_room(), StereoRig::new(90.0, (31.5, 23.5), 0.13, (64, 48)).unwrap());
        let view = View::new(&scene, &rig, RigidMotion::identity());
        let on =
            |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(|| view.render(3));
        assert_eq!(on(1), on(5));
    }

    #[test]
    fn a_pixel_at_an_edge_shows_both_sides() {
        // More rays converge to the mean: 4 × 4 lies nearer to 16 × 16 than the single ray does.
        let (scene, rig) = (Scene::demo_room(), StereoRig::new(90.0, (31.5, 23.5), 0.13, (64, 48)).unwrap());
        let view = View::new(&scene, &rig, RigidMotion::identity());
        let [one, four, many] = [1, 4, 16].map(|n| view.render(n).left);
        let distance = |a: &Image| -> f64 {
            a.values().iter().zip(many.values()).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt()
        };
        assert!(distance(&four) < 0.25 * distance(&one), "{} {}", distance(&four), distance(&one));
    }
}
