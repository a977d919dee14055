//! The synthetic world of 7.1 at one reference pose: exact disparities around t, and which pixels may be used.

use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;

use egomotion::geometry::{RigidMotion, StereoRig, Twist};
use egomotion::pipeline::Approach;
use egomotion::sim::{Scene, View, reference_pose};

/// Exact disparity and surface of every pixel of the left image at one time.
#[derive(Debug, Clone, PartialEq)]
struct ExactMaps {
    disparity: Vec<f64>,
    surface: Vec<Option<u16>>,
}

/// A pixel that may be used, with everything that is true about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UsablePixel {
    /// Row-major index in the image.
    pub index: usize,
    /// The point P at t, in metres, left camera.
    pub point: Vector3<f64>,
    /// (x, y, d) at t, in pixels.
    pub xyd: Vector3<f64>,
    /// Differential flow (vx, vy) of the left image, in pixels per interval.
    pub flow_left: Vector2<f64>,
    /// Differential flow vx of the right image at the same point, in pixels per interval.
    pub flow_right_x: f64,
    /// (x, y, d) at t′, in pixels.
    pub later_xyd: Vector3<f64>,
    /// VZ at t, in metres per interval.
    pub vz_m: f64,
    /// Z′ − Z, in metres per interval.
    pub depth_change_m: f64,
    /// Whether the differential form may use it.
    pub differential: bool,
    /// Whether the discrete form may use it.
    pub discrete: bool,
}

impl UsablePixel {
    /// Whether the form of an approach may use it.
    pub(crate) fn usable_in(&self, approach: Approach) -> bool {
        match approach {
            Approach::Differential => self.differential,
            Approach::Discrete => self.discrete,
        }
    }

    /// The depth velocity that an approach speaks of, in metres per interval: VZ, or Z′ − Z.
    pub(crate) fn depth_velocity_m(&self, approach: Approach) -> f64 {
        match approach {
            Approach::Differential => self.vz_m,
            Approach::Discrete => self.depth_change_m,
        }
    }
}

/// The world around one reference pose, for one motion of a frame pair.
///
/// A pixel may be used if both cameras see it and every disparity that its gradient and its rate are made of
/// lies on one surface: in the differential form its four neighbours and itself at t, and itself at t − 1 and
/// t + 1; in the discrete form its four neighbours and itself both at t and at t′.
#[derive(Debug, Clone, PartialEq)]
pub struct SyntheticWorld {
    /// The cameras.
    pub rig: StereoRig,
    /// The pair's motion: scene motion of the left camera.
    pub phi: Twist,
    maps: [ExactMaps; 3],
    pixels: Vec<UsablePixel>,
}

/// Which of the three frames around t.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FrameTime {
    /// One interval before.
    Before,
    /// At t.
    Now,
    /// One interval after: t′.
    After,
}

impl SyntheticWorld {
    /// A scene seen from the reference pose exp(k φ), moving by `step` φ; φ is of the cyclopean camera.
    pub fn new(scene: &Scene, rig: &StereoRig, phi: &Twist, k: i32, step: f64) -> Self {
        let pose = reference_pose(phi, k);
        let moved = phi.scaled(step);
        let at = |motion: RigidMotion| View::new(scene, rig, pose.after(&motion));
        let views = [at(moved.exp()), at(RigidMotion::identity()), at(moved.exp().inverse())];
        let maps = views.map(|view| exact_maps(&view));
        let phi = moved.seen_from(&rig.left_from_cyclopean());
        let pixels = (0..rig.width_px * rig.height_px)
            .into_par_iter()
            .with_min_len(rig.width_px)
            .filter_map(|index| usable(&views[1], &maps, &phi, index))
            .collect();
        Self { rig: *rig, phi, maps, pixels }
    }

    /// Pixels that the form of an approach may use, in row-major order.
    pub(crate) fn usable_in(&self, approach: Approach) -> impl Iterator<Item = &UsablePixel> {
        self.pixels.iter().filter(move |pixel| pixel.usable_in(approach))
    }

    /// Pixels that one of the two forms may use, in row-major order.
    pub(crate) fn pixels(&self) -> &[UsablePixel] {
        &self.pixels
    }

    /// Exact disparity at every pixel, row-major, in pixels; NaN where nothing is seen.
    pub(crate) fn disparity(&self, when: FrameTime) -> &[f64] {
        &self.maps[when as usize].disparity
    }
}

fn exact_maps(view: &View<'_>) -> ExactMaps {
    let (width, height) = (view.rig.width_px, view.rig.height_px);
    let (disparity, surface) = (0..width * height)
        .into_par_iter()
        .with_min_len(width)
        .map(|i| {
            let seen = view.structure_at((i % width) as f64, (i / width) as f64);
            seen.map_or((f64::NAN, None), |(xyd, surface)| (xyd.z, Some(surface)))
        })
        .unzip();
    ExactMaps { disparity, surface }
}

/// The surface under the five-pixel stencil; `None` at the border or across an edge.
fn stencil(surface: &[Option<u16>], index: usize, width: usize, height: usize) -> Option<u16> {
    let (u, v) = (index % width, index / width);
    if u == 0 || v == 0 || u + 1 >= width || v + 1 >= height {
        return None;
    }
    let neighbours = [index - 1, index + 1, index - width, index + width];
    surface[index].filter(|_| neighbours.iter().all(|&i| surface[i] == surface[index]))
}

fn usable(view: &View<'_>, maps: &[ExactMaps; 3], phi: &Twist, index: usize) -> Option<UsablePixel> {
    let (width, height) = (view.rig.width_px, view.rig.height_px);
    let [before, now, after] = maps;
    let surface = stencil(&now.surface, index, width, height)?;
    let stays = |maps: &ExactMaps| maps.surface[index] == Some(surface);
    let differential = stays(before) && stays(after);
    let discrete = stencil(&after.surface, index, width, height) == Some(surface);
    if !(differential || discrete) {
        return None;
    }
    let truth = view.truth_at((index % width) as f64, (index / width) as f64).filter(|t| t.in_right)?;
    let moved = view.motion_at(&truth, phi);
    Some(UsablePixel {
        index,
        point: truth.point,
        xyd: truth.xyd,
        flow_left: moved.flow_left,
        flow_right_x: moved.flow_right.x,
        later_xyd: moved.later_xyd?,
        vz_m: moved.velocity.z,
        depth_change_m: moved.depth_change_m(&truth),
        differential,
        discrete,
    })
}
