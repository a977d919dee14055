//! Every method with every approach, estimator and kind of observation that makes sense.

use tempfile::TempDir;

use crate::outputs::{phi, trajectory};
use crate::process::{run, summary};
use crate::recording::{drive, recording};
use crate::table::motion;

/// Options of every combination of a method and an approach that has a meaning, with its estimators.
fn options(observe: &str, approach: &str) -> Vec<String> {
    let mut all = vec![format!("--method ml --approach {approach}")];
    let methods: &[&str] = if approach == "discrete" {
        &["dcce", "dv", "joint", "rigid", "linear22"]
    } else {
        &["dcce", "dv", "joint"]
    };
    for method in methods.iter().filter(|method| observe == "dense" || **method != "dcce") {
        for estimator in ["ls", "lmeds", "irls"] {
            all.push(format!("--method {method} --approach {approach} --estimator {estimator}"));
        }
    }
    all
}

/// Nothing is nearer than 1 m, so a third of the disparities will do.
const SETTINGS: &str = "[disparity]\nlevels = 48\n";

fn run_all(observe: &str, approach: &str) {
    let folder = TempDir::new().unwrap();
    let (settings, out) = (folder.path().join("settings.toml"), folder.path().join("out"));
    std::fs::write(&settings, SETTINGS).unwrap();
    for options in options(observe, approach) {
        let settings = format!("--config {} --observe {observe}", settings.display());
        run(recording(), &out, &format!("--frames 3 {settings} {options}"));
        let rows = motion(&out);
        assert_eq!((rows.len(), trajectory(&out).len()), (2, 3), "{options}");
        for (k, row) in rows.iter().enumerate() {
            assert_eq!((row.status(), row.text("observed")), ("ok", "111111"), "{options}");
            // What each method and estimator is worth is the study's question. Here: the right magnitude.
            let truth = drive().phi(k).unwrap().vector();
            let error = (phi(row).vector() - truth).fixed_rows::<3>(0).norm();
            assert!(error < 2.0 * truth.fixed_rows::<3>(0).norm(), "{options}: {error}");
            let variance = |i| row.number(&format!("cov_{i}{i}"));
            assert!((0..6).all(|i| variance(i) > 0.0 && variance(i).is_finite()), "{options}");
        }
        let config = &summary(&out)["config"];
        assert!(options.contains(config["method"].as_str().unwrap()), "{options}");
    }
}

#[test]
fn dense_discrete() {
    run_all("dense", "discrete");
}

#[test]
fn dense_differential() {
    run_all("dense", "differential");
}

#[test]
fn sparse_discrete() {
    run_all("sparse", "discrete");
}

#[test]
fn sparse_differential() {
    run_all("sparse", "differential");
}
