//! Section 5 of the paper: how uncertain VZ is, by its formulas and by drawing.
//!
//! [`exact`] measurements of a pixel → [`formula`]: estimators, inputs and predicted variances →
//! [`monte_carlo`] → [`trial`]: cases at random places; beside them (51) in [`resolution`], (52) in
//! [`rounding`], (53) in [`coefficients`], DCCE against DV in [`comparison`], and the [`maps`].

pub mod cases;
pub mod coefficients;
pub mod comparison;
pub mod exact;
pub mod formula;
pub mod maps;
pub mod monte_carlo;
pub mod resolution;
pub mod rounding;
pub mod trial;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Publication, Study};
use crate::range::{COUNTS, OutOfRange, size, within};
use coefficients::Coefficients;
use comparison::Comparison;
use egomotion::sim::Sequence;
use formula::Family;
use monte_carlo::mixed;
use trial::Case;

/// The paper's sequences of its synthetic world.
const SEQUENCES: [&str; 3] = ["A", "B", "C"];
/// STEP of the sweeps: multiples of a sequence's motion.
const STEPS: [f64; 6] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0];
/// ROUND of the sweeps: disparity levels per pixel.
const LEVELS: [usize; 4] = [4, 8, 16, 32];

/// `study uncertainty`: the table under (51), Figures 3 to 6, and each variance formula against draws.
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

/// What a part finds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Finding {
    /// A formula against draws.
    Case(Box<Case>),
    /// DCCE against DV over an image.
    Comparison(Comparison),
    /// The coefficients of (53) at one depth of the sphere and one speed.
    Coefficients(Coefficients),
}

/// One part of the study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Formula(Family, &'static str),
    Comparison(&'static str),
    Coefficients,
}

impl Part {
    fn all() -> Vec<Self> {
        let formulas = Family::ALL.iter().flat_map(|&family| SEQUENCES.map(|s| Self::Formula(family, s)));
        formulas.chain(SEQUENCES.map(Self::Comparison)).chain([Self::Coefficients]).collect()
    }

    fn name(self) -> String {
        match self {
            Self::Formula(family, sequence) => format!("{}, sequence {sequence}", family.name()),
            Self::Comparison(sequence) => format!("DCCE against DV, sequence {sequence}"),
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
    type Record = Finding;
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
        Part::all().into_iter().map(Part::name).collect()
    }

    fn run(&self, part: usize) -> Result<Vec<Finding>, UncertaintyError> {
        if self.draws < 2 {
            return Err(UncertaintyError::Draws(self.draws));
        }
        let seed = mixed(&[self.seed, part as u64]);
        Ok(match *Part::all().get(part).ok_or(UncertaintyError::Part(part))? {
            Part::Formula(family, name) => {
                let cases = trial::cases(family, &self.sequence(name)?, self.settings, self.draws, seed);
                cases.into_iter().map(|case| Finding::Case(Box::new(case))).collect()
            }
            Part::Comparison(name) => {
                comparison::over_steps(&self.sequence(name)?).into_iter().map(Finding::Comparison).collect()
            }
            Part::Coefficients => {
                let sequence = self.sequence("C")?;
                let found = [coefficients::over_depth(&sequence), coefficients::over_speed(&sequence)];
                found.into_iter().flatten().map(Finding::Coefficients).collect()
            }
        })
    }

    fn publish(&self, records: &[Finding]) -> Publication {
        let (mut drawn, mut compared, mut weights) = (Vec::new(), Vec::new(), Vec::new());
        for record in records {
            match record {
                Finding::Case(case) => drawn.push(&**case),
                Finding::Comparison(comparison) => compared.push(comparison),
                Finding::Coefficients(coefficients) => weights.push(coefficients),
            }
        }
        let mut published = Publication {
            title: "Uncertainty of depth velocity: section 5 of the paper".to_owned(),
            data: vec![cases::data(&drawn), coefficients::data(&weights)],
            tables: vec![
                resolution::table(),
                cases::summary(&drawn),
                cases::rounding(&drawn),
                comparison::table(&compared),
                coefficients::table(&weights),
            ],
            figures: vec![resolution::figure()],
        };
        if let Ok(sequence) = self.sequence("C") {
            published.figures.extend([maps::figure_4(&sequence), maps::figure_5(&sequence)]);
        }
        let drawings = [coefficients::figure(&weights), cases::figure(&drawn), cases::product_figure(&drawn)];
        published.figures.extend(drawings);
        published
    }
}
