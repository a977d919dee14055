//! Scenes that leave a motion, or an estimator, short of something: what is reported observed.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::measure::{differential, discrete};
use super::setting::{Ends, Kind, Setting, Solve, by_displacements, by_velocities};
use super::site::Site;
use crate::contender::Contender;
use egomotion::geometry::{StereoRig, Twist};
use egomotion::pipeline::Approach;
use egomotion::sim::{paper_rig, twist_from_mm_deg};

/// Noise of the points, in pixels.
const NOISE_PX: f64 = 0.125;
/// Points of a scene.
const POINTS: usize = 512;

/// A plane normal · P = offset, in metres.
type Plane = ([f64; 3], f64);

/// A scene of planes, seen through parts of the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Degenerate {
    /// Its name in files.
    pub name: &'static str,
    /// Planes, each seen in a strip of the image of the same width.
    planes: &'static [Plane],
    /// (tX … ΩZ) in mm and degrees.
    motion: [f64; 6],
    /// The points lie in so many rows of the image; `None`: anywhere.
    rows: Option<usize>,
    points: usize,
}

const WALL: Plane = ([0.0, 0.0, 1.0], 3.0);
const SLANTED: Plane = ([0.3, 0.2, 1.0], 3.0);
const SIDE: Plane = ([0.6, 0.0, 1.0], 2.5);
const GROUND: Plane = ([0.0, 0.8, 0.6], 2.0);
const C: [f64; 6] = [10.0, -10.0, -15.0, 0.1, 0.1, 0.0];
const TURN: [f64; 6] = [0.0, 0.0, 0.0, 0.1, -0.25, 0.2];

/// The scenes: what is missing, and one where nothing is.
pub const SCENES: [Degenerate; 8] = [
    Degenerate {
        name: "three planes",
        planes: &[SLANTED, SIDE, GROUND],
        motion: C,
        rows: None,
        points: POINTS,
    },
    Degenerate { name: "two planes", planes: &[SLANTED, SIDE], motion: C, rows: None, points: POINTS },
    Degenerate { name: "one plane", planes: &[SLANTED], motion: C, rows: None, points: POINTS },
    Degenerate { name: "a single depth", planes: &[WALL], motion: C, rows: None, points: POINTS },
    Degenerate {
        name: "pure rotation",
        planes: &[SLANTED, SIDE, GROUND],
        motion: TURN,
        rows: None,
        points: POINTS,
    },
    Degenerate { name: "points on a line", planes: &[SLANTED], motion: C, rows: Some(1), points: POINTS },
    Degenerate { name: "three points", planes: &[SLANTED, SIDE, GROUND], motion: C, rows: None, points: 3 },
    Degenerate { name: "two points", planes: &[SLANTED, SIDE], motion: C, rows: None, points: 2 },
];

/// What one contender reports about one scene.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Draws.
    pub draws: usize,
    /// Draws with an answer.
    pub answered: usize,
    /// Answers that report each component observed.
    pub observed: [usize; 6],
    /// Of those, within 3 of their own σ of the truth.
    pub within_3: [usize; 6],
}

impl Report {
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

impl Degenerate {
    /// What `contenders` report, over so many draws.
    pub fn reports(&self, contenders: &[Contender], draws: usize, seed: u64) -> Vec<Report> {
        let Some(rig) = paper_rig((320, 240)) else { return Vec::new() };
        let truth = twist_from_mm_deg(&self.motion);
        let of_draw = |i: usize| self.draw(&rig, &truth, contenders, seed.wrapping_mul(1_000_003) + i as u64);
        let all: Vec<Vec<Report>> = (0..draws).into_par_iter().map(of_draw).collect();
        let zero = vec![Report::default(); contenders.len()];
        all.iter().fold(zero, |sums, more| sums.iter().zip(more).map(|(a, b)| a.merged(b)).collect())
    }

    fn draw(&self, rig: &StereoRig, truth: &Twist, contenders: &[Contender], seed: u64) -> Vec<Report> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let sites = self.sites(rig, truth, &mut rng);
        let setting = Setting {
            noise_px: NOISE_PX,
            ends: Ends::Later,
            points: self.points,
            outliers: 0.0,
            kind: Kind::Uniform,
        };
        let velocities = by_velocities(differential(&sites, &setting, &mut rng), rig, seed);
        let displacements = by_displacements(discrete(&sites, &setting, &mut rng), rig, seed);
        let judge = |contender: &Contender| {
            let solve: &Solve<'_> = match contender.approach {
                Approach::Differential => &velocities,
                Approach::Discrete => &displacements,
            };
            let Ok(found) = solve(contender).and_then(|found| found.with_unbounded_unobserved()) else {
                return Report { draws: 1, ..Report::default() };
            };
            let error = found.theta.mean - truth.vector();
            let near = |i: usize| found.observed[i] && error[i].powi(2) <= 9.0 * found.theta.cov[(i, i)];
            Report {
                draws: 1,
                answered: 1,
                observed: found.observed.map(usize::from),
                within_3: std::array::from_fn(|i| usize::from(near(i))),
            }
        };
        contenders.iter().map(judge).collect()
    }

    /// Random places of the image, whole pixels; each plane has a strip of it.
    fn sites(&self, rig: &StereoRig, phi: &Twist, rng: &mut Pcg64Mcg) -> Vec<Site> {
        let (width, height) = (rig.width_px as f64, rig.height_px as f64);
        let site = |i: usize| {
            let u = rng.random_range(0.0..width).floor();
            let v = self
                .rows
                .map_or_else(|| rng.random_range(0.0..height).floor(), |rows| (40 + 9 * (i % rows)) as f64);
            let strip = ((u / width * self.planes.len() as f64) as usize).min(self.planes.len() - 1);
            let (normal, offset) = self.planes[strip];
            Site::of_plane(rig, phi, &Vector3::from(normal), offset, rig.image_from_pixel(u, v))
        };
        (0..self.points).filter_map(site).collect()
    }
}
