//! The linear methods answer every pair of the rendered worlds, or name what is undetermined; and where an answer is wrong,
//! they say so. The full table: `egomotion study reliability`, kept in docs/uncertainty.md.

use egomotion_study::reliability::ReliabilityRecord;
use egomotion_study::{Reliability, Study};

/// An answered component further than this many σ from the truth is wrong.
const WRONG_SIGMAS: f64 = 8.0;
/// A pair whose every component lies within this many σ has no bias that a warning should speak of.
const UNBIASED_SIGMAS: f64 = 2.0;

fn records() -> Vec<ReliabilityRecord> {
    let sequences = ["C", "demo", "drive", "lab-A", "lab-E", "lab-J"].map(str::to_owned).to_vec();
    let study = Reliability { sequences, pairs: 2, ..Reliability::default() };
    (0..study.parts().len()).flat_map(|part| study.run(part).unwrap()).collect()
}

fn worst(record: &ReliabilityRecord) -> f64 {
    record.sigmas.iter().flatten().fold(0.0, |worst, sigmas| worst.max(sigmas.abs()))
}

#[test]
fn no_answer_is_wrong_without_a_warning() {
    let records = records();
    // Six sequences, two pairs, exact and matched disparity, 18 ways.
    assert_eq!(records.len(), 6 * 2 * 2 * 18);
    for record in &records {
        let answered = record.refused.is_none();
        let named = record.refused.as_ref().is_some_and(|why| why.contains("observable"));
        assert!(answered || named, "{record:?}");
        assert!(record.warning.is_some() || worst(record) <= WRONG_SIGMAS, "{record:?}");
        let open = record.sigmas.iter().any(Option::is_none);
        assert!(!answered || open != record.undetermined.is_empty(), "{record:?}");
    }
    let answered = records.iter().filter(|record| record.refused.is_none()).count();
    assert!(answered as f64 > 0.95 * records.len() as f64, "{answered} of {}", records.len());
    let unbiased: Vec<_> = records.iter().filter(|record| worst(record) < UNBIASED_SIGMAS).collect();
    let warned = unbiased.iter().filter(|record| record.warning.is_some()).count();
    assert!(unbiased.len() > 100 && (warned as f64) <= 0.05 * unbiased.len() as f64, "{warned}");
}
