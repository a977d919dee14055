//! EvaluationOptions of `evaluate`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use egomotion::metrics::{Delta, TrajectoryAlignment};
use egomotion_io::evaluation::EvaluationOptions;
use egomotion_io::trajectory::TrajectoryFormat;

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
    /// How the trajectories are to be compared.
    pub fn options(&self) -> EvaluationOptions {
        let own = EvaluationOptions::default();
        EvaluationOptions {
            format: self.format.map(Into::into),
            by_time: self.associate == AssociateArg::Time,
            largest_gap_s: self.max_diff,
            alignment: self.align.into(),
            lengths_m: self.lengths.clone().unwrap_or(own.lengths_m),
            deltas: self.delta.clone(),
            truth_sigma: self.truth_sigma.map_or(own.truth_sigma, |(t, degrees)| {
                let r = degrees.to_radians();
                [t, t, t, r, r, r]
            }),
        }
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

impl From<AlignArg> for TrajectoryAlignment {
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
    Ok((text.to_owned(), text.parse()?))
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

#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum FormatArg {
    /// timestamp tx ty tz qx qy qz qw.
    Tum,
    /// 12 numbers, the rows of [R t].
    Kitti,
    /// EuRoC's CSV: nanoseconds, position, quaternion with w first.
    Euroc,
}

impl From<FormatArg> for TrajectoryFormat {
    fn from(format: FormatArg) -> Self {
        match format {
            FormatArg::Tum => Self::Tum,
            FormatArg::Kitti => Self::Kitti,
            FormatArg::Euroc => Self::Euroc,
        }
    }
}
