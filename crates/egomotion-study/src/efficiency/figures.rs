//! Variance over the bound by method, by noise and number of points, and by outliers.

use super::setting::{Ends, Kind, Score, Setting};
use super::{COMPONENTS, HELD, NOISE_PX, OUTLIERS, POINTS, Record};
use crate::contender::Contender;
use crate::{Axis, Content, Figure, Line, Panel, Point, Series};
use egomotion::pipeline::{Approach, EstimatorKind, Method};

/// Lines of the figures.
const CONTENDERS: [(&str, Method, EstimatorKind); 9] = [
    ("DCCE, LS", Method::Dcce, EstimatorKind::Ls),
    ("DCCE, LMedS", Method::Dcce, EstimatorKind::Lmeds),
    ("DV, LS", Method::Dv, EstimatorKind::Ls),
    ("DV, LMedS", Method::Dv, EstimatorKind::Lmeds),
    ("joint, LS", Method::Joint, EstimatorKind::Ls),
    ("joint, IRLS", Method::Joint, EstimatorKind::Irls),
    ("(22), LS", Method::Linear22, EstimatorKind::Ls),
    ("rigid, IRLS", Method::Rigid, EstimatorKind::Irls),
    ("ML", Method::Ml, EstimatorKind::Irls),
];
const APPROACHES: [(&str, Approach); 2] =
    [("differential", Approach::Differential), ("discrete", Approach::Discrete)];

/// Figures of one sequence, C where it is among them; the files hold every other.
pub(super) fn figures(sequences: &[String], records: &[Record]) -> Vec<Figure> {
    let Some(sequence) = sequences.iter().find(|name| *name == "C").or(sequences.first()) else {
        return Vec::new();
    };
    let plots = Plots { sequence, records };
    let outliers = [Kind::Uniform, Kind::Coherent].map(|kind| plots.by_outliers(kind));
    let mut figures: Vec<Figure> =
        [plots.by_method(), plots.by_noise()].into_iter().chain(outliers).collect();
    figures.retain(|figure| figure.panels.iter().any(has_a_line));
    figures
}

fn has_a_line(panel: &Panel) -> bool {
    matches!(&panel.content, Content::Plot { series, .. } if !series.is_empty())
}

struct Plots<'a> {
    sequence: &'a str,
    records: &'a [Record],
}

impl Plots<'_> {
    fn score(&self, setting: &Setting, contender: &Contender) -> Option<&Score> {
        self.records.iter().find_map(|record| match record {
            Record::Errors { sequence, setting: at, score } => {
                let same = sequence == self.sequence && at == setting && score.contender == *contender;
                same.then_some(score.as_ref())
            }
            Record::Observed { .. } => None,
        })
    }

    fn point(
        &self,
        x: usize,
        setting: &Setting,
        contender: &Contender,
        component: Option<usize>,
    ) -> Option<Point> {
        let tally = &self.score(setting, contender)?.tally;
        let of = |i: usize| tally.figures(i).map(|f| (f.variance_over_bound, f.standard_error));
        let (y, standard_error) = match component {
            Some(i) => of(i)?,
            None => (0..6).filter_map(of).reduce(|a, b| if b.0 > a.0 { b } else { a })?,
        };
        Some(Point { x: x as f64, y, standard_error: Some(standard_error) })
    }

    /// One line for each contender: `settings` from left to right.
    fn panel(
        &self,
        title: String,
        x: Axis,
        approach: Approach,
        settings: &[Setting],
        component: Option<usize>,
    ) -> Panel {
        let series = CONTENDERS.into_iter().filter_map(|(name, method, estimator)| {
            let contender = Contender { approach, method, estimator };
            let point = |(x, setting)| self.point(x, setting, &contender, component);
            let points: Vec<Point> = settings.iter().enumerate().filter_map(point).collect();
            let line = if method == Method::Ml { Line::Solid } else { Line::Dashed };
            (!points.is_empty()).then(|| Series { name: name.to_owned(), line, points })
        });
        let mut series: Vec<Series> = series.collect();
        if !series.is_empty() {
            let at = |x: usize| Point { x: x as f64, y: 1.0, standard_error: None };
            let points = (0..settings.len()).map(at).collect();
            series.push(Series { name: "bound".to_owned(), line: Line::Reference, points });
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

    /// Each component by every contender at the held setting.
    fn by_method(&self) -> Figure {
        let panels = APPROACHES.map(|(name, approach)| {
            let series = CONTENDERS.into_iter().filter_map(|(label, method, estimator)| {
                let contender = Contender { approach, method, estimator };
                let points: Vec<Point> =
                    (0..6).filter_map(|i| self.point(i, &HELD, &contender, Some(i))).collect();
                (!points.is_empty()).then(|| Series { name: label.to_owned(), line: Line::Marks, points })
            });
            let mut series: Vec<Series> = series.collect();
            if !series.is_empty() {
                let points =
                    (0..6).map(|i| Point { x: f64::from(i), y: 1.0, standard_error: None }).collect();
                series.push(Series { name: "bound".to_owned(), line: Line::Reference, points });
            }
            let x = Axis::places("component", COMPONENTS);
            Panel {
                title: name.to_owned(),
                content: Content::Plot { x, y: Axis::log("variance/bound"), series },
            }
        });
        let caption = "1/8 px of noise at both ends, 2048 points, no outliers. 1 is the Cramér–Rao bound.";
        self.figure("efficiency-method", "variance over the bound, by method", caption, panels.into())
    }

    fn by_noise(&self) -> Figure {
        let panels = APPROACHES.into_iter().flat_map(|(name, approach)| {
            let noise = NOISE_PX.map(|noise_px| Setting { noise_px, ..HELD });
            let places = NOISE_PX.map(|noise| format!("1/{}", noise.recip()));
            let points = POINTS.map(|points| Setting { points, ..HELD });
            [
                self.panel(format!("{name}, noise"), Axis::places("σ (px)", places), approach, &noise, None),
                self.panel(
                    format!("{name}, points"),
                    Axis::places("points", POINTS),
                    approach,
                    &points,
                    None,
                ),
            ]
        });
        let caption =
            "The worst component of each contender. What is not swept is held at 1/8 px and 2048 points.";
        self.figure(
            "efficiency-noise",
            "variance over the bound, by noise and points",
            caption,
            panels.collect(),
        )
    }

    fn by_outliers(&self, kind: Kind) -> Figure {
        let (stem, what) = match kind {
            Kind::Uniform => ("efficiency-uniform", "uniform outliers"),
            Kind::Coherent => ("efficiency-coherent", "one moving body"),
        };
        let with = |outliers| Setting { outliers, kind, ends: Ends::Both, ..HELD };
        let settings: Vec<Setting> = [HELD].into_iter().chain(OUTLIERS.map(with)).collect();
        let panels = APPROACHES.map(|(name, approach)| {
            let places = settings.iter().map(|setting| format!("{:.0} %", 100.0 * setting.outliers));
            self.panel(name.to_owned(), Axis::places("outliers", places), approach, &settings, None)
        });
        let caption = "The worst component of each contender, in units of the bound of the inliers alone.";
        self.figure(stem, &format!("variance over the bound, {what}"), caption, panels.into())
    }
}
