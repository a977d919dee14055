//! Variance over the bound by method, by noise and number of points, and by outliers.

use super::factors::{BASELINE, Factors, NOISE_PX, OutlierKind, POINTS, outlier_shares};
use super::{ContenderErrors, EfficiencyRecord};
use crate::components::NAMES;
use crate::synthetic::{APPROACHES, Contender, approach_name};
use crate::{Axis, Content, Figure, Line, Panel, Point, Series};
use egomotion::pipeline::{Approach, EstimatorKind, Method};

/// The contenders that figures show, each with the name of its line.
const CONTENDERS: [(&str, Method, EstimatorKind); 9] = [
    ("DCCE, LS", Method::Dcce, EstimatorKind::Ls),
    ("DCCE, LMedS", Method::Dcce, EstimatorKind::Lmeds),
    ("DV, LS", Method::Dv, EstimatorKind::Ls),
    ("DV, LMedS", Method::Dv, EstimatorKind::Lmeds),
    ("joint, LS", Method::Joint, EstimatorKind::Ls),
    ("joint, IRLS", Method::Joint, EstimatorKind::Irls),
    ("(22), LS", Method::Linear22, EstimatorKind::Ls),
    ("(22) rigid, IRLS", Method::Rigid, EstimatorKind::Irls),
    ("ML", Method::Ml, EstimatorKind::Irls),
];

/// Figures of one sequence, C where it is among them; the files hold every other.
pub(super) fn all(sequences: &[String], records: &[EfficiencyRecord]) -> Vec<Figure> {
    let Some(sequence) = sequences.iter().find(|name| *name == "C").or(sequences.first()) else {
        return Vec::new();
    };
    let plots = EfficiencyPlots { sequence, records };
    let outliers = [OutlierKind::Uniform, OutlierKind::Coherent].map(|kind| plots.by_outliers(kind));
    let mut figures: Vec<Figure> =
        [plots.by_method(), plots.by_noise()].into_iter().chain(outliers).collect();
    figures.retain(Figure::has_a_line);
    figures
}

/// The records of one sequence, from which its figures are drawn.
struct EfficiencyPlots<'a> {
    sequence: &'a str,
    records: &'a [EfficiencyRecord],
}

impl EfficiencyPlots<'_> {
    fn errors(&self, at: &Factors, contender: &Contender) -> Option<&ContenderErrors> {
        self.records.iter().find_map(|record| match record {
            EfficiencyRecord::Errors { sequence, factors, errors } => {
                let same = sequence == self.sequence && at == factors && errors.contender == *contender;
                same.then_some(errors.as_ref())
            }
            EfficiencyRecord::Observed { .. } => None,
        })
    }

    /// Variance over the bound of one component of φ, or of the worst one.
    fn point(
        &self,
        x: usize,
        factors: &Factors,
        contender: &Contender,
        component: Option<usize>,
    ) -> Option<Point> {
        let tally = &self.errors(factors, contender)?.tally;
        let of = |i: usize| tally.statistics(i).map(|f| (f.variance_over_bound, f.standard_error));
        let (y, standard_error) = match component {
            Some(i) => of(i)?,
            None => (0..6).filter_map(of).reduce(|a, b| if b.0 > a.0 { b } else { a })?,
        };
        Some(Point { x: x as f64, y, standard_error: Some(standard_error) })
    }

    /// The worst component of each contender, a line each: `settings` from left to right.
    fn panel(&self, title: String, x: Axis, approach: Approach, settings: &[Factors]) -> Panel {
        let series = CONTENDERS.into_iter().filter_map(|(name, method, estimator)| {
            let contender = Contender { approach, method, estimator };
            let point = |(x, factors)| self.point(x, factors, &contender, None);
            let points: Vec<Point> = settings.iter().enumerate().filter_map(point).collect();
            let line = if method == Method::Ml { Line::Solid } else { Line::Dashed };
            (!points.is_empty()).then(|| Series { name: name.to_owned(), line, points })
        });
        let mut series: Vec<Series> = series.collect();
        if !series.is_empty() {
            series.push(bound(settings.len()));
        }
        Panel { title, content: Content::Plot { x, y: Axis::log("variance/bound"), series } }
    }

    fn figure(&self, stem: &str, about: &str, caption: &str, panels: Vec<Panel>) -> Figure {
        Figure {
            id: format!("{stem}-{}", self.sequence),
            title: format!("Sequence {}: {about}", self.sequence),
            caption: caption.to_owned(),
            columns: 2,
            panels,
        }
    }

    /// Each component by every contender at the baseline.
    fn by_method(&self) -> Figure {
        let panels = APPROACHES.map(|approach| {
            let series = CONTENDERS.into_iter().filter_map(|(label, method, estimator)| {
                let contender = Contender { approach, method, estimator };
                let points: Vec<Point> =
                    (0..6).filter_map(|i| self.point(i, &BASELINE, &contender, Some(i))).collect();
                (!points.is_empty()).then(|| Series { name: label.to_owned(), line: Line::Marks, points })
            });
            let mut series: Vec<Series> = series.collect();
            if !series.is_empty() {
                series.push(bound(6));
            }
            let x = Axis::places("component", NAMES);
            Panel {
                title: approach_name(approach).to_owned(),
                content: Content::Plot { x, y: Axis::log("variance/bound"), series },
            }
        });
        let caption = "1/8 px of noise at both ends, 2048 points, no outliers. 1 is the Cramér–Rao bound. After the comma stands how \
                       the equations are solved.";
        self.figure("efficiency-method", "variance over the bound, by method", caption, panels.into())
    }

    fn by_noise(&self) -> Figure {
        let panels = APPROACHES.into_iter().flat_map(|approach| {
            let name = approach_name(approach);
            let noise = NOISE_PX.map(|noise_px| Factors { noise_px, ..BASELINE });
            let places = NOISE_PX.map(|noise| format!("1/{}", noise.recip()));
            let points = POINTS.map(|points| Factors { points, ..BASELINE });
            [
                self.panel(format!("{name}, noise"), Axis::places("σ (px)", places), approach, &noise),
                self.panel(format!("{name}, points"), Axis::places("points", POINTS), approach, &points),
            ]
        });
        let caption = "The worst component of each contender. What is not swept is held at 1/8 px of noise at both ends, 2048 points and no \
             outliers. After the comma stands how the equations are solved.";
        self.figure(
            "efficiency-noise",
            "variance over the bound, by noise and points",
            caption,
            panels.collect(),
        )
    }

    fn by_outliers(&self, kind: OutlierKind) -> Figure {
        let (stem, what) = match kind {
            OutlierKind::Uniform => ("efficiency-uniform", "uniform outliers"),
            OutlierKind::Coherent => ("efficiency-coherent", "one moving body"),
        };
        let settings: Vec<Factors> = [BASELINE].into_iter().chain(outlier_shares(kind)).collect();
        let panels = APPROACHES.map(|approach| {
            let places = settings.iter().map(|factors| format!("{:.0} %", 100.0 * factors.outliers));
            self.panel(
                approach_name(approach).to_owned(),
                Axis::places("outliers", places),
                approach,
                &settings,
            )
        });
        let caption = "The worst component of each contender, in units of the bound of the inliers alone; 1/8 px of noise at both \
                       ends, 2048 points. After the comma stands how the equations are solved.";
        self.figure(stem, &format!("variance over the bound, {what}"), caption, panels.into())
    }
}

/// The line of the bound under so many places.
fn bound(places: usize) -> Series {
    Series::through("bound", Line::Reference, (0..places).map(|x| (x as f64, 1.0)))
}
