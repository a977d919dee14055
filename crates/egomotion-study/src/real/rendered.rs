//! A sequence around its reference poses: images of every draw, and exact truth.

use std::collections::{BTreeMap, BTreeSet};

use super::contender::ImageContender;
use super::matching::MatchedFrames;
use super::quantity::Quantity;
use super::record::{DrawId, RealRecord};
use crate::synthetic::{EDGE_RAYS, SyntheticWorld};
use egomotion::geometry::{Field, Grid, Twist};
use egomotion::metrics::quantile;
use egomotion::pipeline::Approach;
use egomotion::sim::{SensorNoise, Sequence, StereoImages, View, reference_pose};

/// One sequence with one texture: the images of every pose that a draw needs, without noise.
pub(super) struct RenderedSequence {
    pub(super) sequence: Sequence,
    pub(super) seed: u64,
    /// φ of the cyclopean camera from one frame of the sequence to the next.
    phi: Twist,
    step: i32,
    images: BTreeMap<i32, StereoImages>,
}

impl RenderedSequence {
    pub(super) fn new(sequence: Sequence, seed: u64, step: u32, poses: &[i32]) -> Self {
        let phi = sequence.phi_cyclopean(0).unwrap_or_else(Twist::zero);
        let step = i32::try_from(step.max(1)).unwrap_or(i32::MAX);
        let mut rendered = Self { sequence, seed, phi, step, images: BTreeMap::new() };
        let needed: BTreeSet<i32> = poses.iter().flat_map(|&k| rendered.times(k)).collect();
        rendered.images = needed.into_iter().map(|at| (at, rendered.view(at).render(EDGE_RAYS))).collect();
        rendered
    }

    /// φ of the cyclopean camera from one frame of a draw to the next.
    pub(super) fn motion(&self) -> Twist {
        self.phi.scaled(self.step.into())
    }

    /// Poses of the frames t−1, t, t+1 around reference pose `k`.
    fn times(&self, k: i32) -> [i32; 3] {
        [k.saturating_sub(self.step), k, k.saturating_add(self.step)]
    }

    fn view(&self, k: i32) -> View<'_> {
        View::new(&self.sequence.scene, &self.sequence.rig, reference_pose(&self.phi, k))
    }

    /// The frames around a reference pose, with noise that no other draw has.
    pub(super) fn frames(&self, k: i32) -> [StereoImages; 3] {
        let noise = SensorNoise::default().with_seed(self.seed);
        let mut stream = i64::from(k).wrapping_mul(3) as u64;
        self.times(k).map(|at| {
            stream = stream.wrapping_add(1);
            match self.images.get(&at) {
                Some(images) => noise.expose(images, stream),
                None => noise.expose(&self.view(at).render(EDGE_RAYS), stream),
            }
        })
    }

    /// The truth at a reference pose.
    pub(super) fn truth(&self, k: i32) -> PixelTruth {
        let Sequence { scene, rig, .. } = &self.sequence;
        let world = SyntheticWorld::new(scene, rig, &self.phi, k, self.step.into());
        let (view, motion) = (self.view(k), world.phi.exp());
        let vz = |u: usize, v: usize| {
            let point = rig.point(&view.structure_at(u as f64, v as f64)?.0)?;
            Some([world.phi.velocity(&point).z, motion.apply(&point).z - point.z])
        };
        PixelTruth { vz_m: Grid::from_fn(rig.width_px, rig.height_px, vz), world }
    }
}

/// The exact truth at t.
pub(super) struct PixelTruth {
    world: SyntheticWorld,
    /// VZ and Z′ − Z of every pixel, in metres per frame.
    vz_m: Grid<Option<[f64; 2]>>,
}

impl PixelTruth {
    /// A map of VZ against the truth of its approach: where it can be measured, and anywhere it was.
    pub(super) fn vz(&self, draw: &DrawId, contender: ImageContender, map: &Field) -> Vec<RealRecord> {
        let differential = contender.approach == Approach::Differential;
        let found = map.grid().values();
        let pair = |found: f32, vz_m: f64| (1e3 * f64::from(found), 1e3 * vz_m);
        let usable = self.world.usable_in(contender.approach);
        let inside: Vec<(f64, f64)> = usable
            .map(|pixel| (pixel.index, pixel.depth_velocity_m(contender.approach)))
            .filter_map(|(index, vz_m)| Some(pair(*found.get(index)?, vz_m)))
            .collect();
        let anywhere: Vec<(f64, f64)> = found
            .iter()
            .zip(self.vz_m.values())
            .filter_map(|(&found, vz_m)| Some(pair(found, vz_m.map(|vz| vz[usize::from(!differential)])?)))
            .collect();
        let record = |quantity, pairs: &[_]| draw.record(Some(contender), quantity, pairs);
        record(Quantity::Vz, &inside).into_iter().chain(record(Quantity::VzAnywhere, &anywhere)).collect()
    }

    /// Median errors of disparity and of flow, where they can be matched.
    pub(super) fn matching(&self, draw: &DrawId, matched: &MatchedFrames) -> Vec<RealRecord> {
        let width = self.vz_m.width();
        let (mut disparity, mut flow) = (Vec::new(), Vec::new());
        for pixel in self.world.usable_in(Approach::Discrete) {
            let (u, v) = (pixel.index % width, pixel.index / width);
            if let Some(shift) = matched.disparity[1].shift.get(u, v) {
                disparity.push((matched.rig.disparity_from_shift(shift.into()) - pixel.xyd.z).abs());
            }
            if let Some(found) = matched.flow.get(u, v) {
                flow.push((found.mean - (pixel.later_xyd - pixel.xyd).xy()).norm());
            }
        }
        let record = |quantity, errors: &[f64]| {
            let median = quantile(errors, 0.5)?;
            Some(RealRecord { n: errors.len(), ..draw.record(None, quantity, &[(median, 0.0)])? })
        };
        let disparity = record(Quantity::Disparity, &disparity);
        disparity.into_iter().chain(record(Quantity::Flow, &flow)).collect()
    }
}
