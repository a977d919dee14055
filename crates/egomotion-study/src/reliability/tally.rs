//! What the answers of many pairs in one way amount to.

use super::ReliabilityRecord;

/// An answered component further than this many of its σ from the truth is wrong.
const WRONG_SIGMAS: f64 = 8.0;
/// A bias of less than this many σ is none that a warning should speak of.
const SMALL_BIAS_SIGMAS: f64 = 2.0;

/// Counts over the pairs of one sequence, source of disparity, method, approach and estimator.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct ReliabilityTally {
    /// Pairs.
    pub(super) pairs: usize,
    /// Pairs with an answer to every component.
    pub(super) complete: usize,
    /// Pairs with some component undetermined, the direction named.
    pub(super) partial: usize,
    /// Pairs refused because no direction of motion is determined.
    pub(super) unobservable: usize,
    /// Pairs refused in another way: the estimator failed.
    pub(super) failed: usize,
    /// Pairs with a warning.
    pub(super) warned: usize,
    /// Pairs with a wrong component and no warning.
    pub(super) silently_wrong: usize,
    /// The largest error without a warning, in σ.
    pub(super) worst_unwarned: f64,
    /// Pairs of those whose mean error over all pairs is small.
    unbiased: usize,
    /// Of them, pairs with a warning all the same.
    falsely_warned: usize,
}

impl ReliabilityTally {
    /// The tally of records of one way.
    pub(super) fn of(records: &[&ReliabilityRecord]) -> Self {
        let mut tally = Self { pairs: records.len(), ..Self::default() };
        let unbiased = (0..6).all(|i| mean_sigmas(records, i).abs() < SMALL_BIAS_SIGMAS);
        for record in records {
            let worst = record.sigmas.iter().flatten().map(|sigmas| sigmas.abs()).fold(0.0, f64::max);
            let warned = record.warning.is_some();
            match &record.refused {
                Some(why) if why.contains("observable") => tally.unobservable += 1,
                Some(_) => tally.failed += 1,
                None if record.sigmas.iter().all(Option::is_some) => tally.complete += 1,
                None => tally.partial += 1,
            }
            tally.warned += usize::from(warned);
            tally.silently_wrong += usize::from(!warned && worst > WRONG_SIGMAS);
            if !warned {
                tally.worst_unwarned = tally.worst_unwarned.max(worst);
            }
            if unbiased && record.refused.is_none() {
                tally.unbiased += 1;
                tally.falsely_warned += usize::from(warned);
            }
        }
        tally
    }

    /// Share of the pairs without a bias that were warned of; `None` without such pairs.
    pub(super) fn falsely_warned(&self) -> Option<f64> {
        (self.unbiased > 0).then(|| self.falsely_warned as f64 / self.unbiased as f64)
    }

    /// Both together.
    pub(super) fn merged(mut self, other: &Self) -> Self {
        self.pairs += other.pairs;
        self.complete += other.complete;
        self.partial += other.partial;
        self.unobservable += other.unobservable;
        self.failed += other.failed;
        self.warned += other.warned;
        self.silently_wrong += other.silently_wrong;
        self.worst_unwarned = self.worst_unwarned.max(other.worst_unwarned);
        self.unbiased += other.unbiased;
        self.falsely_warned += other.falsely_warned;
        self
    }
}

/// The mean error of a component over the pairs that answer it, in σ.
fn mean_sigmas(records: &[&ReliabilityRecord], component: usize) -> f64 {
    let answered: Vec<f64> = records.iter().filter_map(|record| record.sigmas[component]).collect();
    answered.iter().sum::<f64>() / answered.len().max(1) as f64
}
