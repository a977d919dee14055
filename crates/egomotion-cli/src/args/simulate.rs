//! Options of `simulate`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use egomotion::geometry::RigErrors;
use egomotion_io::simulation::SimulationOptions;

use super::values::{positive, rig_errors, size, step};

/// Most frames of a sequence, because the files of frames are numbered with six digits.
const MAX_FRAMES: i64 = 1_000_000;
/// Largest seed, because the largest integer that a TOML file can hold is that of 64 bits with a sign.
const MAX_SEED: u64 = i64::MAX as u64;

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
    /// By how much the rig that takes the images differs from the one that the files state: yaw_deg, pitch_deg, roll_deg,
    /// focal_ratio, focal, centre_x_px, centre_y_px, baseline.
    #[arg(long, value_name = "NAME=VALUE,…", value_parser = rig_errors, allow_hyphen_values = true)]
    pub rig_error: Option<RigErrors>,
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
            rig_errors: self.rig_error.unwrap_or_default(),
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum NoiseArg {
    /// Read and shot noise, the right camera with a gain and an offset.
    Sensor,
    /// Rounding to 8 bits alone.
    None,
}
