//! Dense disparity of a rectified pair, with its standard deviation.
//!
//! Five steps: census words of both images, semi-global matching, checks that decide which winners
//! to believe, photometric sub-pixel refinement, and holes filled from either side. What is filled
//! in has a standard deviation of [`GUESS_SIGMA_PX`] and more; wide holes stay missing.

mod census;
mod check;
mod fill;
mod lanes;
mod lucas_kanade;
mod rows;
mod semi_global;
mod speckles;
mod subpixel;
mod surface;
mod sweep;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use census::CensusWindow;

use crate::geometry::{Field, Image};

/// How disparity is found. Penalties are in bits of the census words' Hamming distance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DisparityOptions {
    /// Disparities tried: 0 … `levels` − 1 pixels. Limited to the image's width.
    pub levels: usize,
    /// Neighbourhood compared.
    pub census: CensusWindow,
    /// P1: cost of a step of one level between neighbours, at most 190.
    pub penalty_small: u8,
    /// P2: cost of a jump between neighbours of equal grey level, at most 190.
    pub penalty_large: u8,
    /// The least that P2 becomes where the grey level jumps.
    pub penalty_large_least: u8,
    /// Grey-level difference that halves P2, in units of the image's mean difference of neighbours.
    pub edge_contrast: f32,
    /// A winner's cost must be lower than every rival's by this fraction, 0 … 1.
    pub uniqueness: f32,
    /// Levels by which the disparity found from the right image may differ.
    pub left_right_tolerance: usize,
    /// Connected pieces of fewer pixels are removed.
    pub speckle_size: usize,
    /// Difference of disparity that still connects neighbours, in pixels.
    pub speckle_range: f32,
    /// Whether gaps no wider than `levels` are filled along the row, with a large standard deviation.
    pub fill: bool,
    /// Steps of sub-pixel refinement, at least 1.
    pub refinement_steps: usize,
}

impl Default for DisparityOptions {
    fn default() -> Self {
        Self {
            levels: 128,
            census: CensusWindow::default(),
            penalty_small: 10,
            penalty_large: 54,
            penalty_large_least: 24,
            edge_contrast: 4.0,
            uniqueness: 0.01,
            left_right_tolerance: 2,
            speckle_size: 100,
            speckle_range: 1.0,
            fill: true,
            refinement_steps: 2,
        }
    }
}

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
    winners: Vec<f32>,
    speckles: speckles::Speckles,
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
        let scale = census::grey_scale([left, right]);
        self.left_words.compute(left, options.census, scale, false);
        self.right_words.compute(right, options.census, scale, true);
        self.winners.resize(width * height, f32::NAN);
        let pair =
            semi_global::Pair { left, left_words: &self.left_words, right_words: &self.right_words, levels };
        self.semi_global.winners(&pair, options, &mut self.winners);
        let (size, range) = (options.speckle_size, options.speckle_range);
        self.speckles.remove(&mut self.winners, width, size, range);
        self.refinement.refine(left, right, &self.winners, options.refinement_steps.max(1));
        let rows = (map.shift.rows_mut()).zip(map.sigma.rows_mut());
        rows.zip(self.refinement.rows()).for_each(|((to_shift, to_sigma), (shift, sigma))| {
            to_shift.copy_from_slice(shift);
            to_sigma.copy_from_slice(sigma);
            if options.fill {
                fill::fill_row(to_shift, to_sigma, levels);
            }
        });
        Ok(map)
    }
}
