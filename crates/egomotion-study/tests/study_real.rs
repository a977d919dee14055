//! Section 7.2 in small: one draw through the whole image pipeline, its records, tables and figures.

use egomotion::pipeline::{Approach, Method};
use egomotion_study::real::{ImageContender, ImageEstimator, LabStudy, Quantity, RealRecord};
use egomotion_study::{Cell, Content, Study};

fn tiny(sequence: &str) -> LabStudy {
    LabStudy {
        sequences: vec![sequence.to_owned()],
        seeds: 1,
        poses: 0,
        sample_step_px: 4,
        ..LabStudy::default()
    }
}

fn phi(records: &[RealRecord], contender: ImageContender) -> Vec<&RealRecord> {
    let known = |record: &&RealRecord| {
        record.contender == Some(contender) && Quantity::PHI.contains(&record.quantity)
    };
    records.iter().filter(known).collect()
}

#[test]
fn one_draw_is_answered_by_every_way_and_best_within_its_own_intervals() {
    let study = tiny("lab-G");
    assert_eq!(study.parts(), ["lab-G seed 1"]);
    let records = study.run(0).unwrap();
    for estimator in [ImageEstimator::Ls, ImageEstimator::Lmeds] {
        for approach in [Approach::Differential, Approach::Discrete] {
            for method in [Method::Dcce, Method::Dv] {
                assert_eq!(phi(&records, ImageContender::new(approach, method, estimator)).len(), 6);
            }
        }
        for method in [Method::Linear22, Method::Rigid] {
            assert_eq!(phi(&records, ImageContender::new(Approach::Discrete, method, estimator)).len(), 6);
        }
    }
    let best = phi(&records, ImageContender::BEST);
    assert_eq!(best.len(), 6);
    for record in best {
        let off = (record.estimate - record.truth.unwrap()).abs() / record.sigma.unwrap();
        assert!(off < 4.0, "{} is off by {off} σ", record.quantity.name());
    }
    // Rendered images are good enough to be input.
    for quantity in [Quantity::Disparity, Quantity::Flow] {
        let median = records.iter().find(|record| record.quantity == quantity).unwrap();
        assert!(median.estimate < 0.1 && median.n > 30_000, "{median:?}");
    }
    // VZ of all five contenders, where it can be measured and anywhere; the rigid one is the closest.
    let vz: Vec<&RealRecord> = records.iter().filter(|record| record.quantity == Quantity::Vz).collect();
    assert_eq!(vz.len(), 5);
    let error = |record: &RealRecord| record.erm_abs.unwrap();
    let (best, others): (Vec<&RealRecord>, Vec<&RealRecord>) =
        vz.iter().partition(|r| r.contender == Some(ImageContender::BEST));
    assert!(others.iter().all(|other| error(best[0]) < 0.2 * error(other)));
    assert!(vz.iter().all(|record| (record.truth.unwrap() + 10.0).abs() < 1e-9));
}

#[test]
fn records_do_not_depend_on_the_number_of_threads() {
    let study = LabStudy { poses: 1, width_px: 160, height_px: 120, ..tiny("lab-M") };
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| study.run(0).unwrap())
    };
    let (one, three) = (on(1), on(3));
    assert_eq!(one, three);
    let poses: std::collections::BTreeSet<i64> = one.iter().map(|record| record.pose).collect();
    assert_eq!(poses.into_iter().collect::<Vec<_>>(), [-1, 0, 1]);
    // Another seed is another texture and another noise.
    let other = LabStudy { first_seed: 2, ..study }.run(0).unwrap();
    assert!(one.iter().zip(&other).all(|(a, b)| a.quantity != Quantity::Vz || a.estimate != b.estimate));
}

#[test]
fn the_publication_has_the_papers_tables_and_figures() {
    let study = LabStudy {
        sequences: vec!["lab-B".into(), "lab-I".into()],
        width_px: 160,
        height_px: 120,
        ..tiny("lab-B")
    };
    let mut records = study.run(0).unwrap();
    records.extend(study.run(1).unwrap());
    assert!(study.run(2).unwrap().is_empty());
    let publication = study.publish(&records);
    for table in publication.data.iter().chain(&publication.tables) {
        assert!(table.rows.iter().all(|row| row.len() == table.columns.len()), "{}", table.id);
    }
    let table = |id: &str| publication.tables.iter().find(|table| table.id == id).unwrap();
    let first = |id: &str| -> Vec<Cell> { table(id).rows.iter().map(|row| row[0].clone()).collect() };
    // Paper; here and here anywhere, with the medians of both.
    assert_eq!(
        first("table-03"),
        [["B"; 5], ["I"; 5]].concat().into_iter().map(Cell::from).collect::<Vec<_>>()
    );
    // Exact, two of the paper's, four of ours and the best.
    assert_eq!(first("table-04"), vec![Cell::from("B"); 8]);
    assert_eq!(first("table-05"), vec![Cell::from("I"); 8]);
    assert_eq!(table("table-07").rows.len(), 2 * (2 + 8 + 1));
    let paper = &table("table-06").rows[5];
    assert_eq!(paper[1..4], [Cell::from("paper"), Cell::from(43.513), Cell::from(43.034)]);
    assert_eq!(paper[5..8], [Cell::from(40.0), Cell::from(8.78), Cell::from(7.58)]);
    // −VZ for E to M, as printed.
    for row in [6, 7] {
        let Cell::Number(estimated) = table("table-06").rows[row][3] else { panic!("no estimate by DV") };
        assert!((30.0..50.0).contains(&estimated), "{estimated}");
    }

    let ids: Vec<&str> = publication.figures.iter().map(|figure| figure.id.as_str()).collect();
    assert_eq!(
        ids,
        ["figure-11", "figure-12", "figure-13", "figure-13-medians", "figure-14", "figure-14-medians"]
    );
    let panels: Vec<usize> = publication.figures.iter().map(|figure| figure.panels.len()).collect();
    assert_eq!(panels, [3, 4, 6, 6, 6, 6]);
    // The paper's marks stand for all its sequences, our lines for those that were run.
    let Content::Plot { series, .. } = &publication.figures[1].panels[0].content else { panic!("no plot") };
    let points: Vec<usize> = series.iter().map(|series| series.points.len()).collect();
    assert_eq!(points, [1, 1, 1, 1, 1, 5, 5, 5, 5]);
    // Every figure says of itself what noise its methods met and how their equations were solved.
    for figure in &publication.figures[1..] {
        for words in ["sensor's noise", "1/16 px", "ML"] {
            assert!(figure.caption.contains(words), "{}: {}", figure.id, figure.caption);
        }
    }
    // What is left of an interrupted study can be shown too.
    assert_eq!(study.publish(&[]).figures.len(), 6);
}

#[test]
fn what_cannot_be_run_is_refused_in_words() {
    let error = tiny("lab-K").run(0).unwrap_err();
    assert_eq!(error.to_string(), "no sequence lab-K of 320x240 pixels");
    assert!(LabStudy { width_px: 0, ..tiny("lab-A") }.run(0).is_err());
}
