//! Semi-global matching: census costs, aggregated along three paths, and the winner of each pixel.
//!
//! H. Hirschmüller, "Stereo processing by semiglobal matching and mutual information", IEEE TPAMI
//! 30(2), 2008, equations (13) and (14). The paths come from the left, from above and from the
//! right: one sweep down the image needs the row above alone, and nothing of the size of the cost
//! volume is ever stored. (With the two diagonals from above, more than half of the sum would have
//! come from above, and slanted ground would come out worse.)
//!
//! Everything fits into bytes: a cost has at most 24, a path at most 24 + 54 = 78, the sum of three at most 234.

use rayon::prelude::*;

use super::census::{COMPARISONS, Census};
use super::sweep::{BackwardSweep, ForwardSweep, blocks_for, with_blocks};
use super::winners::{Claims, Winner, believe};
use crate::geometry::Image;
use crate::simd::{LANES, widest};

/// Rows answered by one strip. The strips are fixed, so the answer does not depend on the threads.
const STRIP_ROWS: usize = 96;
/// Rows above a strip from which its downward paths start.
const WARM_UP_ROWS: usize = 8;
/// P1, the cost of a step of one level between neighbours, in bits of the census words' distance: larger smooths
/// slanted surfaces into steps, smaller lets noise through.
const SMALL_PENALTY: u8 = 10;
/// P2, the cost of a jump between neighbours of equal grey level, in the same unit: larger closes gaps between
/// thin objects, smaller breaks surfaces without texture.
const LARGE_PENALTY: u8 = 54;
/// The least that P2 becomes where the grey level jumps, in the same unit.
const LEAST_LARGE_PENALTY: u8 = 24;
/// Grey-level difference that halves P2, in units of the image's mean difference of neighbours.
const EDGE_CONTRAST: f64 = 4.0;
/// Levels by which the disparity found from the right image may differ.
const LEFT_RIGHT_TOLERANCE: usize = 2;
// The sum of three paths fits into 8 bits, and steps of one level are never dearer than jumps.
const _: () = assert!(3 * (LARGE_PENALTY as usize + COMPARISONS) <= u8::MAX as usize);
const _: () = assert!(SMALL_PENALTY <= LEAST_LARGE_PENALTY && LEAST_LARGE_PENALTY <= LARGE_PENALTY);

/// The census words of a pair and what the sweeps need to know of it.
pub(super) struct CensusPair<'a> {
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
    strips: Vec<SweepStrip>,
}

impl SemiGlobal {
    /// The winning disparity of every pixel, to a fraction of a pixel, NaN where no winner is to be
    /// believed; row-major in `winners`.
    pub(super) fn winners(&mut self, pair: &CensusPair<'_>, uniqueness: f32, winners: &mut [f32]) {
        let width = pair.left.width();
        let penalty = JumpPenalty::new(pair.left);
        self.strips.resize_with(pair.left.height().div_ceil(STRIP_ROWS), SweepStrip::default);
        let chunks = winners.par_chunks_mut(STRIP_ROWS * width);
        self.strips.par_iter_mut().zip(chunks).enumerate().for_each(|(index, (strip, winners))| {
            let first = index * STRIP_ROWS;
            strip.start(width, pair.levels);
            for v in first.saturating_sub(WARM_UP_ROWS)..first {
                strip.sweep_forward(pair, &penalty, v);
            }
            for (v, winners) in (first..).zip(winners.chunks_mut(width)) {
                strip.sweep_forward(pair, &penalty, v);
                strip.sweep_backward(pair.levels, uniqueness, winners);
            }
        });
    }
}

/// P2 as a function of the difference of two neighbouring grey levels.
struct JumpPenalty {
    /// One over the grey-level difference that halves P2.
    per_grey: f32,
}

impl JumpPenalty {
    fn new(image: &Image) -> Self {
        let contrast = mean_step(image) * EDGE_CONTRAST;
        Self { per_grey: if contrast > 0.0 { contrast.recip() as f32 } else { 0.0 } }
    }

    /// P2 between two neighbouring pixels: a jump of depth is likely where the grey level jumps.
    #[inline(always)]
    fn between(&self, grey: f32, neighbour: f32) -> u8 {
        let p2 = f32::from(LARGE_PENALTY) / (1.0 + (grey - neighbour).abs() * self.per_grey);
        p2.max(f32::from(LEAST_LARGE_PENALTY)) as u8
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
struct SweepStrip {
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

impl SweepStrip {
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
    fn sweep_forward(&mut self, pair: &CensusPair<'_>, penalty: &JumpPenalty, v: usize) {
        let (here, above) = (pair.left.row(v), pair.left.row(v.saturating_sub(1)));
        for (p2, two) in self.p2_left[1..].iter_mut().zip(here.windows(2)) {
            *p2 = penalty.between(two[1], two[0]);
        }
        for ((p2, &grey), &above) in self.p2_above.iter_mut().zip(here).zip(above) {
            *p2 = penalty.between(grey, above);
        }
        let words = pair.right_words.row(v);
        self.right_row.clear();
        self.right_row.extend_from_slice(words);
        self.right_row.resize(words.len() + self.stride, 0);
        with_blocks!(
            self.stride / LANES,
            BLOCKS,
            widest(ForwardSweep::<BLOCKS> {
                left: pair.left_words.row(v),
                right: &self.right_row,
                plane: pair.right_words.stride,
                levels: pair.levels,
                p1: SMALL_PENALTY,
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
    fn sweep_backward(&mut self, levels: usize, uniqueness: f32, winners: &mut [f32]) {
        self.best.resize(winners.len(), Winner::default());
        with_blocks!(
            self.stride / LANES,
            BLOCKS,
            widest(BackwardSweep::<BLOCKS> {
                levels,
                p1: SMALL_PENALTY,
                p2_left: &self.p2_left,
                matching: &self.matching,
                sums: &self.sums,
                uniqueness,
                best: &mut self.best,
            })
        );
        self.claims.of_winners(&self.best);
        believe(&self.best, LEFT_RIGHT_TOLERANCE, &self.claims, winners);
    }
}
