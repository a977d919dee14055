//! What a run will do: every option resolved once, and what has no meaning refused.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use egomotion::geometry::RigCamera;
use egomotion::pipeline::{Config, Observe};
use egomotion_io::recording::{RecordingOptions, Sensor};
use egomotion_io::stream::StreamFormat;
use serde_json::Value;

use super::config_file;
use super::resume;
use crate::args::{MapFormatArg, RunArgs};
use crate::exit::UsageError;
use crate::results::maps::{MapFiles, MapFormat};

/// Where the results of a run go that names no folder.
const DEFAULT_FOLDER: &str = "egomotion-out";

/// What a run will do.
#[derive(Debug)]
pub struct RunPlan {
    /// What is read.
    pub input: Input,
    /// Folder for the results.
    pub out: PathBuf,
    /// Settings of the pipeline, which fit together.
    pub config: Config,
    /// Files of maps that are written of each frame pair.
    pub maps: MapFiles,
    /// Formats of the disparity of a pair that has no second time.
    pub pair_formats: Vec<MapFormat>,
    /// Camera whose φ is written.
    pub camera: RigCamera,
    /// Whether `motion.parquet` is written too.
    pub parquet: bool,
    /// Worker threads; all cores if `None`.
    pub threads: Option<usize>,
    /// Whether to go on where the same run was stopped.
    pub resume: bool,
    /// Whether to show no progress.
    pub quiet: bool,
    /// Whether to print the summary as JSON.
    pub json: bool,
    /// `options` of `summary.json`: what changes the results and is not in `config`.
    pub options: Value,
}

/// What is read.
#[derive(Debug)]
pub enum Input {
    /// A recording.
    Recording(RecordingInput),
    /// Images piped in.
    Stream(StreamInput),
}

/// A recording, and what of it.
#[derive(Debug)]
pub struct RecordingInput {
    /// Folder or file.
    pub path: PathBuf,
    /// Calibration in place of its own.
    pub calibration: Option<PathBuf>,
    /// Which frames are used, and what takes the place of their images.
    pub selection: RecordingOptions,
}

/// Images on standard input.
#[derive(Debug)]
pub struct StreamInput {
    /// Calibration of their cameras.
    pub calibration: PathBuf,
    /// How an image is coded.
    pub kind: StreamFormat,
    /// Frames a second.
    pub rate_hz: f64,
    /// Whether an image holds the left one and the right one side by side.
    pub side_by_side: bool,
}

impl RunPlan {
    /// The plan of what was typed.
    ///
    /// # Errors
    /// A combination of options has no meaning; the file of settings cannot be used; there is no run to go on with.
    pub fn new(args: &RunArgs) -> Result<Self> {
        let config = resolved_config(args)?;
        let maps = map_files(args);
        if maps.any() && config.observe == Observe::Sparse {
            return refused(
                "--maps needs the maps of every pixel: use observe dense (the default), not sparse",
            );
        }
        if args.parquet && !cfg!(feature = "parquet") {
            return refused(
                "--parquet is not in this build: build with `cargo install --path crates/egomotion-cli --features parquet`",
            );
        }
        let piped_in = args.source.as_os_str() == "-";
        let input = if piped_in {
            Input::Stream(stream_input(args)?)
        } else {
            Input::Recording(recording_input(args)?)
        };
        let out = args.out.clone().unwrap_or_else(|| default_folder(&args.source, piped_in));
        if args.resume {
            resume::expect_run(&out)?;
        }
        Ok(Self {
            input,
            out,
            config,
            maps,
            pair_formats: pair_formats(args),
            camera: args.frame.map_or(RigCamera::Left, RigCamera::from),
            parquet: args.parquet,
            threads: args.threads,
            resume: args.resume,
            quiet: args.quiet,
            json: args.json,
            options: serde_json::to_value(args).context("the options cannot be put into JSON")?,
        })
    }
}

fn refused<T>(reason: &str) -> Result<T> {
    Err(UsageError(reason.into()).into())
}

/// Defaults, then the file, then the options.
fn resolved_config(args: &RunArgs) -> Result<Config> {
    let mut config = match &args.config {
        None => Config::default(),
        Some(path) => config_file::read(path)?,
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
    checked(&config)?;
    Ok(config)
}

/// Refuse settings that do not fit together.
pub fn checked(config: &Config) -> Result<()> {
    config.check().map_err(|e| UsageError(e.to_string()).into())
}

fn map_files(args: &RunArgs) -> MapFiles {
    let mut formats = typed_formats(args);
    if args.maps && !formats.contains(&MapFormat::Pfm) {
        formats.push(MapFormat::Pfm);
    }
    MapFiles { formats, cloud: args.cloud.map(Into::into) }
}

/// Those that were named, or the numbers and a picture to look at.
fn pair_formats(args: &RunArgs) -> Vec<MapFormat> {
    let typed = typed_formats(args);
    if typed.is_empty() { vec![MapFormat::Pfm, MapFormat::Colour] } else { typed }
}

fn typed_formats(args: &RunArgs) -> Vec<MapFormat> {
    args.maps_as.iter().copied().map(MapFormatArg::into).collect()
}

fn stream_input(args: &RunArgs) -> Result<StreamInput> {
    if args.resume {
        return refused("frames on standard input cannot be had again: --resume needs a recording");
    }
    let of_recordings = [
        ("--start", args.start > 0),
        ("--frames", args.frames.is_some()),
        ("--stride", args.stride > 1),
        ("--reverse", args.reverse),
        ("--sensor", args.sensor.is_some()),
        ("--disparity", args.disparity.is_some()),
        ("--flow", args.flow.is_some()),
        ("--tracks", args.tracks.is_some()),
        ("--mask", args.mask.is_some()),
    ];
    if let Some((option, _)) = of_recordings.into_iter().find(|(_, typed)| *typed) {
        return refused(&format!(
            "frames on standard input are taken as they come: {option} needs a recording"
        ));
    }
    let Some(calibration) = args.calibration.clone() else {
        return refused("frames on standard input need --calibration FILE");
    };
    Ok(StreamInput {
        calibration,
        kind: args.raw.map_or(StreamFormat::Png, |(width, height)| StreamFormat::Raw { width, height }),
        rate_hz: args.rate,
        side_by_side: args.side_by_side,
    })
}

fn recording_input(args: &RunArgs) -> Result<RecordingInput> {
    for (option, typed) in [("--raw", args.raw.is_some()), ("--side-by-side", args.side_by_side)] {
        if typed {
            return refused(&format!(
                "{option} tells how frames on standard input are coded: it needs SOURCE -"
            ));
        }
    }
    Ok(RecordingInput {
        path: args.source.clone(),
        calibration: args.calibration.clone(),
        selection: RecordingOptions {
            start: args.start,
            frames: args.frames,
            stride: Some(args.stride),
            reverse: args.reverse,
            sensor: args.sensor.map(Sensor::from),
            disparity: args.disparity.clone(),
            flow: args.flow.clone(),
            tracks: args.tracks.clone(),
            mask: args.mask.clone(),
        },
    })
}

fn default_folder(source: &Path, piped_in: bool) -> PathBuf {
    let full = source.canonicalize().unwrap_or_else(|_| source.to_owned());
    let name = if piped_in { "stdin".as_ref() } else { full.file_name().unwrap_or_else(|| "run".as_ref()) };
    Path::new(DEFAULT_FOLDER).join(name)
}
