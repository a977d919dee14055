//! Dense disparity of a rectified pair, with its standard deviation.
//!
//! Five steps: census words of both images, semi-global matching, checks that decide which winners
//! to believe, photometric sub-pixel refinement, and holes filled from either side. What is filled
//! in has a standard deviation of [`GUESS_SIGMA_PX`] and more; wide holes stay missing.

mod area;
mod census;
mod compare;
mod depth_edges;
mod lucas_kanade;
mod reading;
mod semi_global;
mod smoothing;
mod subpixel;
mod sweep;
mod winners;

use documented::DocumentedFields;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use reading::Reading;

use crate::geometry::{Field, Image};

/// Which matcher finds the disparities that refinement begins with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Matcher {
    /// Census and semi-global matching: dense, robust.
    #[default]
    SemiGlobal,
    /// Area correlation to 1/16 pixel, as the stereo cameras of the paper have it. Answers where there
    /// is texture; its disparities are not refined.
    AreaCorrelation,
}

/// How disparity is found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, DocumentedFields)]
#[serde(default, deny_unknown_fields)]
pub struct DisparityOptions {
    /// Disparities tried: 0 … `levels` − 1 pixels. Limited to the image's width.
    pub levels: usize,
    /// Which matcher.
    pub matcher: Matcher,
    /// Semi-global matching: a winner's cost must be lower than every rival's by this fraction, 0 … 1.
    pub uniqueness: f32,
    /// Connected pieces of fewer pixels are removed.
    pub speckle_size: usize,
    /// Whether gaps no wider than `levels` are filled along the row, with a large standard deviation.
    pub fill: bool,
    /// For experts: settings that few have a reason to change.
    pub expert: DisparityExpert,
}

impl Default for DisparityOptions {
    fn default() -> Self {
        Self {
            levels: 128,
            matcher: Matcher::default(),
            uniqueness: 0.01,
            speckle_size: 100,
            fill: true,
            expert: DisparityExpert::default(),
        }
    }
}

/// For experts: how areas are correlated, which depends on the camera that [`Matcher::AreaCorrelation`] stands for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, DocumentedFields)]
#[serde(default, deny_unknown_fields)]
pub struct DisparityExpert {
    /// Area correlation: half width of the square window, at most 10 pixels.
    pub area_radius_px: usize,
    /// Area correlation: a winner's cost must be lower than every rival's by this fraction, 0 … 1.
    pub area_uniqueness: f32,
    /// Area correlation: least mean absolute slope of a window, in quarters of a grey level of 8 bits per pixel.
    pub area_texture: f32,
}

impl Default for DisparityExpert {
    fn default() -> Self {
        Self { area_radius_px: 4, area_uniqueness: 0.1, area_texture: 1.0 }
    }
}

/// Difference of disparity that still connects neighbours to one piece, in pixels: a larger one lets speckles hang on
/// surfaces, a smaller one tears slanted surfaces to pieces.
const SPECKLE_RANGE_PX: f32 = 1.0;

/// Standard deviation from which on a disparity is a guess and no measurement, in pixels: all that
/// is filled in, and where grey levels contradict the matching.
///
/// Such values tell where surfaces are; motion is not to be estimated from them, for their errors
/// are systematic: an occluded pixel keeps its side of the object.
pub const GUESS_SIGMA_PX: f32 = 1.0;

/// Disparity of the left image's pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct DisparityMap {
    /// u_left − u_right, in pixels; missing where no match is to be believed.
    pub shift: Field,
    /// Its standard deviation, in pixels; present where `shift` is.
    pub sigma: Field,
}

/// Why there is no disparity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DisparityError {
    /// The images of a pair differ in size: (width, height), in pixels.
    #[error("the left image is {left:?} pixels, the right one {right:?}: a rectified pair has one size")]
    SizeMismatch {
        /// Size of the left image.
        left: (usize, usize),
        /// Size of the right image.
        right: (usize, usize),
    },
}

/// Finds the disparity of one pair after another, and keeps its work space between them.
///
/// ```
/// use egomotion::geometry::Image;
/// use egomotion::observe::disparity::{DisparityMatcher, DisparityOptions};
///
/// let texture = |u: usize, v: usize| ((u * 7919 + v * 104_729) % 251) as f32;
/// let left = Image::from_fn(80, 40, texture);
/// let right = Image::from_fn(80, 40, |u, v| texture(u + 6, v));
/// let mut matcher = DisparityMatcher::new(DisparityOptions { levels: 32, ..Default::default() });
/// let map = matcher.compute(&left, &right)?;
/// assert!((map.shift.get(50, 20).unwrap() - 6.0).abs() < 0.1);
/// # Ok::<(), egomotion::observe::disparity::DisparityError>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct DisparityMatcher {
    options: DisparityOptions,
    left_words: census::Census,
    right_words: census::Census,
    semi_global: semi_global::SemiGlobal,
    left_slopes: area::Slopes,
    right_slopes: area::Slopes,
    area: area::AreaCorrelation,
    winners: Vec<f32>,
    /// Of the area correlation's winners.
    sigma: Vec<f32>,
    speckles: winners::Speckles,
    refinement: subpixel::Refinement,
}

impl DisparityMatcher {
    /// A matcher; its work space grows with the first pair.
    pub fn new(options: DisparityOptions) -> Self {
        Self { options, ..Self::default() }
    }

    /// The options it was made with.
    pub fn options(&self) -> &DisparityOptions {
        &self.options
    }

    /// Disparity of the left image of a rectified pair.
    ///
    /// Grey levels may have any scale; pixels that are not finite match nothing well. The answer does
    /// not depend on the number of threads, nor on the pairs seen before.
    pub fn compute(&mut self, left: &Image, right: &Image) -> Result<DisparityMap, DisparityError> {
        if left.size() != right.size() {
            return Err(DisparityError::SizeMismatch { left: left.size(), right: right.size() });
        }
        let (width, height) = left.size();
        let mut map =
            DisparityMap { shift: Field::missing(width, height), sigma: Field::missing(width, height) };
        let levels = self.options.levels.min(width).min(usize::from(u16::MAX));
        if width == 0 || height == 0 || levels == 0 {
            return Ok(map);
        }
        let options = &self.options;
        self.winners.resize(width * height, f32::NAN);
        match options.matcher {
            Matcher::SemiGlobal => self.match_semi_globally(left, right, levels),
            Matcher::AreaCorrelation => self.correlate_areas(left, right, levels),
        }
        let options = &self.options;
        self.speckles.remove(&mut self.winners, width, options.speckle_size, SPECKLE_RANGE_PX);
        if options.matcher == Matcher::SemiGlobal {
            self.refinement.refine(left, right, &self.winners);
        }
        let rows = map.shift.rows_mut().zip(map.sigma.rows_mut()).enumerate();
        rows.for_each(|(v, (to_shift, to_sigma))| {
            let row = v * width..(v + 1) * width;
            let (shift, sigma) = match options.matcher {
                Matcher::SemiGlobal => self.refinement.row(v),
                Matcher::AreaCorrelation => (&self.winners[row.clone()], &self.sigma[row]),
            };
            to_shift.copy_from_slice(shift);
            for (to_sigma, (sigma, shift)) in to_sigma.iter_mut().zip(sigma.iter().zip(shift)) {
                *to_sigma = if shift.is_nan() { f32::NAN } else { *sigma };
            }
            if options.fill {
                depth_edges::fill_row(to_shift, to_sigma, levels);
            }
        });
        if options.matcher == Matcher::SemiGlobal {
            depth_edges::widen_beside_edges(&mut map);
        }
        Ok(map)
    }

    fn match_semi_globally(&mut self, left: &Image, right: &Image, levels: usize) {
        let scale = smoothing::grey_scale([left, right]);
        self.left_words.compute(left, scale, false);
        self.right_words.compute(right, scale, true);
        let (left_words, right_words) = (&self.left_words, &self.right_words);
        let pair = semi_global::CensusPair { left, left_words, right_words, levels };
        self.semi_global.winners(&pair, self.options.uniqueness, &mut self.winners);
    }

    fn correlate_areas(&mut self, left: &Image, right: &Image, levels: usize) {
        let scale = smoothing::grey_scale([left, right]);
        self.left_slopes.compute(left, scale, false);
        self.right_slopes.compute(right, scale, true);
        let pair = area::SlopePair {
            left: &self.left_slopes,
            right: &self.right_slopes,
            width: left.width(),
            height: left.height(),
            levels,
            options: &self.options.expert,
        };
        self.sigma.resize(self.winners.len(), f32::NAN);
        self.area.winners(&pair, &mut self.winners, &mut self.sigma);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::Ordering;

    use super::*;
    use crate::simd::PLAIN;

    /// A rough pair of textured steps, of odd size.
    fn pair(width: usize, height: usize, depth: f32) -> (Image, Image) {
        let grey = |u: usize, v: usize| {
            let hash = (u as u32).wrapping_mul(2_654_435_761) ^ (v as u32).wrapping_mul(40_503);
            let noise = (hash ^ (hash >> 13)).wrapping_mul(1_274_126_177) >> 24;
            noise as f32 / 255.0 * depth
        };
        let left = Image::from_fn(width, height, grey);
        let right = Image::from_fn(width, height, |u, v| grey(u + if v < height / 2 { 3 } else { 11 }, v));
        (left, right)
    }

    #[test]
    fn the_answer_depends_not_on_the_vectors() {
        let bits = |map: &DisparityMap| -> Vec<u32> {
            let planes = [map.shift.grid(), map.sigma.grid()];
            planes.iter().flat_map(|plane| plane.values().iter().map(|v| v.to_bits())).collect()
        };
        for matcher in [Matcher::SemiGlobal, Matcher::AreaCorrelation] {
            for (width, height, levels, depth) in
                [(131, 37, 24, 255.0), (97, 21, 97, 65_535.0), (61, 33, 70, 1.0)]
            {
                let (left, right) = pair(width, height, depth);
                let options = DisparityOptions { matcher, levels, ..DisparityOptions::default() };
                let wide = DisparityMatcher::new(options.clone()).compute(&left, &right).unwrap();
                PLAIN.store(true, Ordering::Relaxed);
                let plain = DisparityMatcher::new(options).compute(&left, &right).unwrap();
                PLAIN.store(false, Ordering::Relaxed);
                assert!(wide.shift.density() > 0.5, "{matcher:?} {}", wide.shift.density());
                assert_eq!(bits(&wide), bits(&plain), "{matcher:?} {width} x {height}");
            }
        }
    }
}
