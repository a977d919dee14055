//! Options of `study`, a file for each study that has some of its own.

mod consistency;
mod efficiency;
mod real;
mod reliability;
mod sensitivity;
mod table;

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use super::values::positive;
pub use consistency::{ConsistencyArgs, PairSensorArg, RigArg};
pub use efficiency::EfficiencyArgs;
pub use real::RealArgs;
pub use reliability::ReliabilityArgs;
pub use sensitivity::SensitivityArgs;
pub use table::TableArgs;

/// The studies.
#[derive(Debug, Subcommand)]
pub enum StudyCommand {
    /// One setting of the synthetic study alone: every method, approach and estimator.
    Table(TableArgs),
    /// The six sweeps of section 7.1, at both baselines: Figures 7, 8 and 9.
    Sensitivity(SensitivityArgs),
    /// Section 5: the table under (51), Figures 3 to 6, and every variance formula against draws.
    Uncertainty(LaboratoryArgs),
    /// Section 7.2: Tables 3 to 7 and Figures 11 to 14, on the manipulator's sequences or on a recording.
    ///
    /// Without SOURCE the sequences lab-A … lab-M are rendered and go through the whole image pipeline. SOURCE is a
    /// stereo recording that `run` takes. Errors, and with them Figures 12 to 14, need its true poses; without them the
    /// tables hold estimates alone.
    Real(RealArgs),
    /// Sections 1, 3.1 and 4.3: depth against brightness, and instantaneous formulas on finite motions.
    Assumptions(LaboratoryArgs),
    /// Whether the stated uncertainty is true: the whole image pipeline on random pairs of rendered frames.
    Consistency(ConsistencyArgs),
    /// Variance over the Cramér–Rao bound, bias, NEES and coverage of every method, over noise, number of points and
    /// outliers; what is reported observed where something is missing.
    Efficiency(EfficiencyArgs),
    /// Which answers of the linear methods can be believed: answered, refused, warned of, and wrong without a word.
    Reliability(ReliabilityArgs),
    /// Every study, with one page that links them.
    All(LaboratoryArgs),
}

/// What all studies take.
#[derive(Debug, Clone, Args)]
pub struct LaboratoryArgs {
    /// Folder for the results [default: egomotion-out/study-NAME, of all studies egomotion-out/study].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Seed of every random choice.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Draws of each setting [default: the study's own number].
    #[arg(long, value_name = "N", value_parser = positive)]
    pub draws: Option<usize>,
    /// Worker threads; the results do not depend on their number.
    #[arg(long, value_name = "N", value_parser = positive)]
    pub threads: Option<usize>,
    /// Go on where the same study was stopped, and keep the parts that are done.
    #[arg(long)]
    pub resume: bool,
    /// Show no progress.
    #[arg(long)]
    pub quiet: bool,
}

impl LaboratoryArgs {
    /// The folder for the results of a study, or of all.
    pub fn folder(&self, study: Option<&str>) -> PathBuf {
        let own =
            || Path::new("egomotion-out").join(study.map_or("study".into(), |name| format!("study-{name}")));
        self.out.clone().unwrap_or_else(own)
    }
}
