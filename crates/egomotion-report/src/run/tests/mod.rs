//! The page as a whole: nothing in the input can break it or make it load anything.

mod pictures;

use egomotion::estimate::{MotionEstimate, UndeterminedDirections};
use egomotion::geometry::{Gaussian, Image, PixelBounds, RigidMotion, StereoRig, Twist};
use egomotion::motion::{NoObstacle, Obstacle, TimeToImpact};
use egomotion::pipeline::MovingGroup;
use nalgebra::{Matrix6, Vector6};

use self::pictures::{album, dense};
use super::{Album, FramePictures, FrameRow, InputKind, Report, SceneSummary, render, render_index};

/// What a report refers to.
pub struct Run {
    pub rig: StereoRig,
    pub rows: Vec<FrameRow>,
    pub poses: Vec<RigidMotion>,
    pub pose_covariances: Vec<Matrix6<f64>>,
    pub truth: Option<Vec<RigidMotion>>,
}

/// φ with all components observed, each with the variance `variance`.
pub fn motion(phi: &Vector6<f64>, variance: f64) -> MotionEstimate {
    let theta = Gaussian { mean: *phi, cov: Matrix6::from_diagonal_element(variance) };
    let undetermined = UndeterminedDirections::default();
    MotionEstimate { theta, observed: [true; 6], undetermined, rows: 900, inliers: 800, residual_scale: 1.0 }
}

const BOUNDS: PixelBounds = PixelBounds { u: 8, v: 16, width: 24, height: 12 };

fn obstacle(looming: f64, variance: f64) -> Obstacle {
    let impact = TimeToImpact { looming: Gaussian::scalar(looming, variance) };
    Obstacle { impact, points: 200, bounds: BOUNDS }
}

/// Something three metres away that comes nearer.
fn group(looming: f64) -> MovingGroup {
    MovingGroup {
        pixels: 100,
        bounds: BOUNDS,
        centre_px: (20.0, 22.0),
        depth_m: 3.0,
        motion: None,
        depth_velocity: Gaussian::scalar(-0.2, 1e-4),
        impact: Some(TimeToImpact { looming: Gaussian::scalar(looming, 1e-3) }),
    }
}

impl Run {
    /// A first frame, and one more for each φ, 0.1 s apart.
    pub fn of(phis: &[Vector6<f64>]) -> Self {
        let row = |k: usize, phi: Option<&Vector6<f64>>| FrameRow {
            frame: k,
            time_s: 0.1 * k as f64,
            dt_s: phi.map(|_| 0.1),
            motion: phi.map(|phi| motion(phi, 1e-6)),
            truth: phi.map(Twist::from_vector),
            obstacle: phi.map(|_| obstacle(0.5, 1e-3)).ok_or(NoObstacle::NothingMeasured),
            moving: Vec::new(),
            status: if phi.is_some() { "ok" } else { "first" }.into(),
        };
        let phis: Vec<_> = std::iter::once(None).chain(phis.iter().map(Some)).collect();
        let poses = vec![RigidMotion::identity(); phis.len()];
        Self {
            rig: StereoRig::new(500.0, (31.5, 23.5), 0.1, (64, 48)).unwrap(),
            rows: phis.iter().enumerate().map(|(k, phi)| row(k, *phi)).collect(),
            pose_covariances: (0..phis.len()).map(|k| Matrix6::identity() * 1e-6 * k as f64).collect(),
            truth: Some(poses.clone()),
            poses,
        }
    }

    pub fn report<'a>(&'a self, album: &'a Album) -> Report<'a> {
        Report {
            title: "A run".into(),
            source: "somewhere".into(),
            command: "egomotion run somewhere".into(),
            settings_toml: "seed = 1".into(),
            rig: &self.rig,
            input: InputKind::Stereo,
            sparse: false,
            complete: true,
            frames: &self.rows,
            poses: &self.poses,
            pose_covariances: &self.pose_covariances,
            truth: self.truth.as_deref(),
            album,
            stages_ms: vec![("disparity", 12.0), ("flow", 30.0)],
            frame_ms: 45.0,
            biased: false,
            notes: Vec::new(),
        }
    }
}

fn steady(frames: usize) -> Run {
    Run::of(&vec![Vector6::new(0.001, 0.0, -0.05, 0.0, 0.002, 0.0); frames])
}

/// The values of all attributes of a page, which puts none in single quotes; the script is left out.
fn attributes(page: &str) -> impl Iterator<Item = (&str, &str)> {
    let markup = page.split("<script").next().unwrap_or_default();
    let inside_tags = markup.split('<').filter_map(|tag| tag.split_once('>').map(|(inside, _)| inside));
    inside_tags.flat_map(|inside| {
        let parts: Vec<&str> = inside.split('"').collect();
        (0..parts.len() / 2)
            .map(|i| (parts[2 * i].trim().trim_end_matches('='), parts[2 * i + 1]))
            .collect::<Vec<_>>()
    })
}

fn assert_sound(page: &str) {
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>"));
    for (name, value) in attributes(page) {
        let numeric = !matches!(name, "content" | "aria-label" | "alt" | "src") && !name.contains("class");
        if numeric && !value.starts_with("data:") {
            assert!(!value.contains("NaN") && !value.contains("inf"), "{name}={value}");
        }
    }
    if let Some((_, data)) = page.split_once("id=\"data\">") {
        let json = data.split("</script>").next().unwrap();
        assert!(serde_json::from_str::<serde_json::Value>(json).unwrap()["series"].is_object());
    }
}

#[test]
fn every_text_of_the_input_is_escaped() {
    let evil = "</pre><script>alert('x')</script><img src=http://x.invalid/ \"onload=\"y\">";
    let mut run = steady(2);
    run.rows[1].status = evil.into();
    run.rows[1].motion = None;
    let album = Album::of(3);
    let report = Report {
        title: evil.into(),
        source: evil.into(),
        command: evil.into(),
        settings_toml: evil.into(),
        notes: vec![evil.into()],
        stages_ms: vec![("<b>", 1.0)],
        ..run.report(&album)
    };
    let page = render(&report);
    assert!(!page.contains("<script>alert") && !page.contains("<img src=http") && !page.contains("<b></th>"));
    // Title twice, then source, status twice, command, settings, note.
    assert_eq!(page.matches("&lt;script&gt;alert").count(), 8);
    let scene = SceneSummary {
        name: evil.into(),
        frames: 2,
        outcome: evil.into(),
        verdict: evil.into(),
        has_page: true,
    };
    let index = render_index(evil, evil, false, &[scene]);
    assert!(!index.contains("<script>alert") && !index.contains("<img src=http"));
}

#[test]
fn a_method_that_does_not_hold_is_said_before_its_numbers() {
    let run = steady(3);
    let album = Album::of(3);
    let page = render(&Report { biased: true, notes: vec!["The cause.".into()], ..run.report(&album) });
    assert_sound(&page);
    let wrong = page.find("These numbers are wrong").unwrap();
    assert!(wrong < page.find("the camera <b>travelled").unwrap());
    assert!(page.contains("href=\"#warnings\"") && page.contains("id=\"warnings\""));
    assert!(!render(&run.report(&album)).contains("These numbers are wrong"));
}

#[test]
fn the_page_loads_nothing() {
    let run = steady(3);
    let page = render(&run.report(&album(3, (64, 48))));
    assert_sound(&page);
    assert!(!page.contains("http://") && !page.contains("https://") && !page.contains("@import"));
    let sources: Vec<_> =
        attributes(&page).filter(|(name, _)| matches!(*name, "src" | "href" | "xlink:href")).collect();
    assert_eq!(sources.len(), 3 * 7);
    assert!(sources.iter().all(|(_, value)| value.starts_with("data:image/")));
    assert!(page.match_indices("url(").all(|(at, _)| page[at..].starts_with("url(#")));
    assert!(page.contains("default-src 'none'"));
}

#[test]
fn no_number_that_is_not_finite_reaches_a_drawing() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e308, -1e308, 0.0] {
        let mut run = steady(6);
        for (k, row) in run.rows.iter_mut().enumerate() {
            if k % 2 == 1 {
                row.motion = Some(motion(&Vector6::repeat(bad), bad));
                row.truth = Some(Twist::from_vector(&Vector6::repeat(bad)));
                row.obstacle = Ok(obstacle(bad, bad));
                row.moving = vec![group(bad)];
            }
        }
        run.rows[4].time_s = bad;
        run.rows[5].dt_s = Some(bad);
        run.poses[3].translation.fill(bad);
        run.poses[4].rotation.fill(bad);
        run.truth.as_mut().unwrap()[2].translation.fill(bad);
        let mut album = Album::of(7);
        let maps = dense(32, 8, |u, _| if u % 2 == 0 { bad as f32 } else { 1.0 });
        album.offer(|| FramePictures::new(2, 3, &Image::filled(32, 8, bad as f32), &maps, bad, 32));
        let report =
            Report { stages_ms: vec![("flow", bad), ("maps", 1.0)], frame_ms: bad, ..run.report(&album) };
        assert_sound(&render(&report));
    }
}

#[test]
fn nothing_one_frame_two_and_no_answer_at_all_have_a_page() {
    let none = Run { rows: Vec::new(), poses: Vec::new(), truth: None, ..steady(0) };
    let mut silent = steady(4);
    for row in &mut silent.rows {
        (row.motion, row.truth, row.obstacle, row.status) =
            (None, None, Err(NoObstacle::NothingMeasured), "few_rows".into());
    }
    for (run, slider) in [(none, false), (steady(0), false), (silent, true)] {
        let page = render(&run.report(&Album::of(0)));
        assert_sound(&page);
        assert!(page.contains("The path from above") && page.contains("Nothing in the way approached"));
        assert!(page.contains("No motion could be estimated") && page.contains("There are no pictures"));
        assert_eq!(page.contains("type=\"range\""), slider);
    }
    // One pair has its pictures, and a slider would have nowhere to go.
    let page = render(&steady(1).report(&album(1, (64, 48))));
    assert_sound(&page);
    assert!(page.matches("<img").count() == 7 && !page.contains("type=\"range\""));
}

#[test]
fn a_frame_without_answer_is_a_gap_in_every_curve() {
    let curves = |run: &Run| {
        let page = render(&run.report(&Album::of(9)));
        let lines = attributes(&page).filter(|(name, d)| *name == "d" && d.starts_with('M'));
        let broken =
            lines.filter(|(_, d)| d.matches('M').count() == 2 && d.matches('L').count() >= 4).count();
        (broken, page)
    };
    let mut run = steady(9);
    assert_eq!(curves(&run).0, 0);
    run.rows[5].motion = None;
    run.rows[5].obstacle = Err(NoObstacle::NothingMeasured);
    run.rows[5].status = "bad_image".into();
    let (broken, page) = curves(&run);
    // Of velocity, φ and its error each six curves and bands; time to impact; measurements kept and all. And the
    // band of the height ends where the gap begins to matter, in one piece.
    assert_eq!(broken, 3 * 12 + 1 + 2);
    assert!(
        page.contains(
            "1 interval gave no motion: an image is missing, damaged or without contrast (frame 5)."
        )
    );
}

#[test]
fn the_page_says_why_there_is_no_obstacle() {
    let album = Album::of(9);
    let mut run = steady(9);
    assert!(!render(&run.report(&album)).contains("No obstacle in"));
    for (k, why) in
        [(2, NoObstacle::NothingCrosses), (4, NoObstacle::OnlyScattered), (5, NoObstacle::NothingCrosses)]
    {
        run.rows[k].obstacle = Err(why);
    }
    let page = render(&run.report(&album));
    let sentence = "No obstacle in 3 of 9 intervals: c – nothing that approaches crosses the vehicle's window (2); \
                    d – only scattered points cross the vehicle's window (1).";
    assert!(page.contains(sentence), "{page}");
}

#[test]
fn the_summary_is_that_of_the_run() {
    let album = Album::of(6);
    let mut run = steady(5);
    let page = render(&run.report(&album));
    // 50 mm every tenth of a second.
    assert!(page.contains("<b>0.500\u{a0}m/s</b>"), "{page}");
    assert!(
        page.contains("all six components of the motion were determined in every one of the 5 intervals")
    );
    assert!(page.contains("100 % of 30 true values"));
    // σ is 1 mm: 1.9 mm lie within 2σ, 2.1 mm do not.
    for (row, error) in run.rows.iter_mut().skip(1).zip([0.0019, 0.0021]) {
        row.truth.as_mut().unwrap().t.x += error;
    }
    assert!(render(&run.report(&album)).contains("96.7 % of 30 true values"));
    run.rows[3].motion.as_mut().unwrap().observed[1] = false;
    let page = render(&Report { complete: false, ..run.report(&album) });
    assert!(page.contains("In 1 interval part of the motion cannot be known"));
    assert!(page.contains("4 of 5") && page.contains("The run was stopped before its end"));
}

#[test]
fn what_moves_is_outlined_and_described() {
    let mut run = steady(3);
    run.rows[2].moving = vec![group(2.0), group(0.5)];
    let page = render(&run.report(&album(3, (64, 48))));
    let outlined = page.split("<g data-k=\"1\"").nth(1).unwrap().split("</g>").next().unwrap();
    assert_eq!(outlined.matches("class=\"moving\"").count(), 2);
    assert!(outlined.contains("<text x=\"8\"") && outlined.contains(">2</text>"), "{outlined}");
    // VZ is −0.2 m in 0.1 s with σ 10 mm; the band is two of them on each side.
    assert!(page.contains("3.00 m away, VZ −2.00 ± 0.20 m/s, reached in 0.500 s"), "{page}");
}
