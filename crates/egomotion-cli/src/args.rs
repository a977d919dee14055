//! What can be typed.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::study::StudyCommand;
use egomotion::metrics::{Alignment, Delta};
use egomotion::pipeline::{Approach, EstimatorKind, Method, Observe};

use crate::maps::MapFiles;
use crate::simulate::check_size;

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
    /// SOURCE is a folder in KITTI odometry layout (image_0, image_1, calib.txt, times.txt), a recording of EuRoC
    /// or TUM-VI (mav0/cam0, mav0/cam1: raw images, which are rectified), or the training folder of KITTI 2012
    /// or 2015, whose scenes are run one by one.
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
pub struct RunArgs {
    /// Folder of the sequence, an .npz of stereo tracks, or - for images piped in.
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
    /// Which camera to use where a source has both [default: stereo].
    #[arg(long, value_enum)]
    pub sensor: Option<SensorArg>,
    /// Folder of disparity maps in place of our own: PFM, .npy or KITTI PNG, named as the left images or by number.
    #[arg(long, value_name = "DIR")]
    pub disparity: Option<PathBuf>,
    /// Folder of flow maps to the next frame in place of our own: .flo, .npy or KITTI PNG, named alike.
    #[arg(long, value_name = "DIR")]
    pub flow: Option<PathBuf>,
    /// Stereo tracks in place of images: CSV (frame,track,u_left,v_left,u_right,v_right[,time_s]) or .npz.
    #[arg(long, value_name = "FILE")]
    pub tracks: Option<PathBuf>,
    /// Calibration to use in place of the source's own: KITTI, EuRoC sensor.yaml, Kalibr camchain, OpenCV
    /// YAML or XML, ROS CameraInfo, or rig.toml; raw cameras are rectified.
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
    /// With SOURCE -: raw frames of 8-bit grey levels and this size, left and right in turn [default: PNG files].
    #[arg(long, value_name = "WxH", value_parser = frame_size)]
    pub raw: Option<(usize, usize)>,
    /// With SOURCE -: frames a second.
    #[arg(long, value_name = "HZ", default_value_t = 10.0, value_parser = rate)]
    pub rate: f64,
    /// With SOURCE -: each image holds the left one and the right one side by side.
    #[arg(long)]
    pub side_by_side: bool,
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
    /// Write the maps of every frame in these formats.
    #[arg(long, value_enum, value_name = "FORMAT,…", value_delimiter = ',')]
    pub maps_as: Vec<MapFormat>,
    /// Write every frame as a cloud of points (PLY) in the colours of a quantity.
    #[arg(long, value_enum, value_name = "QUANTITY")]
    pub cloud: Option<CloudArg>,
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

impl RunArgs {
    /// What is written of each frame pair.
    pub fn map_files(&self) -> MapFiles {
        let mut formats = self.maps_as.clone();
        if self.maps && !formats.contains(&MapFormat::Pfm) {
            formats.push(MapFormat::Pfm);
        }
        MapFiles { formats, cloud: self.cloud }
    }
}

/// A format of maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MapFormat {
    /// PFM, flow as .flo.
    Pfm,
    /// NumPy arrays of single precision.
    Npy,
    /// KITTI's 16-bit PNG, of disparity and flow alone.
    Kitti,
    /// PNG in colours, to look at.
    Colour,
}

/// What a cloud's colours show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum CloudArg {
    /// Depth velocity.
    Vz,
    /// Time to impact.
    Impact,
}

impl CloudArg {
    /// Name of the property in the file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vz => "depth_velocity",
            Self::Impact => "impact",
        }
    }
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
pub struct EvaluateArgs {
    /// Estimated trajectory (TUM, KITTI or EuRoC rows), or the folder of a run: then its stated uncertainty is judged too.
    pub estimate: PathBuf,
    /// True trajectory, or a recording that comes with true poses.
    pub truth: PathBuf,
    /// Format of both files [default: told by their rows].
    #[arg(long, value_enum)]
    pub format: Option<FormatArg>,
    /// Lengths of path in metres over which drift is measured [default: 100,200 … 800].
    #[arg(long, value_name = "L,L,…", value_delimiter = ',', num_args = 1..)]
    pub lengths: Option<Vec<f64>>,
    /// Distances over which relative motions are compared: frames (f), seconds (s) or metres of path (m).
    #[arg(long, value_name = "D,D,…", value_delimiter = ',', num_args = 1.., default_value = "1s,1m", value_parser = delta)]
    pub delta: Vec<(String, Delta)>,
    /// What is laid over the truth before positions are compared; with sim3 all lengths are scaled.
    #[arg(long, value_enum, default_value = "se3")]
    pub align: AlignArg,
    /// How poses belong to each other, where both files have time stamps.
    #[arg(long, value_enum, default_value = "time")]
    pub associate: AssociateArg,
    /// Time stamps farther apart than this do not belong to each other, in seconds.
    #[arg(long, value_name = "S", default_value_t = 0.01)]
    pub max_diff: f64,
    /// The truth's own standard deviation from frame to frame, in metres and degrees, for judging the stated one.
    #[arg(long, value_name = "M,DEG", value_parser = two)]
    pub truth_sigma: Option<(f64, f64)>,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

impl EvaluateArgs {
    /// Of each component of φ, in metres and radians.
    pub fn truth_sigma(&self) -> [f64; 6] {
        let (t, degrees) = self.truth_sigma.unwrap_or_default();
        let r = degrees.to_radians();
        [t, t, t, r, r, r]
    }
}

/// What may be changed of a trajectory before it is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum AlignArg {
    /// Nothing.
    None,
    /// Where it begins and how it is turned.
    Se3,
    /// Also its scale.
    Sim3,
}

impl AlignArg {
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Se3 => "se3",
            Self::Sim3 => "sim3",
        }
    }

    pub fn words(self) -> &'static str {
        match self {
            Self::None => "as given",
            Self::Se3 => "laid over the truth",
            Self::Sim3 => "laid over the truth and scaled",
        }
    }
}

impl From<AlignArg> for Alignment {
    fn from(value: AlignArg) -> Self {
        match value {
            AlignArg::None => Self::None,
            AlignArg::Se3 => Self::Se3,
            AlignArg::Sim3 => Self::Sim3,
        }
    }
}

/// How poses of two files belong to each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum AssociateArg {
    /// The nearest time stamps.
    Time,
    /// Row by row.
    Row,
}

/// A distance between poses: 1f, 0.5s, 10m.
fn delta(text: &str) -> Result<(String, Delta), String> {
    let unit = text.chars().last().ok_or("give a distance such as 1f, 1s or 10m")?;
    let number = &text[..text.len() - unit.len_utf8()];
    let positive = |value: f64| {
        if value.is_finite() && value > 0.0 { Ok(value) } else { Err("must be positive".into()) }
    };
    let value = || number.parse::<f64>().map_err(|e| format!("{e}")).and_then(positive);
    let delta = match unit {
        'f' => Delta::Frames(crate::args::positive(number)?),
        's' => Delta::Seconds(value()?),
        'm' => Delta::Metres(value()?),
        _ => return Err("give a distance such as 1f, 1s or 10m".into()),
    };
    Ok((text.to_owned(), delta))
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

/// WxH of any positive size.
fn frame_size(text: &str) -> Result<(usize, usize), String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("give width x height, as 640x480")?;
    Ok((positive(width)?, positive(height)?))
}

/// Two numbers that are not negative.
fn two(text: &str) -> Result<(f64, f64), String> {
    let (a, b) = text.split_once(',').ok_or("give two numbers, as 0.001,0.02")?;
    let number = |text: &str| match text.trim().parse::<f64>() {
        Ok(number) if number.is_finite() && number >= 0.0 => Ok(number),
        _ => Err(format!("{text} is not a number that is not negative")),
    };
    Ok((number(a)?, number(b)?))
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if rate.is_finite() && rate > 0.0 => Ok(rate),
        Ok(_) => Err("must be a positive number".into()),
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
    Eiv: "Least squares corrected for the bias of noisy gradients (method dcce alone).",
});
choice!(ObserveArg for Observe {
    Dense: "Disparity and flow of every pixel, with all maps.",
    Sparse: "Tracked corners alone.",
});

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SensorArg {
    /// Left and right images.
    Stereo,
    /// Left images and depth images.
    Depth,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum FormatArg {
    /// timestamp tx ty tz qx qy qz qw.
    Tum,
    /// 12 numbers, the rows of [R t].
    Kitti,
    /// EuRoC's CSV: nanoseconds, position, quaternion with w first.
    Euroc,
}
