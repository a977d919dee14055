//! Section 5 as a study: formulas against draws, (51) to (53), and what a study must keep.

use std::collections::HashMap;

use egomotion_study::uncertainty::{FormulaKind, Inputs, UncertaintyError, UncertaintyRecord, VarianceCase};
use egomotion_study::{Cell, Content, Study, Table, Uncertainty};
use serde_json::Value;

/// A study small enough for a test.
fn small() -> Uncertainty {
    Uncertainty { draws: 20_000, settings: 2, size_px: (160, 120), ..Uncertainty::default() }
}

fn part(study: &Uncertainty, name: &str) -> Vec<UncertaintyRecord> {
    let index = study.parts().iter().position(|part| part == name).expect(name);
    study.run(index).unwrap()
}

fn cases(study: &Uncertainty, family: &str) -> Vec<VarianceCase> {
    let parts = ["A", "B", "C"].map(|s| part(study, &format!("{family}, sequence {s}")));
    let case = |record| if let UncertaintyRecord::Case(case) = record { Some(*case) } else { None };
    parts.into_iter().flatten().filter_map(case).collect()
}

fn column<'a>(table: &'a Table, name: &str) -> Vec<&'a Cell> {
    let index = table.columns.iter().position(|column| column.name == name).expect(name);
    table.rows.iter().map(|row| &row[index]).collect()
}

fn number(cell: &Cell) -> f64 {
    if let Cell::Number(value) = cell { *value } else { panic!("{cell:?} is no number") }
}

/// Corrected variances hold to first order up to σ_d/d = .02, and to second order everywhere.
#[test]
fn corrected_and_second_order_variances_are_those_of_the_draws() {
    let families = [
        "depth (32)",
        "gradient (35)",
        "DCCE differential (39)",
        "DV differential (44)",
        "DCCE discrete (47)",
        "DV discrete (50)",
        "rounding (52)",
    ];
    let study = Uncertainty { settings: 3, ..small() };
    for family in families {
        let (mut first, mut second) = (0, 0);
        for case in cases(&study, family).iter().filter(|case| case.place.is_some()) {
            let error = case.standard_error / case.predicted;
            if case.kind == FormulaKind::Corrected && case.relative() <= 0.02 {
                // 1/d² has 10 (σ_d/d)² of second order: .004.
                assert!((case.ratio() - 1.0).abs() < 0.006 + 5.0 * error, "{case:?} {}", case.ratio());
                first += 1;
            }
            if case.kind == FormulaKind::SecondOrder && case.relative() <= 0.06 {
                // The next order of 1/d² is about 200 (σ_d/d)⁴: .003.
                assert!((case.ratio() - 1.0).abs() < 0.003 + 5.0 * error, "{case:?} {}", case.ratio());
                second += 1;
            }
        }
        assert!(first >= 12 && (second >= 12 || family.starts_with("rounding")), "{family} {first} {second}");
    }
}

/// The printed formulas hold where their assumptions do; (47) with ½σ²_d misses for the estimator as it is.
#[test]
fn printed_variances_are_right_for_what_they_assume_only() {
    let study = Uncertainty { settings: 4, ..small() };
    let found = cases(&study, "DV discrete (50)");
    let assumed = found.iter().filter(|c| c.formula == "(49)" && c.inputs == Inputs::Independent);
    for case in assumed.filter(|c| c.kind == FormulaKind::Printed && c.relative() <= 0.02) {
        let error = case.standard_error / case.predicted;
        assert!((case.ratio() - 1.0).abs() < 0.006 + 5.0 * error, "{case:?}");
    }
    let found = cases(&study, "DCCE discrete (47)");
    let slow = |c: &&VarianceCase| c.place.is_some_and(|p| p.flow_px < 1.0 && p.relative <= 0.02);
    let halved: Vec<&VarianceCase> = found
        .iter()
        .filter(|c| c.formula.starts_with("(47) with") && c.kind == FormulaKind::Printed)
        .filter(slow)
        .collect();
    // 2 + ½|Δ|² where it says ½ (1 + |Δ|²).
    assert!(!halved.is_empty() && halved.iter().all(|c| c.ratio() > 2.0), "{halved:?}");
}

/// The product of gradient's and flow's noise: what first order misses, the corrected formula has.
#[test]
fn product_of_two_noises() {
    let study = Uncertainty { settings: 16, ..small() };
    let (mut missed, mut reached) = (0, 0);
    let found = cases(&study, "DCCE differential (39)");
    for pair in
        found.windows(2).filter(|pair| pair[0].kind == FormulaKind::FirstOrder && pair[0].relative() <= 0.02)
    {
        let (first, corrected, place) = (&pair[0], &pair[1], pair[0].place.unwrap());
        assert_eq!((corrected.kind, corrected.place), (FormulaKind::Corrected, first.place));
        let excess = corrected.predicted / first.predicted - 1.0;
        // Reached where disparity has no gradient g, so that flow's noise alone does nothing. The disparity
        // that Zx and Zy share adds 8 g²/d² of it: 2 % where g is .5 px/px at d = 10 px.
        let most = 2.0 * place.sigma_flow_px.powi(2) / (1.0 + place.flow_px.powi(2));
        assert!((0.0..=1.02 * most).contains(&excess), "{excess} {most}");
        let error = 5.0 * first.standard_error / first.predicted;
        missed += usize::from(first.ratio() - 1.0 > 0.006 + error);
        reached += usize::from(excess > 0.95 * most);
    }
    assert!(missed >= 3 && reached >= 3, "{missed} {reached}");
}

#[test]
fn the_table_under_51() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../egomotion/tests/data/vectors.json");
    let all: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let expected: HashMap<(u64, u64), f64> = all["resolution51_mm"]
        .as_array()
        .unwrap()
        .iter()
        .map(|case| {
            let get = |name: &str| case[name].as_f64().unwrap();
            (((16.0 * get("d")) as u64, (16.0 * get("step")) as u64), get("dZ_mm"))
        })
        .collect();
    let published = Uncertainty { size_px: (40, 30), ..small() }.publish(&[]);
    let table = published.tables.iter().find(|table| table.id == "table-51").unwrap();
    let [d, step, change] = ["disparity_px", "step_px", "change_mm"].map(|name| column(table, name));
    assert_eq!(d.len(), expected.len());
    for ((d, step), change) in d.into_iter().zip(step).zip(change) {
        let key = ((16.0 * number(d)) as u64, (16.0 * number(step)) as u64);
        assert!((number(change) / expected[&key] - 1.0).abs() < 1e-12, "{key:?}");
    }
}

/// Figure 6: every coefficient grows with depth, those of (a) about as Z⁴ and far above those of (b).
#[test]
fn coefficients_grow_with_depth() {
    let study = small();
    let published = study.publish(&part(&study, "coefficients of (53)"));
    let figure = published.figures.iter().find(|figure| figure.id == "figure-06").unwrap();
    let series = |panel: usize| {
        let Content::Plot { series, .. } = &figure.panels[panel].content else { panic!("a plot") };
        series.iter().map(|s| s.points.iter().map(|p| p.y).collect::<Vec<_>>()).collect::<Vec<_>>()
    };
    for (strong, weak) in [(0, 1), (2, 3)] {
        let (strong, weak) = (series(strong), series(weak));
        assert_eq!((strong.len(), weak.len()), (4, 3));
        for line in strong.iter().chain(&weak) {
            assert!(line.len() == 11 && line.windows(2).all(|pair| pair[0] < pair[1]), "{line:?}");
        }
        let least = strong.iter().map(|line| line[0]).fold(f64::MAX, f64::min);
        let most = weak.iter().map(|line| line[0]).fold(0.0, f64::max);
        assert!(least > 100.0 * most, "{least} {most}");
    }
    let growth = published.tables.iter().find(|table| table.id == "coefficients-growth").unwrap();
    for (name, power) in column(growth, "coefficient").into_iter().zip(column(growth, "power")) {
        // Coef2_vel is 2 (Z²/(b f))², and so Z⁴ at each point.
        if *name == Cell::from("Coef2_vel") {
            assert!((number(power) - 4.0).abs() < 0.05, "{power:?}");
        }
    }
}

/// (1 + |v|²)/4 for the differential forms, 1 + |Δ|²/4 for the discrete ones, in sequences of small gradients.
#[test]
fn dcce_is_the_better_one_below_root_three_pixels() {
    let study = small();
    for record in part(&study, "DCCE against DV, sequence A") {
        let UncertaintyRecord::Ratios(found) = record else { panic!("ratios") };
        assert!((found.differential_rule.median - 1.0).abs() < 0.01, "{found:?}");
        assert!((found.discrete_rule.median - 1.0).abs() < 0.05, "{found:?}");
        assert!(
            (found.differential_wins - found.slow).abs() < 0.01 && found.discrete_wins == 0.0,
            "{found:?}"
        );
    }
}

#[test]
fn the_same_findings_on_any_number_of_threads_and_after_a_file() {
    let study = Uncertainty { draws: 12_000, settings: 1, ..small() };
    for name in ["DCCE discrete (47), sequence B", "rounding (52), sequence A", "DCCE against DV, sequence C"]
    {
        let on = |n| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
            pool.install(|| part(&study, name))
        };
        let found = on(1);
        assert_eq!(found, on(3), "{name}");
        let text = serde_json::to_string(&found).unwrap();
        assert_eq!(serde_json::from_str::<Vec<UncertaintyRecord>>(&text).unwrap(), found, "{name}");
    }
    let other = Uncertainty { seed: 1, ..study.clone() };
    assert_ne!(part(&study, "depth (32), sequence A"), part(&other, "depth (32), sequence A"));
}

#[test]
fn what_cannot_be_studied_is_refused_and_what_is_missing_left_out() {
    let study = small();
    let bad = |study: Uncertainty| study.run(0).unwrap_err();
    assert_eq!(bad(Uncertainty { draws: 1, ..study.clone() }), UncertaintyError::Draws(1));
    assert_eq!(bad(Uncertainty { size_px: (2, 240), ..study.clone() }), UncertaintyError::Size(2, 240));
    assert_eq!(study.run(999).unwrap_err(), UncertaintyError::Part(999));
    let mut parts = study.parts();
    parts.sort();
    parts.dedup();
    assert_eq!(parts.len(), study.parts().len());
    // Whatever has run, every row has a cell for each column and every map a size.
    let tiny = Uncertainty { draws: 100, settings: 1, size_px: (40, 30), ..study };
    let some = tiny.run(0).unwrap();
    for records in [Vec::new(), some] {
        let published = tiny.publish(&records);
        for table in published.data.iter().chain(&published.tables) {
            assert!(table.rows.iter().all(|row| row.len() == table.columns.len()), "{}", table.id);
        }
        let ids: Vec<&str> = published.figures.iter().map(|figure| figure.id.as_str()).collect();
        assert!(["figure-03", "figure-04", "figure-05", "figure-06"].iter().all(|id| ids.contains(id)));
    }
}
