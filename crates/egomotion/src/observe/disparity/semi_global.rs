//! Semi-global matching: census costs, aggregated along three paths, and the winner of each pixel.
//!
//! H. Hirschmüller, "Stereo processing by semiglobal matching and mutual information", IEEE TPAMI
//! 30(2), 2008, equations (13) and (14). The paths come from the left, from above and from the
//! right: one sweep down the image needs the row above alone, and nothing of the size of the cost
//! volume is ever stored. (With the two diagonals from above, more than half of the sum would have
//! come from above, and slanted ground would come out worse.)
//!
//! Everything fits into bytes: a cost has at most 31, a path at most 85, their sum at most 255.

use rayon::prelude::*;

use super::DisparityOptions;
use super::census::Census;
use super::check::{Claims, Winner, believe};
use super::lanes::{LANES, widest};
use super::sweep::{Back, Forth, blocks_for, with_blocks};
use crate::geometry::Image;

/// Rows answered by one strip. The strips are fixed, so the answer does not depend on the threads.
const STRIP_ROWS: usize = 96;
/// Rows above a strip from which its downward paths start.
const WARM_UP_ROWS: usize = 8;
/// Largest penalty for which the sum of three paths fits into 8 bits.
const LARGEST_PENALTY: u8 = u8::MAX / 3 - super::census::LARGEST_COST;

/// The census words of a pair and what the sweeps need to know of it.
pub(super) struct Pair<'a> {
    /// Left image, grey levels.
    pub left: &'a Image,
    /// Census words of the left image.
    pub left_words: &'a Census,
    /// Census words of the right image, its last column first.
    pub right_words: &'a Census,
    /// Number of levels, 1 … width.
    pub levels: usize,
}

/// The work space of all strips.
#[derive(Debug, Clone, Default)]
pub(super) struct SemiGlobal {
    strips: Vec<Strip>,
}

impl SemiGlobal {
    /// The winning disparity of every pixel, to a fraction of a pixel, NaN where no winner is to be
    /// believed; row-major in `winners`.
    pub(super) fn winners(&mut self, pair: &Pair<'_>, options: &DisparityOptions, winners: &mut [f32]) {
        let width = pair.left.width();
        let penalties = Penalties::new(pair.left, options);
        self.strips.resize_with(pair.left.height().div_ceil(STRIP_ROWS), Strip::default);
        let chunks = winners.par_chunks_mut(STRIP_ROWS * width);
        self.strips.par_iter_mut().zip(chunks).enumerate().for_each(|(index, (strip, winners))| {
            let first = index * STRIP_ROWS;
            strip.start(width, pair.levels);
            for v in first.saturating_sub(WARM_UP_ROWS)..first {
                strip.sweep_forth(pair, &penalties, v);
            }
            for (v, winners) in (first..).zip(winners.chunks_mut(width)) {
                strip.sweep_forth(pair, &penalties, v);
                strip.sweep_back(pair.levels, &penalties, options, winners);
            }
        });
    }
}

/// P1, and P2 as a function of the difference of two neighbouring grey levels.
struct Penalties {
    small: u8,
    large: f32,
    least: f32,
    /// One over the grey-level difference that halves P2.
    per_grey: f32,
}

impl Penalties {
    fn new(image: &Image, options: &DisparityOptions) -> Self {
        let small = options.penalty_small.min(LARGEST_PENALTY);
        let large = options.penalty_large.clamp(small, LARGEST_PENALTY);
        let least = options.penalty_large_least.clamp(small, large);
        let contrast = mean_step(image) * f64::from(options.edge_contrast);
        let per_grey = if contrast > 0.0 { contrast.recip() as f32 } else { 0.0 };
        Self { small, large: large.into(), least: least.into(), per_grey }
    }

    /// P2 between two neighbouring pixels: a jump of depth is likely where the grey level jumps.
    #[inline(always)]
    fn large(&self, grey: f32, neighbour: f32) -> u8 {
        let p2 = self.large / (1.0 + (grey - neighbour).abs() * self.per_grey);
        p2.max(self.least) as u8
    }
}

/// Mean absolute difference of horizontal neighbours: the unit of contrast of an image of any depth.
fn mean_step(image: &Image) -> f64 {
    let row_sum = |v| -> f64 { image.row(v).windows(2).map(|p| f64::from((p[1] - p[0]).abs())).sum() };
    let pairs = image.height() * image.width().saturating_sub(1);
    let sums: Vec<f64> = (0..image.height()).into_par_iter().map(row_sum).collect();
    sums.iter().filter(|s| s.is_finite()).sum::<f64>() / pairs.max(1) as f64
}

/// One strip's work space: rows of costs, level by level for each pixel, `stride` levels to a pixel.
#[derive(Debug, Clone, Default)]
struct Strip {
    stride: usize,
    matching: Vec<u8>,
    /// Costs of the path from above, less their minimum, between two margins: the row above until
    /// the sweep comes to the pixel.
    downward: Vec<u8>,
    /// Sum of the paths from the left and from above.
    sums: Vec<u8>,
    /// The right image's words, and a margin for levels beyond the row.
    right_row: Vec<u8>,
    p2_left: Vec<u8>,
    p2_above: Vec<u8>,
    claims: Claims,
    best: Vec<Winner>,
}

impl Strip {
    fn start(&mut self, width: usize, levels: usize) {
        self.stride = blocks_for(levels) * LANES;
        let size = width * self.stride;
        self.matching.resize(size, 0);
        self.sums.resize(size, 0);
        self.downward.clear();
        self.downward.resize(size + 2 * LANES, 0);
        self.p2_left.resize(width, 0);
        self.p2_above.resize(width, 0);
    }

    /// Matching costs of row `v`, and the paths from the left and from above.
    fn sweep_forth(&mut self, pair: &Pair<'_>, penalties: &Penalties, v: usize) {
        let (here, above) = (pair.left.row(v), pair.left.row(v.saturating_sub(1)));
        for (p2, two) in self.p2_left[1..].iter_mut().zip(here.windows(2)) {
            *p2 = penalties.large(two[1], two[0]);
        }
        for ((p2, &grey), &above) in self.p2_above.iter_mut().zip(here).zip(above) {
            *p2 = penalties.large(grey, above);
        }
        let words = pair.right_words.row(v);
        self.right_row.clear();
        self.right_row.extend_from_slice(words);
        self.right_row.resize(words.len() + self.stride, 0);
        with_blocks!(
            self.stride / LANES,
            BLOCKS,
            widest(Forth::<BLOCKS> {
                left: pair.left_words.row(v),
                right: &self.right_row,
                plane: pair.right_words.stride,
                planes: pair.right_words.planes,
                halve: pair.right_words.halve,
                levels: pair.levels,
                p1: penalties.small,
                p2_left: &self.p2_left,
                p2_above: &self.p2_above,
                matching: &mut self.matching,
                downward: &mut self.downward,
                sums: &mut self.sums,
            })
        );
    }

    /// The path from the right, and the winners of the row: those that are unique and not a better
    /// match of another pixel.
    fn sweep_back(
        &mut self,
        levels: usize,
        penalties: &Penalties,
        options: &DisparityOptions,
        winners: &mut [f32],
    ) {
        self.best.resize(winners.len(), Winner::default());
        with_blocks!(
            self.stride / LANES,
            BLOCKS,
            widest(Back::<BLOCKS> {
                levels,
                p1: penalties.small,
                p2_left: &self.p2_left,
                matching: &self.matching,
                sums: &self.sums,
                uniqueness: options.uniqueness,
                best: &mut self.best,
            })
        );
        self.claims.of_winners(&self.best);
        believe(&self.best, options.left_right_tolerance, &self.claims, winners);
    }
}
