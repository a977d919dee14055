//! Degenerate scenes, which leave a motion or an estimator short of something: what is reported as observed.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::exact_point::ExactPoint;
use super::factors::{Ends, Factors, OutlierKind};
use super::measurements::{differential, discrete};
use super::solver::{ContenderSolver, by_displacements, by_velocities};
use crate::synthetic::{Contender, draw_seed};
use egomotion::geometry::{StereoRig, Twist};
use egomotion::pipeline::Approach;
use egomotion::sim::{paper_rig, twist_from_mm_deg};

/// Size of the image, width and height in pixels: that of the synthetic world.
const SIZE_PX: (usize, usize) = (320, 240);
/// Standard deviation of the points' noise, in pixels: that of the paper's real baseline.
const NOISE_PX: f64 = 0.125;
/// Points of a scene that lacks none: enough that a missing component is the scene's fault, not that of chance.
const POINTS: usize = 512;
/// Row of the image from which points on lines are taken, in pixels.
const FIRST_ROW: usize = 40;
/// Distance of the next line, in pixels.
const ROW_STEP: usize = 9;
/// A motion with every component but ΩZ: that of sequence C, in millimetres and degrees.
const ALL_BUT_ROLL: [f64; 6] = [10.0, -10.0, -15.0, 0.1, 0.1, 0.0];
/// A rotation about all three axes, in millimetres and degrees.
const PURE_ROTATION: [f64; 6] = [0.0, 0.0, 0.0, 0.1, -0.25, 0.2];
/// A wall that faces the camera: all of it at one depth.
const WALL: ScenePlane = ScenePlane { normal: [0.0, 0.0, 1.0], offset_m: 3.0 };
/// A wall that slants in both directions.
const SLANTED: ScenePlane = ScenePlane { normal: [0.3, 0.2, 1.0], offset_m: 3.0 };
/// A wall that slants to the side.
const SIDE: ScenePlane = ScenePlane { normal: [0.6, 0.0, 1.0], offset_m: 2.5 };
/// The ground.
const GROUND: ScenePlane = ScenePlane { normal: [0.0, 0.8, 0.6], offset_m: 2.0 };

/// The plane normal · P = offset.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ScenePlane {
    normal: [f64; 3],
    offset_m: f64,
}

/// A scene of planes, seen through parts of the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DegenerateScene {
    /// Its name in files.
    pub name: &'static str,
    /// Planes, each seen in a strip of the image of the same width.
    planes: &'static [ScenePlane],
    /// (tX … ΩZ) in mm and degrees.
    motion: [f64; 6],
    /// Number of rows of the image in which the points lie; `None`: anywhere.
    rows: Option<usize>,
    points: usize,
}

/// The scenes: several that lack something, and "three planes", which lacks nothing.
pub const SCENES: [DegenerateScene; 8] = [
    DegenerateScene::new("three planes", &[SLANTED, SIDE, GROUND]),
    DegenerateScene::new("two planes", &[SLANTED, SIDE]),
    DegenerateScene::new("one plane", &[SLANTED]),
    DegenerateScene::new("a single depth", &[WALL]),
    DegenerateScene {
        motion: PURE_ROTATION,
        ..DegenerateScene::new("pure rotation", &[SLANTED, SIDE, GROUND])
    },
    DegenerateScene { rows: Some(1), ..DegenerateScene::new("points on a line", &[SLANTED]) },
    DegenerateScene { points: 3, ..DegenerateScene::new("three points", &[SLANTED, SIDE, GROUND]) },
    DegenerateScene { points: 2, ..DegenerateScene::new("two points", &[SLANTED, SIDE]) },
];

/// How often one contender reports each component as observed in one scene.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct ObservedCounts {
    /// Draws.
    pub draws: usize,
    /// Draws with an answer.
    pub answered: usize,
    /// Answers that report each component as observed.
    pub observed: [usize; 6],
    /// Of those, answers within 3 of their own σ of the truth.
    pub within_3: [usize; 6],
}

impl ObservedCounts {
    fn merged(mut self, other: &Self) -> Self {
        self.draws += other.draws;
        self.answered += other.answered;
        for i in 0..6 {
            self.observed[i] += other.observed[i];
            self.within_3[i] += other.within_3[i];
        }
        self
    }
}

impl DegenerateScene {
    /// A scene of planes with points anywhere, moving as sequence C.
    const fn new(name: &'static str, planes: &'static [ScenePlane]) -> Self {
        Self { name, planes, motion: ALL_BUT_ROLL, rows: None, points: POINTS }
    }

    /// The counts of each of `contenders`, over so many draws.
    pub fn observed(&self, contenders: &[Contender], draws: usize, seed: u64) -> Vec<ObservedCounts> {
        let Some(rig) = paper_rig(SIZE_PX) else { return Vec::new() };
        let truth = twist_from_mm_deg(&self.motion);
        let of_draw = |i: usize| self.draw(&rig, &truth, contenders, draw_seed(seed, i));
        let all: Vec<Vec<ObservedCounts>> = (0..draws).into_par_iter().map(of_draw).collect();
        let zero = vec![ObservedCounts::default(); contenders.len()];
        all.iter().fold(zero, |sums, more| sums.iter().zip(more).map(|(a, b)| a.merged(b)).collect())
    }

    fn draw(
        &self,
        rig: &StereoRig,
        truth: &Twist,
        contenders: &[Contender],
        seed: u64,
    ) -> Vec<ObservedCounts> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let points = self.exact_points(rig, truth, &mut rng);
        let factors = Factors {
            noise_px: NOISE_PX,
            ends: Ends::Later,
            points: self.points,
            outliers: 0.0,
            outlier_kind: OutlierKind::Uniform,
        };
        let velocities = by_velocities(differential(&points, &factors, &mut rng), rig, seed);
        let displacements = by_displacements(discrete(&points, &factors, &mut rng), rig, seed);
        let report = |contender: &Contender| {
            let solve: &ContenderSolver<'_> = match contender.approach {
                Approach::Differential => &velocities,
                Approach::Discrete => &displacements,
            };
            let Ok(found) = solve(contender).and_then(|found| found.with_unbounded_unobserved()) else {
                return ObservedCounts { draws: 1, ..ObservedCounts::default() };
            };
            let error = found.theta.mean - truth.vector();
            let near = |i: usize| found.observed[i] && error[i].powi(2) <= 9.0 * found.theta.cov[(i, i)];
            ObservedCounts {
                draws: 1,
                answered: 1,
                observed: found.observed.map(usize::from),
                within_3: std::array::from_fn(|i| usize::from(near(i))),
            }
        };
        contenders.iter().map(report).collect()
    }

    /// Random places of the image, whole pixels; each plane has a strip of it.
    fn exact_points(&self, rig: &StereoRig, phi: &Twist, rng: &mut Pcg64Mcg) -> Vec<ExactPoint> {
        let (width, height) = (rig.width_px as f64, rig.height_px as f64);
        let point = |i: usize| {
            let u = rng.random_range(0.0..width).floor();
            let v = self.rows.map_or_else(
                || rng.random_range(0.0..height).floor(),
                |rows| (FIRST_ROW + ROW_STEP * (i % rows)) as f64,
            );
            let strip = ((u / width * self.planes.len() as f64) as usize).min(self.planes.len() - 1);
            let ScenePlane { normal, offset_m } = self.planes[strip];
            ExactPoint::of_plane(rig, phi, &Vector3::from(normal), offset_m, rig.image_from_pixel(u, v))
        };
        (0..self.points).filter_map(point).collect()
    }
}
