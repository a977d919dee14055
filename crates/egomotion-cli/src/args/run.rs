//! Options of `run`.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::{Serialize, Serializer};

use super::choices::{
    ApproachArg, CloudArg, EstimatorArg, FrameArg, MapFormatArg, MethodArg, ObserveArg, SensorArg,
};
use super::values::{frame_size, positive, rate};

// What is serialised is `options` of `summary.json`, and must be alike when a run goes on. The rest is in `Config`, or
// does not change the results.
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
    /// Camera whose φ and covariance motion.csv and JSON lines give; trajectories, maps and moving.csv stay those of
    /// the left camera [default: left].
    #[arg(long, value_enum, value_name = "CAMERA")]
    pub frame: Option<FrameArg>,
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
    pub maps_as: Vec<MapFormatArg>,
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
