//! The page as a whole: nothing in the input can break it or make it load anything.

use egomotion::estimate::{MotionEstimate, Undetermined};
use egomotion::geometry::{Field, Gaussian, Grid, Image, RigidMotion, StereoRig, Twist};
use egomotion::motion::{NoObstacle, TimeToImpact};
use egomotion::observe::{DisparityMap, FlowField};
use egomotion::pipeline::maps::MotionMaps;
use egomotion::pipeline::stereo::DenseResults;
use nalgebra::{Matrix6, Vector6};

use super::{Album, FramePictures, FrameRow, MOST_PICTURES, Report, render};

/// What a report refers to.
pub struct Run {
    pub rig: StereoRig,
    pub rows: Vec<FrameRow>,
    pub poses: Vec<RigidMotion>,
    pub truth: Option<Vec<RigidMotion>>,
    pub pictures: Vec<FramePictures>,
}

/// φ with all components observed, each with the variance `variance`.
pub fn motion(phi: &Vector6<f64>, variance: f64) -> MotionEstimate {
    let theta = Gaussian { mean: *phi, cov: Matrix6::from_diagonal_element(variance) };
    let undetermined = Undetermined::default();
    MotionEstimate { theta, observed: [true; 6], undetermined, rows: 900, inliers: 800, residual_scale: 1.0 }
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
            impact: phi
                .map(|_| TimeToImpact { looming: Gaussian::scalar(0.5, 1e-3) })
                .ok_or(NoObstacle::NothingMeasured),
            status: if phi.is_some() { "ok" } else { "first" }.into(),
        };
        let phis: Vec<_> = std::iter::once(None).chain(phis.iter().map(Some)).collect();
        let poses = vec![RigidMotion::identity(); phis.len()];
        Self {
            rig: StereoRig::new(500.0, (31.5, 23.5), 0.1, (64, 48)).unwrap(),
            rows: phis.iter().enumerate().map(|(k, phi)| row(k, *phi)).collect(),
            truth: Some(poses.clone()),
            poses,
            pictures: Vec::new(),
        }
    }

    pub fn report(&self) -> Report<'_> {
        Report {
            title: "A run".into(),
            source: "somewhere".into(),
            command: "egomotion run somewhere".into(),
            settings_toml: "seed = 1".into(),
            rig: &self.rig,
            frames: &self.rows,
            poses: &self.poses,
            truth: self.truth.as_deref(),
            pictures: &self.pictures,
            stages_ms: vec![("disparity", 12.0), ("flow", 30.0)],
            frame_ms: 45.0,
            notes: Vec::new(),
        }
    }
}

fn steady(frames: usize) -> Run {
    Run::of(&vec![Vector6::new(0.001, 0.0, -0.05, 0.0, 0.002, 0.0); frames])
}

/// Maps of any values, some missing.
fn dense(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> DenseResults {
    let plane = Grid::from_fn(width, height, &value);
    let field = || Field::from_grid(plane.clone());
    let (u, v) = (field(), field());
    let flow = FlowField { u, v, cov_uu: plane.clone(), cov_uv: plane.clone(), cov_vv: plane.clone() };
    DenseResults {
        disparity: DisparityMap { shift: field(), sigma: field() },
        flow,
        motion: MotionMaps {
            depth_velocity: field(),
            depth_velocity_sigma: field(),
            looming: field(),
            looming_sigma: field(),
        },
    }
}

/// A value for every pixel that looks like noise.
fn noise(u: usize, v: usize) -> f32 {
    ((u * 7919 + v * 104_729 + u * v * 31) % 251) as f32
}

fn noisy_pictures(frame: usize, width: usize, height: usize) -> FramePictures {
    FramePictures::new(frame, &Image::from_fn(width, height, noise), &dense(width, height, noise))
}

/// The values of all attributes of a page, which puts none in single quotes.
fn attributes(page: &str) -> impl Iterator<Item = (&str, &str)> {
    let inside_tags = page.split('<').filter_map(|tag| tag.split_once('>').map(|(inside, _)| inside));
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
        let numeric = !matches!(name, "content" | "aria-label" | "alt" | "src") && !name.starts_with("class");
        if numeric && !value.starts_with("data:") {
            assert!(!value.contains("NaN") && !value.contains("inf"), "{name}={value}");
        }
    }
}

#[test]
fn every_text_of_the_input_is_escaped() {
    let evil = "</pre><script>alert('x')</script><img src=http://x.invalid/ \"onload=\"y\">";
    let mut run = steady(2);
    run.rows[1].status = evil.into();
    let report = Report {
        title: evil.into(),
        source: evil.into(),
        command: evil.into(),
        settings_toml: evil.into(),
        notes: vec![evil.into()],
        stages_ms: vec![("<b>", 1.0)],
        ..run.report()
    };
    let page = render(&report);
    assert!(!page.contains("<script>alert") && !page.contains("<img src=http") && !page.contains("<b></th>"));
    // Title twice, then source, status, command, settings, note.
    assert_eq!(page.matches("&lt;script&gt;alert").count(), 7);
}

#[test]
fn the_page_loads_nothing() {
    let mut run = steady(3);
    run.pictures = (0..3).map(|k| noisy_pictures(k, 64, 48)).collect();
    let page = render(&run.report());
    assert_sound(&page);
    assert!(!page.contains("http://") && !page.contains("https://") && !page.contains("@import"));
    let sources: Vec<_> =
        attributes(&page).filter(|(name, _)| matches!(*name, "src" | "href" | "xlink:href")).collect();
    assert_eq!(sources.len(), 3 * 5);
    assert!(sources.iter().all(|(_, value)| value.starts_with("data:image/png;base64,")));
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
                row.impact = Ok(TimeToImpact { looming: Gaussian::scalar(bad, bad) });
            }
        }
        run.rows[4].time_s = bad;
        run.rows[5].dt_s = Some(bad);
        run.poses[3].translation.fill(bad);
        run.poses[4].rotation.fill(bad);
        run.truth.as_mut().unwrap()[2].translation.fill(bad);
        run.pictures = vec![FramePictures::new(
            2,
            &Image::filled(32, 8, bad as f32),
            &dense(32, 8, |u, _| if u % 2 == 0 { bad as f32 } else { 1.0 }),
        )];
        let report = Report { stages_ms: vec![("flow", bad), ("maps", 1.0)], frame_ms: bad, ..run.report() };
        assert_sound(&render(&report));
    }
}

#[test]
fn nothing_one_frame_and_no_answer_at_all_have_a_page() {
    let none = Run { rows: Vec::new(), poses: Vec::new(), truth: None, ..steady(0) };
    let one = steady(0);
    let mut silent = steady(4);
    for row in &mut silent.rows {
        (row.motion, row.truth, row.impact, row.status) =
            (None, None, Err(NoObstacle::NothingMeasured), "few_rows".into());
    }
    for run in [none, one, silent] {
        let page = render(&run.report());
        assert_sound(&page);
        assert!(page.contains("Path from above") && page.contains("Nothing in the way approached"));
        // Without pictures there is neither a slider nor a script to move it.
        assert!(!page.contains("type=\"range\"") && !page.contains("<script"));
    }
}

#[test]
fn a_frame_without_answer_is_a_gap_in_every_curve() {
    let curves = |run: &Run| {
        let page = render(&run.report());
        let lines = attributes(&page).filter(|(_, d)| d.starts_with('M')).map(|(_, d)| d.to_owned());
        let broken = lines.filter(|d| d.matches('M').count() == 2 && d.matches('L').count() >= 4);
        broken.count()
    };
    let mut run = steady(9);
    assert_eq!(curves(&run), 0);
    run.rows[5].motion = None;
    run.rows[5].impact = Err(NoObstacle::NothingMeasured);
    run.rows[5].status = "bad_image".into();
    // Six estimates, six errors, twelve bands around them, and time to impact.
    assert_eq!(curves(&run), 25);
    assert!(render(&run.report()).contains("1 without an answer"));
}

#[test]
fn the_page_says_why_there_is_no_obstacle() {
    let mut run = steady(9);
    assert!(!render(&run.report()).contains("No obstacle in"));
    for (k, why) in
        [(2, NoObstacle::NothingCrosses), (4, NoObstacle::OnlyScattered), (5, NoObstacle::NothingCrosses)]
    {
        run.rows[k].impact = Err(why);
    }
    let page = render(&run.report());
    let sentence = "No obstacle in 3 of 9 intervals: nothing that approaches crosses the vehicle's window (2); \
                    only scattered points cross the vehicle's window (1).";
    assert!(page.contains(sentence), "{page}");
}

#[test]
fn the_headline_tells_whether_sigma_is_true() {
    let mut run = steady(5);
    assert!(render(&run.report()).contains("30 of 30 components"));
    // σ is 1 mm: 1.9 mm lie within 2σ, 2.1 mm do not.
    for (row, error) in run.rows.iter_mut().skip(1).zip([0.0019, 0.0021]) {
        row.truth.as_mut().unwrap().t.x += error;
    }
    assert!(render(&run.report()).contains("29 of 30 components"));
}

#[test]
fn the_page_stays_small() {
    let long = render(&steady(5000).report());
    assert!(long.len() < 3_000_000, "{}", long.len());
    // Pure noise cannot be compressed: one byte a pixel and map, 4/3 of it in base64.
    let mut run = steady(2);
    run.pictures = vec![noisy_pictures(0, 1300, 1000), noisy_pictures(1, 1300, 1000)];
    assert_eq!(run.pictures[0].size(), (480, 370));
    let page = render(&run.report());
    assert!(page.len() < 2 * (5 * 480 * 370 * 4 / 3 + 5000) + 60_000, "{}", page.len());
}

#[test]
fn too_many_pictures_are_thinned_and_it_says_so() {
    let mut run = steady(100);
    run.pictures = (0..100).map(|k| noisy_pictures(k, 8, 4)).collect();
    let page = render(&run.report());
    assert_eq!(page.matches("data:image/png").count(), 34 * 5);
    assert!(page.contains("Pictures are shown of 34 frames"));
    let mut album = Album::default();
    let mut made = 0;
    for k in 0..1000 {
        album.offer(|| {
            made += 1;
            noisy_pictures(k, 8, 4)
        });
    }
    let frames: Vec<usize> = album.pictures().iter().map(|p| p.frame).collect();
    assert_eq!(frames, (0..1000).step_by(32).collect::<Vec<_>>());
    assert!(frames.len() <= MOST_PICTURES && made < 200, "{made}");
}

#[test]
fn a_map_comes_out_in_the_colours_of_its_bar() {
    let disparity = |u: usize, _| if u == 3 { f32::NAN } else { 10.0 * u as f32 };
    let pictures = FramePictures::new(0, &Image::filled(5, 1, 128.0), &dense(5, 1, disparity));
    let (low, high) = pictures.range(1).unwrap();
    // The 2nd and 98th percentile of 0, 10, 20, 40, interpolated.
    assert!((low - 0.6).abs() < 1e-9 && (high - 38.8).abs() < 1e-9, "{low} {high}");
    // Twice the range: the picture uses the lower half of the colours.
    let content = pictures.map_png(1, (0.0, 80.0)).unwrap();
    let mut decoder = png::Decoder::new(std::io::Cursor::new(content));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    let pixel = |u: usize| &pixels[4 * u..4 * u + 4];
    let near = |u: usize, share: f64| {
        let expected = crate::chart::colour::VIRIDIS.at(share);
        pixel(u).iter().zip(expected).all(|(a, b)| a.abs_diff(b) < 8) && pixel(u)[3] == 255
    };
    assert!(near(0, 0.0) && near(2, 0.25) && near(4, 0.5), "{pixels:?}");
    assert_eq!(pixel(3)[3], 0);
}
