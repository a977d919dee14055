//! Options of `study sensitivity`.

use clap::Args;

use super::LaboratoryArgs;
use crate::args::values::{PAPER_SEQUENCES, paper_sequence};

/// The six sweeps.
#[derive(Debug, Clone, Args)]
pub struct SensitivityArgs {
    /// The sequences; each is run once.
    #[arg(
        long = "sequence",
        value_name = "NAME,…",
        value_delimiter = ',',
        default_values = PAPER_SEQUENCES,
        value_parser = paper_sequence
    )]
    sequences: Vec<String>,
    #[command(flatten)]
    pub laboratory: LaboratoryArgs,
}

impl SensitivityArgs {
    /// The sequences in their order, each once.
    pub fn sequences(&self) -> Vec<String> {
        let asked = |name: &&str| self.sequences.iter().any(|typed| typed == name);
        PAPER_SEQUENCES.into_iter().filter(asked).map(str::to_owned).collect()
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct TypedSweeps {
        #[command(flatten)]
        sweeps: SensitivityArgs,
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
}
