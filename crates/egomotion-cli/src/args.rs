//! What can be typed.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use egomotion::pipeline::{Approach, EstimatorKind, Method, Observe};

use crate::study::StudyCommand;

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
    /// Estimate the motion of a real stereo sequence.
    ///
    /// SOURCE is a folder in KITTI odometry layout (image_0, image_1, calib.txt, times.txt) or the
    /// training folder of KITTI 2012 or 2015, whose scenes are run one by one.
    Run(Box<RunArgs>),
    /// Repeat the experiments of the paper: every figure as SVG, every table as CSV, and one page.
    #[command(subcommand)]
    Study(StudyCommand),
    /// Compare a trajectory with the truth, frame to frame and over lengths of path.
    Evaluate(EvaluateArgs),
    /// Say what a source was recognised as: layout, frames, rig, time stamps, truth.
    Info(InfoArgs),
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
pub struct RunArgs {
    /// Folder of the sequence.
    pub source: PathBuf,
    /// Folder for the results [default: egomotion-out/NAME, NAME the last folder of SOURCE].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Which equations determine the motion [default: ml].
    #[arg(long, value_enum)]
    pub method: Option<MethodArg>,
    /// Finite displacements or velocities [default: discrete].
    #[arg(long, value_enum)]
    pub approach: Option<ApproachArg>,
    /// How the equations are solved [default: irls].
    #[arg(long, value_enum)]
    pub estimator: Option<EstimatorArg>,
    /// Every pixel with all maps, or tracked corners alone at the highest rate [default: dense].
    #[arg(long, value_enum)]
    pub observe: Option<ObserveArg>,
    /// Calibration to use in place of the source's own (KITTI calib.txt).
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
    /// Grey PNG of the image's size; pixels that are not black in it are never used.
    #[arg(long, value_name = "FILE")]
    pub mask: Option<PathBuf>,
    /// First frame, counted from 0.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub start: usize,
    /// Number of frames to use [default: all].
    #[arg(long, value_name = "N")]
    pub frames: Option<usize>,
    /// Use every N-th frame.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = positive)]
    pub stride: usize,
    /// Play the sequence backwards.
    #[arg(long)]
    pub reverse: bool,
    /// Write the maps of every frame (disparity, flow, depth velocity, impact) as PFM and .flo.
    #[arg(long)]
    pub maps: bool,
    /// Settings as TOML; options given here come before those in the file.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Worker threads; the results do not depend on their number.
    #[arg(long, value_name = "N", value_parser = positive)]
    pub threads: Option<usize>,
    /// Seed of every random choice.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Show no progress.
    #[arg(long)]
    pub quiet: bool,
    /// Print the summary as JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct EvaluateArgs {
    /// Estimated trajectory, TUM or KITTI rows.
    pub estimate: PathBuf,
    /// True trajectory, one pose for each of the estimate.
    pub truth: PathBuf,
    /// Format of both files [default: told by the length of their rows].
    #[arg(long, value_enum)]
    pub format: Option<FormatArg>,
    /// Lengths of path in metres over which drift is measured.
    #[arg(long, value_name = "L,L,…", value_delimiter = ',', num_args = 1..)]
    pub lengths: Option<Vec<f64>>,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct InfoArgs {
    /// Folder of the sequence or set.
    pub source: PathBuf,
}

/// A whole number of at least 1.
pub fn positive(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("must be at least 1".into()),
        Ok(n) => Ok(n),
        Err(e) => Err(format!("{e}")),
    }
}

/// A choice of the library's, as a word of the command line.
macro_rules! choice {
    ($name:ident for $target:ident { $($variant:ident: $help:literal),+ $(,)? }) => {
        #[derive(Debug, Clone, Copy, ValueEnum)]
        pub enum $name { $(#[doc = $help] $variant),+ }
        impl From<$name> for $target {
            fn from(value: $name) -> Self {
                match value { $($name::$variant => Self::$variant),+ }
            }
        }
    };
}

choice!(MethodArg for Method {
    Ml: "Maximum likelihood in the measured (x, y, disparity) at both times.",
    Dcce: "The paper's depth change constraint.",
    Dv: "The paper's binocular flow, in two steps.",
    Joint: "Binocular flow and image flow solved together.",
    Rigid: "Point pairs with a rotation.",
    Linear22: "Point pairs with any matrix.",
});
choice!(ApproachArg for Approach {
    Discrete: "Finite displacements between two frames.",
    Differential: "Velocities and derivatives.",
});
choice!(EstimatorArg for EstimatorKind {
    Ls: "Least squares, all rows alike.",
    Lmeds: "Least median of squares.",
    Irls: "Reweighted least squares, rows weighted by their variance.",
});
choice!(ObserveArg for Observe {
    Dense: "Disparity and flow of every pixel, with all maps.",
    Sparse: "Tracked corners alone.",
});

#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum FormatArg {
    /// timestamp tx ty tz qx qy qz qw.
    Tum,
    /// 12 numbers, the rows of [R t].
    Kitti,
}
