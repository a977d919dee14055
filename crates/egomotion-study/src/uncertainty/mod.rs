//! Section 5: how uncertain VZ is, by the paper's formulas and by draws.
//!
//! A [`VarianceCase`] sets the variance that a formula predicts beside the variance over draws, at a place drawn at
//! random. Beside the cases stand the table under (51), DCCE against DV ([`VarianceRatios`]) and the [`Coefficients`]
//! of (53); figures 3 to 6 are the paper's.

mod case;
mod coefficients;
mod formula;
mod maps;
mod monte_carlo;
mod pixel;
mod ratios;
mod resolution;
mod rounding;
mod sampling;
mod variances;

use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use case::{SampledPlace, VarianceCase};
pub use coefficients::{Coefficients, Swept};
pub use formula::{Family, FormulaKind, Inputs};
pub use ratios::{QuantileRange, VarianceRatios};

use crate::range::{COUNTS, OutOfRange, size, within};
use crate::sequences::PAPER_SEQUENCES;
use crate::{Publication, Study};
use egomotion::sim::Sequence;
use monte_carlo::mixed_seed;

/// `study uncertainty`: section 5, the table under (51), Figures 3 to 6, and each variance formula against draws.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Uncertainty {
    /// Draws of each case, at least two.
    pub draws: usize,
    /// Places, each with its noise, for each formula, sequence and multiple of the motion.
    pub settings: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Image size (width, height), in pixels; the focal length goes with the width.
    pub size_px: (usize, usize),
}

impl Default for Uncertainty {
    fn default() -> Self {
        Self { draws: 200_000, settings: 8, seed: 2003, size_px: (320, 240) }
    }
}

/// Why the study cannot be run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum UncertaintyError {
    /// The image has no inside.
    #[error("image size {0}x{1} is too small: it takes at least 3x3 pixels")]
    Size(usize, usize),
    /// A variance takes two draws.
    #[error("{0} draws have no variance: it takes at least 2")]
    Draws(usize),
    /// There is no such part.
    #[error("there is no part {0}")]
    Part(usize),
}

/// A finding of one part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum UncertaintyRecord {
    /// A formula against draws.
    Case(Box<VarianceCase>),
    /// DCCE against DV over an image.
    #[serde(rename = "Comparison")]
    Ratios(VarianceRatios),
    /// The coefficients of (53) at one depth of the sphere and one speed.
    Coefficients(Coefficients),
}

/// One part of the study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum UncertaintyPart {
    Formula(Family, &'static str),
    Ratios(&'static str),
    Coefficients,
}

impl UncertaintyPart {
    fn all() -> Vec<Self> {
        let formulas =
            Family::ALL.iter().flat_map(|&family| PAPER_SEQUENCES.map(|name| Self::Formula(family, name)));
        formulas.chain(PAPER_SEQUENCES.map(Self::Ratios)).chain([Self::Coefficients]).collect()
    }

    fn name(self) -> String {
        match self {
            Self::Formula(family, sequence) => format!("{}, sequence {sequence}", family.name()),
            Self::Ratios(sequence) => format!("DCCE against DV, sequence {sequence}"),
            Self::Coefficients => "coefficients of (53)".to_owned(),
        }
    }
}

impl Uncertainty {
    /// A sequence at the study's image size, of one motion.
    fn sequence(&self, name: &str) -> Result<Sequence, UncertaintyError> {
        let (width, height) = self.size_px;
        let inside = (width.min(height) >= 3).then_some(self.size_px);
        inside
            .and_then(|size| Sequence::named(name, Some(size), Some(2), 1.0))
            .ok_or(UncertaintyError::Size(width, height))
    }
}

impl Study for Uncertainty {
    type Record = UncertaintyRecord;
    type Error = UncertaintyError;

    fn name(&self) -> &'static str {
        "uncertainty"
    }

    fn check(&self) -> Result<(), OutOfRange> {
        size(self.size_px.0, self.size_px.1)?;
        within("draws", self.draws, &(2..=*COUNTS.end()))?;
        within("settings", self.settings, &COUNTS)
    }

    fn parts(&self) -> Vec<String> {
        UncertaintyPart::all().into_iter().map(UncertaintyPart::name).collect()
    }

    fn run(&self, part: usize) -> Result<Vec<UncertaintyRecord>, UncertaintyError> {
        if self.draws < 2 {
            return Err(UncertaintyError::Draws(self.draws));
        }
        let seed = mixed_seed(&[self.seed, part as u64]);
        Ok(match *UncertaintyPart::all().get(part).ok_or(UncertaintyError::Part(part))? {
            UncertaintyPart::Formula(family, name) => {
                let cases = sampling::cases(family, &self.sequence(name)?, self.settings, self.draws, seed);
                cases.into_iter().map(|case| UncertaintyRecord::Case(Box::new(case))).collect()
            }
            UncertaintyPart::Ratios(name) => {
                ratios::over_steps(&self.sequence(name)?).into_iter().map(UncertaintyRecord::Ratios).collect()
            }
            UncertaintyPart::Coefficients => {
                let sequence = self.sequence("C")?;
                let found = [coefficients::over_depth(&sequence), coefficients::over_speed(&sequence)];
                found.into_iter().flatten().map(UncertaintyRecord::Coefficients).collect()
            }
        })
    }

    fn publish(&self, records: &[UncertaintyRecord]) -> Publication {
        let (mut drawn, mut compared, mut weights) = (Vec::new(), Vec::new(), Vec::new());
        for record in records {
            match record {
                UncertaintyRecord::Case(case) => drawn.push(&**case),
                UncertaintyRecord::Ratios(ratios) => compared.push(ratios),
                UncertaintyRecord::Coefficients(coefficients) => weights.push(coefficients),
            }
        }
        let mut publication = Publication {
            title: "Uncertainty of depth velocity: section 5 of the paper".to_owned(),
            data: vec![variances::data(&drawn), coefficients::data(&weights)],
            tables: vec![
                resolution::table(),
                variances::summary(&drawn),
                variances::rounding(&drawn),
                ratios::table(&compared),
                coefficients::table(&weights),
            ],
            figures: vec![resolution::figure()],
        };
        if let Ok(sequence) = self.sequence("C") {
            publication.figures.extend([maps::figure_4(&sequence), maps::figure_5(&sequence)]);
        }
        let drawings =
            [coefficients::figure(&weights), variances::figure(&drawn), variances::product_figure(&drawn)];
        publication.figures.extend(drawings);
        publication
    }
}
