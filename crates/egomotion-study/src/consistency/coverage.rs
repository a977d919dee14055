//! Coverage of pixels' intervals, counted by σ.

use serde::{Deserialize, Serialize};

use egomotion::geometry::distribution::NORMAL_P975;

/// Bins of σ for each factor of two. More bins divide answers more finely by σ and make records longer.
const BINS_PER_OCTAVE: f64 = 4.0;
/// Half the width of the wider interval, in standard deviations: a Gaussian leaves it in 0.27 % of all answers.
const WIDE_INTERVAL_SIGMAS: f64 = 3.0;

/// Numbers of answers, of those within 95 % and of those within 3 σ, by σ.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct CoverageBySigma {
    /// (⌊4 log₂ σ⌋, counts), the smallest σ first.
    bins: Vec<(i32, CoverageCounts)>,
}

/// Answers of about the same σ.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct CoverageCounts {
    /// All answers.
    pub answers: usize,
    /// Those whose 95 % interval holds the truth.
    pub inside95: usize,
    /// Those within 3 σ of the truth.
    pub within3: usize,
}

impl CoverageCounts {
    fn merged(self, other: &Self) -> Self {
        Self {
            answers: self.answers + other.answers,
            inside95: self.inside95 + other.inside95,
            within3: self.within3 + other.within3,
        }
    }

    /// Share of the answers whose 95 % interval holds the truth.
    pub(super) fn coverage95(&self) -> Option<f64> {
        (self.answers > 0).then(|| self.inside95 as f64 / self.answers as f64)
    }

    /// Share of the answers within 3 σ of the truth.
    pub(super) fn coverage3(&self) -> Option<f64> {
        (self.answers > 0).then(|| self.within3 as f64 / self.answers as f64)
    }
}

impl CoverageBySigma {
    /// Count an answer; one without a positive σ does not count.
    pub(super) fn add(&mut self, error: f64, sigma: f64) {
        if !(error.is_finite() && sigma > 0.0 && sigma.is_finite()) {
            return;
        }
        let bin = (sigma.log2() * BINS_PER_OCTAVE).floor() as i32;
        let off = error.abs() / sigma;
        let one = CoverageCounts {
            answers: 1,
            inside95: (off <= NORMAL_P975).into(),
            within3: (off <= WIDE_INTERVAL_SIGMAS).into(),
        };
        self.put(bin, &one);
    }

    fn put(&mut self, bin: i32, counts: &CoverageCounts) {
        match self.bins.binary_search_by_key(&bin, |b| b.0) {
            Ok(i) => self.bins[i].1 = self.bins[i].1.merged(counts),
            Err(i) => self.bins.insert(i, (bin, *counts)),
        }
    }

    /// The counts of both.
    #[must_use]
    pub(super) fn merged(mut self, other: &Self) -> Self {
        other.bins.iter().for_each(|(bin, counts)| self.put(*bin, counts));
        self
    }

    /// The counts of all σ.
    pub fn all(&self) -> CoverageCounts {
        self.bins.iter().fold(CoverageCounts::default(), |sum, (_, counts)| sum.merged(counts))
    }

    /// Every fifth of the answers by σ, the surest first; a bin belongs to the fifth in which its middle lies.
    pub(super) fn fifths(&self) -> [CoverageCounts; 5] {
        let mut fifths = [CoverageCounts::default(); 5];
        let total = self.all().answers.max(1);
        let mut before = 0;
        for (_, counts) in &self.bins {
            let middle = 2 * before + counts.answers;
            let fifth = (5 * middle / (2 * total)).min(4);
            fifths[fifth] = fifths[fifth].merged(counts);
            before += counts.answers;
        }
        fifths
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_fall_into_fifths_by_their_sigma() {
        let mut counted = CoverageBySigma::default();
        for fifth in 0..5 {
            for i in 0..100 {
                // Beyond 95 % for one in ten, beyond 3 σ for one in twenty, in the last fifth alone.
                let off = if fifth == 4 && i % 10 == 0 { 2.5 + f64::from(i % 20) } else { 0.5 };
                let sigma = 0.01 * 4_f64.powi(fifth);
                counted.add(off * sigma, sigma);
            }
        }
        counted.add(1.0, f64::NAN);
        counted.add(f64::NAN, 1.0);
        let all = counted.all();
        assert_eq!((all.answers, all.inside95, all.within3), (500, 490, 495));
        let fifths = counted.fifths();
        assert!(fifths.iter().all(|f| f.answers == 100), "{fifths:?}");
        assert_eq!((fifths[4].inside95, fifths[4].within3, fifths[3].inside95), (90, 95, 100));
        let twice = counted.clone().merged(&counted);
        assert_eq!(twice.all().answers, 1000);
        assert_eq!(twice.fifths()[4].within3, 190);
    }
}
