//! Options of `study real`.

use std::path::PathBuf;

use clap::Args;

use super::LaboratoryArgs;
use crate::args::values::{lab_sequence, positive, size};

/// Section 7.2 on images.
#[derive(Debug, Clone, Args)]
pub struct RealArgs {
    /// Folder of a stereo recording [default: the rendered sequences].
    pub source: Option<PathBuf>,
    /// The rendered sequences to use, such as lab-A,lab-E [default: all twelve].
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', conflicts_with = "source", value_parser = lab_sequence)]
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

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

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
}
