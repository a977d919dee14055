//! Figures 11 to 14, for sequences of any origin.

use super::speed::{SpeedAxis, SpeedPlace};
use super::{Example, RealResults};
use crate::real::contender::{ImageContender, ImageEstimator};
use crate::real::quantity::Quantity;
use crate::real::statistics::{MeanError, PooledStatistics};
use crate::{Axis, Content, Figure, Line, Panel, Point, Series};
use egomotion::pipeline::{Approach, Method};

/// How to read Figure 12.
pub(super) const VZ_CAPTION: &str = "DCCE and DV: each pixel's own value, which needs no estimator; ML: the rigid scene under \
     maximum likelihood, or the measured change where that contradicts it. (a) The size of the signed mean of relative errors, (b) the mean of their sizes, (c) and (d) the median of \
     their sizes over the pixels, which wrong matches cannot ruin.";
/// How to read Figures 13 and 14.
pub(super) const PHI_CAPTION: &str =
    "DCCE, DV and (22) by least squares with all rows alike, ML by maximum likelihood.";

/// The paper's values, which are drawn as broken lines.
pub(super) trait PaperLines {
    /// The size of the ERM of VZ in percent.
    fn vz(&self, sequence: &str, contender: ImageContender) -> Option<f64>;
    /// The error of component `i` of φ: in percent of the truth, or in mm or degrees.
    fn phi(&self, sequence: &str, contender: ImageContender, i: usize, relative: bool) -> Option<f64>;
}

/// Figure 11.
pub(super) fn images((frames, matched): Example<'_>, caption: &str) -> Figure {
    let [_, now, _] = frames;
    let disparity = matched.rounded[1].shift.clone();
    let known = disparity.grid().values().iter().copied().filter(|d| d.is_finite());
    let range = known.fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), d| (lo.min(d), hi.max(d)));
    let panel = |title: &str, content| Panel { title: title.to_owned(), content };
    Figure {
        id: "figure-11".to_owned(),
        title: "Figure 11. Intensity images and their disparity map".to_owned(),
        caption: caption.to_owned(),
        columns: 3,
        panels: vec![
            panel("left image", Content::Picture(now.left.clone())),
            panel("right image", Content::Picture(now.right.clone())),
            panel("disparity", Content::Map { field: disparity, name: "disparity (px)".to_owned(), range }),
        ],
    }
}

/// A value of the y axis with its standard error, if the figures have one.
type Height = fn(&PooledStatistics) -> Option<MeanError>;

/// The panels of Figure 12: against the speed of translating, then of turning; means, then medians.
pub(super) fn vz(
    results: &RealResults<'_>,
    axes: [&SpeedAxis; 2],
    paper: Option<&dyn PaperLines>,
) -> Vec<Panel> {
    let pixel = |approach, method| ImageContender::new(approach, method, ImageEstimator::Pixel);
    let (diff, disc) = (Approach::Differential, Approach::Discrete);
    let contenders = [
        pixel(diff, Method::Dcce),
        pixel(diff, Method::Dv),
        pixel(disc, Method::Dcce),
        pixel(disc, Method::Dv),
    ];
    let size_of_signed: Height =
        |found| found.erm_signed.map(|erm| MeanError { mean: erm.mean.abs(), ..erm });
    let median: Height = |found| found.erm_median.map(|mean| MeanError { mean, standard_error: None });
    let panel =
        |letter: char, axis: &SpeedAxis, name: &str, height: Height, paper: Option<&dyn PaperLines>| {
            let ours = contenders.iter().copied().chain([ImageContender::BEST]).map(|contender| {
                // The lab knows the exact VZ, a recording that of a still scene.
                let value = |place: &SpeedPlace| {
                    let found = [Quantity::Vz, Quantity::VzStill].into_iter();
                    let mut found =
                        found.filter_map(|quantity| place.statistics(results, contender, quantity));
                    height(&found.next()?)
                };
                line(contender, axis, value)
            });
            let papers = paper.into_iter().flat_map(|paper| {
                contenders
                    .iter()
                    .map(move |&contender| broken(contender, axis, |sequence| paper.vz(sequence, contender)))
            });
            Panel {
                title: format!("({letter}) {}", axis.title),
                content: Content::Plot {
                    x: axis.axis.clone(),
                    y: Axis::log(name),
                    series: ours.chain(papers).collect(),
                },
            }
        };
    let [translating, turning] = axes;
    vec![
        panel('a', translating, "size of the signed ERM (%)", size_of_signed, paper),
        panel('b', turning, "ERM (%)", |found| found.erm_abs, paper),
        panel('c', translating, "median of |relative error| (%)", median, None),
        panel('d', turning, "median of |relative error| (%)", median, None),
    ]
}

/// What stands for the errors of several draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Typical {
    /// ERM and EAM as the paper has them, with bars.
    Mean,
    /// Their medians, which a few failures cannot ruin.
    Median,
}

impl Typical {
    /// The error of a component of φ: of `relative` ones in percent of the truth.
    fn of(self, found: &PooledStatistics, relative: bool) -> Option<MeanError> {
        let median = |mean| MeanError { mean, standard_error: None };
        match (self, relative) {
            (Self::Mean, true) => found.erm_abs,
            (Self::Mean, false) => found.eam,
            (Self::Median, true) => found.erm_median.map(median),
            (Self::Median, false) => found.eam_median.map(median),
        }
    }

    /// The name of the y axis.
    fn axis(self, quantity: Quantity, relative: bool) -> Axis {
        let (symbol, heading) = (quantity.symbol(), quantity.heading());
        Axis::log(match (self, relative) {
            (Self::Mean, true) => format!("ERM of {symbol} (%)"),
            (Self::Mean, false) => format!("EAM of {heading}"),
            (Self::Median, true) => format!("median |error| of {symbol} (%)"),
            (Self::Median, false) => format!("median |error| of {heading}"),
        })
    }
}

/// The panels of Figure 13 or 14: a component of φ each, in percent of the truth where `relative` says so.
pub(super) fn phi(
    results: &RealResults<'_>,
    axis: &SpeedAxis,
    typical: Typical,
    relative: impl Fn(Quantity) -> bool,
    paper: Option<&dyn PaperLines>,
) -> Vec<Panel> {
    let ls = |approach, method| ImageContender::new(approach, method, ImageEstimator::Ls);
    let contenders = [
        ls(Approach::Differential, Method::Dcce),
        ls(Approach::Differential, Method::Dv),
        ls(Approach::Discrete, Method::Linear22),
    ];
    let panel = |(i, (quantity, letter)): (usize, (Quantity, char))| {
        let relative = relative(quantity);
        let ours = contenders.iter().copied().chain([ImageContender::BEST]).map(|contender| {
            line(contender, axis, |place| {
                typical.of(&place.statistics(results, contender, quantity)?, relative)
            })
        });
        let papers = paper.into_iter().flat_map(|paper| {
            contenders.iter().map(move |&contender| {
                broken(contender, axis, |sequence| paper.phi(sequence, contender, i, relative))
            })
        });
        Panel {
            title: format!("({letter}) {}", quantity.symbol()),
            content: Content::Plot {
                x: axis.axis.clone(),
                y: typical.axis(quantity, relative),
                series: ours.chain(papers).collect(),
            },
        }
    };
    Quantity::PHI.into_iter().zip('a'..).enumerate().map(panel).collect()
}

/// A full line of ours, with bars.
fn line(
    contender: ImageContender,
    axis: &SpeedAxis,
    value: impl Fn(&SpeedPlace) -> Option<MeanError>,
) -> Series {
    let point = |place: &SpeedPlace| {
        let MeanError { mean, standard_error } = value(place)?;
        Some(Point { x: place.speed, y: mean, standard_error })
    };
    Series {
        name: contender.legend(),
        line: Line::Solid,
        points: axis.places.iter().filter_map(point).collect(),
    }
}

/// A broken line of the paper's.
fn broken(contender: ImageContender, axis: &SpeedAxis, value: impl Fn(&str) -> Option<f64>) -> Series {
    let point = |place: &SpeedPlace| Some((place.speed, value(place.sequence()?)?));
    Series::through(&contender.legend(), Line::Dashed, axis.places.iter().filter_map(point))
}
