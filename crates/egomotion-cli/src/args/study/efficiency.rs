//! Options of `study efficiency`.

use clap::Args;
use egomotion::pipeline::Method;

use super::LaboratoryArgs;
use crate::args::choices::MethodArg;
use crate::args::values::study_sequence;

/// How near the bound.
#[derive(Debug, Clone, Args)]
pub struct EfficiencyArgs {
    /// The sequences: A, B and C in full, lab-A … lab-M at fewer settings [default: all].
    #[arg(long = "sequence", value_name = "NAME,…", value_delimiter = ',', value_parser = study_sequence)]
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

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

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
}
