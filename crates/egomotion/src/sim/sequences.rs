//! Named sequences: a scene, a rig, and an exact motion for each frame.

use nalgebra::Vector3;

use super::render::View;
use super::scene::{Scene, least};
use crate::geometry::{RigErrors, RigidMotion, StereoRig, Twist};

/// Constant motions of section 7.1 and ours: name, then (tX, tY, tZ) in mm and Ω in degrees per frame,
/// as scene motion of the cyclopean camera.
const CONSTANT_MOTIONS: [(&str, [f64; 6]); 5] = [
    ("A", [0.0, 0.0, -5.0, 0.0, 0.0, 0.0]),
    ("B", [0.0, 0.0, 0.0, 0.0, -0.25, 0.0]),
    ("C", [10.0, -10.0, -15.0, 0.1, 0.1, 0.0]),
    ("drive", [0.0, 0.0, -50.0, 0.1, 0.3, 0.0]),
    ("still", [0.0; 6]),
];

/// Constant motions of section 7.2 (Table 2, with the signs of Tables 4, 5 and 7), in [`Scene::lab_room`]; the
/// paper has no K.
const LAB_MOTIONS: [(&str, [f64; 6]); 12] = [
    ("lab-A", [0.0, 0.0, 0.0, 0.0, -0.25, 0.0]),
    ("lab-B", [0.0, 0.0, 0.0, 0.0, -0.5, 0.0]),
    ("lab-C", [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
    ("lab-D", [0.0, 0.0, 0.0, 0.0, 2.0, 0.0]),
    ("lab-E", [0.0, 0.0, -1.0, 0.0, 0.0, 0.0]),
    ("lab-F", [0.0, 0.0, -5.0, 0.0, 0.0, 0.0]),
    ("lab-G", [0.0, 0.0, -10.0, 0.0, 0.0, 0.0]),
    ("lab-H", [0.0, 0.0, -20.0, 0.0, 0.0, 0.0]),
    ("lab-I", [0.0, 0.0, -40.0, 0.0, 0.0, 0.0]),
    ("lab-J", [0.0, 5.0, -10.0, 0.0, 0.0, 0.0]),
    ("lab-L", [0.0, 10.0, -20.0, 0.0, 0.0, 0.0]),
    ("lab-M", [0.0, 5.0, -5.0, 0.0, 0.25, 0.0]),
];

/// Frames of a constant sequence where the caller does not say.
const DEFAULT_FRAMES: usize = 10;
/// Frames of the demonstration: further ones would drive into the obstacle.
const DEMO_FRAMES: usize = 24;
/// Time between two frames of the demonstration, in seconds.
const DEMO_INTERVAL_S: f64 = 0.1;
/// Frames of the corridor: to its end, past two turns each way.
const CORRIDOR_FRAMES: usize = 64;

/// A sequence of exact poses in a scene. Motions are scene motions φ of the cyclopean camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Sequence {
    /// Its name.
    pub name: String,
    /// What is seen.
    pub scene: Scene,
    /// What sees it.
    pub rig: StereoRig,
    /// By how much the rig that takes the images differs from `rig`.
    pub rig_errors: RigErrors,
    /// Time between two frames, in seconds; 1 where the motion is defined per frame only.
    pub interval_s: f64,
    motions: Vec<Twist>,
    world_from_cyclopean: Vec<RigidMotion>,
}

impl Sequence {
    /// Every name that [`Sequence::named`] knows.
    pub fn names() -> impl Iterator<Item = &'static str> {
        CONSTANT_MOTIONS.iter().map(|(name, _)| *name).chain(["demo", "corridor"]).chain(Self::lab_names())
    }

    /// The names of the manipulator's sequences, in the paper's order.
    pub fn lab_names() -> impl Iterator<Item = &'static str> {
        LAB_MOTIONS.iter().map(|(name, _)| *name)
    }

    /// The sequence of that name (any case); `None` if there is none.
    ///
    /// `size_px`, the image's (width, height), scales the focal length with the width; `None` is the
    /// sequence's own size, 320×240 for the paper's and 640×480 for `demo` and `corridor`. `frames` `None` is the
    /// sequence's own number; `demo` has at most 24, `corridor` at most 64. `step` multiplies every motion. A long or fast drive
    /// leaves the room: [`Sequence::clearance_m`] tells.
    pub fn named(
        name: &str,
        size_px: Option<(usize, usize)>,
        frames: Option<usize>,
        step: f64,
    ) -> Option<Self> {
        if name.eq_ignore_ascii_case("demo") {
            let frames = frames.unwrap_or(DEMO_FRAMES).min(DEMO_FRAMES);
            let motions = (1..frames).map(|k| demo_motion(k as f64 - 0.5).scaled(step)).collect();
            let rig = rig(500.0 / 640.0, 0.16, size_px.unwrap_or((640, 480)))?;
            return Some(Self::new("demo", Scene::demo_room(), rig, DEMO_INTERVAL_S, motions));
        }
        if name.eq_ignore_ascii_case("corridor") {
            let frames = frames.unwrap_or(CORRIDOR_FRAMES).min(CORRIDOR_FRAMES);
            let motions = (1..frames).map(|k| corridor_motion(k as f64 - 0.5).scaled(step)).collect();
            let rig = rig(500.0 / 640.0, 0.16, size_px.unwrap_or((640, 480)))?;
            return Some(Self::new("corridor", Scene::corridor(), rig, DEMO_INTERVAL_S, motions));
        }
        let known = |list: &[(&'static str, [f64; 6])]| {
            list.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).copied()
        };
        let paper = known(&CONSTANT_MOTIONS).map(|found| (found, Scene::paper_room as fn() -> Scene));
        let ((name, motion), scene) =
            paper.or_else(|| known(&LAB_MOTIONS).map(|found| (found, Scene::lab_room as _)))?;
        let motions =
            vec![twist_from_mm_deg(&motion).scaled(step); frames.unwrap_or(DEFAULT_FRAMES).saturating_sub(1)];
        Some(Self::new(name, scene(), paper_rig(size_px.unwrap_or((320, 240)))?, 1.0, motions))
    }

    /// A sequence that starts at the world's origin and moves by `motions`: one frame more than motions.
    pub fn new(name: &str, scene: Scene, rig: StereoRig, interval_s: f64, motions: Vec<Twist>) -> Self {
        let mut pose = RigidMotion::identity();
        let mut world_from_cyclopean = vec![pose];
        for phi in &motions {
            pose = pose.after(&phi.exp().inverse());
            world_from_cyclopean.push(pose);
        }
        let rig_errors = RigErrors::default();
        Self { name: name.to_owned(), scene, rig, rig_errors, interval_s, motions, world_from_cyclopean }
    }

    /// Number of frames, at least 1.
    pub fn frames(&self) -> usize {
        self.world_from_cyclopean.len()
    }

    /// What the rig sees at frame `k`; `None` past the end.
    pub fn view(&self, k: usize) -> Option<View<'_>> {
        let view = View::new(&self.scene, &self.rig, *self.world_from_cyclopean.get(k)?);
        Some(view.with_rig_errors(self.rig_errors))
    }

    /// Pose of the left camera at frame `k`; `None` past the end.
    pub fn world_from_left(&self, k: usize) -> Option<RigidMotion> {
        self.view(k).map(|view| view.world_from_left())
    }

    /// φ of the cyclopean camera between the frames `k` and `k + 1`; `None` past the end.
    pub fn phi_cyclopean(&self, k: usize) -> Option<Twist> {
        self.motions.get(k).copied()
    }

    /// φ of the left camera between the frames `k` and `k + 1`: the logarithm of the exact relative
    /// motion, and equation (4) of the cyclopean one; `None` past the end.
    pub fn phi(&self, k: usize) -> Option<Twist> {
        self.phi_cyclopean(k).map(|phi| phi.seen_from(&self.rig.left_from_cyclopean()))
    }

    /// Distance from the nearer camera to the nearest surface at frame `k`, in metres; negative where a
    /// camera has left the room or entered a part, NaN where its pose is; `None` past the end.
    pub fn clearance_m(&self, k: usize) -> Option<f64> {
        let (left, right) = self.view(k)?.eyes();
        Some(least(self.scene.clearance_m(&left.origin), self.scene.clearance_m(&right.origin)))
    }

    /// The same sequence, its images taken by a rig that differs from the stated one.
    #[must_use]
    pub fn with_rig_errors(self, rig_errors: RigErrors) -> Self {
        Self { rig_errors, ..self }
    }

    /// The same sequence, its surfaces under the texture of another seed.
    pub fn with_texture(self, seed: u64) -> Self {
        Self { scene: self.scene.with_texture(seed), ..self }
    }
}

/// The rig of section 7.1 at an image size: f = 416.667 px at a width of 320, b = 130 mm.
///
/// `None` if the size is empty.
pub fn paper_rig(size_px: (usize, usize)) -> Option<StereoRig> {
    rig(5.0 / 0.012 / 320.0, 0.13, size_px)
}

/// Pose of the cyclopean camera after `k` frames of φ, k negative too: the reference poses exp(k φ).
pub fn reference_pose(phi: &Twist, k: i32) -> RigidMotion {
    phi.scaled(f64::from(k)).exp().inverse()
}

/// φ from (tX, tY, tZ) in millimetres and (ΩX, ΩY, ΩZ) in degrees.
pub fn twist_from_mm_deg(v: &[f64; 6]) -> Twist {
    let [x, y, z, a, b, c] = *v;
    Twist { t: Vector3::new(x, y, z) * 1e-3, omega: Vector3::new(a, b, c).map(f64::to_radians) }
}

fn rig(focal_per_width: f64, baseline_m: f64, (width, height): (usize, usize)) -> Option<StereoRig> {
    let centre = |n: usize| 0.5 * (n as f64 - 1.0);
    let principal = (centre(width), centre(height));
    StereoRig::new(focal_per_width * width as f64, principal, baseline_m, (width, height)).ok()
}

/// The robot's motion at time `k` in frames: forward at a changing pace, swerving left and back to the
/// obstacle, over a floor that is not quite even.
fn demo_motion(k: f64) -> Twist {
    let pace_mm = 47.0 + 10.0 * (0.33 * k).sin();
    let swerve = (std::f64::consts::TAU * k / (DEMO_FRAMES as f64 - 1.0)).sin();
    let (nod, sway) = (0.12 * (1.7 * k).sin(), 0.10 * (1.1 * k + 0.6).sin());
    twist_from_mm_deg(&[-1.5 * swerve, 0.8 * (1.7 * k).cos(), -pace_mm, nod, 0.85 * swerve, sway])
}

/// Scene motion of the corridor at time `k`, in frames: a walking pace that winds between the pillars, to the right and to
/// the left twice, with a nod.
fn corridor_motion(k: f64) -> Twist {
    let phase = std::f64::consts::TAU * k / (0.5 * (CORRIDOR_FRAMES as f64 - 1.0));
    let (turn, nod) = (phase.cos(), 0.10 * (1.3 * k).sin());
    twist_from_mm_deg(&[
        2.0 * turn,
        1.5 * (1.3 * k).cos(),
        -130.0 - 20.0 * (0.21 * k).sin(),
        nod,
        -2.2 * turn,
        0.5 * nod,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_gives_a_sequence_that_stays_clear() {
        for name in Sequence::names() {
            let sequence = Sequence::named(name, None, None, 1.0).unwrap();
            for k in 0..sequence.frames() {
                assert!(sequence.clearance_m(k).unwrap() > 0.3, "{name} {k} {:?}", sequence.clearance_m(k));
            }
        }
        assert!(Sequence::named("nothing", None, None, 1.0).is_none());
        assert!(Sequence::named("A", Some((0, 240)), None, 1.0).is_none());
    }

    #[test]
    fn the_lab_is_clear_around_every_reference_pose_and_fills_the_image() {
        assert_eq!(Sequence::lab_names().count(), 12);
        for name in Sequence::lab_names() {
            let sequence = Sequence::named(name, None, Some(2), 1.0).unwrap();
            let phi = sequence.phi_cyclopean(0).unwrap();
            for k in -3..=3 {
                let view = View::new(&sequence.scene, &sequence.rig, reference_pose(&phi, k));
                let (left, right) = view.eyes();
                for eye in [left, right] {
                    assert!(sequence.scene.clearance_m(&eye.origin) > 0.35, "{name} {k}");
                }
                for (u, v) in [(0.0, 0.0), (319.0, 0.0), (160.0, 120.0), (0.0, 239.0), (319.0, 239.0)] {
                    let disparity = view.truth_at(u, v).unwrap().disparity_px();
                    assert!((10.0..60.0).contains(&disparity), "{name} {k} {u} {v}: {disparity}");
                }
            }
        }
    }

    #[test]
    fn rig_of_the_paper_at_both_sizes() {
        let rig = paper_rig((640, 480)).unwrap();
        assert!((rig.focal_px - 2500.0 / 3.0).abs() < 1e-9);
        assert_eq!((rig.cx_px, rig.cy_px, rig.baseline_m), (319.5, 239.5, 0.13));
    }

    #[test]
    fn phi_of_the_left_camera_is_the_log_of_its_relative_motion() {
        for name in ["C", "drive", "demo"] {
            let sequence = Sequence::named(name, None, None, 2.0).unwrap();
            for k in 0..sequence.frames() - 1 {
                let [pose, next] = [k, k + 1].map(|k| sequence.world_from_left(k).unwrap());
                let relative = next.inverse().after(&pose).log();
                let phi = sequence.phi(k).unwrap();
                assert!((relative.vector() - phi.vector()).norm() < 1e-12, "{name} {k}");
            }
        }
    }

    #[test]
    fn poses_of_a_constant_sequence_are_the_reference_poses() {
        let sequence = Sequence::named("c", None, Some(5), 1.0).unwrap();
        let (pose, phi) = (sequence.world_from_left(4).unwrap(), sequence.phi(0).unwrap());
        let left = RigidMotion { translation: sequence.rig.left_from_cyclopean(), ..RigidMotion::identity() };
        assert!((pose.translation - left.after(&reference_pose(&phi, 4)).translation).norm() < 1e-12);
        // Scene motion towards the camera drives the camera forward.
        assert!(pose.translation.z > 0.05);
    }

    #[test]
    fn the_demonstration_drives_gently_to_its_obstacle() {
        let sequence = Sequence::named("demo", None, None, 1.0).unwrap();
        assert_eq!(sequence.frames(), DEMO_FRAMES);
        for k in 0..sequence.frames() - 1 {
            let phi = sequence.phi_cyclopean(k).unwrap();
            assert!(
                (0.03..0.06).contains(&phi.t.norm()) && phi.omega.norm().to_degrees() < 1.0,
                "{k} {phi:?}"
            );
        }
        // It starts and ends with its obstacle, the seventh part, ahead, and has come more than 1 m nearer.
        let ahead = |k| sequence.view(k).unwrap().truth_at(sequence.rig.cx_px + 13.0, 290.0).unwrap();
        let (first, last) = (ahead(0), ahead(sequence.frames() - 1));
        assert_eq!((first.surface / 6, last.surface / 6), (6, 6));
        assert!(first.depth_m() - last.depth_m() > 1.0 && last.depth_m() > 1.0, "{first:?} {last:?}");
    }
}
