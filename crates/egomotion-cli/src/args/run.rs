//! Options of `run`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use egomotion::pipeline::{Approach, EstimatorKind, Method, Observe};
use egomotion_io::recording::{RecordingOptions, Sensor};
use serde::{Serialize, Serializer};

use super::positive;
use crate::maps::MapFiles;

// What is serialised must be alike when a run goes on; the rest is in `Config`, or is of no consequence for the results.
#[derive(Debug, Args, Serialize)]
pub struct RunArgs {
    /// Folder of the sequence, an .npz of stereo tracks, or - for images piped in.
    #[serde(serialize_with = "source_place")]
    pub source: PathBuf,
    /// Folder for the results [default: egomotion-out/NAME, NAME the last folder of SOURCE].
    #[arg(long, value_name = "DIR")]
    #[serde(skip)]
    pub out: Option<PathBuf>,
    /// Which equations determine the motion [default: ml].
    #[arg(long, value_enum)]
    #[serde(skip)]
    pub method: Option<MethodArg>,
    /// Finite displacements or velocities [default: discrete].
    #[arg(long, value_enum)]
    #[serde(skip)]
    pub approach: Option<ApproachArg>,
    /// How the equations are solved [default: irls].
    #[arg(long, value_enum)]
    #[serde(skip)]
    pub estimator: Option<EstimatorArg>,
    /// Every pixel with all maps, or tracked corners alone at the highest rate [default: dense].
    #[arg(long, value_enum)]
    #[serde(skip)]
    pub observe: Option<ObserveArg>,
    /// Which camera to use where a source has both [default: stereo].
    #[arg(long, value_enum)]
    pub sensor: Option<SensorArg>,
    /// Folder of disparity maps in place of our own: PFM, .npy or KITTI PNG, named as the left images or by number.
    #[arg(long, value_name = "DIR")]
    #[serde(serialize_with = "place")]
    pub disparity: Option<PathBuf>,
    /// Folder of flow maps to the next frame in place of our own: .flo, .npy or KITTI PNG, named alike.
    #[arg(long, value_name = "DIR")]
    #[serde(serialize_with = "place")]
    pub flow: Option<PathBuf>,
    /// Stereo tracks in place of images: CSV (frame,track,u_left,v_left,u_right,v_right[,time_s]) or .npz.
    #[arg(long, value_name = "FILE")]
    #[serde(serialize_with = "place")]
    pub tracks: Option<PathBuf>,
    /// Calibration to use in place of the source's own: KITTI, EuRoC sensor.yaml, Kalibr camchain, OpenCV
    /// YAML or XML, ROS CameraInfo, or rig.toml; raw cameras are rectified.
    #[arg(long, value_name = "FILE")]
    #[serde(serialize_with = "place")]
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
    #[serde(serialize_with = "place")]
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
    /// Write motion.parquet too, motion.csv for data frames; needs a build with the feature parquet.
    #[arg(long)]
    pub parquet: bool,
    /// Settings as TOML; options given here come before those in the file.
    #[arg(long, value_name = "FILE")]
    #[serde(skip)]
    pub config: Option<PathBuf>,
    /// Worker threads; the results do not depend on their number.
    #[arg(long, value_name = "N", value_parser = positive)]
    #[serde(skip)]
    pub threads: Option<usize>,
    /// Seed of every random choice.
    #[arg(long, value_name = "N")]
    #[serde(skip)]
    pub seed: Option<u64>,
    /// Go on where the same command was interrupted or killed, and keep the frames or scenes that are done.
    #[arg(long)]
    #[serde(skip)]
    pub resume: bool,
    /// Show no progress.
    #[arg(long)]
    #[serde(skip)]
    pub quiet: bool,
    /// Print the summary as JSON.
    #[arg(long)]
    #[serde(skip)]
    pub json: bool,
}

impl RunArgs {
    /// What is taken of the recording.
    pub fn recording_options(&self) -> RecordingOptions {
        RecordingOptions {
            start: self.start,
            frames: self.frames,
            stride: Some(self.stride),
            reverse: self.reverse,
            sensor: self.sensor.map(|sensor| match sensor {
                SensorArg::Stereo => Sensor::Stereo,
                SensorArg::Depth => Sensor::Depth,
            }),
            disparity: self.disparity.clone(),
            flow: self.flow.clone(),
            tracks: self.tracks.clone(),
            mask: self.mask.clone(),
        }
    }

    /// What is written of each frame pair.
    pub fn map_files(&self) -> MapFiles {
        let mut formats = self.maps_as.clone();
        if self.maps && !formats.contains(&MapFormat::Pfm) {
            formats.push(MapFormat::Pfm);
        }
        MapFiles { formats, cloud: self.cloud }
    }
}

/// Where a file or folder is, whatever it was called from where; of a file also its size.
fn place<S: Serializer>(path: &Option<PathBuf>, serializer: S) -> Result<S::Ok, S::Error> {
    path.as_deref().map(placed).serialize(serializer)
}

fn source_place<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&placed(path))
}

fn placed(path: &Path) -> String {
    let full = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    match full.metadata() {
        Ok(about) if about.is_file() => format!("{} ({} bytes)", full.display(), about.len()),
        _ => full.display().to_string(),
    }
}

/// A format of maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
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

/// WxH of any positive size.
fn frame_size(text: &str) -> Result<(usize, usize), String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("give width x height, as 640x480")?;
    Ok((positive(width)?, positive(height)?))
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if rate.is_finite() && rate > 0.0 => Ok(rate),
        Ok(_) => Err("must be a positive number".into()),
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
    Eiv: "Least squares corrected for the bias of noisy gradients (method dcce alone).",
});
choice!(ObserveArg for Observe {
    Dense: "Disparity and flow of every pixel, with all maps.",
    Sparse: "Tracked corners alone.",
});

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
pub enum SensorArg {
    /// Left and right images.
    Stereo,
    /// Left images and depth images.
    Depth,
}
