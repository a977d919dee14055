//! Options of `study reliability`.

use clap::Args;

use super::LaboratoryArgs;
use crate::args::values::{rendered_sequence, size};

/// Random pairs by every linear method.
#[derive(Debug, Clone, Args)]
pub struct ReliabilityArgs {
    /// The sequences, such as C,drive,lab-A [default: A, B, C, demo, drive and lab-A … lab-M].
    #[arg(long = "sequence", alias = "sequences", value_name = "NAME,…", value_delimiter = ',', value_parser = rendered_sequence)]
    pub sequences: Option<Vec<String>>,
    /// Size of the rendered images.
    #[arg(long, value_name = "WxH", default_value = "320x240", value_parser = size)]
    pub size: (usize, usize),
    #[command(flatten)]
    pub laboratory: LaboratoryArgs,
}
