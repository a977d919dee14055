//! What corners and their traces are, and one corner followed through the four images of two stereo frames, and back.

use documented::DocumentedFields;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::disparity::{DisparityMap, GUESS_SIGMA_PX};
use super::patch::{Freedom, Localisation, Located, Patch, Settling};
use super::stereo_pyramid::StereoPyramid;
use crate::geometry::{Field, Grid, StereoRig, Twist};

/// A place is found when a step is shorter than this, in pixels; steps shrink tenfold each.
const SETTLED_PX: f64 = 0.01;
/// The same on the way back and on coarse levels, where a tenth of a pixel decides nothing.
const NEARLY_SETTLED_PX: f64 = 0.1;
/// Share of the strength asked of a new corner that one must keep to be followed: windows differ from
/// those of the search, and a corner is not to be lost for little.
const FOLLOWED_STRENGTH: f64 = 0.25;

/// How corners are found and followed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, DocumentedFields)]
#[serde(default, deny_unknown_fields)]
pub struct TrackOptions {
    /// About how many corners are followed.
    pub corners: usize,
    /// Corners weaker than this are not used, in (grey levels per pixel)².
    pub least_strength: f32,
    /// Levels of the image pyramid.
    pub pyramid_levels: usize,
    /// Largest disparity that is searched, in pixels.
    pub largest_disparity_px: usize,
    /// Most iterations of one localisation.
    pub iterations: usize,
    /// Largest distance after following a corner there and back, in pixels.
    pub back_tolerance_px: f64,
    /// Largest root mean square difference of two windows, as a share of the window's contrast.
    pub largest_residual: f64,
}

impl Default for TrackOptions {
    fn default() -> Self {
        Self {
            corners: 1200,
            least_strength: 4.0,
            pyramid_levels: 5,
            largest_disparity_px: 128,
            iterations: 25,
            back_tolerance_px: 0.5,
            largest_residual: 0.5,
        }
    }
}

/// What is known before tracking.
#[derive(Debug, Clone, Copy, Default)]
pub struct Hints<'a> {
    /// Dense disparity of the earlier frame, as shifts u_left − u_right in pixels.
    pub shift: Option<&'a Field>,
    /// Expected scene motion, left camera.
    pub motion: Option<&'a Twist>,
    /// Pixels of the left image never to use, where `true`.
    pub mask: Option<&'a Grid<bool>>,
    /// The same of the right image.
    pub mask_right: Option<&'a Grid<bool>>,
    /// Disparity of the earlier and the later frame that somebody else has measured, as a depth camera does; it takes
    /// the place of their right images.
    pub external_disparity: Option<[&'a DisparityMap; 2]>,
}

/// Where the search of a corner in the later frame starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchStart {
    /// At full resolution: it is expected within a pixel or two.
    FullResolution,
    /// At this level of the pyramid: it is expected within as many pixels as the window has there.
    Level(usize),
}

/// A corner of a frame, located in both its images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StereoCorner {
    /// Column in the left image, in pixels.
    pub u: f64,
    /// Row in both images, in pixels.
    pub v: f64,
    /// u_left − u_right, in pixels.
    pub shift: f64,
    /// Number of frames before this one in which it was seen.
    pub age: u32,
    /// How noise moves its place.
    pub(super) localisation: Localisation,
    /// How its disparity was found.
    pub(super) across: Across,
}

/// How the disparity of a corner was found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) enum Across {
    /// In the right image.
    Matched {
        /// Mean squared difference of the left and the right window.
        residual: f64,
    },
    /// In a map from outside.
    Read {
        /// Variance of the disparity, in px².
        variance: f64,
        /// Its change per pixel in u and in v.
        slope: (f64, f64),
    },
}

/// A corner in two frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trace {
    /// In the earlier frame.
    pub before: StereoCorner,
    /// In the later frame.
    pub after: StereoCorner,
    /// Mean squared difference of the two left windows.
    pub(super) residual: f64,
}

/// Two frames between which corners are followed.
pub(super) struct Follower<'a> {
    pub(super) before: &'a StereoPyramid,
    pub(super) after: &'a StereoPyramid,
    pub(super) rig: &'a StereoRig,
    pub(super) hints: Hints<'a>,
    pub(super) options: &'a TrackOptions,
    pub(super) start: SearchStart,
}

/// Which of the two frames; also the place of its map in [`Hints::external_disparity`].
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

    /// Left to right along the row, and back; or as a map from outside has it.
    pub(super) fn across(
        &self,
        frame: &StereoPyramid,
        time: Time,
        (u, v): (f64, f64),
        shift: f64,
        age: u32,
    ) -> Option<StereoCorner> {
        let patch = Patch::new(&frame.left_spline, u, v)?;
        if patch.strength() < f64::from(self.options.least_strength) * FOLLOWED_STRENGTH {
            return None;
        }
        if let Some(maps) = self.hints.external_disparity {
            let reading = maps[time as usize].read(u, v)?;
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
        if let SearchStart::Level(level) = self.start {
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

/// Whether a place belongs to a masked pixel.
pub(super) fn is_masked(mask: &Grid<bool>, u: f64, v: f64) -> bool {
    let (u, v) = (u.round() as usize, v.round() as usize);
    u < mask.width() && v < mask.height() && mask.at(u, v)
}
