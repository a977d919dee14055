//! Options of `study consistency`.

use clap::{Args, ValueEnum};

use super::LaboratoryArgs;
use crate::args::values::{rendered_sequence, size};

/// Random pairs through the pipeline.
#[derive(Debug, Clone, Args)]
pub struct ConsistencyArgs {
    /// The sequences, such as C,drive,lab-A [default: A, B, C, drive and lab-A … lab-M].
    #[arg(long = "sequence", alias = "sequences", value_name = "NAME,…", value_delimiter = ',', value_parser = rendered_sequence)]
    pub sequences: Option<Vec<String>>,
    /// Size of the rendered images.
    #[arg(long, value_name = "WxH", default_value = "320x240", value_parser = size)]
    pub size: (usize, usize),
    /// What takes the pairs: a stereo rig or a depth camera, which errs as its tolerance says.
    #[arg(long, value_name = "SENSOR", default_value = "stereo")]
    pub sensor: PairSensorArg,
    /// Tracks alone: φ, and no maps.
    #[arg(long)]
    pub sparse: bool,
    /// Whole sequences in place of pairs, and the covariance of their poses: `erring` draws the rig's errors anew for each
    /// run, `exact` has none [default sequences: corridor, C, lab-E].
    #[arg(long, value_name = "RIG", num_args = 0..=1, default_missing_value = "erring")]
    pub rig: Option<RigArg>,
    #[command(flatten)]
    pub laboratory: LaboratoryArgs,
}

/// What takes the pairs of the consistency study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PairSensorArg {
    /// Two cameras.
    Stereo,
    /// A Kinect held in a hand.
    Kinect,
    /// A time-of-flight camera held in a hand.
    TimeOfFlight,
    /// Rendered images and depth in half-precision numbers.
    Rendered,
}

/// The rig that takes whole sequences.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum RigArg {
    /// One whose errors are drawn from the prior that the pipeline is told.
    Erring,
    /// One that is exactly as stated.
    Exact,
}
