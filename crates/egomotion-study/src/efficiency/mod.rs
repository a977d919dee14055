//! How near each estimator comes to the Cramér–Rao bound, how biased it is, and whether its covariance is true.
//!
//! The draws are exact points of the synthetic world (7.1) with Gaussian noise of known σ. The [`Factors`] are the
//! noise, the number of points and the outliers, uniform ones or one moving body. Beside them stand degenerate scenes
//! ([`SCENES`]), which leave something undetermined. The paper has no such study: it extends sections 6 and 7.1.

mod degenerate;
mod exact_point;
mod factors;
mod figures;
mod measurements;
mod solver;
mod tables;
mod tally;
mod trial;

use serde::{Deserialize, Serialize};

pub use degenerate::{DegenerateScene, ObservedCounts, SCENES};
pub use factors::{Ends, Factors, OutlierKind};
pub use tally::{EfficiencyStatistics, EfficiencyTally};
pub use trial::{ContenderErrors, PosePoints};

use crate::range::{COUNTS, OutOfRange, sequences, within};
use crate::sequences::{NoSequence, PAPER_SEQUENCES, owned, required};
use crate::synthetic::{APPROACHES, Contender};
use crate::{Publication, Study};
use egomotion::pipeline::{Approach, Method};
use egomotion::sim::Sequence;
use factors::{BASELINE, POINTS, noise_by_points, outlier_shares};

/// Every method, in the order of the paper, maximum likelihood last.
const METHODS: [Method; 6] =
    [Method::Dcce, Method::Dv, Method::Joint, Method::Linear22, Method::Rigid, Method::Ml];

/// `study efficiency`: every estimator against the Cramér–Rao bound.
///
/// Sequences A, B and C are studied at every level of the factors, the others at fewer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Efficiency {
    /// Sequences: A, B, C, lab-A … lab-M.
    pub sequences: Vec<String>,
    /// Methods, each with all its estimators and in both approaches.
    pub methods: Vec<Method>,
    /// Draws of each setting, over the five reference poses in turn.
    pub draws: usize,
    /// Seed of the draws.
    pub seed: u64,
}

impl Default for Efficiency {
    fn default() -> Self {
        let sequences = owned(PAPER_SEQUENCES.into_iter().chain(Sequence::lab_names()));
        Self { sequences, methods: METHODS.to_vec(), draws: 40, seed: 1 }
    }
}

/// The errors of one contender at one setting, or its reports in one degenerate scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum EfficiencyRecord {
    /// Errors in units of the bound.
    Errors {
        /// Name of the sequence.
        sequence: String,
        /// The setting.
        #[serde(rename = "setting")]
        factors: Factors,
        /// The contender and its errors.
        #[serde(rename = "score")]
        errors: Box<ContenderErrors>,
    },
    /// How often components are reported as observed.
    Observed {
        /// Name of the scene.
        scene: String,
        /// The contender.
        contender: Contender,
        /// Its reports.
        #[serde(rename = "report")]
        counts: ObservedCounts,
    },
}

/// A part of the study: settings of one sequence, or a degenerate scene.
enum EfficiencyPart<'a> {
    Settings { sequence: &'a str, about: &'static str, settings: Vec<Factors> },
    Scene(&'static DegenerateScene),
}

impl EfficiencyPart<'_> {
    fn name(&self) -> String {
        match self {
            Self::Settings { sequence, about, .. } => format!("{sequence}, {about}"),
            Self::Scene(scene) => scene.name.to_owned(),
        }
    }
}

/// The settings of each part of one of the paper's sequences, with the part's name.
fn all_settings() -> [(&'static str, Vec<Factors>); 6] {
    let (fewer, most) = POINTS.split_at(3);
    [
        ("128 to 2048 points", noise_by_points(fewer, Ends::Both)),
        ("8192 points", noise_by_points(most, Ends::Both)),
        ("exact at t, 128 to 2048 points", noise_by_points(fewer, Ends::Later)),
        ("exact at t, 8192 points", noise_by_points(most, Ends::Later)),
        ("uniform outliers", outlier_shares(OutlierKind::Uniform)),
        ("one moving body", outlier_shares(OutlierKind::Coherent)),
    ]
}

/// The settings of any other sequence: noise and number of points, each swept alone.
fn fewer_settings() -> Vec<Factors> {
    let others = POINTS.into_iter().filter(|&points| points != BASELINE.points);
    let mut settings = noise_by_points(&[BASELINE.points], Ends::Both);
    settings.extend(others.map(|points| Factors { points, ..BASELINE }));
    settings
}

impl Efficiency {
    fn plan(&self) -> Vec<EfficiencyPart<'_>> {
        let mut parts = Vec::new();
        for sequence in &self.sequences {
            let mut add =
                |(about, settings)| parts.push(EfficiencyPart::Settings { sequence, about, settings });
            if PAPER_SEQUENCES.contains(&sequence.as_str()) {
                all_settings().into_iter().for_each(add);
            } else {
                add(("noise and number of points", fewer_settings()));
            }
        }
        parts.extend(SCENES.iter().map(EfficiencyPart::Scene));
        parts
    }

    fn contenders(&self, approaches: &[Approach]) -> Vec<Contender> {
        let all = approaches.iter().flat_map(|&approach| Contender::all(approach));
        all.filter(|contender| self.methods.contains(&contender.method)).collect()
    }

    fn at_settings(&self, name: &str, settings: &[Factors]) -> Result<Vec<EfficiencyRecord>, NoSequence> {
        let sequence = required(name, None)?;
        let poses = PosePoints::of(&sequence);
        let name = &sequence.name;
        let of = |factors: &Factors| {
            // Pixels have exact places in the differential form anyway.
            let approaches = if factors.ends == Ends::Both { &APPROACHES[..] } else { &APPROACHES[1..] };
            let errors = factors.errors(&poses, &self.contenders(approaches), self.draws, self.seed);
            let factors = *factors;
            errors.into_iter().map(move |errors| EfficiencyRecord::Errors {
                sequence: name.clone(),
                factors,
                errors: Box::new(errors),
            })
        };
        Ok(settings.iter().flat_map(of).collect())
    }

    fn in_scene(&self, scene: &DegenerateScene) -> Vec<EfficiencyRecord> {
        let contenders = self.contenders(&APPROACHES);
        let counts = scene.observed(&contenders, self.draws, self.seed);
        let record = |(contender, counts)| EfficiencyRecord::Observed {
            scene: scene.name.to_owned(),
            contender,
            counts,
        };
        contenders.iter().copied().zip(counts).map(record).collect()
    }
}

impl Study for Efficiency {
    type Record = EfficiencyRecord;
    type Error = NoSequence;

    fn name(&self) -> &'static str {
        "efficiency"
    }

    fn check(&self) -> Result<(), OutOfRange> {
        sequences(&self.sequences)?;
        within("draws", self.draws, &COUNTS)
    }

    fn parts(&self) -> Vec<String> {
        self.plan().iter().map(EfficiencyPart::name).collect()
    }

    fn run(&self, part: usize) -> Result<Vec<EfficiencyRecord>, NoSequence> {
        match self.plan().get(part) {
            None => Ok(Vec::new()),
            Some(EfficiencyPart::Scene(scene)) => Ok(self.in_scene(scene)),
            Some(EfficiencyPart::Settings { sequence, settings, .. }) => self.at_settings(sequence, settings),
        }
    }

    fn publish(&self, records: &[EfficiencyRecord]) -> Publication {
        let both = "Noise of the same σ on x, y and d at both ends; in the differential form on d and on every \
                    component of flow. Outliers lie anywhere within 16 px of the truth. Variance, bias and NEES \
                    are differences from those of an efficient estimate on the same draws, whose own are known.";
        let exact = "As efficiency.csv, where (x, y) is exact at t; discrete form.";
        let body = "As efficiency.csv, where the outliers are one body that moves 0.1 m a frame by itself.";
        Publication {
            title: "Efficiency: how near the Cramér–Rao bound, and how true the covariance".to_owned(),
            data: vec![
                tables::errors("efficiency", "The efficiency study", both, records, |s| {
                    s.ends == Ends::Both && s.outlier_kind == OutlierKind::Uniform
                }),
                tables::errors("efficiency-exact", "Exact places at t", exact, records, |s| {
                    s.ends == Ends::Later
                }),
                tables::errors("efficiency-coherent", "One moving body", body, records, |s| {
                    s.outlier_kind == OutlierKind::Coherent
                }),
            ],
            tables: vec![tables::overview(records), tables::observed(records)],
            figures: figures::all(&self.sequences, records),
        }
    }
}
