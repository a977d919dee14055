//! The search of least median of squares, (58): exact, and fast.
//!
//! A subset is the better one when its median of squared residuals is less. To see that it is *not*, it is
//! enough to count: more than half of the rows beyond the best median so far. Counting is done in single
//! precision, on columns, against a limit widened by the most that rounding can do, so that whoever is dropped
//! is rightly dropped. Whoever is left is judged in double precision as the plain search does. The order in
//! which subsets are judged, best on a few rows first, changes the work and not the answer.

use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

use super::least_squares::Weighting;
use super::row::Row;
use crate::geometry::median;
use crate::simd::vectorised;

/// Candidates are ordered by their median over about this many rows: the better the first is, the sooner others drop.
const PREVIEW_ROWS: usize = 1024;
/// Rows whose squares are taken at once by one thread; the answer does not depend on it.
pub(super) const STRIP: usize = 8192;
/// Rows in a chunk: its columns fit into the cache next to the core.
const CHUNK: usize = 512;
/// Candidates that are counted by one task, chunk by chunk: so many that a chunk is used often while it is in the cache.
const CANDIDATES_PER_TASK: usize = 36;
/// Beyond this magnitude single precision is not certain of anything, and no candidate is dropped.
const LARGEST_SINGLE: f64 = 1e30;

/// The best subset found by the search: its θ and the median of its squared residuals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BestSubset<const N: usize> {
    /// θ that fits the subset exactly.
    pub theta: SVector<f64, N>,
    /// Median over all rows of the squared residual.
    pub median_square: f64,
}

/// Minimise the median of squared residuals over the given subsets of N row indices, (58).
///
/// Of equal medians the first subset's is taken: the answer is that of [`best_subset_plain`], bit for bit.
pub fn best_subset<const N: usize>(
    rows: &[Row<N>],
    weighting: Weighting,
    subsets: impl Iterator<Item = [usize; N]>,
) -> Option<BestSubset<N>> {
    let candidates = in_order_of_promise(rows, weighting, distinct(rows, subsets));
    let columns = Columns::of(rows, weighting);
    let mut best: Option<(BestSubset<N>, usize)> = None;
    let mut left = candidates.as_slice();
    let mut kept;
    let mut squares = vec![0.0; rows.len()];
    while let Some((candidate, rest)) = left.split_first() {
        left = rest;
        let limit = best.map_or(f64::INFINITY, |(b, _)| b.median_square);
        let Some(median_square) = median_within(rows, weighting, &candidate.theta, limit, &mut squares)
        else {
            continue;
        };
        let better = best.is_none_or(|(b, index)| {
            median_square < b.median_square || (median_square == b.median_square && candidate.index < index)
        });
        if better {
            best = Some((BestSubset { theta: candidate.theta, median_square }, candidate.index));
            kept = columns.within(left, median_square);
            left = &kept;
        }
    }
    best.map(|(found, _)| found)
}

/// The same, as it is defined: every median of every subset, in double precision and in order.
pub fn best_subset_plain<const N: usize>(
    rows: &[Row<N>],
    weighting: Weighting,
    subsets: impl Iterator<Item = [usize; N]>,
) -> Option<BestSubset<N>> {
    let mut best: Option<BestSubset<N>> = None;
    for subset in subsets {
        let Some(theta) = exact_fit(rows, &subset) else { continue };
        let mut squares: Vec<f64> = rows.iter().map(|row| square(row, weighting, &theta)).collect();
        let median_square = median(&mut squares);
        if best.is_none_or(|b| median_square < b.median_square) {
            best = Some(BestSubset { theta, median_square });
        }
    }
    best
}

/// Squared residual of a row.
pub(super) fn square<const N: usize>(row: &Row<N>, weighting: Weighting, theta: &SVector<f64, N>) -> f64 {
    weighting.of(row) * row.residual(theta).powi(2)
}

/// θ through N rows; `None` where they do not determine it.
fn exact_fit<const N: usize>(rows: &[Row<N>], subset: &[usize; N]) -> Option<SVector<f64, N>> {
    let matrix = SMatrix::<f64, N, N>::from_fn(|i, j| rows[subset[i]].a[j]);
    let theta = matrix.try_inverse()? * SVector::<f64, N>::from_fn(|i, _| rows[subset[i]].b);
    theta.iter().all(|v| v.is_finite()).then_some(theta)
}

/// What a subset proposes, and its place among the subsets.
#[derive(Debug, Clone, Copy)]
struct Candidate<const N: usize> {
    theta: SVector<f64, N>,
    index: usize,
}

/// The candidates of the subsets; of those that propose the same, as all do that fit nothing but zeros, the first.
fn distinct<const N: usize>(rows: &[Row<N>], subsets: impl Iterator<Item = [usize; N]>) -> Vec<Candidate<N>> {
    let mut candidates: Vec<Candidate<N>> = subsets
        .enumerate()
        .filter_map(|(index, subset)| Some(Candidate { theta: exact_fit(rows, &subset)?, index }))
        .collect();
    // Adding zero makes one of the two zeros.
    let key = |c: &Candidate<N>| c.theta.map(|v| v + 0.0);
    let order = |a: &SVector<f64, N>, b: &SVector<f64, N>| {
        let of = a.iter().zip(b.iter()).map(|(a, b)| a.total_cmp(b));
        of.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
    };
    candidates.sort_by(|a, b| order(&key(a), &key(b)).then(a.index.cmp(&b.index)));
    candidates.dedup_by(|later, first| key(later) == key(first));
    candidates
}

/// Candidates by their median over a few rows that are spread evenly.
fn in_order_of_promise<const N: usize>(
    rows: &[Row<N>],
    weighting: Weighting,
    candidates: Vec<Candidate<N>>,
) -> Vec<Candidate<N>> {
    let sample: Vec<Row<N>> =
        rows.iter().step_by(rows.len().div_ceil(PREVIEW_ROWS).max(1)).copied().collect();
    let mut judged: Vec<(f64, Candidate<N>)> = candidates
        .into_par_iter()
        .map(|candidate| {
            let mut squares: Vec<f64> =
                sample.iter().map(|row| square(row, weighting, &candidate.theta)).collect();
            (median(&mut squares), candidate)
        })
        .collect();
    judged.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.index.cmp(&b.1.index)));
    judged.into_iter().map(|(_, candidate)| candidate).collect()
}

/// Median of the squared residuals; `None` where it exceeds `limit`.
fn median_within<const N: usize>(
    rows: &[Row<N>],
    weighting: Weighting,
    theta: &SVector<f64, N>,
    limit: f64,
    squares: &mut [f64],
) -> Option<f64> {
    let strips = rows.par_chunks(STRIP).zip(squares.par_chunks_mut(STRIP));
    let beyond: usize = strips
        .map(|(rows, squares)| {
            for (into, row) in squares.iter_mut().zip(rows) {
                *into = square(row, weighting, theta);
            }
            squares.iter().filter(|&&square| square > limit).count()
        })
        .sum();
    (2 * beyond <= rows.len()).then(|| median(squares))
}

/// The rows in single precision, in chunks of columns: b and a, times the root of the weight.
struct Columns<const N: usize> {
    chunks: Vec<Chunk<N>>,
    rows: usize,
}

struct Chunk<const N: usize> {
    b: [f32; CHUNK],
    a: [[f32; CHUNK]; N],
    /// Largest magnitude of b and of each column of a.
    most: (f64, [f64; N]),
}

impl<const N: usize> Columns<N> {
    fn of(rows: &[Row<N>], weighting: Weighting) -> Self {
        Self {
            chunks: rows.par_chunks(CHUNK).map(|rows| Chunk::of(rows, weighting)).collect(),
            rows: rows.len(),
        }
    }

    /// Those of the candidates of which it is not certain that their median exceeds `median_square`.
    fn within(&self, candidates: &[Candidate<N>], median_square: f64) -> Vec<Candidate<N>> {
        let limit = median_square.sqrt();
        candidates
            .par_chunks(CANDIDATES_PER_TASK)
            .flat_map_iter(|some| self.some_within(some, limit))
            .collect()
    }

    fn some_within(&self, candidates: &[Candidate<N>], limit: f64) -> Vec<Candidate<N>> {
        let mut left: Vec<(Candidate<N>, usize)> = candidates.iter().map(|c| (*c, 0)).collect();
        for chunk in &self.chunks {
            for (candidate, beyond) in &mut left {
                *beyond += chunk.beyond(&candidate.theta, limit);
            }
            left.retain(|(_, beyond)| 2 * beyond <= self.rows);
        }
        left.into_iter().map(|(candidate, _)| candidate).collect()
    }
}

impl<const N: usize> Chunk<N> {
    /// A row that is not finite counts as zero, which is within any limit.
    fn of(rows: &[Row<N>], weighting: Weighting) -> Self {
        let mut chunk = Self { b: [0.0; CHUNK], a: [[0.0; CHUNK]; N], most: (0.0, [0.0; N]) };
        for (k, row) in rows.iter().enumerate() {
            let root = weighting.of(row).sqrt();
            let (b, a) = (root * row.b, root * row.a);
            let fits = |v: f64| (v as f32).is_finite();
            if fits(b) && a.iter().all(|&v| fits(v)) {
                chunk.b[k] = b as f32;
                chunk.most.0 = chunk.most.0.max(b.abs());
                for j in 0..N {
                    chunk.a[j][k] = a[j] as f32;
                    chunk.most.1[j] = chunk.most.1[j].max(a[j].abs());
                }
            }
        }
        chunk
    }

    /// At most so many rows have a residual beyond the limit as counted here, whatever rounding does.
    fn beyond(&self, theta: &SVector<f64, N>, limit: f64) -> usize {
        // Each of the N products and sums, and each number itself, is rounded once; twice that is ample.
        let rounding = 2.0 * (N as f64 + 3.0) * f64::from(f32::EPSILON);
        let reach = self.most.0 + (0..N).map(|j| (self.most.1[j] * theta[j]).abs()).sum::<f64>();
        // What is too small for a normal number loses more, but no more than this.
        let least = f64::from(f32::MIN_POSITIVE) * (2.0 + N as f64 + theta.abs().sum());
        let bound = (limit * (1.0 + 1e-6) + rounding * reach + least) as f32;
        if !(reach < LARGEST_SINGLE && bound.is_finite() && theta.amax() < LARGEST_SINGLE) {
            return 0;
        }
        match N {
            0..=3 => count_three(&self.b, self.columns(), single(theta), bound),
            4..=6 => count_six(&self.b, self.columns(), single(theta), bound),
            // Nothing is certain of more unknowns than any of the methods has.
            _ => 0,
        }
    }

    /// The columns of M ≥ N unknowns, of which those that are not there do not count.
    fn columns<const M: usize>(&self) -> [&[f32; CHUNK]; M] {
        std::array::from_fn(|j| self.a.get(j).unwrap_or(&self.b))
    }
}

/// θ of M ≥ N unknowns.
fn single<const N: usize, const M: usize>(theta: &SVector<f64, N>) -> [f32; M] {
    std::array::from_fn(|j| theta.get(j).map_or(0.0, |&v| v as f32))
}

vectorised! {
    /// How many residuals in three unknowns exceed the bound.
    count_three(b: &[f32; CHUNK], a: [&[f32; CHUNK]; 3], t: [f32; 3], bound: f32) -> usize {
        let residual = |k: usize| b[k] - (a[0][k] * t[0] + a[1][k] * t[1] + a[2][k] * t[2]);
        (0..CHUNK).map(|k| u32::from(residual(k).abs() > bound)).sum::<u32>() as usize
    }
}

vectorised! {
    /// How many residuals in six unknowns exceed the bound.
    count_six(b: &[f32; CHUNK], a: [&[f32; CHUNK]; 6], t: [f32; 6], bound: f32) -> usize {
        let residual = |k: usize| {
            b[k] - (a[0][k] * t[0] + a[1][k] * t[1] + a[2][k] * t[2])
                - (a[3][k] * t[3] + a[4][k] * t[4] + a[5][k] * t[5])
        };
        (0..CHUNK).map(|k| u32::from(residual(k).abs() > bound)).sum::<u32>() as usize
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::estimate::random_subsets::random_subsets;

    /// Rows about a truth, a share of them anywhere; σ differs from row to row.
    fn rows<const N: usize>(count: usize, wild: f64, step: Option<f64>, seed: u64) -> Vec<Row<N>> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let truth = SVector::<f64, N>::from_fn(|i, _| 0.3 - 0.2 * i as f64);
        (0..count)
            .map(|block| {
                let a = SVector::<f64, N>::from_fn(|j, _| {
                    if j == 0 { 1.0 } else { rng.random_range(-1.0..1.0) * 10f64.powi(j as i32 - 2) }
                });
                let off: f64 = if rng.random_bool(wild) { 5.0 } else { 0.01 };
                let b = a.dot(&truth) + off * rng.random_range(-1.0..1.0);
                let b = step.map_or(b, |step| (b / step).round() * step);
                Row { a, b, sigma: rng.random_range(0.5..2.0), block }
            })
            .collect()
    }

    fn agrees<const N: usize>(rows: &[Row<N>], subsets: usize) {
        for weighting in [Weighting::Unit, Weighting::InverseVariance] {
            let all = || random_subsets::<N>(rows.len(), subsets, 7);
            let plain = best_subset_plain(rows, weighting, all());
            assert_eq!(best_subset(rows, weighting, all()), plain);
            // In any order: what is best does not depend on what is met first, but for ties.
            let mut turned: Vec<[usize; N]> = all().collect();
            turned.reverse();
            assert_eq!(
                best_subset(rows, weighting, turned.iter().copied()),
                best_subset_plain(rows, weighting, turned.into_iter())
            );
        }
    }

    #[test]
    fn the_answer_is_that_of_the_plain_search() {
        for (count, wild) in [(6, 0.0), (40, 0.4), (41, 0.6), (900, 0.3), (1201, 0.5), (3 * CHUNK, 0.2)] {
            agrees(&rows::<2>(count, wild, None, 1), 200);
            agrees(&rows::<3>(count, wild, None, 2), 200);
            agrees(&rows::<6>(count, wild, None, 3), 300);
        }
        assert_eq!(best_subset::<2>(&[], Weighting::Unit, std::iter::empty()), None);
    }

    #[test]
    fn ties_go_to_the_first() {
        // Rounded so coarsely that most right-hand sides are zero, and many subsets propose the same.
        for step in [0.3, 0.7, 1.5] {
            agrees(&rows::<3>(501, 0.1, Some(step), 4), 200);
            agrees(&rows::<6>(2000, 0.1, Some(step), 5), 300);
        }
    }

    #[test]
    fn numbers_beyond_single_precision_change_no_answer() {
        for factor in [1e-25, 1e-12, 1e12, 1e25, 1e60] {
            let mut scaled = rows::<3>(800, 0.3, None, 6);
            scaled.iter_mut().for_each(|row| row.b *= factor);
            agrees(&scaled, 100);
            scaled.iter_mut().for_each(|row| row.a *= factor);
            agrees(&scaled, 100);
        }
        let mut odd = rows::<3>(800, 0.3, None, 8);
        (0..20).for_each(|i| odd[37 * i].b = [f64::NAN, f64::INFINITY, 1e39, -1e300][i % 4]);
        agrees(&odd, 100);
        // The same numbers on a large offset: what single precision leaves of them is rounding.
        let mut offset = rows::<3>(800, 0.3, None, 9);
        offset.iter_mut().for_each(|row| row.b += 1e7 * row.a[0]);
        agrees(&offset, 100);
    }

    #[test]
    fn the_answer_does_not_depend_on_the_threads() {
        let rows = rows::<6>(20_000, 0.4, None, 10);
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| best_subset(&rows, Weighting::Unit, random_subsets(rows.len(), 100, 3)))
        };
        assert_eq!(with(1), with(5));
        assert_eq!(with(1), best_subset_plain(&rows, Weighting::Unit, random_subsets(rows.len(), 100, 3)));
    }
}
