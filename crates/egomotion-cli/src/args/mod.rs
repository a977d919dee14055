//! What can be typed.

mod evaluate;
mod run;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::study::StudyCommand;
use egomotion_io::simulation::{SimulationOptions, check_size};

pub use evaluate::EvaluateArgs;
pub use run::{ApproachArg, CloudArg, EstimatorArg, MapFormat, MethodArg, ObserveArg, RunArgs};

/// 3D motion, depth velocity and time to impact from stereo, each with an uncertainty that can be trusted.
#[derive(Debug, Parser)]
#[command(name = "egomotion", version, propagate_version = true, max_term_width = 100)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a robot's drive with exact truth, estimate its motion, and judge the estimate.
    Demo(DemoArgs),
    /// Estimate the motion of a recording.
    ///
    /// SOURCE is a folder of KITTI (odometry, raw, the training folder of 2012 or 2015), EuRoC, TUM-VI, TUM RGB-D,
    /// TartanAir, Karlsruhe or Middlebury, or a plain one: left and right, or rgb and depth, and rig.toml. Raw images are
    /// rectified. An .npz of stereo tracks will do, and - reads images from standard input. `egomotion info SOURCE` says
    /// what was recognised and why.
    Run(Box<RunArgs>),
    /// Render a sequence in KITTI layout, with its exact truth beside it.
    ///
    /// DIR then holds image_0, image_1, calib.txt, times.txt and poses.txt, which run and info read like a real
    /// sequence; truth/ with disparity, depth, depth_velocity (PFM) and flow (.flo) on the left camera's pixels,
    /// visible (PNG: 1 seen by the right camera, 2 by the later left one, 3 both), trajectory_tum.txt and
    /// motion.toml; and scene.toml.
    Simulate(SimulateArgs),
    /// Compare a trajectory with the truth, frame to frame and over lengths of path.
    Evaluate(EvaluateArgs),
    /// Say what a source was recognised as: layout, frames, rig, time stamps, truth.
    Info(InfoArgs),
    /// Repeat the paper's studies: files with every figure, and one page.
    Study {
        #[command(subcommand)]
        command: StudyCommand,
    },
    /// Print every default with its meaning, as TOML that `run --config` takes.
    Config,
    /// Print a script that makes a shell complete commands and options.
    ///
    /// For bash: egomotion completions bash > ~/.local/share/bash-completion/completions/egomotion
    Completions(CompletionsArgs),
    /// Print the manual page, or write those of all commands.
    Man(ManArgs),
}

#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// Which shell.
    pub shell: clap_complete::Shell,
}

#[derive(Debug, Args)]
pub struct ManArgs {
    /// Folder for the pages of all commands [default: print the main page].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Folder for the results.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Worker threads; the results do not depend on their number.
    #[arg(long, value_name = "N", value_parser = positive)]
    pub threads: Option<usize>,
    /// Show no progress.
    #[arg(long)]
    pub quiet: bool,
}

#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// Name of the motion and its scene: A, B, C, drive, demo … (any other name lists them all).
    #[arg(long, value_name = "NAME")]
    pub sequence: String,
    /// Factor of every motion.
    #[arg(long, value_name = "S", default_value_t = 1.0, allow_negative_numbers = true, value_parser = step)]
    pub step: f64,
    /// Number of frames [default: the sequence's own].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=MAX_FRAMES))]
    pub frames: Option<u32>,
    /// Size of the images; the focal length scales with the width [default: the sequence's own].
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<(usize, usize)>,
    /// What the cameras add to the light [default: that of the scene file, or sensor].
    #[arg(long, value_enum)]
    pub noise: Option<NoiseArg>,
    /// Seed of the cameras' noise [default: that of the scene file, or 0].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(..=MAX_SEED))]
    pub seed: Option<u64>,
    /// Seed of the texture on every surface [default: the scene's own].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(..=MAX_SEED))]
    pub texture: Option<u64>,
    /// Scene (and, if it has them, rig and sensor) in place of the sequence's own, as in scene.toml.
    #[arg(long, value_name = "FILE")]
    pub scene: Option<PathBuf>,
    /// Folder for the sequence [default: egomotion-out/NAME].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Worker threads; the results do not depend on their number.
    #[arg(long, value_name = "N", value_parser = positive)]
    pub threads: Option<usize>,
    /// Show no progress.
    #[arg(long)]
    pub quiet: bool,
}

impl SimulateArgs {
    /// What is asked for.
    pub fn options(&self) -> SimulationOptions {
        SimulationOptions {
            sequence: self.sequence.clone(),
            step: self.step,
            frames: self.frames.map(|frames| frames as usize),
            size_px: self.size,
            noise: self.noise.map(|noise| matches!(noise, NoiseArg::Sensor)),
            seed: self.seed,
            texture: self.texture,
            scene: self.scene.clone(),
        }
    }
}

/// Files are numbered with six digits.
const MAX_FRAMES: i64 = 1_000_000;
/// TOML's integers end here.
const MAX_SEED: u64 = i64::MAX as u64;

#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum NoiseArg {
    /// Read and shot noise, the right camera with a gain and an offset.
    Sensor,
    /// Rounding to 8 bits alone.
    None,
}

#[derive(Debug, Args)]
pub struct InfoArgs {
    /// Folder of the sequence or set.
    pub source: PathBuf,
    /// Calibration to use in place of the source's own, as for run.
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
}

/// A whole number of at least 1.
pub fn positive(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("must be at least 1".into()),
        Ok(n) => Ok(n),
        Err(e) => Err(format!("{e}")),
    }
}

fn step(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(step) if step.is_finite() && step >= 0.0 => Ok(step),
        Ok(_) => Err("must be a finite number that is not negative".into()),
        Err(e) => Err(format!("{e}")),
    }
}

/// WxH.
pub fn size(text: &str) -> Result<(usize, usize), String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("give width x height, as 640x480")?;
    let side = |text: &str| text.parse::<usize>().map_err(|e| format!("{e}"));
    let size = (side(width)?, side(height)?);
    check_size(size).map(|()| size)
}
