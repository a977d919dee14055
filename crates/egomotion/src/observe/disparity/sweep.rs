//! The two sweeps along a row of pixels, on whole vectors of levels.
//!
//! What a path hands on is its cost less its minimum, so that equation (13) of Hirschmüller reads
//! L(d) = C(d) + min(l(d), l(d∓1) + P1, P2) with l = L − min L of the pixel before. L itself is
//! summed.

use super::census::PLANES;
use super::winners::{NO_LEVEL, Winner};
use crate::simd::{Bytes, Kernel, LANES};

/// Cost beyond the ends of the levels: no path enters from there.
const WALL: u8 = u8::MAX;
/// A wall in the first byte alone, for the level before the first.
const FIRST_WALL: [u8; LANES] = wall_at(0);
/// A wall in the last byte alone, for the level after the last.
const LAST_WALL: [u8; LANES] = wall_at(LANES - 1);

const fn wall_at(lane: usize) -> [u8; LANES] {
    let mut bytes = [0; LANES];
    bytes[lane] = WALL;
    bytes
}

/// Run `$call` with the constant `$name` for a number of blocks that [`blocks_for`] gives.
macro_rules! with_blocks {
    ($blocks:expr, $name:ident, $call:expr) => {
        with_blocks!($blocks, $name, $call, 1 2 3 4 5 6 8 12 16 32 64 256)
    };
    ($blocks:expr, $name:ident, $call:expr, $($n:literal)*) => {
        match $blocks {
            $($n => { const $name: usize = $n; $call })*
            _ => { const $name: usize = 2048; $call }
        }
    };
}
pub(super) use with_blocks;

/// Vectors that hold `levels` levels: a number for which the sweeps are compiled.
pub(super) fn blocks_for(levels: usize) -> usize {
    const SIZES: [usize; 12] = [1, 2, 3, 4, 5, 6, 8, 12, 16, 32, 64, 256];
    let needed = levels.div_ceil(LANES);
    SIZES.into_iter().find(|&size| size >= needed).unwrap_or(2048)
}

/// A path along the row: its costs at the last pixel less their minimum, in registers.
#[derive(Clone, Copy)]
struct RowPath<B, const BLOCKS: usize>([B; BLOCKS]);

impl<B: Bytes, const BLOCKS: usize> RowPath<B, BLOCKS> {
    #[inline(always)]
    fn start() -> Self {
        Self([B::splat(0); BLOCKS])
    }

    /// What it hands on to block `block` of the next pixel.
    #[inline(always)]
    fn hand_on(&self, block: usize, p1: B, p2: B) -> B {
        let wall = B::splat(WALL);
        let same = self.0[block];
        let below = same.moved_up(if block > 0 { self.0[block - 1] } else { wall });
        let above = same.moved_down(if block + 1 < BLOCKS { self.0[block + 1] } else { wall });
        below.min(above).plus(p1).min(same).min(p2)
    }
}

/// From the left and from above: matching costs, and the sums of two paths.
pub(super) struct ForwardSweep<'a, const BLOCKS: usize> {
    /// Census words of the row, plane by plane of `plane` bytes; of the right image mirrored, so that
    /// the candidates of rising disparity stand side by side.
    pub left: &'a [u8],
    pub right: &'a [u8],
    pub plane: usize,
    pub levels: usize,
    pub p1: u8,
    /// P2 between each pixel and the one left of it, and the one above.
    pub p2_left: &'a [u8],
    pub p2_above: &'a [u8],
    pub matching: &'a mut [u8],
    pub downward: &'a mut [u8],
    pub sums: &'a mut [u8],
}

impl<const BLOCKS: usize> ForwardSweep<'_, BLOCKS> {
    /// Matching costs of pixel `u`.
    ///
    /// A match outside the right image is neither confirmed nor refuted: it costs as much as the
    /// mean one inside. Were it as cheap as the best, the smoothness of these equal costs would win
    /// wherever the window of disparities sticks out.
    #[inline(always)]
    fn match_pixel<B: Bytes>(&mut self, u: usize) {
        let costs = &mut self.matching[u * BLOCKS * LANES..(u + 1) * BLOCKS * LANES];
        let first = self.p2_left.len() - 1 - u;
        let mut words = [B::splat(0); PLANES];
        for (k, word) in words.iter_mut().enumerate() {
            *word = B::splat(self.left[k * self.plane + u]);
        }
        for block in 0..BLOCKS {
            let mut sum = B::splat(0);
            for (k, word) in words.iter().enumerate() {
                sum = sum.plus(word.distance(B::load(self.right, k * self.plane + first + block * LANES)));
            }
            sum.store(costs, block * LANES);
        }
        let inside = self.levels.min(u + 1);
        if inside < self.levels {
            let sum: usize = costs[..inside].iter().map(|&cost| usize::from(cost)).sum();
            costs[inside..self.levels].fill((sum / inside.max(1)) as u8);
        }
        if self.levels < BLOCKS * LANES {
            costs[self.levels..].fill(WALL);
        }
    }
}

impl<const BLOCKS: usize> Kernel for ForwardSweep<'_, BLOCKS> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(mut self) {
        let stride = BLOCKS * LANES;
        let p1 = B::splat(self.p1);
        let mut rightward = RowPath::<B, BLOCKS>::start();
        for u in 0..self.p2_left.len() {
            self.match_pixel::<B>(u);
            let (p2_left, p2_above) = (B::splat(self.p2_left[u]), B::splat(self.p2_above[u]));
            let above = &mut self.downward[u * stride..(u + 1) * stride + 2 * LANES];
            let matching = &self.matching[u * stride..(u + 1) * stride];
            let sums = &mut self.sums[u * stride..(u + 1) * stride];
            let (mut along, mut down) = ([B::splat(0); BLOCKS], [B::splat(0); BLOCKS]);
            let (mut least_along, mut least_down) = (B::splat(WALL), B::splat(WALL));
            for block in 0..BLOCKS {
                let at = LANES + block * LANES;
                let cost = B::load(matching, block * LANES);
                let same = B::load(above, at);
                let mut below = B::load(above, at - 1);
                let mut over = B::load(above, at + 1);
                if block == 0 {
                    below = below.max(B::from_array(FIRST_WALL));
                }
                if block + 1 == BLOCKS {
                    over = over.max(B::from_array(LAST_WALL));
                }
                down[block] = below.min(over).plus(p1).min(same).min(p2_above).plus(cost);
                along[block] = rightward.hand_on(block, p1, p2_left).plus(cost);
                least_down = least_down.min(down[block]);
                least_along = least_along.min(along[block]);
                down[block].plus(along[block]).store(sums, block * LANES);
            }
            let (least_along, least_down) = (least_along.least(), least_down.least());
            for block in 0..BLOCKS {
                rightward.0[block] = along[block].minus(least_along);
                down[block].minus(least_down).store(above, LANES + block * LANES);
            }
        }
    }
}

/// From the right: the last path, and the winners.
pub(super) struct BackwardSweep<'a, const BLOCKS: usize> {
    pub levels: usize,
    pub p1: u8,
    pub p2_left: &'a [u8],
    pub matching: &'a [u8],
    pub sums: &'a [u8],
    pub uniqueness: f32,
    pub best: &'a mut [Winner],
}

impl<const BLOCKS: usize> Kernel for BackwardSweep<'_, BLOCKS> {
    type Output = ();
    #[inline(always)]
    fn run<B: Bytes>(self) {
        let stride = BLOCKS * LANES;
        let p1 = B::splat(self.p1);
        let mut leftward = RowPath::<B, BLOCKS>::start();
        let mut total = [[0_u8; LANES]; BLOCKS];
        let width = self.best.len();
        // Up to which cost another level is a rival of the winner.
        let mut rivals_of = [0_u8; 256];
        for (cost, rival) in rivals_of.iter_mut().enumerate().map(|(cost, rival)| (cost as f32, rival)) {
            *rival = (cost / (1.0 - self.uniqueness)).max(cost).min(254.0) as u8;
        }
        for u in (0..width).rev() {
            let p2 = B::splat(*self.p2_left.get(u + 1).unwrap_or(&0));
            let matching = &self.matching[u * stride..(u + 1) * stride];
            let sums = &self.sums[u * stride..(u + 1) * stride];
            let mut along = [B::splat(0); BLOCKS];
            let mut totals = [B::splat(0); BLOCKS];
            let (mut least_along, mut least) = (B::splat(WALL), B::splat(WALL));
            for (block, along) in along.iter_mut().enumerate() {
                let cost = B::load(matching, block * LANES);
                *along = leftward.hand_on(block, p1, p2).plus(cost);
                least_along = least_along.min(*along);
                totals[block] = along.plus(B::load(sums, block * LANES));
                total[block] = totals[block].to_array();
                least = least.min(totals[block]);
            }
            let least_along = least_along.least();
            leftward = RowPath(along.map(|cost| cost.minus(least_along)));
            let least = least.least();
            let least_cost = least.to_array()[0];
            let rival = rivals_of[usize::from(least_cost)];
            let bound = B::splat(rival);
            let mut level = 0;
            let mut rivals = 0_u32;
            for block in (0..BLOCKS).rev() {
                let low = totals[block].at_most(least);
                // Without a branch: no processor guesses the block.
                level = if low != 0 { block * LANES + low.trailing_zeros() as usize } else { level };
                rivals += totals[block].at_most(bound).count_ones();
            }
            let total = total.as_flattened();
            let cost = |level: usize| match total.get(level) {
                Some(&cost) if level < self.levels => u16::from(cost),
                _ => NO_LEVEL,
            };
            let (below, above) = (cost(level.wrapping_sub(1)), cost(level + 1));
            let own = 1 + u32::from(below <= rival.into()) + u32::from(above <= rival.into());
            let inside = self.levels.min(u + 1);
            self.best[u] = Winner {
                level: level as u16,
                costs: [below, least_cost.into(), above],
                unique: rivals <= own && (level >= 2 || level + 2 < inside),
            };
        }
    }
}
