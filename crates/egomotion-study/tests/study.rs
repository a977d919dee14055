//! The sensitivity study against statistics that others measured, and against what must hold exactly.

use egomotion::pipeline::Approach;
use egomotion::sim::Sequence;
use egomotion_study::sensitivity::{ErrorStatistics, QuantityErrors, Setting};
use egomotion_study::synthetic::MeasurementModel;
use egomotion_study::{OneSetting, Sensitivity, Study};

const BOTH: [Approach; 2] = [Approach::Differential, Approach::Discrete];

fn errors(sequence: &str, step: f64, model: MeasurementModel, draws: usize) -> Vec<QuantityErrors> {
    let sequence = Sequence::named(sequence, None, Some(2), 1.0).unwrap();
    Setting { sequence: &sequence, step, model, seed: 7 }.errors(0..draws, &BOTH)
}

fn statistics(errors: &[QuantityErrors], contender: [&str; 3], quantity: &str) -> Option<ErrorStatistics> {
    let is = |s: &&QuantityErrors| s.contender() == contender && s.quantity == quantity;
    errors.iter().find(is)?.tally.statistics()
}

const QUANTITIES: [&str; 8] = ["vz", "vz_phi", "tx", "ty", "tz", "wx", "wy", "wz"];
const NONE: f64 = f64::NAN;

/// Table of an independent implementation, 400 draws: errors in % of the truth, in mm or degrees where it is 0.
type Row = ([&'static str; 3], [f64; 8]);
const YARDSTICK_C: [Row; 8] = [
    (["differential", "dcce", "ls"], [449.0, 31.1, 12.2, 31.2, 24.7, 237.0, 190.0, 0.014]),
    (["differential", "dv", "ls"], [350.0, 1.70, 5.3, 7.4, 0.72, 16.1, 11.1, 0.011]),
    (["discrete", "dcce", "ls"], [536.0, 27.9, 16.1, 27.1, 19.4, 232.0, 190.0, 0.030]),
    (["discrete", "dv", "ls"], [348.0, 10.8, 30.7, 48.9, 5.4, 106.0, 65.0, 0.059]),
    (["discrete", "linear22", "ls"], [NONE, 55.6, 8.2, 8.6, 53.8, 133.0, 60.0, 0.018]),
    (["discrete", "rigid", "ls"], [NONE, 10.0, 16.9, 10.5, 9.9, 11.3, 19.3, 0.010]),
    (["discrete", "ml", "ml"], [NONE, 0.55, 0.370, 0.380, 0.552, 0.670, 0.676, 0.0014]),
    (["differential", "ml", "ml"], [NONE, 0.12, 0.052, 0.049, 0.064, 0.088, 0.088, 0.0002]),
];
const YARDSTICK_A: [Row; 7] = [
    (["differential", "dcce", "ls"], [582.0, 36.4, 0.182, 1.06, 34.9, 0.014, 0.003, 0.002]),
    (["differential", "dv", "ls"], [1123.0, 5.3, 0.50, 0.72, 2.1, 0.016, 0.011, 0.010]),
    (["discrete", "dcce", "ls"], [1142.0, 38.8, 1.19, 1.12, 37.4, 0.017, 0.016, 0.025]),
    (["discrete", "dv", "ls"], [1133.0, 38.3, 3.3, 5.3, 17.6, 0.117, 0.069, 0.062]),
    (["discrete", "linear22", "ls"], [NONE, 165.0, 0.84, 0.82, 154.0, 0.126, 0.056, 0.018]),
    (["discrete", "rigid", "ls"], [NONE, 30.6, 1.66, 1.14, 29.3, 0.012, 0.019, 0.010]),
    (["discrete", "ml", "ml"], [NONE, 1.55, 0.042, 0.038, 1.56, 0.001, 0.001, 0.001]),
];

/// Half a unit of the last digit that a yardstick is printed with.
fn printed_to(value: f64) -> f64 {
    let decimals = (0..4).find(|&d| (value * 10f64.powi(d)).fract().abs() < 1e-9).unwrap_or(4);
    0.5 * 10f64.powi(-decimals)
}

fn agrees(ours: &[QuantityErrors], yardstick: &[Row]) {
    let mut apart = Vec::new();
    for (contender, values) in yardstick {
        for (quantity, &theirs) in QUANTITIES.iter().zip(values).filter(|(_, v)| !v.is_nan()) {
            let found = statistics(ours, *contender, quantity).unwrap();
            let (mine, own) = (found.mean_error(), found.standard_error.unwrap());
            let error = own.hypot(0.04 * theirs) + printed_to(theirs);
            if (mine - theirs).abs() > 3.0 * error {
                apart.push(format!("{contender:?} {quantity}: {mine} ± {own}, theirs {theirs}"));
            }
        }
    }
    assert!(apart.is_empty(), "{}", apart.join("\n"));
}

#[test]
fn sequence_c_agrees_with_an_independent_implementation_and_maximum_likelihood_is_at_the_bound() {
    let found = errors("C", 1.0, MeasurementModel::real(), 20);
    agrees(&found, &YARDSTICK_C);
    for approach in ["differential", "discrete"] {
        for quantity in &QUANTITIES[1..] {
            let ml = statistics(&found, [approach, "ml", "ml"], quantity).unwrap();
            let bound = statistics(&found, [approach, "bound", "bound"], quantity).unwrap();
            let ratio = ml.mean_error() / bound.mean_error();
            let sigma = ml.standard_error.unwrap() / bound.mean_error();
            assert!((ratio - 1.0).abs() < 4.0 * sigma, "{approach} {quantity}: {ratio} ± {sigma}");
        }
    }
}

#[test]
fn sequence_a_agrees_with_an_independent_implementation() {
    agrees(&errors("A", 1.0, MeasurementModel::real(), 10), &YARDSTICK_A);
}

#[test]
fn without_noise_binocular_flow_is_exact_and_the_depth_change_is_linearised() {
    for (sequence, step) in [("A", 1.0), ("B", 4.0), ("C", 8.0)] {
        let found = errors(sequence, step, MeasurementModel::clean(), 1);
        for approach in ["differential", "discrete"] {
            let dv = statistics(&found, [approach, "dv", "ls"], "vz").unwrap();
            assert!(dv.erm_abs.unwrap() < 1e-7, "{sequence} {step} {approach} {dv:?}");
        }
    }
    let error = |step: f64| {
        let found = errors("C", step, MeasurementModel::clean(), 1);
        statistics(&found, ["discrete", "dcce", "ls"], "vz").unwrap().erm_abs.unwrap()
    };
    let (slow, fast) = (error(1.0), error(16.0));
    assert!(fast > 4.0 * slow && fast > 10.0, "{slow} {fast}");
}

#[test]
fn the_same_numbers_on_any_number_of_threads_and_in_any_parts() {
    let study = OneSetting {
        sequence: "B".to_owned(),
        step: 2.0,
        model: MeasurementModel { features: 300, ..MeasurementModel::real() },
        draws: 3,
        seed: 3,
    };
    let on = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| study.run(0).unwrap())
    };
    assert_eq!(on(1), on(3));
    assert_ne!(on(1), OneSetting { seed: 4, ..study }.run(0).unwrap());
}

#[test]
fn every_part_has_a_name_of_its_own_and_every_setting_a_part() {
    let parts = Sensitivity::default().parts();
    assert_eq!(parts.len(), 3 * 2 * (6 + 5 + 5 + 5 + 5 + 4));
    let unique: std::collections::BTreeSet<_> = parts.iter().collect();
    assert_eq!(unique.len(), parts.len());
}

#[test]
fn noise_above_the_signal_leaves_fewer_answers_and_no_crash() {
    for (noise_px, features) in [(1.0, 8), (20.0, 9), (1000.0, 64)] {
        let model = MeasurementModel {
            std_disp_px: noise_px,
            std_vel_px: noise_px,
            std_track_px: noise_px,
            features,
            ..MeasurementModel::real()
        };
        model.check().unwrap();
        let found = errors("A", 1.0, model, 5);
        // The paper's VZ of a pixel needs no φ, and so it is there whatever the noise.
        assert!(statistics(&found, ["discrete", "dv", "ls"], "vz").is_some(), "{noise_px} px");
        let bad = |s: &&QuantityErrors| s.tally.statistics().is_some_and(|f| f.eam.is_nan());
        assert_eq!(found.iter().find(bad), None, "{noise_px} px");
    }
}

#[test]
fn settings_without_a_meaning_are_named() {
    let refused = |study: OneSetting| study.check().unwrap_err().to_string();
    let own = OneSetting::default();
    assert_eq!(own.check(), Ok(()));
    let unknown = refused(OneSetting { sequence: "Z".to_owned(), ..own.clone() });
    assert!(unknown.starts_with("sequence is Z; give one of A, B, C, "), "{unknown}");
    assert_eq!(
        refused(OneSetting { step: -1.0, ..own.clone() }),
        "step is -1.0; give 0.000001 to 1000000000"
    );
    assert_eq!(refused(OneSetting { draws: 0, ..own.clone() }), "draws is 0; give 1 to 100000000");
    let with = |model| refused(OneSetting { model, ..own.clone() });
    let real = MeasurementModel::real();
    assert_eq!(with(MeasurementModel { features: 3, ..real }), "features is 3; give 8 to 100000000");
    assert_eq!(with(MeasurementModel { round: Some(0), ..real }), "round is 0; give 1 to 4096");
    assert_eq!(with(MeasurementModel { std_vel_px: f64::NAN, ..real }), "std_vel_px is NaN; give 0 to 1000");
}
