//! A pipeline that goes on from what another one kept, after every frame and to the same bits.

use egomotion::geometry::{Grid, Image, StereoRig};
use egomotion::pipeline::StageTimes;
use egomotion::pipeline::{
    Config, Frame, FrameMotion, Observe, StereoFrame, StereoMotion, TrackMotion, TrackPoint, Unanswered,
};
use egomotion::sim::{SensorNoise, Sequence};

const FRAMES: usize = 9;

fn sequence() -> Sequence {
    Sequence::named("demo", Some((320, 240)), Some(FRAMES), 1.0).unwrap()
}

/// The frames of a drive: one cannot be used, three give no answer, one is repeated.
fn frames(sequence: &Sequence) -> Vec<Frame> {
    let frame = |k: usize| {
        let shown = if k >= 7 { 4 } else { k };
        let images = SensorNoise::default()
            .with_seed(7)
            .expose(&sequence.view(shown).unwrap().render(2), shown as u64);
        let left = match k {
            2 => Image::filled(320, 240, 90.0),
            // Noise: good images that have nothing in common with the others.
            4..7 => Grid::from_fn(320, 240, |u, v| ((u * 7919 + v * 104_729) * (k + 3) % 251) as f32),
            _ => images.left,
        };
        StereoFrame { time_s: sequence.interval_s * k as f64, left, right: images.right }.into()
    };
    (0..FRAMES).map(frame).collect()
}

/// All that an answer says, to the last bit, without the time it took.
fn words(answer: FrameMotion) -> String {
    format!("{:?}", FrameMotion { stages: StageTimes::default(), ..answer })
}

#[test]
fn images_go_on_to_the_same_bits() {
    let sequence = sequence();
    let frames = frames(&sequence);
    for observe in [Observe::Sparse, Observe::Dense] {
        let mut mask = Grid::filled(320, 240, false);
        (0..40).for_each(|u| mask.set(u, 200, true));
        let begin = || {
            let mut motion =
                StereoMotion::new(sequence.rig, Config { observe, ..Config::default() }).unwrap();
            motion.set_mask(Some(mask.clone()));
            motion
        };
        let mut whole = begin();
        let (mut answers, mut memories) = (Vec::new(), Vec::new());
        for frame in &frames {
            memories.push(serde_json::to_string(&whole.memory()).unwrap());
            answers.push(words(whole.push(frame.clone())));
        }
        let statuses: Vec<bool> = answers.iter().map(|words| words.contains("Ok(Estimate")).collect();
        assert!(statuses[1] && statuses[3] && statuses[7], "{observe:?} {statuses:?}");
        assert!([2, 4, 5, 6, 8].iter().all(|&k| !statuses[k]), "{observe:?} {statuses:?}");
        for (start, memory) in memories.iter().enumerate() {
            let mut rest = begin();
            let memory = serde_json::from_str(memory).unwrap();
            rest.recall(memory, |k| Ok(frames[k].clone())).unwrap();
            for (k, frame) in frames.iter().enumerate().skip(start) {
                assert!(
                    words(rest.push(frame.clone())) == answers[k],
                    "{observe:?} from {start}: {k} differs"
                );
            }
        }
    }
}

#[test]
fn a_reference_that_is_lost_leaves_the_pipeline_as_it_was() {
    let sequence = sequence();
    let frames = frames(&sequence);
    let begin =
        || StereoMotion::new(sequence.rig, Config { observe: Observe::Sparse, ..Config::default() }).unwrap();
    let mut whole = begin();
    whole.push(frames[0].clone());
    let memory = whole.memory();
    assert_eq!(memory.reference_frame(), Some(0));
    let mut other = begin();
    let lost = other.recall(memory.clone(), |_| Err(Unanswered::MissingRight));
    assert_eq!(lost.unwrap_err(), Unanswered::MissingRight);
    let black = Frame { left: Image::filled(320, 240, 0.0), ..frames[0].clone() };
    assert!(matches!(other.recall(memory, |_| Ok(black.clone())), Err(Unanswered::BadImage(_))));
    assert_eq!(other.reference(), None);
    assert_eq!(other.push(frames[0].clone()).motion.unwrap_err(), Unanswered::First);
}

#[test]
fn tracks_go_on_to_the_same_bits() {
    let rig = StereoRig::new(700.0, (600.0, 180.0), 0.5, (1200, 360)).unwrap();
    // Points of a wall that comes nearer; places are rounded, as a tracker's are.
    let points = |k: usize| -> Vec<TrackPoint> {
        let shown = if k == 4 { 3 } else { k };
        let z = 20.0 - 0.5 * shown as f64;
        let place = |track: u64| ((track % 12) as f64 - 5.5, (track / 12) as f64 - 4.5);
        let point = |track| {
            let (x, y) = place(track);
            let depth = z + (track % 7) as f64;
            let round = |c: f64| (4.0 * c).round() / 4.0;
            let (u, v) = (round(600.0 + 700.0 * x / depth), round(180.0 + 700.0 * y / depth));
            TrackPoint { track, left: (u, v), right: (u - round(350.0 / depth), v) }
        };
        if k == 2 { Vec::new() } else { (0..120).map(point).collect() }
    };
    let mut whole = TrackMotion::new(rig, Config::default()).unwrap();
    let (mut answers, mut memories) = (Vec::new(), Vec::new());
    for k in 0..FRAMES {
        memories.push(serde_json::to_string(&whole.memory()).unwrap());
        answers.push(words(whole.push(0.1 * k as f64, &points(k))));
    }
    let answered = answers.iter().filter(|words| words.contains("Ok(Estimate")).count();
    assert!((3..FRAMES).contains(&answered), "{answers:#?}");
    for (start, memory) in memories.iter().enumerate() {
        let mut rest = TrackMotion::new(rig, Config::default()).unwrap();
        rest.recall(serde_json::from_str(memory).unwrap());
        for (k, answer) in answers.iter().enumerate().skip(start) {
            assert!(words(rest.push(0.1 * k as f64, &points(k))) == *answer, "from {start}: {k} differs");
        }
    }
}
