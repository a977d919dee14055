//! `egomotion demo`: a robot's drive, rendered with exact truth, estimated and judged.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use egomotion::metrics;
use egomotion::pipeline::DenseResults;
use egomotion::pipeline::{Config, StereoFrame, Unanswered};
use egomotion::sim::{SensorNoise, Sequence, StereoImages};

use crate::Ending;
use crate::args::DemoArgs;
use crate::judge::MapTally;
use crate::results::{About, ResultFolder};
use crate::run::set_threads;
use crate::session::{Outcome, Row, Session, progress, stop_signal};
use crate::summary::Summary;
use crate::terminal;
use egomotion_io::recording::{FrameInput, SourceFrame};
use egomotion_report::run::Eyes;

/// Rays along each side of a pixel that shows an edge.
const SAMPLES: usize = 3;
/// Seed of the cameras' noise.
const NOISE_SEED: u64 = 2003;

/// Render, run, judge.
pub fn demo(args: &DemoArgs) -> Result<Ending> {
    set_threads(args.threads)?;
    let config = Config::default();
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
        progress: progress(sequence.frames(), args.quiet),
    };
    let mut stdout = terminal::stdout();
    writeln!(
        stdout,
        "A robot drives {} frames through a rendered room; φ is the motion of the scene",
        sequence.frames()
    )?;
    writeln!(stdout, "seen from its left camera, estimate ± σ (truth), in mm and degrees a frame:")?;
    writeln!(stdout, "{}", heading())?;
    let mut verdicts = Verdicts::default();
    let outcome = session.run(
        None,
        &stop,
        |k| (k < sequence.frames()).then(|| render(&sequence, &noise, k)),
        |row| {
            if row.motion.frame > 0 {
                verdicts.add(&sequence, row);
                session.progress.suspend(|| writeln!(terminal::stdout(), "{}", line(row)))?;
            }
            Ok(())
        },
    )?;
    folder.write_motion(&config, &outcome, false)?;
    let mut summary = Summary::new("demo".into(), sequence.rig, &config, &outcome);
    summary.truth_maps = verdicts.vz.verdict();
    folder.write_json("summary.json", &summary)?;
    let about = About {
        title: "A robot's drive through a rendered room",
        source: "rendered by egomotion demo",
        command: "egomotion demo".into(),
        config: &config,
        rig: &sequence.rig,
        eyes: Eyes::Stereo,
        notes: Vec::new(),
    };
    folder.write_report(&about, &outcome)?;
    print_verdict(&mut stdout, &outcome, &summary, &verdicts, &out)?;
    Ok(if outcome.complete { Ending::Done } else { Ending::Interrupted })
}

fn render(sequence: &Sequence, noise: &SensorNoise, k: usize) -> SourceFrame {
    let start = Instant::now();
    let images = sequence.view(k).map(|view| noise.expose(&view.render(SAMPLES), k as u64));
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

fn line(row: &Row) -> String {
    let (Ok(motion), Some(truth)) = (&row.motion.motion, row.truth) else {
        return format!("{:>5}  {}", row.index, crate::results::status(row));
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
    format!("{:>5} {}", row.index, columns.join(" "))
}

/// Maps against the rendered truth.
#[derive(Default)]
struct Verdicts {
    vz: MapTally,
    impact_errors_s: Vec<f64>,
    impact_inside: usize,
}

/// Pixels are judged on every so-many-th row and column.
const STEP: usize = 4;

impl Verdicts {
    fn add(&mut self, sequence: &Sequence, row: &Row) {
        let (Some(dense), Some(reference), Some(dt_s)) =
            (&row.motion.dense, row.motion.reference, row.motion.dt_s)
        else {
            return;
        };
        // The truth is that of consecutive frames.
        let (Some(view), Some(phi)) = (sequence.view(reference), sequence.phi(reference)) else { return };
        let (width, height) = dense.disparity.shift.size();
        for v in (0..height).step_by(STEP) {
            for u in (0..width).step_by(STEP) {
                let Some(truth) = view.truth_at(u as f64, v as f64) else { continue };
                let moved = view.motion_at(&truth, &phi);
                if !(truth.in_right && moved.in_later) {
                    continue;
                }
                let vz = moved.depth_change_m(&truth);
                self.vz.add(dense, (u, v), sequence.rig.shift_from_disparity(truth.disparity_px()), vz);
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
    verdicts: &Verdicts,
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
    if let Some(median) = metrics::quantile(&verdicts.impact_errors_s, 0.5) {
        let share = verdicts.impact_inside as f64 / verdicts.impact_errors_s.len() as f64;
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
