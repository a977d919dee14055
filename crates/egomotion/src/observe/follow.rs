//! One corner followed through the four images of two stereo frames, and back.

use nalgebra::Vector3;

use super::disparity::GUESS_SIGMA_PX;
use super::patch::{Freedom, Located, Patch, Settling};
use super::stereo_pyramid::StereoPyramid;
use super::tracks::{Across, Expected, Hints, StereoCorner, Trace, TrackOptions, is_masked};
use crate::geometry::{StereoRig, Twist};

/// A place is found when a step is shorter than this, in pixels; steps shrink tenfold each.
const SETTLED_PX: f64 = 0.01;
/// The same on the way back and on coarse levels, where a tenth of a pixel decides nothing.
const NEARLY_SETTLED_PX: f64 = 0.1;

/// Two frames between which corners are followed.
pub(super) struct Follower<'a> {
    pub(super) before: &'a StereoPyramid,
    pub(super) after: &'a StereoPyramid,
    pub(super) rig: &'a StereoRig,
    pub(super) hints: Hints<'a>,
    pub(super) options: &'a TrackOptions,
    pub(super) expected: Expected,
}

/// Which of the two frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Time {
    Earlier,
    Later,
}

impl Follower<'_> {
    /// A corner of the earlier frame in the later one.
    pub(super) fn trace(&self, corner: &StereoCorner) -> Option<Trace> {
        let (next, scale) = self.in_time(corner)?;
        if self.hints.mask.is_some_and(|mask| is_masked(mask, next.u, next.v)) {
            return None;
        }
        let after =
            self.across(self.after, Time::Later, (next.u, next.v), corner.shift * scale, corner.age + 1)?;
        Some(Trace { before: *corner, after, residual: next.residual })
    }

    /// Left to right along the row, and back; or as the given map has it.
    pub(super) fn across(
        &self,
        frame: &StereoPyramid,
        time: Time,
        (u, v): (f64, f64),
        shift: f64,
        age: u32,
    ) -> Option<StereoCorner> {
        let patch = Patch::new(&frame.left_spline, u, v)?;
        if patch.strength() < f64::from(self.options.least_strength) * WEAKENED {
            return None;
        }
        if let Some(given) = self.hints.given {
            let reading = given[time as usize].read(u, v)?;
            let across = Across::Read { variance: reading.variance, slope: reading.slope };
            let known = reading.variance < f64::from(GUESS_SIGMA_PX).powi(2);
            let positive = self.rig.disparity_from_shift(reading.shift) > 0.0;
            let localisation = patch.localisation()?;
            return (known && positive).then_some(StereoCorner {
                u,
                v,
                shift: reading.shift,
                age,
                localisation,
                across,
            });
        }
        let found =
            patch.locate(&frame.right_spline, (u - shift, v), Freedom::Row, self.settling(SETTLED_PX))?;
        if self.hints.mask_right.is_some_and(|mask| is_masked(mask, found.u, found.v)) {
            return None;
        }
        let shift = u - found.u;
        if !self.acceptable(&patch, &found) || self.rig.disparity_from_shift(shift) <= 0.0 {
            return None;
        }
        let back = Patch::new(&frame.right_spline, found.u, found.v)?;
        let home = back.locate(&frame.left_spline, (u, v), Freedom::Row, self.settling(NEARLY_SETTLED_PX))?;
        let localisation = patch.localisation()?;
        ((home.u - u).abs() <= self.options.back_tolerance_px).then_some(StereoCorner {
            u,
            v,
            shift,
            age,
            localisation,
            across: Across::Matched { residual: found.residual },
        })
    }

    /// Left to the next left, and back; also the magnification.
    fn in_time(&self, corner: &StereoCorner) -> Option<(Located, f64)> {
        let (u, v) = (corner.u, corner.v);
        let (mut start, scale) = match self.hints.motion {
            Some(motion) => self.predict((u, v), corner.shift, motion)?,
            None => ((u, v), 1.0),
        };
        if let Expected::FromLevel(level) = self.expected {
            start = self.coarse_to_fine((u, v), start, level);
        }
        let patch = Patch::magnified(&self.before.left_spline, u, v, scale)?;
        let found =
            patch.locate(&self.after.left_spline, start, Freedom::Plane, self.settling(SETTLED_PX))?;
        if !self.acceptable(&patch, &found) {
            return None;
        }
        let back = Patch::magnified(&self.after.left_spline, found.u, found.v, scale.recip())?;
        let settling = self.settling(NEARLY_SETTLED_PX);
        let home = back.locate(&self.before.left_spline, (u, v), Freedom::Plane, settling)?;
        let distance = (home.u - u).hypot(home.v - v);
        (distance <= self.options.back_tolerance_px).then_some((found, scale))
    }

    fn settling(&self, step_px: f64) -> Settling {
        Settling { iterations: self.options.iterations, step_px }
    }

    fn acceptable(&self, patch: &Patch, found: &Located) -> bool {
        found.residual.sqrt() <= self.options.largest_residual * patch.contrast()
    }

    /// Where the still world's point would be, and by how much its image grows.
    fn predict(&self, (u, v): (f64, f64), shift: f64, motion: &Twist) -> Option<((f64, f64), f64)> {
        let (x, y) = self.rig.image_from_pixel(u, v);
        let d = self.rig.disparity_from_shift(shift);
        let moved = motion.exp().apply(&self.rig.point(&Vector3::new(x, y, d))?);
        let after = self.rig.project(&moved)?;
        Some((self.rig.pixel_from_image(after.x, after.y), after.z / d))
    }

    /// A start at full resolution from one at a coarse level, down to half resolution.
    ///
    /// The levels serve as spline coefficients as they are, which only smooths them a little more.
    fn coarse_to_fine(&self, (u, v): (f64, f64), start: (f64, f64), coarsest: usize) -> (f64, f64) {
        let levels = self.before.left.levels().iter().zip(self.after.left.levels());
        let levels: Vec<_> = levels.enumerate().skip(1).take(coarsest).collect();
        levels.into_iter().rev().fold(start, |start, (level, (before, after))| {
            let size = (1 << level) as f64;
            let found = Patch::new(before, u / size, v / size).and_then(|patch| {
                let start = (start.0 / size, start.1 / size);
                patch.locate(after, start, Freedom::Plane, self.settling(NEARLY_SETTLED_PX))
            });
            found.map_or(start, |found| (found.u * size, found.v * size))
        })
    }
}

/// Share of the strength asked of a new corner that one must keep to be followed: windows differ from
/// those of the search, and a corner is not to be lost for little.
const WEAKENED: f64 = 0.25;
