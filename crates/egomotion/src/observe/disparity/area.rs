//! Area correlation: the classical block matcher, to 1/16 of a pixel.
//!
//! Sums of absolute differences of the horizontal slope over a square window, as in T. Kanade and
//! M. Okutomi, IEEE TPAMI 16(9), 1994, and the correlators sold with stereo cameras. The sums of
//! each column are kept from row to row, the sum of a window from pixel to pixel, so that the time
//! depends on the number of levels alone and not on the window.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::check::{Claims, NO_LEVEL, Winner, believe};
use super::lanes::{Bytes, Kernel, LANES, widest};
use super::slopes::Slopes;

/// Rows answered by one strip. The strips are fixed, so the answer does not depend on the threads.
const STRIP_ROWS: usize = 48;
/// Largest half window, for which the sum of all differences fits into 16 bits.
const LARGEST_RADIUS: usize = 10;
/// Fraction of a pixel to which disparity is told.
const RESOLUTION_PX: f32 = 1.0 / 16.0;

/// How areas are correlated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AreaOptions {
    /// Half width of the square window, at most 10 pixels.
    pub radius: usize,
    /// A winner's cost must be lower than every rival's by this fraction, 0 … 1.
    pub uniqueness: f32,
    /// Least mean absolute slope of a window, in quarters of a grey level of 8 bits per pixel.
    pub texture: f32,
    /// Levels by which the disparity found from the right image may differ.
    pub left_right_tolerance: usize,
}

impl Default for AreaOptions {
    fn default() -> Self {
        Self { radius: 4, uniqueness: 0.1, texture: 1.0, left_right_tolerance: 1 }
    }
}

/// The work space of all strips.
#[derive(Debug, Clone, Default)]
pub(super) struct AreaCorrelation {
    strips: Vec<Strip>,
}

/// What is matched, and how.
pub(super) struct Pair<'a> {
    /// Slopes of the left image.
    pub left: &'a Slopes,
    /// Slopes of the right image, its last column first.
    pub right: &'a Slopes,
    pub width: usize,
    pub height: usize,
    /// Number of levels, 1 … width.
    pub levels: usize,
    pub options: &'a AreaOptions,
}

impl AreaCorrelation {
    /// The winning disparity of every pixel, to 1/16 pixel, NaN where no winner is to be believed.
    pub(super) fn winners(&mut self, pair: &Pair<'_>, winners: &mut [f32]) {
        self.strips.resize_with(pair.height.div_ceil(STRIP_ROWS), Strip::default);
        let chunks = winners.par_chunks_mut(STRIP_ROWS * pair.width);
        self.strips.par_iter_mut().zip(chunks).enumerate().for_each(|(index, (strip, winners))| {
            strip.run(pair, index * STRIP_ROWS, winners);
        });
    }
}

/// One strip's work space.
#[derive(Debug, Clone, Default)]
struct Strip {
    /// Per pixel and level the sum of the differences of its column's part of the window.
    columns: Vec<u16>,
    /// The same of the slopes themselves.
    texture: Vec<u16>,
    /// The right row, and a margin for levels beyond it.
    right_row: Vec<u8>,
    best: Vec<Winner>,
    claims: Claims,
}

impl Strip {
    fn run(&mut self, pair: &Pair<'_>, first: usize, winners: &mut [f32]) {
        let radius = pair.options.radius.min(LARGEST_RADIUS);
        let stride = pair.levels.next_multiple_of(LANES);
        self.columns.clear();
        self.columns.resize(pair.width * stride, 0);
        self.texture.clear();
        self.texture.resize(pair.width, 0);
        self.best.resize(pair.width, Winner::default());
        for v in first.saturating_sub(radius)..(first + radius).min(pair.height) {
            self.change(pair, stride, v, true);
        }
        for (v, winners) in (first..).zip(winners.chunks_mut(pair.width)) {
            if v + radius < pair.height {
                self.change(pair, stride, v + radius, true);
            }
            let rows = (v + radius).min(pair.height - 1) + 1 - v.saturating_sub(radius);
            let window = Window {
                columns: &self.columns,
                texture: &self.texture,
                stride,
                radius,
                levels: pair.levels,
                uniqueness: pair.options.uniqueness,
                // The sum of a window; at the border less of it is inside.
                least_texture: pair.options.texture * (rows * (2 * radius + 1)) as f32,
                best: &mut self.best,
                claims: &mut self.claims,
            };
            widest(window);
            believe(&self.best, pair.options.left_right_tolerance, &self.claims, winners);
            for winner in winners {
                *winner = (*winner / RESOLUTION_PX).round() * RESOLUTION_PX;
            }
            if let Some(v) = v.checked_sub(radius) {
                self.change(pair, stride, v, false);
            }
        }
    }

    /// Add row `v` to the columns, or take it away.
    fn change(&mut self, pair: &Pair<'_>, stride: usize, v: usize, add: bool) {
        self.right_row.clear();
        self.right_row.extend_from_slice(pair.right.row(v));
        self.right_row.resize(pair.width + stride, 0);
        let Self { columns, texture, right_row, .. } = self;
        widest(Change { left: pair.left.row(v), right: right_row, columns, texture, stride, add });
    }
}

/// The differences of a row, added to the columns or taken away.
struct Change<'a> {
    left: &'a [u8],
    /// Mirrored: the candidates of rising disparity stand side by side.
    right: &'a [u8],
    columns: &'a mut [u16],
    texture: &'a mut [u16],
    stride: usize,
    add: bool,
}

impl Kernel for Change<'_> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(self) {
        let Self { left, right, columns, texture, stride, add } = self;
        let width = left.len();
        // Taking away is adding the negative, modulo 2¹⁶.
        let sign = if add { 1_u16 } else { u16::MAX };
        for (u, column) in columns.chunks_exact_mut(stride).enumerate() {
            let grey = B::splat(left[u]);
            let right = &right[width - 1 - u..width - 1 - u + stride];
            for (block, sums) in column.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
                let there = B::load(right, block * LANES);
                let difference = grey.minus(there).plus(there.minus(grey)).to_array();
                for i in 0..LANES {
                    sums[i] = sums[i].wrapping_add(u16::from(difference[i]).wrapping_mul(sign));
                }
            }
        }
        for (sum, &slope) in texture.iter_mut().zip(left) {
            let slope = u16::from(slope.abs_diff(super::slopes::ZERO));
            *sum = sum.wrapping_add(slope.wrapping_mul(sign));
        }
    }
}

/// The winner of each window of a row.
struct Window<'a> {
    columns: &'a [u16],
    texture: &'a [u16],
    stride: usize,
    radius: usize,
    levels: usize,
    uniqueness: f32,
    least_texture: f32,
    best: &'a mut [Winner],
    /// Of every level, not of the winners alone: what the right image would answer.
    claims: &'a mut Claims,
}

impl Kernel for Window<'_> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(self) {
        let Self { columns, texture, stride, radius, levels, uniqueness, least_texture, best, claims } = self;
        let width = best.len();
        claims.start_row(width);
        let mut sums = vec![0_u16; stride];
        let mut slopes = 0_u16;
        let column = |u: usize| &columns[u * stride..(u + 1) * stride];
        for (u, &slope) in texture.iter().enumerate().take(radius) {
            add(&mut sums, column(u));
            slopes = slopes.wrapping_add(slope);
        }
        for (u, best) in best.iter_mut().enumerate() {
            let enters = (u + radius < width).then(|| u + radius);
            let leaves = u.checked_sub(radius + 1);
            if let Some(u) = enters {
                slopes = slopes.wrapping_add(texture[u]);
            }
            if let Some(u) = leaves {
                slopes = slopes.wrapping_sub(texture[u]);
            }
            match (enters, leaves) {
                (Some(new), Some(old)) => exchange(&mut sums, column(new), column(old)),
                (Some(new), None) => add(&mut sums, column(new)),
                (None, Some(old)) => subtract(&mut sums, column(old)),
                (None, None) => {}
            }
            // Only levels whose match is inside the right image.
            let inside = levels.min(u + 1);
            let textured = f32::from(slopes) >= least_texture;
            *best = if textured { winner(&mut sums[..inside], uniqueness) } else { Winner::default() };
            claim(&sums[..inside], &mut claims.0[width - 1 - u..]);
        }
    }
}

#[inline(always)]
fn add(sums: &mut [u16], column: &[u16]) {
    for (sum, x) in sums.iter_mut().zip(column) {
        *sum = sum.wrapping_add(*x);
    }
}

#[inline(always)]
fn subtract(sums: &mut [u16], column: &[u16]) {
    for (sum, x) in sums.iter_mut().zip(column) {
        *sum = sum.wrapping_sub(*x);
    }
}

#[inline(always)]
fn exchange(sums: &mut [u16], new: &[u16], old: &[u16]) {
    for (sum, (new, old)) in sums.iter_mut().zip(new.iter().zip(old)) {
        *sum = sum.wrapping_add(new.wrapping_sub(*old));
    }
}

/// Claim each level's right pixel.
#[inline(always)]
fn claim(sums: &[u16], claims: &mut [u32]) {
    for ((level, &cost), claim) in sums.iter().enumerate().zip(claims) {
        *claim = (*claim).min(u32::from(cost) << 16 | level as u32);
    }
}

/// The level of least cost; not unique where a rival comes near.
#[inline(always)]
fn winner(sums: &mut [u16], uniqueness: f32) -> Winner {
    let inside = sums.len();
    let mut key = u32::MAX;
    for (level, &cost) in sums.iter().enumerate() {
        key = key.min(u32::from(cost) << 16 | level as u32);
    }
    let (level, cost) = ((key & 0xffff) as usize, (key >> 16) as u16);
    let costs = [level.wrapping_sub(1), level, level + 1].map(|l| sums.get(l).copied());
    // The neighbours are no rivals.
    let beside = level.saturating_sub(1)..(level + 2).min(inside);
    let mut own = [0_u16; 3];
    for (own, cost) in own.iter_mut().zip(&mut sums[beside.clone()]) {
        *own = std::mem::replace(cost, u16::MAX);
    }
    let rival = sums.iter().copied().fold(u16::MAX, u16::min);
    for (own, cost) in own.iter().zip(&mut sums[beside.clone()]) {
        *cost = *own;
    }
    Winner {
        level: level as u16,
        costs: costs.map(|cost| cost.unwrap_or(NO_LEVEL)),
        unique: inside > beside.len() && f32::from(rival) * (1.0 - uniqueness) > f32::from(cost),
    }
}
