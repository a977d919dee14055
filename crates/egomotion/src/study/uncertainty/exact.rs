//! What both approaches measure at one pixel of the synthetic world, without noise.

use crate::geometry::{Gaussian, RigidMotion, StereoRig, Twist};
use crate::observe::{DepthFlow, DepthTrack, StereoFlow, StereoTrack};
use crate::sim::sequences::reference_pose;
use crate::sim::{PointTruth, Scene, View};

/// A scene before, at and after a reference pose: t − 1, t and t + 1, which is t′ of the discrete form.
#[derive(Debug, Clone, Copy)]
pub struct Instants<'a> {
    before: View<'a>,
    now: View<'a>,
    after: View<'a>,
    phi_left: Twist,
}

/// Disparity at a pixel and at its four neighbours, in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stencil {
    /// At the pixel.
    pub centre: f64,
    /// One column to the left.
    pub left: f64,
    /// One column to the right.
    pub right: f64,
    /// One row up.
    pub above: f64,
    /// One row down.
    pub below: f64,
}

/// The exact measurements at one pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exact {
    /// Pixel (u, v).
    pub pixel: (usize, usize),
    /// Image coordinates (x, y), in pixels.
    pub image_px: (f64, f64),
    /// Depth Z at t, in metres.
    pub depth_m: f64,
    /// Disparity at t − 1, in pixels.
    pub before: f64,
    /// Disparities at t.
    pub now: Stencil,
    /// Disparities at t + 1.
    pub after: Stencil,
    /// Flow (vx, vy) of the left image, in pixels per interval.
    pub flow: [f64; 2],
    /// Flow vx of the right image, in pixels per interval.
    pub flow_right_x: f64,
    /// Displacement (x′ − x, y′ − y) of the point, in pixels.
    pub displacement: [f64; 2],
    /// Disparity d′ of the point after the motion, in pixels.
    pub moved: f64,
}

/// Standard deviations of what is measured, in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Of every disparity.
    pub disparity_px: f64,
    /// Of every component of flow, and of the later end of a displacement.
    pub flow_px: f64,
}

/// Which pixels count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Surface {
    /// The five pixels on one surface, the same at all three times, visible to both cameras.
    One,
    /// Every pixel that sees something: what a program does that does not know the edges.
    Any,
}

impl Noise {
    /// Variances (σ²_d, σ²_v), in pixels².
    pub fn variances(&self) -> (f64, f64) {
        (self.disparity_px.powi(2), self.flow_px.powi(2))
    }
}

impl<'a> Instants<'a> {
    /// The pose exp(k φ), and the motion `step` φ from and to it; φ is the cyclopean camera's.
    pub fn new(scene: &'a Scene, rig: &'a StereoRig, phi: &Twist, k: i32, step: f64) -> Self {
        let (pose, motion) = (reference_pose(phi, k), phi.scaled(step));
        let view = |pose: RigidMotion| View::new(scene, rig, pose);
        Self {
            before: view(pose.after(&motion.exp())),
            now: view(pose),
            after: view(pose.after(&motion.exp().inverse())),
            phi_left: motion.seen_from(&rig.left_from_cyclopean()),
        }
    }

    /// The view at t.
    pub fn now(&self) -> &View<'a> {
        &self.now
    }

    /// The exact measurements at the pixel (u, v); `None` where a stencil leaves the image or `surface`.
    pub fn at(&self, u: usize, v: usize, surface: Surface) -> Option<Exact> {
        let rig = self.now.rig;
        if u == 0 || v == 0 || u + 1 >= rig.width_px || v + 1 >= rig.height_px {
            return None;
        }
        let (u_px, v_px) = (u as f64, v as f64);
        let centre = self.now.truth_at(u_px, v_px)?;
        let motion = self.now.motion_at(&centre, &self.phi_left);
        if surface == Surface::One && !motion.in_later {
            return None;
        }
        let wanted = (surface == Surface::One).then_some(centre.surface);
        let [before, now, after] = [self.before, self.now, self.after].map(|v| stencil(&v, u_px, v_px, wanted));
        Some(Exact {
            pixel: (u, v),
            image_px: (centre.xyd.x, centre.xyd.y),
            depth_m: centre.depth_m(),
            before: before?.centre,
            now: now?,
            after: after?,
            flow: motion.flow_left.into(),
            flow_right_x: motion.flow_right.x,
            displacement: motion.displacement_px(&centre)?.into(),
            moved: motion.later_xyd?.z,
        })
    }
}

fn stencil(view: &View<'_>, u: f64, v: f64, surface: Option<u16>) -> Option<Stencil> {
    let seen = |p: &PointTruth| surface.is_none_or(|surface| surface == p.surface && p.in_right);
    let disparity = |du: f64, dv: f64| {
        view.truth_at(u + du, v + dv).filter(seen).map(|point| point.disparity_px())
    };
    Some(Stencil {
        centre: disparity(0.0, 0.0)?,
        left: disparity(-1.0, 0.0)?,
        right: disparity(1.0, 0.0)?,
        above: disparity(0.0, -1.0)?,
        below: disparity(0.0, 1.0)?,
    })
}

impl Stencil {
    /// Central differences (d_x, d_y), in pixels per pixel.
    pub fn gradient(&self) -> [f64; 2] {
        [0.5 * (self.right - self.left), 0.5 * (self.below - self.above)]
    }
}

impl Exact {
    /// What the differential DCCE measures: central differences, so σ²_di = ½ σ²_d.
    pub fn depth_flow(&self, noise: &Noise) -> DepthFlow {
        let (d, v) = noise.variances();
        let [dx, dy] = self.now.gradient();
        let dt = 0.5 * (self.after.centre - self.before);
        DepthFlow {
            x_px: self.image_px.0,
            y_px: self.image_px.1,
            disparity: Gaussian::independent(
                [self.now.centre, dx, dy, dt],
                [d, 0.5 * d, 0.5 * d, 0.5 * d],
            ),
            flow: Gaussian::independent(self.flow, [v, v]),
        }
    }

    /// What the discrete DCCE measures: disparity at t and t′, and central differences at t′.
    pub fn depth_track(&self, noise: &Noise) -> DepthTrack {
        let (d, v) = noise.variances();
        let [dx, dy] = self.after.gradient();
        DepthTrack {
            x_px: self.image_px.0,
            y_px: self.image_px.1,
            disparity: Gaussian::independent(
                [self.now.centre, self.after.centre, dx, dy],
                [d, d, 0.5 * d, 0.5 * d],
            ),
            displacement: Gaussian::independent(self.displacement, [v, v]),
        }
    }

    /// What the differential DV measures.
    pub fn stereo_flow(&self, noise: &Noise) -> StereoFlow {
        let (d, v) = noise.variances();
        StereoFlow {
            x_px: self.image_px.0,
            y_px: self.image_px.1,
            measured: Gaussian::independent(
                [self.now.centre, self.flow[0], self.flow[1], self.flow_right_x],
                [d, v, v, v],
            ),
        }
    }

    /// What the discrete DV measures: the earlier end is a pixel, the later one is tracked.
    pub fn stereo_track(&self, noise: &Noise) -> StereoTrack {
        let (d, v) = noise.variances();
        let (x, y) = self.image_px;
        let [dx, dy] = self.displacement;
        StereoTrack {
            before: Gaussian::independent([x, y, self.now.centre], [0.0, 0.0, d]),
            after: Gaussian::independent([x + dx, y + dy, self.moved], [v, v, d]),
        }
    }
}
