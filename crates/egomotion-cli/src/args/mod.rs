//! What can be typed.

mod choices;
mod evaluate;
mod run;
mod simulate;
pub mod study;
mod values;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

pub use choices::{ApproachArg, EstimatorArg, MapFormatArg, MethodArg, ObserveArg};
pub use evaluate::EvaluateArgs;
pub use run::RunArgs;
pub use simulate::SimulateArgs;
use study::StudyCommand;
use values::positive;

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
pub struct InfoArgs {
    /// Folder of the sequence or set.
    pub source: PathBuf,
    /// Calibration to use in place of the source's own, as for run.
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
}
