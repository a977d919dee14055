//! A sequence around its reference poses: images of every draw, and exact truth to judge by.

use std::collections::BTreeMap;

use super::measured::Measured;
use super::record::{Draw, Record};
use super::way::{Quantity, Way};
use crate::geometry::{Field, Grid, Twist};
use crate::metrics::quantile;
use crate::pipeline::Approach;
use crate::sim::sequences::reference_pose;
use crate::sim::{MotionTruth, PointTruth, SensorNoise, Sequence, StereoImages, View};

/// Rays through a pixel at an edge between surfaces, in each direction.
const RAYS: usize = 3;

/// One sequence with one texture: the images of every pose that a draw needs, without noise.
pub(super) struct Stage {
    pub(super) sequence: Sequence,
    pub(super) seed: u64,
    /// φ of the cyclopean camera from one frame of a draw to the next.
    pub(super) phi: Twist,
    unit: Twist,
    step: i32,
    images: BTreeMap<i32, StereoImages>,
}

impl Stage {
    pub(super) fn new(sequence: Sequence, seed: u64, step: u32, poses: &[i32]) -> Self {
        let unit = sequence.phi_cyclopean(0).unwrap_or_else(Twist::zero);
        let step = i32::try_from(step.max(1)).unwrap_or(i32::MAX);
        let mut stage =
            Self { phi: unit.scaled(f64::from(step)), unit, step, images: BTreeMap::new(), sequence, seed };
        for at in poses.iter().flat_map(|&k| stage.times(k)) {
            if !stage.images.contains_key(&at) {
                let images = stage.view(at).render(RAYS);
                stage.images.insert(at, images);
            }
        }
        stage
    }

    /// Poses of the frames t−1, t, t+1 around reference pose `k`.
    fn times(&self, k: i32) -> [i32; 3] {
        [k.saturating_sub(self.step), k, k.saturating_add(self.step)]
    }

    fn view(&self, k: i32) -> View<'_> {
        View::new(&self.sequence.scene, &self.sequence.rig, reference_pose(&self.unit, k))
    }

    /// The frames around one of its reference poses, with noise that no other draw has.
    pub(super) fn frames(&self, k: i32) -> [StereoImages; 3] {
        let noise = SensorNoise::default().with_seed(self.seed);
        // Streams 0, 1, 2 for pose 0, 3, 4, 5 for pose 1, … and the same from the other end below 0.
        let first = i64::from(k).wrapping_mul(3) as u64;
        let mut side = 0;
        self.times(k).map(|at| {
            let stream = first.wrapping_add(side);
            side += 1;
            match self.images.get(&at) {
                Some(images) => noise.expose(images, stream),
                None => noise.expose(&self.view(at).render(RAYS), stream),
            }
        })
    }

    pub(super) fn truth(&self, k: i32) -> Truth {
        let [before, now, after] = self.times(k).map(|at| self.view(at).truth());
        let motion = self.view(k).motion(&now, &self.phi_left());
        let on = |truth: &Grid<Option<PointTruth>>, u: usize, v: usize| truth.at(u, v).map(|t| t.surface);
        let (width, height) = now.size();
        let one_surface = |times: &[&Grid<Option<PointTruth>>], u: usize, v: usize| {
            let inner = u > 0 && v > 0 && u + 1 < width && v + 1 < height;
            let here = on(&now, u, v);
            let stencil = [(u, v), (u + 1, v), (u, v + 1), (u.wrapping_sub(1), v), (u, v.wrapping_sub(1))];
            inner && times.iter().all(|t| stencil.iter().all(|&(u, v)| on(t, u, v) == here))
        };
        let seen = |u: usize, v: usize| {
            let both = now.at(u, v).is_some_and(|point| point.in_right);
            both && motion.at(u, v).is_some_and(|motion| motion.in_later)
        };
        let usable = [&[&before, &now, &after][..], &[&now, &after]]
            .map(|times| Grid::from_fn(width, height, |u, v| one_surface(times, u, v) && seen(u, v)));
        Truth { points: now, motion, usable }
    }

    fn phi_left(&self) -> Twist {
        self.phi.seen_from(&self.sequence.rig.left_from_cyclopean())
    }
}

/// The exact truth of every pixel at t.
pub(super) struct Truth {
    points: Grid<Option<PointTruth>>,
    motion: Grid<Option<MotionTruth>>,
    /// Where the differential and the discrete approach can measure at all.
    usable: [Grid<bool>; 2],
}

impl Truth {
    /// VZ of a map against the truth of its approach: instantaneous, or Z′ − Z.
    pub(super) fn vz(&self, draw: &Draw, way: Way, map: &Field) -> Vec<Record> {
        let discrete = way.approach == Approach::Discrete;
        let usable = &self.usable[usize::from(discrete)];
        let (mut inside, mut anywhere) = (Vec::new(), Vec::new());
        for v in 0..map.height() {
            for u in 0..map.width() {
                let (Some(value), Some(point)) = (map.get(u, v), self.points.at(u, v)) else { continue };
                let Some(motion) = self.motion.at(u, v) else { continue };
                let truth = if discrete { motion.depth_change_m(&point) } else { motion.velocity.z };
                let pair = (1e3 * f64::from(value), 1e3 * truth);
                anywhere.push(pair);
                if usable.at(u, v) {
                    inside.push(pair);
                }
            }
        }
        let record = |quantity, pairs: &[_]| draw.record(Some(way), quantity, pairs);
        record(Quantity::Vz, &inside).into_iter().chain(record(Quantity::VzAnywhere, &anywhere)).collect()
    }

    /// Median errors of disparity and flow at usable pixels.
    pub(super) fn matching(&self, draw: &Draw, measured: &Measured) -> Vec<Record> {
        let usable = &self.usable[1];
        let (mut disparity, mut flow) = (Vec::new(), Vec::new());
        for v in 0..usable.height() {
            for u in (0..usable.width()).filter(|&u| usable.at(u, v)) {
                let (Some(point), Some(motion)) = (self.points.at(u, v), self.motion.at(u, v)) else {
                    continue;
                };
                if let Some(shift) = measured.disparity[1].shift.get(u, v) {
                    disparity.push((f64::from(shift) - point.disparity_px()).abs());
                }
                if let (Some(found), Some(moved)) = (measured.flow.get(u, v), motion.displacement_px(&point))
                {
                    flow.push((found.mean - moved).norm());
                }
            }
        }
        let record = |quantity, errors: &[f64]| {
            let median = quantile(errors, 0.5)?;
            Some(Record { n: errors.len(), ..draw.record(None, quantity, &[(median, 0.0)])? })
        };
        let disparity = record(Quantity::Disparity, &disparity);
        disparity.into_iter().chain(record(Quantity::Flow, &flow)).collect()
    }
}
