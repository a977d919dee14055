//! What is given of one time: images, and what is known of them already.

use nalgebra::Vector3;

use super::answer::Unanswered;
use super::memory::TimedFrame;
use crate::geometry::{Field, Grid, Image, RigErrors, StereoRig};
use crate::observe::tracks::StereoCorner;
use crate::observe::{DisparityMap, FlowField, StereoPyramid};

/// A rectified pair of images of one time.
#[derive(Debug, Clone, PartialEq)]
pub struct StereoFrame {
    /// Time in seconds; it must increase from frame to frame.
    pub time_s: f64,
    /// Left image, of the rig's size.
    pub left: Image,
    /// Right image, of the rig's size.
    pub right: Image,
}

/// What is given of one time: the left image, and a right image or disparity or both.
///
/// What is given is not computed. Without a right image the corners take their disparity from the map
/// too: a depth camera is a rig whose disparity is given (see [`super::RgbdMotion`]).
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Time in seconds; it must increase from frame to frame.
    pub time_s: f64,
    /// Left image, of the rig's size.
    pub left: Image,
    /// Right image, of the rig's size.
    pub right: Option<Image>,
    /// Disparity of the left image's pixels.
    pub disparity: Option<DisparityMap>,
    /// Flow of the left image to the next frame; not used where that one is bad and another is compared with.
    pub flow: Option<FlowField>,
}

impl From<StereoFrame> for Frame {
    fn from(StereoFrame { time_s, left, right }: StereoFrame) -> Self {
        Self { time_s, left, right: Some(right), disparity: None, flow: None }
    }
}

/// Least standard deviation of a usable image's grey levels, on the scale of 0 to 255.
const LEAST_CONTRAST: f64 = 1.0;

impl Frame {
    /// Whether depth is given in place of a right image, so that shape tells of motion where texture does not.
    fn is_shape(&self) -> bool {
        self.right.is_none() && self.disparity.is_some()
    }

    /// Whether nothing but its shape tells it from another frame.
    pub(super) fn is_blank(&self) -> bool {
        self.is_shape() && contrast(&self.left) < LEAST_CONTRAST
    }

    /// Whether its images and maps can be used with a rig.
    pub(super) fn check(&self, rig: &StereoRig) -> Result<(), Unanswered> {
        let sized = |what: &str, size| sized(what, size, rig);
        for (side, image) in [("left", Some(&self.left)), ("right", self.right.as_ref())] {
            let Some(image) = image else { continue };
            sized(&format!("{side} image"), image.size())?;
            let contrast = contrast(image);
            if contrast.is_nan() {
                return Err(Unanswered::BadImage(format!(
                    "the {side} image has values that are not numbers"
                )));
            }
            if contrast < LEAST_CONTRAST && !self.is_shape() {
                return Err(Unanswered::BadImage(format!("the {side} image is constant")));
            }
        }
        if let Some(flow) = &self.flow {
            sized("flow", flow.size())?;
        }
        match &self.disparity {
            Some(map) => {
                sized("disparity map", map.shift.size())?;
                sized("disparity's standard deviation", map.sigma.size())
            }
            None if self.right.is_none() => Err(Unanswered::MissingRight),
            None => Ok(()),
        }
    }
}

/// A frame with all that is computed of it alone: what later ones are matched with.
#[derive(Debug)]
pub(super) struct PreparedFrame {
    /// Index, counted over all frames pushed or skipped.
    pub(super) frame: usize,
    pub(super) time_s: f64,
    pub(super) images: StereoPyramid,
    pub(super) disparity: Option<DisparityMap>,
    /// Given flow to the next frame.
    pub(super) flow: Option<FlowField>,
    /// Corners that were followed here from the frame before.
    pub(super) corners: Vec<StereoCorner>,
}

impl TimedFrame for PreparedFrame {
    fn moment(&self) -> (usize, f64) {
        (self.frame, self.time_s)
    }
}

impl PreparedFrame {
    /// Whether it is a copy of another: in its images, and where they are `blank` in its disparity too.
    pub(super) fn repeats(&self, other: &Self, blank: bool) -> bool {
        let same_shape = || self.disparity.as_ref().map(bits) == other.disparity.as_ref().map(bits);
        self.images.repeats(&other.images) && (!blank || same_shape())
    }
}

/// The values of a map, missing pixels included, for comparison.
fn bits(map: &DisparityMap) -> Vec<u32> {
    map.shift.grid().values().iter().map(|value| value.to_bits()).collect()
}

/// Whether a plane is as wide and high as the rig's images.
pub(super) fn sized(what: &str, (w, h): (usize, usize), rig: &StereoRig) -> Result<(), Unanswered> {
    let expected = (rig.width_px, rig.height_px);
    let reason = || format!("the {what} is {w}x{h}, the rig {}x{}", expected.0, expected.1);
    if (w, h) == expected { Ok(()) } else { Err(Unanswered::BadImage(reason())) }
}

/// Standard deviation of the grey levels; NaN if one of them is not a number.
fn contrast(image: &Image) -> f64 {
    const LANES: usize = 8;
    let n = image.values().len().max(1) as f64;
    // Differences from one grey level: squares of the levels themselves would cancel.
    let level = f64::from(image.values().first().copied().unwrap_or(0.0));
    let (mut sums, mut squares) = ([0.0; LANES], [0.0; LANES]);
    let (chunks, rest) = image.values().as_chunks::<LANES>();
    for chunk in chunks {
        for i in 0..LANES {
            let x = f64::from(chunk[i]) - level;
            sums[i] += x;
            squares[i] += x * x;
        }
    }
    let rest = rest.iter().map(|&v| f64::from(v) - level);
    let mean = (sums.iter().sum::<f64>() + rest.clone().sum::<f64>()) / n;
    let square = (squares.iter().sum::<f64>() + rest.map(|x| x * x).sum::<f64>()) / n;
    let variance = square - mean * mean;
    // Rounding may make it negative, and comparisons must let NaN through.
    if variance < 0.0 { 0.0 } else { variance.sqrt() }
}

/// Clear the pixels that the mask excludes.
pub(super) fn erase(field: &mut Field, mask: &Grid<bool>) {
    for v in 0..field.height().min(mask.height()) {
        for (value, &masked) in field.row_mut(v).iter_mut().zip(mask.row(v)) {
            if masked {
                *value = f32::NAN;
            }
        }
    }
}

/// Take known errors of the right camera away from the shifts.
pub(super) fn correct(shift: &mut Field, errors: &RigErrors, rig: &StereoRig) {
    for v in 0..shift.height() {
        for (u, value) in shift.row_mut(v).iter_mut().enumerate() {
            let (x, y) = rig.image_from_pixel(u as f64, v as f64);
            let xyd = Vector3::new(x, y, rig.disparity_from_shift(f64::from(*value)));
            let excess = errors.disparity_excess_px(&xyd, rig);
            // A point beyond the horizon is none.
            *value = if xyd.z > excess { *value - excess as f32 } else { f32::NAN };
        }
    }
}

/// Clear the shifts whose pixel of the right image the mask excludes.
pub(super) fn erase_partners(shift: &mut Field, mask: &Grid<bool>) {
    for v in 0..shift.height().min(mask.height()) {
        for (u, value) in shift.row_mut(v).iter_mut().enumerate() {
            // NaN and what lies left of the image become 0, which the first column answers for.
            let partner = (u as f32 - *value).round() as usize;
            if partner < mask.width() && mask.at(partner, v) {
                *value = f32::NAN;
            }
        }
    }
}
