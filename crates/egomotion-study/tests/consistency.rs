//! The study that judges the stated uncertainty: what it gives does not depend on threads, and has its columns.

use egomotion::pipeline::Observe;
use egomotion_study::consistency::{ConsistencyRecord, DepthKind, RenderedSensor};
use egomotion_study::{Consistency, Study};
use nalgebra::{SMatrix, SVector};

fn small() -> Consistency {
    Consistency { sequences: vec!["C".into(), "lab-E".into()], pairs: 2, ..Consistency::default() }
}

#[test]
fn pairs_are_the_same_on_any_number_of_threads_and_each_its_own() {
    let study = small();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| study.run(0).unwrap())
    };
    let records = with(1);
    assert!(records == with(3));
    assert_eq!(records.len(), 2);
    assert_ne!(records[0].error, records[1].error);
    for record in &records {
        assert!(record.error.is_some() && record.answered > 0.9, "{}", record.answered);
        assert!(record.depth_velocity.all().answers > 60_000 && record.looming.all().answers > 60_000);
    }
    let other = Consistency { seed: 2, ..small() };
    assert_ne!(other.run(0).unwrap()[0].error, records[0].error);
}

#[test]
fn every_sequence_has_a_row_and_all_have_one() {
    let study = Consistency { observe: Observe::Sparse, ..small() };
    let records: Vec<_> = (0..study.parts().len()).flat_map(|part| study.run(part).unwrap()).collect();
    let publication = study.publish(&records);
    let names: Vec<String> = publication.data[0].rows.iter().map(|row| format!("{:?}", row[0])).collect();
    assert_eq!(names, ["Text(\"C\")", "Text(\"lab-E\")", "Text(\"all\")"]);
    assert!(publication.data[0].rows.iter().all(|row| row.len() == publication.data[0].columns.len()));
    assert_eq!(publication.data[1].rows.len(), 4);
    let unknown = Consistency { sequences: vec!["Q".into()], ..study };
    assert!(unknown.run(0).is_err());
}

/// eᵀ Σ⁻¹ e / 6 of a pair.
fn nees_over_6(record: &ConsistencyRecord) -> f64 {
    let error = SVector::<f64, 6>::from(record.error.unwrap());
    let cov = SMatrix::<f64, 6, 6>::from_column_slice(&record.cov);
    error.dot(&cov.cholesky().unwrap().solve(&error)) / 6.0
}

#[test]
fn depth_cameras_with_rolling_shutters_know_how_wrong_they_are() {
    for kind in [DepthKind::Kinect, DepthKind::TimeOfFlight, DepthKind::Rendered] {
        let sequences = vec!["lab-E".into()];
        let study = Consistency {
            sequences,
            pairs: 8,
            sensor: RenderedSensor::Depth(kind),
            ..Consistency::default()
        };
        let records: Vec<_> = (0..study.parts().len()).flat_map(|part| study.run(part).unwrap()).collect();
        let nees = records.iter().map(nees_over_6).sum::<f64>() / records.len() as f64;
        let turned = |r: &ConsistencyRecord| r.error.unwrap()[3..].iter().map(|e| e * e).sum::<f64>();
        let rms = (records.iter().map(turned).sum::<f64>() / records.len() as f64).sqrt().to_degrees();
        println!("{kind:?}: NEES/6 {nees:.2}, {rms:.4} degrees");
        // χ² exceeds twice its 48 degrees of freedom in one of 20,000 draws.
        assert!(records.len() == 8 && nees < 2.0, "{kind:?}: {nees}");
        // Before the image's rows and depth were told apart a camera with this noise erred by .04°.
        assert!(rms < 0.005, "{kind:?}: {rms}");
    }
}

/// A camera with 30 ms of read-out that pans, rises and comes nearer at constant velocity, by far more than it accelerates.
///
/// While only acceleration was modelled, NEES/6 of these pairs was 3.3, and ΩZ and tY were off by 1.2 and 2.1 σ on average.
#[test]
fn a_rolling_shutter_at_constant_velocity_is_no_bias() {
    let study = Consistency {
        sequences: vec!["C".into()],
        pairs: 8,
        sensor: RenderedSensor::Depth(DepthKind::TimeOfFlight),
        ..Consistency::default()
    };
    let records = study.run(0).unwrap();
    let nees = records.iter().map(nees_over_6).sum::<f64>() / records.len() as f64;
    // χ² exceeds twice its 48 degrees of freedom in one of 20,000 draws.
    assert!(records.len() == 8 && nees < 2.0, "{nees}");
    for i in 0..6 {
        let in_sigmas = |r: &ConsistencyRecord| r.error.unwrap()[i] / r.cov[7 * i].sqrt();
        let mean = records.iter().map(in_sigmas).sum::<f64>() / records.len() as f64;
        // Four standard errors of a mean of eight.
        assert!(mean.abs() < 4.0 / 8.0_f64.sqrt(), "component {i} is off by {mean} σ");
    }
}
