//! Area correlation: the classical block matcher, to 1/16 of a pixel.
//!
//! Sums of absolute differences of the horizontal slope over a square window, as in T. Kanade and
//! M. Okutomi, IEEE TPAMI 16(9), 1994, and the correlators sold with stereo cameras. The sums of
//! each column are kept from row to row, the sum of a window from pixel to pixel, so that the time
//! depends on the number of levels alone and not on the window.

use rayon::prelude::*;

use super::DisparityExpert;
use super::smoothing::Smoothed;
use super::winners::{Claims, NO_LEVEL, Winner};
use crate::geometry::Image;
use crate::simd::{Bytes, Kernel, LANES, widest};

/// Rows answered by one strip. The strips are fixed, so the answer does not depend on the threads.
const STRIP_ROWS: usize = 48;
/// Largest half window, in pixels, for which the sum of all differences fits into 16 bits.
const LARGEST_RADIUS_PX: usize = 10;
/// Levels by which the disparity found from the right image may differ: a larger number lets more false matches
/// through, and 0 drops slanted surfaces.
const LEFT_RIGHT_TOLERANCE: usize = 1;
/// Fraction of a pixel to which disparity is told, that of the stereo cameras of the paper.
const RESOLUTION_PX: f32 = 1.0 / 16.0;
/// Pixels that the smoothing by (1, 2, 1)/4 both ways makes one observation: 1/Σw².
const SMOOTHED_PIXELS: f32 = (16.0 / 6.0) * (16.0 / 6.0);
/// Growth of the variance for the depth inside a window that no one disparity fits; measured on
/// Middlebury and KITTI pairs.
const DEPTH_MISFIT: f32 = 1.7;
/// Standard deviation that no image noise explains, in pixels: the shape of the cost between the levels.
const MODEL_SIGMA_PX: f32 = 0.05;
/// The byte of no slope.
const ZERO_SLOPE: u8 = 63;
/// Largest slope told apart, either way, in quarters of a grey level of 8 bits per pixel.
const LARGEST_SLOPE: i32 = 63;
/// Bits by which the difference of two neighbours is shifted: slopes of an 8-bit image count in
/// quarters of a grey level per pixel.
const SLOPE_SHIFT: u32 = 6;

/// The horizontal slope of an image in bytes, row by row.
#[derive(Debug, Clone, Default)]
pub(super) struct Slopes {
    smoothed: Smoothed,
    bytes: Vec<u8>,
    width: usize,
}

impl Slopes {
    /// The slopes of `image` smoothed by (1, 2, 1)/4 both ways, of the last column first if `mirrored`.
    pub(super) fn compute(&mut self, image: &Image, scale: f32, mirrored: bool) {
        self.width = image.width();
        self.smoothed.compute(image, 1, scale, mirrored);
        self.bytes.resize(image.values().len(), 0);
        let Self { smoothed, bytes, width } = self;
        // In the mirrored image the slope has the other sign.
        let sign = if mirrored { -1 } else { 1 };
        bytes.par_chunks_mut((*width).max(1)).enumerate().for_each(|(v, bytes)| {
            widest(HorizontalSlope { smoothed: smoothed.row(v), bytes, sign });
        });
    }

    /// Row `v`.
    pub(super) fn row(&self, v: usize) -> &[u8] {
        &self.bytes[v * self.width..(v + 1) * self.width]
    }
}

struct HorizontalSlope<'a> {
    /// From one pixel before the first on.
    smoothed: &'a [i16],
    bytes: &'a mut [u8],
    sign: i32,
}

impl Kernel for HorizontalSlope<'_> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(self) {
        let n = self.bytes.len();
        let (before, after) = (&self.smoothed[..n], &self.smoothed[2..n + 2]);
        for (byte, (before, after)) in self.bytes.iter_mut().zip(before.iter().zip(after)) {
            let difference = (self.sign * (i32::from(*after) - i32::from(*before))) >> SLOPE_SHIFT;
            *byte = (difference.clamp(-LARGEST_SLOPE, LARGEST_SLOPE) + i32::from(ZERO_SLOPE)) as u8;
        }
    }
}

/// The work space of all strips.
#[derive(Debug, Clone, Default)]
pub(super) struct AreaCorrelation {
    strips: Vec<AreaStrip>,
}

/// What is matched, and how.
pub(super) struct SlopePair<'a> {
    /// Slopes of the left image.
    pub left: &'a Slopes,
    /// Slopes of the right image, its last column first.
    pub right: &'a Slopes,
    pub width: usize,
    pub height: usize,
    /// Number of levels, 1 … width.
    pub levels: usize,
    pub options: &'a DisparityExpert,
}

impl AreaCorrelation {
    /// The winning disparity of every pixel, to 1/16 pixel, and its standard deviation; NaN where no
    /// winner is to be believed.
    pub(super) fn winners(&mut self, pair: &SlopePair<'_>, winners: &mut [f32], sigma: &mut [f32]) {
        self.strips.resize_with(pair.height.div_ceil(STRIP_ROWS), AreaStrip::default);
        let strip = STRIP_ROWS * pair.width;
        let answers = winners.par_chunks_mut(strip).zip(sigma.par_chunks_mut(strip));
        self.strips.par_iter_mut().zip(answers).enumerate().for_each(|(index, (strip, answers))| {
            strip.run(pair, index * STRIP_ROWS, answers);
        });
    }
}

/// One strip's work space.
#[derive(Debug, Clone, Default)]
struct AreaStrip {
    /// Per pixel and level the sum of the differences of its column's part of the window, after zeros
    /// for the pixel before the first.
    columns: Vec<u16>,
    /// The same of the slopes themselves.
    texture: Vec<u16>,
    /// Per level the sum over the window.
    sums: Vec<u16>,
    enters: SlopeRows,
    leaves: SlopeRows,
    best: Vec<Winner>,
    claims: Claims,
}

/// A row of both images.
#[derive(Debug, Clone, Default)]
struct SlopeRows {
    left: Vec<u8>,
    /// Mirrored, so that the candidates of rising disparity stand side by side, with a margin for
    /// levels beyond the row.
    right: Vec<u8>,
}

impl SlopeRows {
    /// Row `v`; where there is none a row without slopes, which changes no sum.
    fn take(&mut self, pair: &SlopePair<'_>, v: Option<usize>, margin: usize) {
        self.left.clear();
        self.right.clear();
        if let Some(v) = v {
            self.left.extend_from_slice(pair.left.row(v));
            self.right.extend_from_slice(pair.right.row(v));
        }
        self.left.resize(pair.width, ZERO_SLOPE);
        self.right.resize(pair.width + margin, ZERO_SLOPE);
    }
}

impl AreaStrip {
    fn run(&mut self, pair: &SlopePair<'_>, first: usize, (winners, sigma): (&mut [f32], &mut [f32])) {
        let radius = pair.options.area_radius_px.min(LARGEST_RADIUS_PX);
        let stride = pair.levels.next_multiple_of(LANES);
        self.columns.clear();
        self.columns.resize((pair.width + 1) * stride, 0);
        self.texture.clear();
        self.texture.resize(pair.width, 0);
        self.sums.resize(stride, 0);
        self.best.resize(pair.width, Winner::default());
        let start = first.saturating_sub(radius);
        for v in start..(first + radius).min(pair.height) {
            self.exchange(pair, Some(v), None);
            let Self { enters, leaves, columns, texture, .. } = self;
            widest(Exchange { enters, leaves, columns, texture, stride });
        }
        let answers = winners.chunks_mut(pair.width).zip(sigma.chunks_mut(pair.width));
        for (v, (winners, sigma)) in (first..).zip(answers) {
            let enters = Some(v + radius).filter(|&v| v < pair.height);
            self.exchange(pair, enters, v.checked_sub(radius + 1).filter(|&v| v >= start));
            let rows = (v + radius).min(pair.height - 1) + 1 - v.saturating_sub(radius);
            let Self { columns, texture, sums, enters, leaves, best, claims } = self;
            widest(Windows {
                columns: Exchange { enters, leaves, columns, texture, stride },
                sums,
                radius,
                levels: pair.levels,
                uniqueness: pair.options.area_uniqueness,
                // The sum of a window; at the border less of it is inside.
                least_texture: pair.options.area_texture * (rows * (2 * radius + 1)) as f32,
                best,
            });
            claims.of_winners(best);
            let pixels = (rows * (2 * radius + 1)) as f32;
            for ((u, winner), (shift, sigma)) in best.iter().enumerate().zip(winners.iter_mut().zip(sigma)) {
                let believed = winner.unique && claims.agree(u, winner.level, LEFT_RIGHT_TOLERANCE);
                (*shift, *sigma) = if believed { answer(winner, pixels) } else { (f32::NAN, f32::NAN) };
            }
        }
    }

    /// Which rows enter the columns and leave them next.
    fn exchange(&mut self, pair: &SlopePair<'_>, enters: Option<usize>, leaves: Option<usize>) {
        let margin = pair.levels.next_multiple_of(LANES);
        self.enters.take(pair, enters, margin);
        self.leaves.take(pair, leaves, margin);
    }
}

/// The columns' sums moved down by a row: one enters and one leaves.
struct Exchange<'a> {
    enters: &'a SlopeRows,
    leaves: &'a SlopeRows,
    columns: &'a mut [u16],
    texture: &'a mut [u16],
    stride: usize,
}

impl Exchange<'_> {
    /// Move the column of pixel `u`, and `sums` of a window along with it: that column enters, and
    /// the column of pixel `old` leaves.
    #[inline(always)]
    fn column<B: Bytes>(&mut self, u: usize, old: Option<usize>, sums: &mut [u16]) {
        let Self { enters, leaves, stride, .. } = *self;
        let at = enters.left.len() - 1 - u;
        let (grey, gone) = (B::splat(enters.left[u]), B::splat(leaves.left[u]));
        let (rights, rights_gone) = (&enters.right[at..at + stride], &leaves.right[at..at + stride]);
        // The first column is that of no pixel.
        let (before, from) = self.columns.split_at_mut((u + 1) * stride);
        let column = from[..stride].as_chunks_mut::<LANES>().0;
        let old = old.map_or(0, |old| old + 1) * stride;
        let old = before[old..old + stride].as_chunks::<LANES>().0;
        let lines = column.iter_mut().zip(sums.as_chunks_mut::<LANES>().0).zip(old);
        for (block, ((column, sums), old)) in lines.enumerate() {
            let new = difference(grey, B::load(rights, block * LANES));
            let gone = difference(gone, B::load(rights_gone, block * LANES));
            for i in 0..LANES {
                let moved = column[i].wrapping_add(u16::from(new[i])).wrapping_sub(u16::from(gone[i]));
                column[i] = moved;
                sums[i] = sums[i].wrapping_add(moved).wrapping_sub(old[i]);
            }
        }
        let slope = |rows: &SlopeRows| u16::from(rows.left[u].abs_diff(ZERO_SLOPE));
        self.texture[u] = self.texture[u].wrapping_add(slope(enters)).wrapping_sub(slope(leaves));
    }
}

#[inline(always)]
fn difference<B: Bytes>(a: B, b: B) -> [u8; LANES] {
    a.minus(b).plus(b.minus(a)).to_array()
}

impl Kernel for Exchange<'_> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(mut self) {
        let mut sums = vec![0; self.stride];
        for u in 0..self.texture.len() {
            self.column::<B>(u, None, &mut sums);
        }
    }
}

/// The winner of each window of a row.
struct Windows<'a> {
    columns: Exchange<'a>,
    sums: &'a mut [u16],
    radius: usize,
    levels: usize,
    uniqueness: f32,
    least_texture: f32,
    best: &'a mut [Winner],
}

impl Kernel for Windows<'_> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(self) {
        let Self { mut columns, sums, radius, levels, uniqueness, least_texture, best } = self;
        let width = best.len();
        sums.fill(0);
        let mut slopes = 0_u16;
        for u in 0..width + radius {
            let old = u.checked_sub(2 * radius + 1);
            if u < width {
                columns.column::<B>(u, old, sums);
                slopes = slopes.wrapping_add(columns.texture[u]);
            } else if let Some(old) = old {
                let stride = columns.stride;
                for (sum, x) in sums.iter_mut().zip(&columns.columns[(old + 1) * stride..]) {
                    *sum = sum.wrapping_sub(*x);
                }
            }
            slopes = slopes.wrapping_sub(old.map_or(0, |old| columns.texture[old]));
            let Some(centre) = u.checked_sub(radius) else { continue };
            // Only levels whose match is inside the right image.
            let inside = levels.min(centre + 1);
            let textured = f32::from(slopes) >= least_texture;
            best[centre] = if textured { winner(&mut sums[..inside], uniqueness) } else { Winner::default() };
        }
    }
}

/// Disparity of a winner to 1/16 pixel, and its standard deviation; `pixels` are those of a window.
///
/// About its minimum a sum of N absolute differences of Laplacian noise is C₀ + A δ², and the
/// variance of the minimum C₀/(2 N A): the more the cost rises to either side, and the less remains
/// of it, the surer.
fn answer(winner: &Winner, pixels: f32) -> (f32, f32) {
    let [before, here, after] = winner.costs;
    // Beside the end of the levels the other side tells both.
    let [before, after] =
        [(before, after), (after, before)].map(|(own, other)| if own == NO_LEVEL { other } else { own });
    let [before, here, after] = [before, here, after].map(f32::from);
    let steeper = before.max(after) - here;
    // Two lines of opposite slope: nearer to such a sum's shape than a parabola.
    let offset = if steeper > 0.0 { 0.5 * (before - after) / steeper } else { 0.0 };
    let shift = f32::from(winner.level) + offset;
    // What would remain at the minimum itself.
    let least = (here - 0.5 * (before - after).abs()).max(0.0);
    let rise = (0.5 * (before + after) - least).max(1.0);
    let variance = DEPTH_MISFIT * 0.5 * least * SMOOTHED_PIXELS / (pixels * rise);
    let shift = (shift / RESOLUTION_PX).round() * RESOLUTION_PX;
    (shift, (variance + RESOLUTION_PX * RESOLUTION_PX / 12.0 + MODEL_SIGMA_PX * MODEL_SIGMA_PX).sqrt())
}

/// Where `value` first stands in `sums`, looked for in whole vectors.
#[inline(always)]
fn position(sums: &[u16], value: u16) -> usize {
    let (blocks, rest) = sums.as_chunks::<LANES>();
    let has = |block: &[u16; LANES]| block.iter().fold(0, |any, &sum| any | u16::from(sum == value)) > 0;
    let before = blocks.iter().take_while(|block| !has(block)).count();
    let within = blocks.get(before).map_or(rest, |block| block);
    before * LANES + within.iter().position(|&sum| sum == value).unwrap_or(0)
}

/// The level of least cost; not unique where a rival comes near.
#[inline(always)]
fn winner(sums: &mut [u16], uniqueness: f32) -> Winner {
    let inside = sums.len();
    let cost = sums.iter().copied().fold(u16::MAX, u16::min);
    let level = position(sums, cost);
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
