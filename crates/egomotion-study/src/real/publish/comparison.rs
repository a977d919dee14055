//! Least squares against least median of squares (6.2), and whether stated uncertainties are true.

use super::RealResults;
use super::tables::contenders;
use crate::real::contender::{ImageContender, ImageEstimator};
use crate::real::quantity::Quantity;
use crate::synthetic::APPROACHES;
use crate::{Cell, Table};

/// Mean absolute error of LMedS over that of LS, and of maximum likelihood over the best of all others.
pub(super) fn estimators(results: &RealResults<'_>) -> Table {
    let mut table = Table::new(
        "real-estimators",
        "Section 6.2: least median of squares against least squares",
        "Mean absolute error with LMedS over that with LS, the geometric mean over the sequences: below 1 LMedS is the \
         better one. Last row: maximum likelihood over the best of all the others in each sequence.",
        &columns(&[("approach", "approach"), ("method", "method")]),
    );
    let eam = |name: &str, contender, quantity| {
        results.get(name, Some(contender), quantity)?.eam.map(|eam| eam.mean)
    };
    let all: Vec<ImageContender> =
        APPROACHES.into_iter().flat_map(contenders).filter(|w| *w != ImageContender::BEST).collect();
    for ls in all.iter().filter(|contender| contender.estimator == ImageEstimator::Ls) {
        let lmeds = ImageContender { estimator: ImageEstimator::Lmeds, ..*ls };
        let ratio = |quantity| {
            geometric_mean(
                results
                    .sequences()
                    .into_iter()
                    .filter_map(|name| Some(eam(name, lmeds, quantity)? / eam(name, *ls, quantity)?)),
            )
        };
        let [approach, method, _] = ls.names();
        table.rows.push(row([approach, method], Quantity::PHI.map(ratio)));
    }
    let best = |quantity| {
        geometric_mean(results.sequences().into_iter().filter_map(|name| {
            let others = all.iter().filter_map(|contender| eam(name, *contender, quantity));
            Some(eam(name, ImageContender::BEST, quantity)? / others.min_by(f64::total_cmp)?)
        }))
    };
    table.rows.push(row(["discrete", "ml / best of the others"], Quantity::PHI.map(best)));
    table
}

/// Root mean square of error over stated standard deviation: 1 where the uncertainty is true.
pub(super) fn consistency(results: &RealResults<'_>) -> Table {
    let mut table = Table::new(
        "real-consistency",
        "Whether the stated uncertainty of φ is true",
        "Root mean square over all draws of the error of φ in units of its stated standard deviation: 1 where it is true, \
         more where bias or wrong matches are not accounted for; the poses of a recording have errors of their own, which count too.",
        &columns(&[("approach", "approach"), ("method", "method"), ("estimator", "estimator")]),
    );
    let mut all: Vec<ImageContender> = APPROACHES.into_iter().flat_map(contenders).collect();
    all.dedup();
    all.sort_by_key(|contender| usize::from(*contender == ImageContender::BEST));
    all.dedup();
    for contender in all {
        let normalised = |quantity: Quantity| {
            let chosen =
                results.records.iter().filter(|r| r.contender == Some(contender) && r.quantity == quantity);
            let squares: Vec<f64> =
                chosen.filter_map(|r| Some(((r.estimate - r.truth?) / r.sigma?).powi(2))).collect();
            (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
        };
        table.rows.push(row(contender.names(), Quantity::PHI.map(normalised)));
    }
    table
}

fn columns(first: &[(&'static str, &'static str)]) -> Vec<(&'static str, &'static str)> {
    let component = |quantity: Quantity| {
        let symbol = quantity.symbol();
        (quantity.name(), symbol)
    };
    first.iter().copied().chain(Quantity::PHI.map(component)).collect()
}

fn row<const N: usize>(names: [&str; N], values: [Option<f64>; 6]) -> Vec<Cell> {
    names.map(Cell::from).into_iter().chain(values.map(Cell::from)).collect()
}

fn geometric_mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let logs: Vec<f64> = values.filter(|value| *value > 0.0).map(f64::ln).collect();
    (!logs.is_empty()).then(|| (logs.iter().sum::<f64>() / logs.len() as f64).exp())
}
