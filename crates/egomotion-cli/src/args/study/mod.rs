//! What can be typed after `egomotion study`.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};

use egomotion::pipeline::Method;
use egomotion::sim::Sequence;
use egomotion_study::draw::LEAST_FEATURES;

use crate::args::{MethodArg, positive, size};

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
    /// folder in KITTI odometry layout with true poses (poses.txt, or ../../poses/NAME.txt).
    Real(RealArgs),
    /// Sections 1, 3.1 and 4.3: depth against brightness, and instantaneous formulas on finite motions.
    Assumptions(LaboratoryArgs),
    /// Whether the stated uncertainty is true: the whole image pipeline on random pairs of rendered frames.
    Consistency(ConsistencyArgs),
    /// Variance over the Cramér–Rao bound, bias, NEES and coverage of every method, over noise, number of points and
    /// outliers; what is reported observed where something is missing.
    Efficiency(EfficiencyArgs),
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

/// One setting alone.
#[derive(Debug, Clone, Args)]
pub struct TableArgs {
    /// The sequence: A moves ahead, B turns, C does both.
    #[arg(long, value_name = "NAME", value_parser = sequence)]
    pub sequence: String,
    /// STEP: the motion is so many times that of the sequence.
    #[arg(long, value_name = "S", default_value_t = 1.0, value_parser = above_zero, allow_negative_numbers = true)]
    pub step: f64,
    /// ROUND: levels of disparity in a pixel; 0 or inf: not rounded.
    #[arg(long, value_name = "N", default_value = "16", value_parser = levels, allow_negative_numbers = true)]
    pub round: Levels,
    /// Standard deviation of the noise of disparity, of differential flow and of tracks, in pixels.
    #[arg(long, value_name = "PX", default_value_t = 0.125, value_parser = not_negative, allow_negative_numbers = true)]
    pub std: f64,
    /// Tracked features of the discrete approach.
    #[arg(long, value_name = "N", default_value_t = 2048, value_parser = enough, allow_negative_numbers = true)]
    pub features: usize,
    #[command(flatten)]
    pub laboratory: LaboratoryArgs,
}

/// The six sweeps.
#[derive(Debug, Clone, Args)]
pub struct SensitivityArgs {
    /// The sequences; each is run once.
    #[arg(
        long = "sequence",
        value_name = "NAME,…",
        value_delimiter = ',',
        default_values = SEQUENCES,
        value_parser = sequence
    )]
    sequences: Vec<String>,
    #[command(flatten)]
    pub laboratory: LaboratoryArgs,
}

impl SensitivityArgs {
    /// The sequences in their order, each once.
    pub fn sequences(&self) -> Vec<String> {
        let asked = |name: &&str| self.sequences.iter().any(|typed| typed == name);
        SEQUENCES.into_iter().filter(asked).map(str::to_owned).collect()
    }
}

/// The paper's sequences.
const SEQUENCES: [&str; 3] = ["A", "B", "C"];

/// How near the bound.
#[derive(Debug, Clone, Args)]
pub struct EfficiencyArgs {
    /// The sequences: A, B and C in full, lab-A … lab-M at fewer settings [default: all].
    #[arg(long = "sequence", value_name = "NAME,…", value_delimiter = ',', value_parser = any_sequence)]
    pub sequences: Option<Vec<String>>,
    /// The methods, each with all its estimators [default: all].
    #[arg(long = "method", value_name = "NAME,…", value_delimiter = ',')]
    methods: Option<Vec<MethodArg>>,
    #[command(flatten)]
    pub laboratory: LaboratoryArgs,
}

impl EfficiencyArgs {
    /// The methods that were asked for.
    pub fn methods(&self) -> Option<Vec<Method>> {
        Some(self.methods.as_ref()?.iter().map(|&method| method.into()).collect())
    }
}

/// Section 7.2 on images.
#[derive(Debug, Clone, Args)]
pub struct RealArgs {
    /// Folder of a recording with true poses [default: the rendered sequences].
    pub source: Option<PathBuf>,
    /// The rendered sequences to use, such as lab-A,lab-E [default: all twelve].
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', conflicts_with = "source", value_parser = lab_name)]
    pub sequences: Option<Vec<String>>,
    /// Size of the rendered images.
    #[arg(long, value_name = "WxH", default_value = "320x240", conflicts_with = "source", value_parser = size)]
    pub size: (usize, usize),
    /// STEP: frames of a rendered sequence between two images of a draw.
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with = "source", allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub step: u32,
    /// ROUND: levels of disparity in a pixel.
    #[arg(long, value_name = "N", default_value_t = 16, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub round: u32,
    /// φ is estimated from every N-th pixel in both directions [default: 2 rendered, 4 of a recording].
    #[arg(long, value_name = "N", value_parser = positive)]
    pub sample: Option<usize>,
    /// Calibration of the recording to use in place of its own (any format that run takes).
    #[arg(long, value_name = "FILE", requires = "source")]
    pub calibration: Option<PathBuf>,
    /// First frame of the recording, counted from 0.
    #[arg(long, value_name = "N", default_value_t = 0, requires = "source")]
    pub start: usize,
    /// Number of frames of the recording to use.
    #[arg(long, value_name = "N", default_value_t = 50, requires = "source")]
    pub frames: usize,
    /// Use every N-th frame of the recording.
    #[arg(long, value_name = "N", default_value_t = 1, requires = "source", value_parser = positive)]
    pub stride: usize,
    #[command(flatten)]
    pub laboratory: LaboratoryArgs,
}

/// Random pairs through the pipeline.
#[derive(Debug, Clone, Args)]
pub struct ConsistencyArgs {
    /// The sequences, such as C,drive,lab-A [default: A, B, C, drive and lab-A … lab-M].
    #[arg(long = "sequence", alias = "sequences", value_name = "NAME,…", value_delimiter = ',', value_parser = any_name)]
    pub sequences: Option<Vec<String>>,
    /// Size of the rendered images.
    #[arg(long, value_name = "WxH", default_value = "320x240", value_parser = size)]
    pub size: (usize, usize),
    /// What takes the pairs: a stereo rig or a depth camera, which errs as its tolerance says.
    #[arg(long, value_name = "SENSOR", default_value = "stereo")]
    pub sensor: PairSensor,
    /// Tracks alone: φ, and no maps.
    #[arg(long)]
    pub sparse: bool,
    #[command(flatten)]
    pub laboratory: LaboratoryArgs,
}

/// What takes the pairs of the consistency study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PairSensor {
    /// Two cameras.
    Stereo,
    /// A Kinect held in a hand.
    Kinect,
    /// A time-of-flight camera held in a hand.
    TimeOfFlight,
    /// Rendered images and depth in half-precision numbers.
    Rendered,
}

/// Levels of disparity in a pixel; `None` where disparity is not rounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Levels(pub Option<u32>);

fn sequence(text: &str) -> Result<String, String> {
    let known = SEQUENCES.into_iter().find(|name| name.eq_ignore_ascii_case(text));
    known.map(str::to_owned).ok_or_else(|| "there are the sequences A, B and C".into())
}

fn number(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err("must be a number".into()),
    }
}

fn lab_name(text: &str) -> Result<String, String> {
    let known = Sequence::lab_names().find(|name| name.eq_ignore_ascii_case(text));
    let all = || Sequence::lab_names().collect::<Vec<_>>().join(", ");
    known.map(str::to_owned).ok_or_else(|| format!("must be of {}", all()))
}

fn any_name(text: &str) -> Result<String, String> {
    let known = Sequence::names().find(|name| name.eq_ignore_ascii_case(text));
    let all = || Sequence::names().collect::<Vec<_>>().join(", ");
    known.map(str::to_owned).ok_or_else(|| format!("must be of {}", all()))
}

fn any_sequence(text: &str) -> Result<String, String> {
    sequence(text).or_else(|_| lab_name(text)).map_err(|_| "there are A, B, C and lab-A to lab-M".into())
}

fn above_zero(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if v > 0.0 { Ok(v) } else { Err("must be above 0".into()) })
}

fn not_negative(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if v >= 0.0 { Ok(v) } else { Err("must not be negative".into()) })
}

fn levels(text: &str) -> Result<Levels, String> {
    match text {
        "0" | "inf" | "Inf" | "INF" | "∞" => Ok(Levels(None)),
        _ => match text.parse() {
            Ok(levels) => Ok(Levels(Some(levels))),
            Err(_) => Err("must be a whole number of levels, or 0 or inf for none".into()),
        },
    }
}

fn enough(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(n) if n >= LEAST_FEATURES => Ok(n),
        _ => Err(format!("must be a whole number of at least {LEAST_FEATURES}")),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Typed {
        #[command(flatten)]
        table: TableArgs,
    }

    #[derive(Debug, Parser)]
    struct TypedSweeps {
        #[command(flatten)]
        sweeps: SensitivityArgs,
    }

    fn typed(options: &str) -> Result<TableArgs, String> {
        let words = std::iter::once("table").chain(options.split_whitespace());
        Typed::try_parse_from(words).map(|t| t.table).map_err(|e| {
            assert_eq!(e.exit_code(), 2);
            e.to_string()
        })
    }

    #[test]
    fn one_setting_is_typed_as_in_the_paper() {
        let args =
            typed("--sequence c --step 2 --round inf --std 0 --features 128 --draws 40 --seed 3").unwrap();
        assert_eq!((args.sequence.as_str(), args.step, args.std, args.features), ("C", 2.0, 0.0, 128));
        assert_eq!((args.round, args.laboratory.draws, args.laboratory.seed), (Levels(None), Some(40), 3));
        let args = typed("--sequence A").unwrap();
        assert_eq!((args.step, args.round, args.std, args.features), (1.0, Levels(Some(16)), 0.125, 2048));
        assert_eq!(typed("--sequence A --round 0").unwrap().round, Levels(None));
        assert_eq!(args.laboratory.folder(Some("table")), Path::new("egomotion-out/study-table"));
        assert_eq!(args.laboratory.folder(None), Path::new("egomotion-out/study"));
    }

    #[derive(Debug, Parser)]
    struct TypedEfficiency {
        #[command(flatten)]
        efficiency: EfficiencyArgs,
    }

    #[test]
    fn methods_are_named_as_in_a_run() {
        let typed = |words: &[&str]| {
            TypedEfficiency::try_parse_from([&["efficiency"], words].concat()).map(|t| t.efficiency)
        };
        let args = typed(&["--sequence", "c,LAB-a", "--method", "ml,dcce"]).unwrap();
        assert_eq!(args.sequences.as_deref().unwrap(), ["C", "lab-A"]);
        assert_eq!(args.methods().unwrap(), [Method::Ml, Method::Dcce]);
        assert!(typed(&[]).unwrap().methods().is_none());
        assert_eq!(typed(&["--sequence", "D"]).unwrap_err().exit_code(), 2);
        assert_eq!(typed(&["--method", "mle"]).unwrap_err().exit_code(), 2);
    }

    #[test]
    fn sequences_are_swept_once_each() {
        let sequences = |words: &[&str]| {
            TypedSweeps::try_parse_from([&["sensitivity"], words].concat()).map(|t| t.sweeps.sequences())
        };
        assert_eq!(sequences(&[]).unwrap(), ["A", "B", "C"]);
        assert_eq!(sequences(&["--sequence", "c,A,C"]).unwrap(), ["A", "C"]);
        assert_eq!(sequences(&["--sequence", "A,D"]).unwrap_err().exit_code(), 2);
    }

    #[derive(Debug, Parser)]
    struct TypedReal {
        #[command(flatten)]
        real: RealArgs,
    }

    #[test]
    fn section_7_2_is_rendered_or_recorded() {
        let typed = |options: &str| {
            let words = std::iter::once("real").chain(options.split_whitespace());
            TypedReal::try_parse_from(words).map(|t| t.real).map_err(|e| e.to_string())
        };
        let args = typed("--sequences LAB-a,lab-M --size 640x480").unwrap();
        assert_eq!(args.sequences.unwrap(), ["lab-A", "lab-M"]);
        assert_eq!((args.size, args.step, args.round), ((640, 480), 1, 16));
        let args = typed("drive/06 --frames 20 --stride 2").unwrap();
        assert_eq!((args.source.unwrap().to_str(), args.frames, args.stride), (Some("drive/06"), 20, 2));
        for (options, words) in [
            ("--sequences lab-K", "must be of lab-A, lab-B"),
            ("--size 320", "give width x height"),
            ("--size 0x0", "'0x0' for '--size <WxH>'"),
            ("--step 0", "--step <N>"),
            ("--step -1", "'-1' for '--step <N>'"),
            ("--frames 5", "<SOURCE>"),
            ("06 --sequences lab-A", "cannot be used with"),
        ] {
            let error = typed(options).expect_err(options);
            assert!(error.contains(words), "{options}: {error}");
        }
    }

    #[test]
    fn what_has_no_meaning_is_refused_in_words() {
        for (options, words) in [
            ("", "--sequence <NAME>"),
            ("--sequence Q", "'Q' for '--sequence <NAME>': there are the sequences A, B and C"),
            ("--sequence A --step -1", "'-1' for '--step <S>': must be above 0"),
            ("--sequence A --step 0", "must be above 0"),
            ("--sequence A --step nan", "must be a number"),
            ("--sequence A --std -0.1", "'-0.1' for '--std <PX>': must not be negative"),
            ("--sequence A --std inf", "must be a number"),
            ("--sequence A --features 0", "'0' for '--features <N>': must be a whole number of at least 8"),
            ("--sequence A --features -5", "must be a whole number of at least 8"),
            ("--sequence A --round 2.5", "must be a whole number of levels, or 0 or inf for none"),
            ("--sequence A --round -4", "'-4' for '--round <N>'"),
            ("--sequence A --draws 0", "must be at least 1"),
            ("--sequence A --seed x", "'x' for '--seed <N>'"),
        ] {
            let error = typed(options).expect_err(options);
            assert!(error.contains(words), "{options}: {error}");
        }
    }
}
