//! How near the Cramér–Rao bound each method comes, how far from the truth, and whether its covariance is true.
//!
//! Points of the synthetic world with Gaussian noise of known σ, over noise levels and numbers of points; with
//! outliers, uniform or one moving body; and scenes that leave something undetermined.

pub mod degenerate;
mod figures;
mod measure;
pub mod setting;
pub mod site;
pub mod tally;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::contender::{Contender, approach_name};
use super::{Cell, Publication, Study, Table};
use crate::range::{COUNTS, OutOfRange, sequences, within};
use degenerate::{Report, SCENES};
use egomotion::pipeline::{Approach, Method};
use egomotion::sim::Sequence;
use setting::{Ends, Kind, Place, Score, Setting};

/// Components of φ, as in files.
pub const COMPONENTS: [&str; 6] = ["tx", "ty", "tz", "wx", "wy", "wz"];
/// σ of the noise, in pixels.
const NOISE_PX: [f64; 4] = [0.0625, 0.125, 0.25, 0.5];
/// Numbers of points.
const POINTS: [usize; 4] = [128, 512, 2048, 8192];
/// Shares of outliers.
const OUTLIERS: [f64; 6] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
/// What is held while other things are swept.
const HELD: Setting =
    Setting { noise_px: 0.125, ends: Ends::Both, points: 2048, outliers: 0.0, kind: Kind::Uniform };
/// Sequences of 7.1, which are studied in full; the others at fewer settings.
const IN_FULL: [&str; 3] = ["A", "B", "C"];

/// Columns of the study's files, with their headings.
const COLUMNS: [(&str, &str); 13] = [
    ("sequence", "sequence"),
    ("noise_px", "noise (px)"),
    ("points", "points"),
    ("outliers", "outliers"),
    ("approach", "approach"),
    ("method", "method"),
    ("estimator", "estimator"),
    ("component", "component"),
    ("variance_over_bound", "variance/bound"),
    ("bias_over_sigma", "bias/σ"),
    ("nees_over_6", "NEES/6"),
    ("coverage_95", "coverage of 95 %"),
    ("draws", "draws"),
];

/// Why a part gives no numbers.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum EfficiencyError {
    /// There is no such sequence.
    #[error("there is no sequence {0}")]
    Sequence(String),
}

/// The study of efficiency.
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

/// Every method.
pub const METHODS: [Method; 6] =
    [Method::Dcce, Method::Dv, Method::Joint, Method::Linear22, Method::Rigid, Method::Ml];

impl Default for Efficiency {
    fn default() -> Self {
        let sequences = IN_FULL.into_iter().chain(Sequence::lab_names()).map(str::to_owned).collect();
        Self { sequences, methods: METHODS.to_vec(), draws: 40, seed: 1 }
    }
}

/// What one contender showed at one setting, or in one degenerate scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Record {
    /// Errors in units of the bound.
    Errors {
        /// The sequence.
        sequence: String,
        /// The setting.
        setting: Setting,
        /// Who, and how wrong.
        score: Box<Score>,
    },
    /// What is reported observed.
    Observed {
        /// Name of the scene.
        scene: String,
        /// Who.
        contender: Contender,
        /// What.
        report: Report,
    },
}

/// A part of the study: settings of one sequence, or a degenerate scene.
enum Part<'a> {
    Settings(&'a str, &'static str, Vec<Setting>),
    Scene(usize),
}

impl Part<'_> {
    fn name(&self) -> String {
        match self {
            Self::Settings(sequence, what, _) => format!("{sequence}, {what}"),
            Self::Scene(k) => SCENES[*k].name.to_owned(),
        }
    }
}

/// Every noise with each of `points`.
fn grid(points: &[usize], ends: Ends) -> Vec<Setting> {
    let of = |&points: &usize| NOISE_PX.map(|noise_px| Setting { noise_px, points, ends, ..HELD });
    points.iter().flat_map(of).collect()
}

fn with_outliers(kind: Kind) -> Vec<Setting> {
    OUTLIERS.into_iter().map(|outliers| Setting { outliers, kind, ..HELD }).collect()
}

impl Efficiency {
    fn plan(&self) -> Vec<Part<'_>> {
        let mut parts = Vec::new();
        for name in &self.sequences {
            let mut add = |what, settings| parts.push(Part::Settings(name, what, settings));
            if IN_FULL.contains(&name.as_str()) {
                add("128 to 2048 points", grid(&POINTS[..3], Ends::Both));
                add("8192 points", grid(&POINTS[3..], Ends::Both));
                add("exact at t, 128 to 2048 points", grid(&POINTS[..3], Ends::Later));
                add("exact at t, 8192 points", grid(&POINTS[3..], Ends::Later));
                add("uniform outliers", with_outliers(Kind::Uniform));
                add("one moving body", with_outliers(Kind::Coherent));
            } else {
                let mut settings = grid(&[HELD.points], Ends::Both);
                let others = POINTS.into_iter().filter(|&points| points != HELD.points);
                settings.extend(others.map(|points| Setting { points, ..HELD }));
                add("noise and number of points", settings);
            }
        }
        parts.extend((0..SCENES.len()).map(Part::Scene));
        parts
    }

    fn contenders(&self, approaches: &[Approach]) -> Vec<Contender> {
        let all = approaches.iter().flat_map(|&approach| Contender::all(approach));
        all.filter(|contender| self.methods.contains(&contender.method)).collect()
    }
}

impl Study for Efficiency {
    type Record = Record;
    type Error = EfficiencyError;

    fn name(&self) -> &'static str {
        "efficiency"
    }

    fn check(&self) -> Result<(), OutOfRange> {
        sequences(&self.sequences)?;
        within("draws", self.draws, &COUNTS)
    }

    fn parts(&self) -> Vec<String> {
        self.plan().iter().map(Part::name).collect()
    }

    fn run(&self, part: usize) -> Result<Vec<Record>, EfficiencyError> {
        const BOTH: [Approach; 2] = [Approach::Differential, Approach::Discrete];
        match self.plan().get(part) {
            None => Ok(Vec::new()),
            Some(Part::Scene(k)) => {
                let contenders = self.contenders(&BOTH);
                let reports = SCENES[*k].reports(&contenders, self.draws, self.seed);
                let scene = SCENES[*k].name;
                let record =
                    |(contender, report)| Record::Observed { scene: scene.to_owned(), contender, report };
                Ok(contenders.iter().copied().zip(reports).map(record).collect())
            }
            Some(Part::Settings(name, _, settings)) => {
                let sequence = Sequence::named(name, None, Some(2), 1.0)
                    .ok_or_else(|| EfficiencyError::Sequence((*name).to_owned()))?;
                let places = Place::of(&sequence);
                let name = &sequence.name;
                let of = |setting: &Setting| {
                    // Pixels have exact places in the differential form anyway.
                    let approaches = if setting.ends == Ends::Both { &BOTH[..] } else { &BOTH[1..] };
                    let scores = setting.scores(&places, &self.contenders(approaches), self.draws, self.seed);
                    let setting = *setting;
                    scores.into_iter().map(move |score| Record::Errors {
                        sequence: name.clone(),
                        setting,
                        score: Box::new(score),
                    })
                };
                Ok(settings.iter().flat_map(of).collect())
            }
        }
    }

    fn publish(&self, records: &[Record]) -> Publication {
        let both = "Noise of the same σ on x, y and d at both ends; in the differential form on d and on every \
                    component of flow. Outliers lie anywhere within 16 px of the truth. Variance, bias and NEES \
                    are differences from those of an efficient estimate on the same draws, whose own are known.";
        let exact = "As efficiency.csv, where (x, y) is exact at t; discrete form.";
        let body = "As efficiency.csv, where the outliers are one body that moves .1 m a frame by itself.";
        Publication {
            title: "Efficiency: how near the Cramér–Rao bound, and how true the covariance".to_owned(),
            data: vec![
                errors("efficiency", "The efficiency study", both, records, |s| {
                    s.ends == Ends::Both && s.kind == Kind::Uniform
                }),
                errors("efficiency-exact", "Exact places at t", exact, records, |s| s.ends == Ends::Later),
                errors("efficiency-coherent", "One moving body", body, records, |s| s.kind == Kind::Coherent),
            ],
            tables: vec![overview(records), observed(records)],
            figures: figures::figures(&self.sequences, records),
        }
    }
}

/// Names of a contender.
fn who(contender: &Contender) -> [Cell; 3] {
    [approach_name(contender.approach), contender.method_name(), contender.estimator_name()].map(Cell::from)
}

fn errors(
    id: &str,
    title: &str,
    caption: &str,
    records: &[Record],
    belongs: impl Fn(&Setting) -> bool,
) -> Table {
    let mut table = Table::new(id, title, caption, &COLUMNS);
    for record in records {
        let Record::Errors { sequence, setting, score } = record else { continue };
        if !belongs(setting) {
            continue;
        }
        for (i, component) in COMPONENTS.into_iter().enumerate() {
            let figures = score.tally.figures(i);
            let mut row = vec![
                sequence.as_str().into(),
                setting.noise_px.into(),
                setting.points.into(),
                setting.outliers.into(),
            ];
            row.extend(who(&score.contender));
            row.push(component.into());
            row.extend([
                figures.map(|f| f.variance_over_bound).into(),
                figures.map(|f| f.bias_over_sigma).into(),
                figures.map(|f| f.nees_over_6).into(),
                figures.map(|f| f.coverage_95).into(),
                score.tally.draws.into(),
            ]);
            table.rows.push(row);
        }
    }
    table
}

/// The worst component of each contender at the held setting, and with a fifth and two fifths of outliers.
fn overview(records: &[Record]) -> Table {
    let mut table = Table::new(
        "overview",
        "The worst component of each contender",
        "1/8 px of noise, 2048 points; within 3 σ: answers within 3 of their own σ of the truth.",
        &[
            ("sequence", "sequence"),
            ("outliers", "outliers"),
            ("kind", "kind"),
            ("approach", "approach"),
            ("method", "method"),
            ("estimator", "estimator"),
            ("variance_over_bound", "variance/bound"),
            ("bias_over_sigma", "|bias|/σ"),
            ("nees_over_6", "NEES/6"),
            ("coverage_95", "coverage of 95 %"),
            ("within_3_sigma", "within 3 σ"),
            ("draws", "draws"),
            ("refused", "no answer"),
        ],
    );
    for record in records {
        let Record::Errors { sequence, setting, score } = record else { continue };
        let shown = [0.0, 0.2, 0.4].contains(&setting.outliers);
        if !shown || *setting != (Setting { outliers: setting.outliers, kind: setting.kind, ..HELD }) {
            continue;
        }
        let all: Vec<_> = (0..6).filter_map(|i| score.tally.figures(i)).collect();
        let most = |f: fn(&tally::Figures) -> f64| all.iter().map(f).reduce(f64::max);
        let least = |f: fn(&tally::Figures) -> f64| all.iter().map(f).reduce(f64::min);
        let kind = match (setting.outliers > 0.0, setting.kind) {
            (false, _) => "",
            (true, Kind::Uniform) => "uniform",
            (true, Kind::Coherent) => "one body",
        };
        let mut row = vec![sequence.as_str().into(), setting.outliers.into(), kind.into()];
        row.extend(who(&score.contender));
        row.extend([
            most(|f| f.variance_over_bound).into(),
            most(|f| f.bias_over_sigma.abs()).into(),
            all.first().map(|f| f.nees_over_6).into(),
            least(|f| f.coverage_95).into(),
            least(|f| f.within_3_sigma).into(),
            score.tally.draws.into(),
            score.tally.refused.into(),
        ]);
        table.rows.push(row);
    }
    table
}

/// What is reported observed in the degenerate scenes.
fn observed(records: &[Record]) -> Table {
    let mut columns: Vec<(&str, &str)> =
        vec![("scene", "scene"), ("approach", "approach"), ("method", "method"), ("estimator", "estimator")];
    columns.extend(
        COMPONENTS.iter().zip(["tX", "tY", "tZ", "ΩX", "ΩY", "ΩZ"]).map(|(name, heading)| (*name, heading)),
    );
    columns.extend([("within_3_sigma", "within 3 σ"), ("answered", "answered"), ("draws", "draws")]);
    let mut table = Table::new(
        "efficiency-degenerate",
        "What is reported observed",
        "Share of the draws in which each component is reported observed; of those, the share within 3 of their own σ \
         of the truth. 1/8 px of noise, places exact at t.",
        &columns,
    );
    for record in records {
        let Record::Observed { scene, contender, report } = record else { continue };
        let mut row = vec![scene.as_str().into()];
        row.extend(who(contender));
        let share = |count: usize, of: usize| Cell::from((of > 0).then(|| count as f64 / of as f64));
        row.extend(report.observed.map(|count| share(count, report.draws)));
        row.push(share(report.within_3.iter().sum(), report.observed.iter().sum()));
        row.extend([report.answered.into(), report.draws.into()]);
        table.rows.push(row);
    }
    table
}
