//! `egomotion run`: a real sequence in, motion out.

pub mod resume;
mod scenes;
mod sequence;
mod stream;

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use egomotion::pipeline::{Config, Observe};
use egomotion_io::read;
use egomotion_io::source::{DatasetLayout, Source};

use crate::args::RunArgs;
use crate::session::stop_signal;
use crate::summary::{Summary, Word};
use crate::{Ending, Usage, pairs, terminal};
use sequence::{DoneSequence, run_sequence};

/// Run a source, be it one sequence or a set of scenes.
pub fn run(args: &RunArgs) -> Result<Ending> {
    let config = resolve_config(args)?;
    if args.parquet && !cfg!(feature = "parquet") {
        let reason = "--parquet is not in this build: build with `cargo install --path crates/egomotion-cli --features parquet`";
        return Err(Usage(reason.into()).into());
    }
    set_threads(args.threads)?;
    if args.source.as_os_str() == "-" {
        return stream::run(args, &config);
    }
    let out = args.out.clone().unwrap_or_else(|| default_out(&args.source));
    if args.resume {
        resume::expect_run(&out)?;
    }
    let source = Source::open_with(&args.source, args.calibration.as_deref())?;
    let stop = stop_signal("frame");
    if source.layout == DatasetLayout::StereoPairs {
        return pairs::run(args, &config, &source, &out, &stop);
    }
    if source.layout.is_scene_set() {
        return scenes::run(args, &config, &source, &out, &stop);
    }
    let Some(done) = run_sequence(args, &config, &source.sequences[0], &out, &stop, true)? else {
        return complete_before(args, &out);
    };
    print_result(args, &done.summary, &out)?;
    answered(&source.path, &done)?;
    Ok(ending(done.summary.complete))
}

/// Say that nothing is left to do; with `--json` by the summary that is there.
pub fn complete_before(args: &RunArgs, out: &Path) -> Result<Ending> {
    let mut stdout = terminal::stdout();
    if args.json {
        let summary = out.join("summary.json");
        stdout.write_all(&std::fs::read(&summary).with_context(|| summary.display().to_string())?)?;
    } else {
        writeln!(stdout, "{}: the run is complete, nothing is left to do", out.display())?;
    }
    Ok(Ending::Done)
}

fn ending(complete: bool) -> Ending {
    if complete { Ending::Done } else { Ending::Interrupted }
}

/// Defaults, then the file, then the options.
fn resolve_config(args: &RunArgs) -> Result<Config> {
    let mut config = match &args.config {
        None => Config::default(),
        Some(path) => read::toml(path)?,
    };
    if let Some(method) = args.method {
        config.method = method.into();
    }
    if let Some(approach) = args.approach {
        config.approach = approach.into();
    }
    if let Some(estimator) = args.estimator {
        config.estimator = estimator.into();
    }
    if let Some(observe) = args.observe {
        config.observe = observe.into();
    }
    if let Some(seed) = args.seed {
        config.seed = seed;
    }
    config.check().map_err(|e| anyhow::Error::new(Usage(e.to_string())))?;
    if args.map_files().any() && config.observe == Observe::Sparse {
        let reason = "--maps needs the maps of every pixel: use observe dense (the default), not sparse";
        return Err(Usage(reason.into()).into());
    }
    Ok(config)
}

/// Use this many worker threads in the whole process.
pub fn set_threads(threads: Option<usize>) -> Result<()> {
    if let Some(threads) = threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global()
            .context("cannot start the threads")?;
    }
    Ok(())
}

fn default_out(source: &Path) -> PathBuf {
    let full = source.canonicalize().unwrap_or_else(|_| source.to_owned());
    Path::new("egomotion-out").join(full.file_name().unwrap_or_else(|| "run".as_ref()))
}

/// Whether any row gives a motion, or part of one.
fn has_answers(counts: &BTreeMap<Word, usize>) -> bool {
    counts.contains_key("ok") || counts.contains_key("partial")
}

fn answered(source: &Path, done: &DoneSequence) -> Result<()> {
    if has_answers(&done.summary.counts) || !done.summary.complete {
        return Ok(());
    }
    let why = done.first_failure.as_deref().unwrap_or("no frame could be compared with an earlier one");
    bail!("{}: no motion could be estimated; the first reason: {why}", source.display())
}

fn print_result(args: &RunArgs, summary: &Summary, out: &Path) -> Result<()> {
    let mut stdout = terminal::stdout();
    if args.json {
        writeln!(stdout, "{}", serde_json::to_string_pretty(summary)?)?;
        return Ok(());
    }
    let answered =
        summary.counts.get("ok").copied().unwrap_or(0) + summary.counts.get("partial").copied().unwrap_or(0);
    writeln!(
        stdout,
        "{}: {} frames, {answered} of {} motions answered, {:.1} ms a frame",
        out.display(),
        summary.frames,
        summary.frames.saturating_sub(1),
        summary.frame_ms
    )?;
    if let Some(truth) = &summary.truth {
        writeln!(
            stdout,
            "  against the source's poses, frame to frame: {:.2} mm, {:.4}° (root mean square)",
            1e3 * truth.t_rmse_m,
            truth.r_rmse_deg
        )?;
    }
    if let Some(maps) = &summary.truth_maps {
        writeln!(
            stdout,
            "  against the source's maps: VZ median error {:.3} m, {:.1} % within 2σ, {:.1} % answered; disparity {:.1} % off by more than 3 px or missing",
            maps.vz_median_abs_error_m,
            100.0 * maps.vz_within_2_sigma,
            100.0 * maps.answered,
            100.0 * maps.disparity_bad_3px
        )?;
    }
    Ok(())
}
