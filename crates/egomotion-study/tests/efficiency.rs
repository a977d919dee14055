//! Maximum likelihood against the Cramér–Rao bound, and the study that shows it.
//!
//! Variances, biases and NEES are differences from an efficient estimate on the same draws, with standard errors
//! from the draws themselves; bounds are those that the method must keep, widened by four of these.

use egomotion::pipeline::{Approach, Method};
use egomotion::sim::Sequence;
use egomotion_study::efficiency::{
    ContenderErrors, EfficiencyStatistics, Ends, Factors, OutlierKind, PosePoints, SCENES,
};
use egomotion_study::synthetic::Contender;
use egomotion_study::{Cell, Efficiency, Study};

const COMPONENTS: [&str; 6] = ["tx", "ty", "tz", "wx", "wy", "wz"];

const FACTORS: Factors = Factors {
    noise_px: 0.125,
    ends: Ends::Both,
    points: 512,
    outliers: 0.0,
    outlier_kind: OutlierKind::Uniform,
};

fn poses(sequence: &str) -> Vec<PosePoints> {
    PosePoints::of(&Sequence::named(sequence, None, Some(2), 1.0).unwrap())
}

/// Maximum likelihood in both approaches.
fn errors(poses: &[PosePoints], factors: &Factors, draws: usize) -> Vec<ContenderErrors> {
    let all = [Approach::Differential, Approach::Discrete].into_iter().flat_map(Contender::all);
    let contenders: Vec<Contender> = all.filter(|contender| contender.method == Method::Ml).collect();
    assert_eq!(contenders.len(), 2);
    factors.errors(poses, &contenders, draws, 5)
}

/// Of each component, with its name.
fn statistics(errors: &ContenderErrors) -> impl Iterator<Item = (String, EfficiencyStatistics)> + '_ {
    let who = errors.contender.approach;
    (0..6).map(move |i| (format!("{who:?} {}", COMPONENTS[i]), errors.tally.statistics(i).unwrap()))
}

#[test]
fn maximum_likelihood_reaches_the_bound() {
    let poses = poses("C");
    for factors in [
        FACTORS,
        Factors { points: 128, ..FACTORS },
        Factors { noise_px: 0.5, ..FACTORS },
        Factors { noise_px: 0.5, ends: Ends::Later, ..FACTORS },
    ] {
        for one in errors(&poses, &factors, 100) {
            assert_eq!(one.tally.refused, 0);
            let nees_error = one.tally.nees_standard_error();
            for (name, f) in statistics(&one) {
                let error = 4.0 * f.standard_error;
                println!("{factors:?} {name}: {f:?} ± {nees_error}");
                // What is found must mean something: the errors of a variance of its own draws would be 14 %.
                assert!(error < 0.15, "{name} {f:?}");
                assert!(
                    f.variance_over_bound < 1.15 + error && f.variance_over_bound > 1.0 - error,
                    "{name} {f:?}"
                );
                // The bias is that of the difference from the efficient estimate, whose variance is at most .15.
                let bias_error = 4.0 * (0.15f64 / 100.0).sqrt();
                assert!(f.bias_over_sigma.abs() < 0.10 + bias_error, "{name} {f:?}");
                assert!((f.nees_over_6 - 1.0).abs() < 0.05 + 4.0 * nees_error, "{name} {f:?} ± {nees_error}");
                let share_error = 4.0 * (0.95f64 * 0.05 / 100.0).sqrt();
                assert!((f.coverage_95 - 0.95).abs() < share_error, "{name} {f:?}");
            }
        }
    }
}

#[test]
fn outliers_cost_little_even_if_they_agree() {
    let poses = poses("C");
    let draws = 60;
    for outlier_kind in [OutlierKind::Uniform, OutlierKind::Coherent] {
        let with = |outliers| Factors { outliers, outlier_kind, points: 1024, ..FACTORS };
        for one in errors(&poses, &with(0.2), draws) {
            for (name, f) in statistics(&one) {
                println!("20 % {outlier_kind:?} {name}: {f:?}");
                let (bound, error) = (f.variance_over_bound, 4.0 * f.standard_error);
                assert!(bound < 1.15 + error, "{outlier_kind:?} {name} {f:?}");
            }
        }
        let draws = 4 * draws;
        for one in errors(&poses, &with(0.4), draws) {
            for (name, f) in statistics(&one) {
                println!("40 % {outlier_kind:?} {name}: {f:?}");
                let error = 4.0 * (0.99f64 * 0.01 / draws as f64).sqrt();
                assert!(f.within_3_sigma > 0.99 - error, "{outlier_kind:?} {name} {f:?}");
                // One draw captured by the body, a hundred σ off, would make it forty.
                assert!(f.variance_over_bound < 1.5, "{outlier_kind:?} {name} {f:?}");
            }
        }
    }
}

fn small() -> Efficiency {
    Efficiency { sequences: vec!["lab-E".into()], methods: vec![Method::Ml, Method::Dv], draws: 3, seed: 2 }
}

#[test]
fn the_study_does_not_depend_on_threads() {
    let study = small();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| study.run(0).unwrap())
    };
    assert!(with(1) == with(3));
}

#[test]
fn the_study_has_its_columns() {
    let study = small();
    let parts = study.parts();
    // One sequence and eight scenes.
    assert_eq!(parts.len(), 9);
    let mut records = study.run(0).unwrap();
    records.extend(study.run(1).unwrap());
    let publication = study.publish(&records);
    let table = &publication.data[0];
    let names: Vec<&str> = table.columns.iter().map(|column| column.name.as_str()).collect();
    let expected = "sequence,noise_px,points,outliers,approach,method,estimator,component,variance_over_bound,bias_over_sigma,nees_over_6,coverage_95,draws";
    assert_eq!(table.id, "efficiency");
    assert_eq!(names.join(","), expected);
    // Four noises and three other numbers of points; DV by three estimators and ML, in two approaches.
    assert!(table.rows.len() >= 7 * 2 * 4 * 6);
    assert!(table.rows.iter().all(|row| row.len() == names.len() && row[12] == Cell::Count(3)));
    assert!(publication.figures.len() >= 2);
    assert!(study.run(parts.len()).unwrap().is_empty());
    let unknown = Efficiency { sequences: vec!["Q".into()], ..study };
    assert!(unknown.run(0).is_err());
}

#[test]
fn what_cannot_be_observed_is_said() {
    let ml: Vec<Contender> = [Approach::Differential, Approach::Discrete]
        .into_iter()
        .flat_map(Contender::all)
        .filter(|contender| contender.method == Method::Ml)
        .collect();
    let scene = |name: &str| SCENES.iter().find(|scene| scene.name == name).unwrap().observed(&ml, 10, 3);
    // Points in depth and in the image determine everything, on a single plane too.
    for name in ["three planes", "one plane", "a single depth", "pure rotation"] {
        for report in scene(name) {
            assert_eq!((report.answered, report.observed), (10, [10; 6]), "{name}");
        }
    }
    for report in scene("two points") {
        assert_eq!(report.answered, 0);
    }
}
