//! Which winners to believe: uniqueness, left-right agreement, speckles.

use rayon::prelude::*;

/// The cost of a level that does not exist: larger than that of any that does.
pub(super) const NO_LEVEL: u16 = u16::MAX;
/// Rows labelled together, in rows. The answer does not depend on them: more make the strips' work coarser,
/// fewer leave more borders to join.
const STRIP_ROWS: usize = 64;

/// The level of least cost of a pixel.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Winner {
    /// The level.
    pub level: u16,
    /// Cost of the level below, of the level, and of the one above; [`NO_LEVEL`] where there is none.
    pub costs: [u16; 3],
    /// Whether no other level but its neighbours is about as cheap.
    pub unique: bool,
}

/// What left pixels claim each pixel of the right row with: the cost (high half) and the level of the
/// best of them. The last right pixel comes first, so that one left pixel's levels stand side by side.
#[derive(Debug, Clone, Default)]
pub(super) struct Claims(Vec<u32>);

impl Claims {
    /// Forget the last row.
    fn start_row(&mut self, width: usize) {
        self.0.clear();
        self.0.resize(width, u32::MAX);
    }

    /// Every winner claims its right pixel.
    pub(super) fn of_winners(&mut self, row: &[Winner]) {
        self.start_row(row.len());
        for (u, winner) in row.iter().enumerate() {
            let claim = u32::from(winner.costs[1]) << 16 | u32::from(winner.level);
            if let Some(best) = self.0.get_mut(row.len() - 1 - u + usize::from(winner.level)) {
                *best = claim.min(*best);
            }
        }
    }

    /// Whether the right pixel of left pixel `u` at `level` is claimed at that level, within
    /// `tolerance`; never outside the right image.
    pub(super) fn agree(&self, u: usize, level: u16, tolerance: usize) -> bool {
        let claim = self.0.get(self.0.len() - 1 - u + usize::from(level));
        claim.is_some_and(|&claim| usize::from((claim as u16).abs_diff(level)) <= tolerance)
    }
}

/// The winners of a row to a fraction of a pixel, NaN where not to be believed.
///
/// To be believed a winner must be unique, and the right pixel it takes must not belong to a better
/// match at a level that differs by more than `tolerance`.
pub(super) fn believe(row: &[Winner], tolerance: usize, claims: &Claims, believed: &mut [f32]) {
    for ((u, winner), believed) in row.iter().enumerate().zip(believed) {
        let agrees = claims.agree(u, winner.level, tolerance);
        *believed =
            if agrees && winner.unique { f32::from(winner.level) + parabola(winner.costs) } else { f32::NAN };
    }
}

/// Offset of the minimum of the parabola through three neighbouring costs, −½ … ½; 0 beside the
/// end of the levels and where there is no minimum.
fn parabola(costs: [u16; 3]) -> f32 {
    let [before, here, after] = costs.map(f32::from);
    let curvature = before - 2.0 * here + after;
    let beside_end = costs[0].max(costs[2]) == NO_LEVEL;
    if curvature > 0.0 && !beside_end { (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
}

/// Neighbours along a row whose values are connected: columns `start` … `end` − 1.
#[derive(Debug, Clone, Copy)]
struct Run {
    start: u32,
    end: u32,
    /// A run of the same piece before this one, or itself.
    parent: u32,
    /// Of a piece's first run: its number of pixels.
    size: u32,
}

/// The runs of some rows.
#[derive(Debug, Clone, Default)]
struct Runs {
    runs: Vec<Run>,
    /// Where each row's runs begin, and where the last ends.
    rows: Vec<u32>,
}

impl Runs {
    fn clear(&mut self) {
        self.runs.clear();
        self.rows.clear();
        self.rows.push(0);
    }

    /// Append the runs of a row.
    fn push_row(&mut self, row: &[f32], range: f32) {
        let mut last = f32::NAN;
        for (u, &value) in row.iter().enumerate() {
            if (value - last).abs() <= range {
                last = value;
                continue;
            }
            self.end_run(last, u);
            if !value.is_nan() {
                let (start, index) = (u as u32, self.runs.len() as u32);
                self.runs.push(Run { start, end: start, parent: index, size: 0 });
            }
            last = value;
        }
        self.end_run(last, row.len());
        self.rows.push(self.runs.len() as u32);
    }

    fn end_run(&mut self, last: f32, end: usize) {
        if let Some(run) = self.runs.last_mut().filter(|_| !last.is_nan()) {
            run.end = end as u32;
            run.size = run.end - run.start;
        }
    }

    /// The first run of the piece.
    fn first(&mut self, mut index: u32) -> u32 {
        loop {
            let parent = self.runs[index as usize].parent;
            if parent == index {
                return index;
            }
            // Halve the way for the next one.
            let above = self.runs[parent as usize].parent;
            self.runs[index as usize].parent = above;
            index = above;
        }
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.first(a), self.first(b));
        if a != b {
            let (first, second) = (a.min(b), a.max(b));
            self.runs[second as usize].parent = first;
            self.runs[first as usize].size += self.runs[second as usize].size;
        }
    }

    /// Join the runs of row `row` to those of the row above.
    fn join_above(&mut self, row: usize, above: &[f32], here: &[f32], range: f32) {
        let (mut a, mut b) = (self.rows[row - 1], self.rows[row]);
        let (end_a, end_b) = (self.rows[row], self.rows[row + 1]);
        while a < end_a && b < end_b {
            let (over, run) = (self.runs[a as usize], self.runs[b as usize]);
            let common = over.start.max(run.start) as usize..over.end.min(run.end) as usize;
            if common.start < common.end {
                let mut both = above[common.clone()].iter().zip(&here[common]);
                if both.any(|(x, y)| (x - y).abs() <= range) {
                    self.join(a, b);
                }
            }
            if over.end <= run.end { a += 1 } else { b += 1 }
        }
    }
}

/// Work space of [`Speckles::remove`].
#[derive(Debug, Clone, Default)]
pub(super) struct Speckles {
    strips: Vec<Runs>,
    all: Runs,
}

impl Speckles {
    /// Remove (set to NaN) connected pieces of fewer than `size` pixels.
    ///
    /// Two of the four-neighbours are connected if they differ by at most `range`. `values` is
    /// row-major with rows of `width`.
    pub(super) fn remove(&mut self, values: &mut [f32], width: usize, size: usize, range: f32) {
        let strip_size = STRIP_ROWS * width;
        self.strips.resize_with(values.len().div_ceil(strip_size), Runs::default);
        self.strips.par_iter_mut().zip(values.par_chunks(strip_size)).for_each(|(strip, values)| {
            strip.clear();
            let mut above: &[f32] = &[];
            for (v, row) in values.chunks_exact(width).enumerate() {
                strip.push_row(row, range);
                if v > 0 {
                    strip.join_above(v, above, row, range);
                }
                above = row;
            }
        });
        self.join_strips(values, width, range);
        let (runs, rows) = (&self.all.runs, &self.all.rows);
        values.par_chunks_exact_mut(width).enumerate().for_each(|(v, row)| {
            for run in &runs[rows[v] as usize..rows[v + 1] as usize] {
                if (runs[run.parent as usize].size as usize) < size {
                    row[run.start as usize..run.end as usize].fill(f32::NAN);
                }
            }
        });
    }

    /// Collect the strips into one; at the end each run's parent is the first of its piece.
    fn join_strips(&mut self, values: &[f32], width: usize, range: f32) {
        let Self { strips, all } = self;
        all.clear();
        for strip in strips.iter() {
            let offset = all.runs.len() as u32;
            let row = all.rows.len() - 1;
            all.runs.extend(strip.runs.iter().map(|&run| Run { parent: run.parent + offset, ..run }));
            all.rows.extend(strip.rows[1..].iter().map(|&index| index + offset));
            if row > 0 {
                let (above, here) = values[(row - 1) * width..(row + 1) * width].split_at(width);
                all.join_above(row, above, here, range);
            }
        }
        for index in 0..all.runs.len() as u32 {
            let first = all.first(index);
            all.runs[index as usize].parent = first;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_right_pixel_keeps_its_best_left_pixel() {
        let winner = |level, cost| Winner { level, costs: [99, cost, 99], unique: true };
        // Left pixels 3 and 5 both claim right pixel 2; left pixel 0 lies outside at level 1.
        let row = [winner(1, 1), winner(0, 5), winner(0, 50), winner(1, 7), winner(0, 5), winner(3, 4)];
        let mut claims = Claims::default();
        claims.of_winners(&row);
        let mut believed = [0.0; 6];
        believe(&row, 1, &claims, &mut believed);
        let kept: Vec<bool> = believed.iter().map(|d| !d.is_nan()).collect();
        assert_eq!(kept, [false, true, false, false, true, true]);
        believe(&row, 2, &claims, &mut believed);
        assert_eq!(believed[3], 1.0);
    }

    #[test]
    fn the_parabola_finds_its_minimum() {
        let costs = [1.0, 0.0, -1.0].map(|d: f64| (1000.0 * (d + 0.3).powi(2)) as u16);
        assert!((parabola(costs) - 0.3).abs() < 1e-3);
        assert_eq!((parabola([7, 7, 7]), parabola([NO_LEVEL, 3, 9])), (0.0, 0.0));
    }

    /// Size of the piece of every pixel, by flooding.
    fn flooded(values: &[f32], width: usize, range: f32) -> Vec<usize> {
        let mut sizes = vec![0; values.len()];
        for start in (0..values.len()).filter(|&i| !values[i].is_nan()) {
            let (mut piece, mut next) = (vec![start], 0);
            while next < piece.len() {
                let (u, v) = (piece[next] % width, piece[next] / width);
                for other in 0..values.len() {
                    let beside = (other % width).abs_diff(u) + (other / width).abs_diff(v) == 1;
                    let connected = (values[other] - values[piece[next]]).abs() <= range;
                    if beside && connected && !piece.contains(&other) {
                        piece.push(other);
                    }
                }
                next += 1;
            }
            sizes[start] = piece.len();
        }
        sizes
    }

    #[test]
    fn speckles_go_and_surfaces_stay() {
        let mut values = vec![1.0, 1.5, 9.0, 2.0, 1.8, f32::NAN, 2.4, 2.0, 30.0];
        Speckles::default().remove(&mut values, 3, 2, 0.6);
        let kept: Vec<bool> = values.iter().map(|v| !v.is_nan()).collect();
        assert_eq!(kept, [true, true, false, true, true, false, true, true, false]);
    }

    #[test]
    fn pieces_are_those_of_a_flood_over_strips_too() {
        let mut speckles = Speckles::default();
        for (width, height, seed) in [(5, 150, 1_u64), (17, 9, 2), (1, 200, 3), (3, 65, 4)] {
            let mut state = seed;
            let mut random = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 33) as f32 / (1_u64 << 31) as f32
            };
            let level = |x: f32| if x < 0.2 { f32::NAN } else { (x * 4.0).floor() };
            let values: Vec<f32> = (0..width * height).map(|_| level(random())).collect();
            let mut kept = values.clone();
            speckles.remove(&mut kept, width, 4, 1.0);
            let sizes = flooded(&values, width, 1.0);
            for (i, value) in kept.iter().enumerate() {
                assert_eq!(value.is_nan(), values[i].is_nan() || sizes[i] < 4, "{width} x {height}: {i}");
            }
        }
    }
}
