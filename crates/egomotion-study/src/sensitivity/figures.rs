//! Figures 7, 8 and 9 in the paper's arrangement, and two of our own: by estimator, and by number of features.

use super::record::{SensitivityRecord, value_name};
use super::sweep::{Baseline, Sweep};
use crate::figure::Layout;
use crate::{Axis, Content, Figure, Line, Panel, Point, Series};

/// Least error that is drawn, in percent, millimetres or degrees; smaller ones are drawn there.
///
/// Exact answers leave rounding errors alone, which a logarithmic axis would stretch over many decades.
const LEAST_DRAWN: f64 = 1e-4;
/// What the baseline real holds, no unit: said under every figure of it.
const REAL_HELD: &str = "What is not swept is held at STEP 1, disparity rounded to 1/16 px, noise of 1/8 px in disparity, velocity \
     and tracks, 2048 features (discrete).";
/// How the equations of the lines of φ are solved, no unit.
const PHI_SOLVED: &str = "DCCE, DV and (22) by least squares with all rows alike, ML by maximum likelihood.";

/// Names of the contender that a line shows: approach, method, estimator.
type ContenderNames = [&'static str; 3];

/// A line of a panel: its name in the legend, its quantity, its contender.
type LineOf<'a> = (&'a str, &'a str, ContenderNames);

/// The paper's four methods, by least squares.
const PAPER: [(&str, ContenderNames); 4] = [
    ("DCCE DIFF", ["differential", "dcce", "ls"]),
    ("DV DIFF", ["differential", "dv", "ls"]),
    ("DCCE DISC", ["discrete", "dcce", "ls"]),
    ("DV DISC", ["discrete", "dv", "ls"]),
];
/// The lines beside the paper's four methods in figures of φ.
const BESIDE: [(&str, ContenderNames); 4] = [
    ("(22) DISC", ["discrete", "linear22", "ls"]),
    ("ML DIFF", ["differential", "ml", "ml"]),
    ("ML DISC", ["discrete", "ml", "ml"]),
    ("bound DISC", ["discrete", "bound", "bound"]),
];
/// The sweeps of Figures 7 to 9: heading, and the sweep of each approach, differential first.
const SWEEPS: [(&str, [Sweep; 2]); 4] = [
    ("amplitude of velocity", [Sweep::Step, Sweep::Step]),
    ("disparity resolution", [Sweep::Round, Sweep::Round]),
    ("noise in disparity", [Sweep::StdDisp, Sweep::StdDisp]),
    ("noise in velocity", [Sweep::StdVel, Sweep::StdTrack]),
];

/// All figures that the records have something for.
pub(super) fn all(sequences: &[String], records: &[SensitivityRecord]) -> Vec<Figure> {
    let mut figures = Vec::new();
    // The paper shows C.
    let ordered = sequences.iter().filter(|s| *s == "C").chain(sequences.iter().filter(|s| *s != "C"));
    for sequence in ordered {
        for baseline in [Baseline::Real, Baseline::Clean] {
            let plot = SweepPlots { records, sequence, baseline };
            figures.extend([plot.figure_7(), plot.figure_8(), plot.figure_9()]);
        }
        let plot = SweepPlots { records, sequence, baseline: Baseline::Real };
        figures.extend([plot.estimators(), plot.features()]);
    }
    figures.retain(Figure::has_a_line);
    figures
}

/// The records of one sequence at one baseline, from which its figures are drawn.
struct SweepPlots<'a> {
    records: &'a [SensitivityRecord],
    sequence: &'a str,
    baseline: Baseline,
}

impl SweepPlots<'_> {
    fn figure_7(&self) -> Figure {
        let panels = SWEEPS.iter().zip('a'..).map(|((name, sweeps), letter)| {
            let mut lines: Vec<LineOf<'_>> =
                PAPER.iter().map(|(name, contender)| (*name, "vz", *contender)).collect();
            lines.extend([
                ("ML DIFF, via φ", "vz_phi", ["differential", "ml", "ml"]),
                ("ML DISC, via φ", "vz_phi", ["discrete", "ml", "ml"]),
            ]);
            self.panel(&format!("({letter}) {name}"), "VZ", *sweeps, &lines)
        });
        let about = "error of VZ of each pixel";
        let solved = "DCCE and DV: each pixel's own value, which needs no estimator; ML: the rigid scene under maximum likelihood.";
        self.figure("07", (about, solved), 2, panels.collect())
    }

    fn figure_8(&self) -> Figure {
        let about = "error of tZ, ΩX and ΩY: velocity and resolution";
        self.figure("08", (about, PHI_SOLVED), 3, self.phi_panels(0))
    }

    fn figure_9(&self) -> Figure {
        self.figure("09", ("error of tZ, ΩX and ΩY: noise", PHI_SOLVED), 3, self.phi_panels(2))
    }

    fn figure(
        &self,
        number: &str,
        (about, solved): (&str, &str),
        columns: usize,
        panels: Vec<Panel>,
    ) -> Figure {
        let (sequence, baseline) = (self.sequence, self.baseline.name());
        let paper = if sequence == "C" {
            format!("Figure {}", number.trim_start_matches('0'))
        } else {
            format!("As Figure {}", number.trim_start_matches('0'))
        };
        let held = match self.baseline {
            Baseline::Clean => {
                "What is not swept is held at STEP 1, no rounding, no noise, 2048 features (discrete)."
            }
            Baseline::Real => REAL_HELD,
        };
        Figure {
            id: format!("figure-{number}-{sequence}-{baseline}"),
            title: format!("{paper}. Sequence {sequence}, baseline {baseline}: {about}"),
            caption: format!(
                "{held} {solved} Bars are ± 2 standard errors over the draws. Errors below {LEAST_DRAWN} are drawn there."
            ),
            columns,
            panels,
        }
    }

    /// tZ, ΩX and ΩY against two of [`SWEEPS`].
    fn phi_panels(&self, first: usize) -> Vec<Panel> {
        let quantities = [("tZ", "tz"), ("ΩX", "wx"), ("ΩY", "wy")];
        let of_sweep = SWEEPS[first..first + 2].iter().flat_map(|(name, sweeps)| {
            quantities.iter().map(move |(heading, quantity)| (name, sweeps, heading, *quantity))
        });
        of_sweep
            .zip('a'..)
            .map(|((name, sweeps, heading, quantity), letter)| {
                let lines: Vec<_> = PAPER
                    .iter()
                    .chain(&BESIDE)
                    .map(|(name, contender)| (*name, quantity, *contender))
                    .collect();
                self.panel(&format!("({letter}) {heading}, {name}"), heading, *sweeps, &lines)
            })
            .collect()
    }

    /// tZ by every estimator of a method, against the resolution of disparity.
    fn estimators(&self) -> Figure {
        let methods = [
            ("DCCE DIFF", "differential", "dcce"),
            ("DV DIFF", "differential", "dv"),
            ("joint DIFF", "differential", "joint"),
            ("DCCE DISC", "discrete", "dcce"),
            ("DV DISC", "discrete", "dv"),
            ("joint DISC", "discrete", "joint"),
            ("(22) DISC", "discrete", "linear22"),
            ("(22) rigid DISC", "discrete", "rigid"),
        ];
        let panels = methods.iter().zip('a'..).map(|((heading, approach, method), letter)| {
            let lines: Vec<LineOf<'_>> = vec![
                ("LS", "tz", [approach, method, "ls"]),
                ("LMedS", "tz", [approach, method, "lmeds"]),
                ("IRLS", "tz", [approach, method, "irls"]),
                ("ML", "tz", [approach, "ml", "ml"]),
                ("bound", "tz", [approach, "bound", "bound"]),
            ];
            self.panel(&format!("({letter}) {heading}"), "tZ", [Sweep::Round; 2], &lines)
        });
        let panels: Vec<Panel> = panels.collect();
        Figure {
            id: format!("estimators-{}", self.sequence),
            title: format!("Sequence {}: error of tZ by method and estimator", self.sequence),
            caption: format!(
                "{REAL_HELD} LS: least squares, LMedS: least median of squares, IRLS: Student's t with rows weighted by \
                 their variance, ML: maximum likelihood, bound: the Cramér–Rao bound."
            ),
            columns: 3,
            panels,
        }
    }

    fn features(&self) -> Figure {
        let quantities = [("VZ via φ", "vz_phi"), ("tZ", "tz"), ("ΩX", "wx"), ("ΩY", "wy")];
        let panels = quantities.iter().zip('a'..).map(|((heading, quantity), letter)| {
            let all = PAPER.iter().chain(&BESIDE).filter(|(_, contender)| contender[0] == "discrete");
            let lines: Vec<_> = all.map(|(name, contender)| (*name, *quantity, *contender)).collect();
            self.panel(&format!("({letter}) {heading}"), heading, [Sweep::Features; 2], &lines)
        });
        let panels: Vec<Panel> = panels.collect();
        Figure {
            id: format!("features-{}", self.sequence),
            title: format!("Sequence {}: error against the number of features", self.sequence),
            caption: format!(
                "Discrete approach. {REAL_HELD} {PHI_SOLVED} An error that does not fall with more features is bias."
            ),
            columns: 2,
            panels,
        }
    }

    fn panel(&self, title: &str, quantity: &str, sweeps: [Sweep; 2], lines: &[LineOf<'_>]) -> Panel {
        let relative = |(_, quantity, _): &LineOf<'_>| {
            self.records.iter().find(|r| r.errors.quantity == *quantity && r.sequence == self.sequence)
        };
        let found = lines.iter().find_map(relative).and_then(|r| r.errors.tally.statistics());
        let error = match (found.is_none_or(|f| f.erm_abs.is_some()), quantity.starts_with('Ω')) {
            (true, _) => "ERM (%)",
            (false, true) => "EAM (°)",
            (false, false) => "EAM (mm)",
        };
        let series = lines.iter().filter_map(|(name, quantity, contender)| {
            let points = self.points(sweeps[usize::from(contender[0] == "discrete")], quantity, *contender);
            let line = match contender {
                [_, "bound", _] => Line::Reference,
                ["discrete", ..] => Line::Dashed,
                _ => Line::Solid,
            };
            (!points.is_empty()).then(|| Series { name: (*name).to_owned(), line, points })
        });
        let content = Content::Plot {
            x: axis(sweeps),
            y: Axis::log(format!("{quantity}: {error}")),
            series: series.collect(),
        };
        Panel { title: title.to_owned(), content }
    }

    fn points(&self, sweep: Sweep, quantity: &str, contender: ContenderNames) -> Vec<Point> {
        let point = |(place, value): (usize, &f64)| {
            let value = value_name(*value);
            let record = self.records.iter().find(|r| {
                r.sequence == self.sequence
                    && r.baseline == self.baseline.name()
                    && r.sweep == sweep.name()
                    && r.value == value
                    && r.errors.quantity == quantity
                    && r.errors.contender() == contender
            })?;
            let found = record.errors.tally.statistics()?;
            let (x, y) = (place as f64, found.mean_error().max(LEAST_DRAWN));
            Some(Point { x, y, standard_error: found.standard_error })
        };
        sweep.values().iter().enumerate().filter_map(point).collect()
    }
}

/// The values of a sweep stand at equal distances, as in the paper.
fn axis(sweeps: [Sweep; 2]) -> Axis {
    let name = match sweeps {
        [Sweep::Step, _] => "STEP",
        [Sweep::Round, _] => "ROUND (levels per pixel)",
        [Sweep::StdDisp, _] => "STD_DISP (px)",
        [Sweep::Features, _] => "FEATURES",
        _ => "STD_VEL, STD_TRACK (px)",
    };
    let place = |v: &f64| match () {
        () if v.is_infinite() => "Inf.".to_owned(),
        () if *v > 0.0 && *v < 1.0 => format!("1/{}", v.recip()),
        () => v.to_string(),
    };
    Axis { name: name.to_owned(), layout: Layout::Places(sweeps[0].values().iter().map(place).collect()) }
}
