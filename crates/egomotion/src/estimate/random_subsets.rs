//! Random subsets of the smallest size that determines a motion: how many are needed, and which.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Share of the number of subsets that rounding errors may add: P = 0.99, ε = 0.1, p = 1 needs exactly 2, not 3.
const ROUNDING: f64 = 1e-12;

/// Number of random p-subsets of which, with probability P, one is free of a share ε of outliers, (59).
pub fn subsets_needed(confidence: f64, outliers: f64, subset: u32) -> usize {
    let clean = (1.0 - outliers).powi(subset as i32);
    if clean >= 1.0 {
        return 1;
    }
    let exact = (1.0 - confidence).ln() / (1.0 - clean).ln();
    (exact * (1.0 - ROUNDING)).ceil().max(1.0) as usize
}

/// `count` random subsets of N different indices below `rows`.
pub fn random_subsets<const N: usize>(
    rows: usize,
    count: usize,
    seed: u64,
) -> impl Iterator<Item = [usize; N]> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    (0..if rows < N { 0 } else { count }).map(move |_| {
        let mut subset = [usize::MAX; N];
        let mut filled = 0;
        while filled < N {
            let candidate = rng.random_range(0..rows);
            if !subset[..filled].contains(&candidate) {
                subset[filled] = candidate;
                filled += 1;
            }
        }
        subset
    })
}
