//! Options of `study table`.

use clap::Args;
use egomotion_study::synthetic::LEAST_FEATURES;

use super::LaboratoryArgs;
use crate::args::values::{above_zero, not_negative, paper_sequence};

/// One setting alone.
#[derive(Debug, Clone, Args)]
pub struct TableArgs {
    /// The sequence: A moves ahead, B turns, C does both.
    #[arg(long, value_name = "NAME", value_parser = paper_sequence)]
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
    #[arg(long, value_name = "N", default_value_t = 2048, value_parser = features, allow_negative_numbers = true)]
    pub features: usize,
    #[command(flatten)]
    pub laboratory: LaboratoryArgs,
}

/// Levels of disparity in a pixel; `None` where disparity is not rounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Levels(pub Option<u32>);

fn levels(text: &str) -> Result<Levels, String> {
    match text {
        "0" | "inf" | "Inf" | "INF" | "∞" => Ok(Levels(None)),
        _ => match text.parse() {
            Ok(levels) => Ok(Levels(Some(levels))),
            Err(_) => Err("must be a whole number of levels, or 0 or inf for none".into()),
        },
    }
}

fn features(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(n) if n >= LEAST_FEATURES => Ok(n),
        _ => Err(format!("must be a whole number of at least {LEAST_FEATURES}")),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Typed {
        #[command(flatten)]
        table: TableArgs,
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
