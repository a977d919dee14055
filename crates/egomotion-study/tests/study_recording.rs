//! Section 7.2 on a recording: the paper's tables and figures with true poses, and what is left of them without.

use std::collections::BTreeMap;

use egomotion::geometry::StereoRig;
use egomotion::sim::{SensorNoise, Sequence};
use egomotion_study::real::{
    DrawId, MatchingSettings, Quantity, RealRecord, ShownFrames, Triple, publish_recording,
};
use egomotion_study::{Cell, Content, Publication};

const SETTINGS: MatchingSettings = MatchingSettings { levels: 16, sample_step_px: 4, seed: 1 };

/// Three frames of a rendered sequence, as those of the recording "walk" around frame `pose`.
fn triple(sequence: &str, pose: i64) -> (StereoRig, Triple) {
    let sequence = Sequence::named(sequence, Some((160, 120)), Some(3), 1.0).unwrap();
    let frames =
        [0, 1, 2].map(|k| SensorNoise::default().expose(&sequence.view(k).unwrap().render(2), k as u64));
    let motion = Some([0, 1].map(|k| sequence.phi(k).unwrap()));
    (sequence.rig, Triple { frames, motion, draw: DrawId { sequence: "walk".into(), pose, seed: 1 } })
}

fn published(triples: &[(StereoRig, Triple)]) -> (Vec<RealRecord>, Publication) {
    let records: Vec<RealRecord> =
        triples.iter().flat_map(|(rig, triple)| triple.records(rig, &SETTINGS).unwrap()).collect();
    let (rig, triple) = &triples[0];
    let shown = ShownFrames { frames: &triple.frames, rig, settings: &SETTINGS };
    let publication = publish_recording("walk", &records, Some(shown));
    for table in publication.data.iter().chain(&publication.tables) {
        assert!(table.rows.iter().all(|row| row.len() == table.columns.len()), "{}", table.id);
    }
    (records, publication)
}

fn figures(publication: &Publication) -> BTreeMap<&str, usize> {
    publication.figures.iter().map(|figure| (figure.id.as_str(), figure.panels.len())).collect()
}

/// The cells of a table in rows, the first two of each as words.
fn rows<'a>(publication: &'a Publication, id: &str) -> Vec<(String, &'a [Cell])> {
    let table = publication.tables.iter().find(|table| table.id == id).unwrap();
    let words = |row: &[Cell]| match row {
        [Cell::Text(a), Cell::Text(b), ..] => format!("{a}: {b}"),
        _ => panic!("{row:?}"),
    };
    table.rows.iter().map(|row| (words(row), &row[2..])).collect()
}

#[test]
fn a_recording_with_true_poses_has_the_papers_tables_and_figures() {
    let (records, publication) = published(&[triple("lab-G", 1), triple("lab-D", 2)]);
    let share = |pose| {
        let found = records.iter().find(|r| r.quantity == Quantity::TurnShare && r.pose == pose).unwrap();
        (found.estimate, found.truth)
    };
    // G goes ahead by 10 mm; D turns about the middle between the cameras, which moves the left one a little.
    assert_eq!(share(1), (0.0, None));
    assert!((0.8..1.0).contains(&share(2).0), "{:?}", share(2));

    let ids: Vec<&str> = publication.tables.iter().map(|table| table.id.as_str()).collect();
    assert_eq!(ids[..6], ["recording", "table-03", "table-04", "table-05", "table-06", "table-07"]);
    let labels = |id: &str| rows(&publication, id).into_iter().map(|(label, _)| label).collect::<Vec<_>>();
    let both = ["walk", "walk, turning"]
        .map(|name| ["here, anywhere", "here, anywhere, median"].map(|row| format!("{name}: {row}")))
        .concat();
    assert_eq!((labels("table-03"), labels("table-06")), (both.clone(), both));
    let motion = ["true, mean", "DCCE, LS", "DCCE, LMedS", "DV, LS", "DV, LMedS", "ML"];
    assert_eq!(labels("table-04"), motion.map(|row| format!("walk, turning: {row}")));
    assert_eq!(labels("table-05"), motion.map(|row| format!("walk: {row}")));
    assert_eq!(labels("table-07").len(), 2 * (1 + 8 + 1));
    let [exact, ..] = &rows(&publication, "table-05")[..] else { panic!("no rows") };
    let Cell::Number(tz) = exact.1[2] else { panic!("{exact:?}") };
    assert!((tz + 10.0).abs() < 1e-9, "{tz}");
    // −VZ of the still scene is 10 mm everywhere, and maximum likelihood finds it.
    let vz = &rows(&publication, "table-06")[0].1;
    let [Cell::Number(ml), Cell::Number(truth)] = vz[2..4] else { panic!("{vz:?}") };
    assert!((truth - 10.0).abs() < 1e-4 && (ml - 10.0).abs() < 0.5, "{ml} {truth}");

    let expected = [
        ("figure-11", 3),
        ("figure-12", 4),
        ("figure-13", 6),
        ("figure-13-medians", 6),
        ("figure-14", 6),
        ("figure-14-medians", 6),
        ("recording-frames", 2),
    ];
    assert_eq!(figures(&publication), BTreeMap::from(expected));
    // Of two frames there is one group of speed, with a point for each method.
    for panel in &publication.figures[1].panels {
        let Content::Plot { series, .. } = &panel.content else { panic!("no plot") };
        let points: Vec<usize> = series.iter().map(|series| series.points.len()).collect();
        assert_eq!(points, [1; 5], "{}", panel.title);
    }
}

#[test]
fn without_true_poses_estimates_are_published_and_the_lack_is_said() {
    let (rig, known) = triple("lab-G", 1);
    let (records, publication) = published(&[(rig, Triple { motion: None, ..known })]);
    assert!(records.iter().all(|record| record.truth.is_none() && record.eam.is_none()));
    // They go through the journal, where a number that is none would be lost.
    let written = serde_json::to_string(&records).unwrap();
    assert_eq!(serde_json::from_str::<Vec<RealRecord>>(&written).unwrap(), records);

    let overview = &publication.tables[0];
    assert!(overview.caption.contains("has no true poses") && overview.caption.contains("Figures 12 to 14"));
    assert_eq!(overview.rows[0][1..3], [Cell::Count(1), Cell::Count(0)]);
    assert_eq!(figures(&publication), BTreeMap::from([("figure-11", 3), ("recording-frames", 2)]));
    // Nothing that compares errors.
    let ids: Vec<&str> = publication.tables.iter().map(|table| table.id.as_str()).collect();
    assert_eq!(ids, ["recording", "table-03", "table-04", "table-05", "table-06", "table-07"]);
    let mean = &rows(&publication, "table-03")[0].1;
    let (estimates, errors) = mean.split_at(3);
    assert!(estimates.iter().all(|cell| matches!(cell, Cell::Number(_))), "{mean:?}");
    assert!(errors.iter().all(|cell| *cell == Cell::Empty), "{mean:?}");
    let motion: Vec<String> = rows(&publication, "table-05").into_iter().map(|(label, _)| label).collect();
    assert_eq!(
        motion,
        ["DCCE, LS", "DCCE, LMedS", "DV, LS", "DV, LMedS", "ML"].map(|row| format!("walk: {row}"))
    );
}
