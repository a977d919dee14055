//! Semi-global matching: census costs, aggregated along five paths, and the winner of each pixel.
//!
//! H. Hirschmüller, "Stereo processing by semiglobal matching and mutual information", IEEE TPAMI
//! 30(2), 2008, equations (13) and (14). The paths come from the left, the three neighbours above
//! and the right, so that one sweep down the image needs the costs of two rows alone and nothing of
//! the size of the whole cost volume is ever stored.

use rayon::prelude::*;

use super::DisparityOptions;
use super::check::{RightWinners, is_unique};
use super::subpixel::parabola;
use crate::geometry::Image;

/// Rows answered by one strip. The strips are fixed, so the answer does not depend on the threads.
const STRIP_ROWS: usize = 96;
/// Rows above a strip from which its downward paths start.
const WARM_UP_ROWS: usize = 20;
/// Cost beyond the ends of the levels: no path enters from there.
const WALL: u8 = u8::MAX;
/// Largest penalty for which a path cost (at most 62 + penalty) still fits into 8 bits.
const LARGEST_PENALTY: u8 = 190;

/// The census words of a pair and what the sweeps need to know of it.
pub(super) struct Pair<'a> {
    /// Left image, grey levels.
    pub left: &'a Image,
    /// Census words of the left image, row by row.
    pub left_words: &'a [u64],
    /// Census words of the right image, row by row.
    pub right_words: &'a [u64],
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
                strip.sweep_down(pair, &penalties, v);
            }
            for (v, winners) in (first..).zip(winners.chunks_mut(width)) {
                strip.sweep_down(pair, &penalties, v);
                strip.sweep_back(pair, &penalties, v);
                strip.choose(pair.levels, options, winners);
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
    fn large(&self, grey: f32, neighbour: f32) -> u8 {
        let p2 = self.large / (1.0 + (grey - neighbour).abs() * self.per_grey);
        p2.max(self.least) as u8
    }
}

/// Mean absolute difference of horizontal neighbours: the unit of contrast of an image of any depth.
fn mean_step(image: &Image) -> f64 {
    let row_sum = |v| -> f64 { image.row(v).windows(2).map(|p| f64::from((p[1] - p[0]).abs())).sum() };
    let pairs = image.height() * image.width().saturating_sub(1);
    (0..image.height()).map(row_sum).filter(|s| s.is_finite()).sum::<f64>() / pairs.max(1) as f64
}

/// The path costs of one row: for each pixel its levels between two walls, and their minimum.
#[derive(Debug, Clone, Default)]
struct PathRow {
    costs: Vec<u8>,
    least: Vec<u8>,
    levels: usize,
}

impl PathRow {
    /// No path has come here yet: costs 0.
    fn start(&mut self, width: usize, levels: usize) {
        self.levels = levels;
        self.costs.clear();
        self.costs.resize(width * (levels + 2), 0);
        for pixel in self.costs.chunks_mut(levels + 2) {
            pixel[0] = WALL;
            pixel[levels + 1] = WALL;
        }
        self.least.clear();
        self.least.resize(width, 0);
    }

    /// Start a path at pixel `u`: L = C.
    fn begin(&mut self, u: usize, matching: &[u8], sum: &mut [u16]) {
        let stride = self.levels + 2;
        self.costs[u * stride + 1..(u + 1) * stride - 1].copy_from_slice(matching);
        sum.iter_mut().zip(matching).for_each(|(sum, &cost)| *sum += u16::from(cost));
        self.least[u] = matching.iter().copied().fold(u8::MAX, u8::min);
    }

    fn pixel(&self, u: usize) -> Path<'_> {
        let stride = self.levels + 2;
        Path { costs: &self.costs[u * stride..(u + 1) * stride], least: self.least[u] }
    }

    /// Extend `before` to pixel `u` and add its costs to the sum over the paths.
    fn extend(&mut self, u: usize, before: Path<'_>, p1: u8, p2: u8, matching: &[u8], sum: &mut [u16]) {
        let stride = self.levels + 2;
        let here = &mut self.costs[u * stride + 1..(u + 1) * stride - 1];
        self.least[u] = extend(before, p1, p2, matching, here, sum);
    }
}

/// The path costs of one pixel, between walls, and their minimum.
#[derive(Clone, Copy)]
struct Path<'a> {
    costs: &'a [u8],
    least: u8,
}

/// Equation (13): L(p, d) = C(p, d) + min(L(p−r, d), L(p−r, d∓1) + P1, min L(p−r) + P2) − min L(p−r).
///
/// Adds L to `sum` and returns its minimum.
#[inline(never)]
fn extend(before: Path<'_>, p1: u8, p2: u8, matching: &[u8], here: &mut [u8], sum: &mut [u16]) -> u8 {
    let n = matching.len();
    let (below, same, above) = (&before.costs[..n], &before.costs[1..=n], &before.costs[2..n + 2]);
    let (here, sum) = (&mut here[..n], &mut sum[..n]);
    let jump = before.least.saturating_add(p2);
    let mut least = u8::MAX;
    for d in 0..n {
        let step = below[d].min(above[d]).saturating_add(p1);
        let cost = (step.min(same[d]).min(jump) - before.least).saturating_add(matching[d]);
        here[d] = cost;
        sum[d] += u16::from(cost);
        least = least.min(cost);
    }
    least
}

/// Number of bits in which each candidate differs from the word.
#[inline(never)]
fn hamming(word: u64, candidates: &[u64], distances: &mut [u8]) {
    for (distance, candidate) in distances.iter_mut().zip(candidates) {
        *distance = (word ^ candidate).count_ones() as u8;
    }
}

/// One strip's work space: two rows of three downward paths, one row of everything else.
#[derive(Debug, Clone, Default)]
struct Strip {
    /// Paths from above left, above and above right, of the row above and of this row.
    above: [PathRow; 3],
    here: [PathRow; 3],
    along: [PathRow; 2],
    matching: Vec<u8>,
    sums: Vec<u16>,
    reversed: Vec<u64>,
    best: Vec<usize>,
    right: RightWinners,
    /// Whether the row above has been swept.
    started: bool,
}

impl Strip {
    fn start(&mut self, width: usize, levels: usize) {
        self.above.iter_mut().chain(&mut self.here).for_each(|row| row.start(width, levels));
        // A path along the row needs the pixel before alone: two, used by turns.
        self.along.iter_mut().for_each(|row| row.start(2, levels));
        self.matching.resize(width * levels, 0);
        self.sums.resize(width * levels, 0);
        self.started = false;
    }

    /// Matching costs of row `v`, and the sums of the paths from the left and from above.
    fn sweep_down(&mut self, pair: &Pair<'_>, penalties: &Penalties, v: usize) {
        self.match_row(pair, v);
        std::mem::swap(&mut self.above, &mut self.here);
        let (width, levels) = (pair.left.width(), pair.levels);
        let grey = pair.left.row(v);
        let grey_above = pair.left.row(v.saturating_sub(1));
        self.sums.fill(0);
        let pixels = self.matching.chunks(levels).zip(self.sums.chunks_mut(levels));
        for (u, (matching, sum)) in pixels.enumerate() {
            let sources = [u.checked_sub(1), Some(u), Some(u + 1).filter(|&u| u < width)];
            for ((here, above), source) in self.here.iter_mut().zip(&self.above).zip(sources) {
                match source.filter(|_| self.started) {
                    Some(w) => {
                        let p2 = penalties.large(grey[u], grey_above[w]);
                        here.extend(u, above.pixel(w), penalties.small, p2, matching, sum);
                    }
                    None => here.begin(u, matching, sum),
                }
            }
            let [odd, even] = &mut self.along;
            let (here, before) = if u % 2 == 0 { (even, odd) } else { (odd, even) };
            match u.checked_sub(1) {
                Some(w) => {
                    let p2 = penalties.large(grey[u], grey[w]);
                    here.extend(0, before.pixel(0), penalties.small, p2, matching, sum);
                }
                None => here.begin(0, matching, sum),
            }
        }
        self.started = true;
    }

    /// Add the path from the right to the sums of row `v`.
    fn sweep_back(&mut self, pair: &Pair<'_>, penalties: &Penalties, v: usize) {
        let (width, levels) = (pair.left.width(), pair.levels);
        let grey = pair.left.row(v);
        let pixels = self.matching.chunks(levels).zip(self.sums.chunks_mut(levels));
        for (u, (matching, sum)) in pixels.enumerate().rev() {
            let [odd, even] = &mut self.along;
            let (here, before) = if u % 2 == 0 { (even, odd) } else { (odd, even) };
            if u + 1 < width {
                let p2 = penalties.large(grey[u], grey[u + 1]);
                here.extend(0, before.pixel(0), penalties.small, p2, matching, sum);
            } else {
                here.begin(0, matching, sum);
            }
        }
    }

    /// Hamming distances of row `v`.
    ///
    /// A match outside the right image is neither confirmed nor refuted: it costs as much as the
    /// mean one inside. Were it as cheap as the best, the smoothness of these equal costs would win
    /// wherever the window of disparities sticks out.
    fn match_row(&mut self, pair: &Pair<'_>, v: usize) {
        let width = pair.left.width();
        let row = v * width..(v + 1) * width;
        self.reversed.clear();
        self.reversed.extend(pair.right_words[row.clone()].iter().rev());
        let costs = self.matching.chunks_mut(pair.levels);
        for (u, (costs, &word)) in costs.zip(&pair.left_words[row]).enumerate() {
            let (inside, outside) = costs.split_at_mut(pair.levels.min(u + 1));
            let candidates = &self.reversed[width - 1 - u..];
            hamming(word, candidates, inside);
            if !outside.is_empty() {
                let sum: usize = inside.iter().map(|&cost| usize::from(cost)).sum();
                outside.fill((sum / inside.len().max(1)) as u8);
            }
        }
    }

    /// The winner of every pixel of the row just swept, if it is inside, unique and not a better
    /// match of another pixel.
    fn choose(&mut self, levels: usize, options: &DisparityOptions, winners: &mut [f32]) {
        self.right.start_row(winners.len());
        self.best.clear();
        for (u, costs) in self.sums.chunks(levels).enumerate() {
            let least = costs.iter().copied().fold(u16::MAX, u16::min);
            let best = costs.iter().position(|&cost| cost == least).unwrap_or_default();
            self.right.claim(u, best, least);
            self.best.push(best);
        }
        let pixels = self.sums.chunks(levels).zip(&self.best).zip(winners);
        for (u, ((costs, &best), winner)) in pixels.enumerate() {
            let believed = self.right.agree(u, best, options.left_right_tolerance)
                && is_unique(&costs[..levels.min(u + 1)], best, options.uniqueness);
            *winner = if believed { best as f32 + parabola(costs, best) } else { f32::NAN };
        }
    }
}
