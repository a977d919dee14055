//! `egomotion demo`: a robot's drive, rendered with exact truth, estimated and judged.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use egomotion::estimate::RigPrior;
use egomotion::geometry::RigCamera;
use egomotion::metrics;
use egomotion::pipeline::DenseResults;
use egomotion::pipeline::{Config, StereoFrame, Unanswered};
use egomotion::sim::{SensorNoise, Sequence, StereoImages};
use egomotion_io::recording::{FrameInput, SourceFrame};
use egomotion_report::run::InputKind;

use crate::args::DemoArgs;
use crate::exit::Ending;
use crate::process::set_threads;
use crate::results::verdict::MapErrors;
use crate::results::{ResultFolder, RunDescription, Summary, Viewpoint, status, write_motion, write_report};
use crate::session::{FrameResult, Outcome, Session};
use crate::terminal::{self, frames_bar, stop_signal};

/// Rays along each side of a pixel that shows an edge: more make edges smoother and rendering slower.
const RAYS_PER_SIDE: usize = 3;
/// Seed of the cameras' noise; any other makes another demo of the same kind.
const NOISE_SEED: u64 = 2003;
/// Pixels between two that maps are judged at, in both directions: errors of neighbours are alike.
const JUDGED_STEP_PX: usize = 4;

/// Render, run, judge.
pub fn demo(args: &DemoArgs) -> Result<Ending> {
    set_threads(args.threads)?;
    // The rig that is rendered is exactly the stated one.
    let config = Config { rig_errors: RigPrior::exact(), ..Config::default() };
    let out: PathBuf = args.out.clone().unwrap_or_else(|| Path::new("egomotion-out").join("demo"));
    let folder = ResultFolder::create(&out)?;
    let sequence = Sequence::named("demo", None, None, 1.0).context("the demo's scene is missing")?;
    let noise = SensorNoise::default().with_seed(NOISE_SEED);
    let stop = stop_signal("frame");
    let session = Session {
        rig: sequence.rig,
        config: &config,
        frames: sequence.frames(),
        masks: [None, None],
        tracks: false,
        progress: frames_bar(sequence.frames(), args.quiet),
    };
    let mut stdout = terminal::stdout();
    writeln!(
        stdout,
        "A robot drives {} frames through a rendered room; φ is the motion of the scene",
        sequence.frames()
    )?;
    writeln!(stdout, "seen from its left camera, estimate ± σ (truth), in mm and degrees a frame:")?;
    writeln!(stdout, "{}", heading())?;
    let mut errors = DemoErrors::default();
    let outcome = session.run(
        None,
        &stop,
        |k| (k < sequence.frames()).then(|| render(&sequence, &noise, k)),
        |frame| {
            if frame.motion.frame > 0 {
                errors.add(&sequence, frame);
                session.progress.suspend(|| writeln!(terminal::stdout(), "{}", line(frame)))?;
            }
            Ok(())
        },
    )?;
    let viewpoint = Viewpoint { rig: &sequence.rig, camera: RigCamera::Left };
    write_motion(&folder, &config, &outcome, viewpoint, false)?;
    let mut summary = Summary::new("demo".into(), viewpoint, &config, &outcome);
    summary.truth_maps = errors.maps.verdict();
    folder.write_json("summary.json", &summary)?;
    let description = RunDescription {
        title: "A robot's drive through a rendered room",
        source: "rendered by egomotion demo",
        command: "egomotion demo".into(),
        config: &config,
        rig: &sequence.rig,
        input: InputKind::Stereo,
        biased: summary.biased.is_some(),
        notes: Vec::new(),
    };
    write_report(&folder, &description, &outcome)?;
    print_verdict(&mut stdout, &outcome, &summary, &errors, &out)?;
    Ok(Ending::of(outcome.complete))
}

fn render(sequence: &Sequence, noise: &SensorNoise, k: usize) -> SourceFrame {
    let start = Instant::now();
    let images = sequence.view(k).map(|view| noise.expose(&view.render(RAYS_PER_SIDE), k as u64));
    let time_s = sequence.interval_s * k as f64;
    SourceFrame {
        index: k,
        time_s,
        input: images
            .map(|StereoImages { left, right }| {
                FrameInput::Images(Box::new(StereoFrame { time_s, left, right }.into()))
            })
            .ok_or(Unanswered::First),
        truth: sequence.world_from_left(k),
        decode_ms: start.elapsed().as_secs_f64() * 1e3,
        bytes: 0,
    }
}

fn heading() -> String {
    let columns = ["tX", "tY", "tZ", "ΩX", "ΩY", "ΩZ"].map(|name| format!("{name:^24}"));
    format!("frame {}", columns.join(" "))
}

fn line(frame: &FrameResult) -> String {
    let (Ok(motion), Some(truth)) = (&frame.motion.motion, frame.truth) else {
        return format!("{:>5}  {}", frame.index, status(frame));
    };
    let columns: Vec<String> = (0..6)
        .map(|i| {
            let (scale, digits) = if i < 3 { (1e3, 2) } else { (f64::to_degrees(1.0), 4) };
            let (value, sigma) = (scale * motion.theta.mean[i], scale * motion.theta.sigma(i));
            let shown =
                format!("{value:.digits$} ± {sigma:.digits$} ({:.digits$})", scale * truth.vector()[i]);
            format!("{shown:^24}")
        })
        .collect();
    format!("{:>5} {}", frame.index, columns.join(" "))
}

/// Maps against the rendered truth.
#[derive(Default)]
struct DemoErrors {
    maps: MapErrors,
    impact_errors_s: Vec<f64>,
    impact_inside: usize,
}

impl DemoErrors {
    fn add(&mut self, sequence: &Sequence, frame: &FrameResult) {
        let (Some(dense), Some(reference), Some(dt_s)) =
            (&frame.motion.dense, frame.motion.reference, frame.motion.dt_s)
        else {
            return;
        };
        // The truth is that of consecutive frames.
        let (Some(view), Some(phi)) = (sequence.view(reference), sequence.phi(reference)) else { return };
        let (width, height) = dense.disparity.shift.size();
        for v in (0..height).step_by(JUDGED_STEP_PX) {
            for u in (0..width).step_by(JUDGED_STEP_PX) {
                let Some(truth) = view.truth_at(u as f64, v as f64) else { continue };
                let moved = view.motion_at(&truth, &phi);
                if !(truth.in_right && moved.in_later) {
                    continue;
                }
                let vz = moved.depth_change_m(&truth);
                self.maps.add(dense, (u, v), sequence.rig.shift_from_disparity(truth.disparity_px()), vz);
                self.add_impact(dense, (u, v), -moved.later.z * dt_s / vz);
            }
        }
    }

    /// `seconds` is the true time to impact, negative where the point recedes.
    fn add_impact(&mut self, dense: &DenseResults, (u, v): (usize, usize), seconds: f64) {
        let Some(impact) = dense.motion.impact(u, v) else { return };
        if let (Some(t), Some((lo, hi))) = (impact.seconds(), impact.interval95_s()) {
            let inside = if seconds > 0.0 { lo <= seconds && seconds <= hi } else { hi.is_infinite() };
            self.impact_inside += usize::from(inside);
            self.impact_errors_s.push((t - seconds).abs());
        }
    }
}

fn print_verdict(
    out: &mut impl std::io::Write,
    outcome: &Outcome,
    summary: &Summary,
    errors: &DemoErrors,
    folder: &Path,
) -> Result<()> {
    if let Some(truth) = &summary.truth {
        writeln!(
            out,
            "\nmotion      {:.3} mm, {:.5}° a frame (root mean square); NEES/6 {:.2}; {:.1} % of {} components within 2σ",
            1e3 * truth.t_rmse_m,
            truth.r_rmse_deg,
            truth.nees_per_component.unwrap_or(f64::NAN),
            100.0 * truth.within_2_sigma,
            truth.components
        )?;
    }
    if let Some(maps) = &summary.truth_maps {
        writeln!(
            out,
            "VZ          median error {:.3} mm a frame over {:.1} % of the pixels; {:.1} % within 2σ",
            1e3 * maps.vz_median_abs_error_m,
            100.0 * maps.answered,
            100.0 * maps.vz_within_2_sigma
        )?;
        writeln!(
            out,
            "disparity   median error {:.3} px; {:.2} % off by more than 3 px or missing",
            maps.disparity_median_abs_error_px,
            100.0 * maps.disparity_bad_3px
        )?;
    }
    if let Some(median) = metrics::quantile(&errors.impact_errors_s, 0.5) {
        let share = errors.impact_inside as f64 / errors.impact_errors_s.len() as f64;
        writeln!(
            out,
            "impact      median error {:.1} ms; {:.1} % inside their 95 % interval",
            1e3 * median,
            100.0 * share
        )?;
    }
    let stages: Vec<String> = outcome.stages_ms.iter().map(|(name, ms)| format!("{name} {ms:.0}")).collect();
    writeln!(out, "time        {:.0} ms a frame: {}", outcome.frame_ms, stages.join(", "))?;
    writeln!(out, "results     {}", folder.display())?;
    Ok(())
}
