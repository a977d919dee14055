//! Figures 11 to 14, the paper's values as broken lines beside ours.

use super::data::speed;
use super::{RealResults, lab_name};
use crate::components::in_mm_deg;
use crate::real::contender::{ImageContender, ImageEstimator};
use crate::real::matching::MatchedFrames;
use crate::real::printed::{TABLE_3, TABLE_6, TABLE_7, TABLES_4_5};
use crate::real::quantity::Quantity;
use crate::sequences::two_frames;
use crate::{Axis, Content, Figure, Line, Panel, Point, Series};
use egomotion::pipeline::{Approach, Method};
use egomotion::sim::StereoImages;

/// Letters of the sequences that translate along Z alone, and of those that turn alone.
const PATHS: [&[&str]; 2] = [&["E", "F", "G", "H", "I"], &["A", "B", "C", "D"]];

/// Figures 11 to 14.
pub(super) fn all(
    example: Option<&([StereoImages; 3], MatchedFrames)>,
    results: &RealResults<'_>,
) -> Vec<Figure> {
    let mut figures: Vec<Figure> = example.map(images).into_iter().collect();
    figures.push(Figure {
        id: "figure-12".to_owned(),
        title: "Figure 12. ERM of VZ against speed (broken: the paper's values)".to_owned(),
        caption: "The size of the relative mean error of VZ at a pixel; translating it is that of the signed mean, turning the mean of \
                  absolute errors. Full lines are measured here, broken lines with open marks are the paper's Tables 3 and 6."
            .to_owned(),
        columns: 2,
        panels: [0, 1].map(|path| vz(results, path)).to_vec(),
    });
    let titles = [
        ("figure-13", "Figure 13. Errors of φ against speed, translating (broken: the paper's values)"),
        ("figure-14", "Figure 14. Errors of φ against speed, turning (broken: the paper's values)"),
    ];
    for (path, (id, title)) in titles.into_iter().enumerate() {
        figures.push(Figure {
            id: id.to_owned(),
            title: title.to_owned(),
            caption: "ERM where the true component is not zero, EAM where it is. Full lines are the means over draws \
                      measured here, by least squares and by maximum likelihood; broken lines with open marks are the paper's Tables 4, 5 \
                      and 7."
                .to_owned(),
            columns: 3,
            panels: Quantity::PHI.iter().enumerate().map(|(i, q)| phi(results, path, i, *q)).collect(),
        });
    }
    figures
}

fn images((frames, matched): &([StereoImages; 3], MatchedFrames)) -> Figure {
    let [_, now, _] = frames;
    let disparity = matched.rounded[1].shift.clone();
    let known = disparity.grid().values().iter().copied().filter(|d| d.is_finite());
    let range = known.fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), d| (lo.min(d), hi.max(d)));
    let panel = |title: &str, content| Panel { title: title.to_owned(), content };
    Figure {
        id: "figure-11".to_owned(),
        title: "Figure 11. Intensity images and their disparity map".to_owned(),
        caption: "The room of the sequences lab-A to lab-M as the sensor gives it, and its computed disparity in steps of 1/16 px; \
                  blank where nothing can be matched."
            .to_owned(),
        columns: 3,
        panels: vec![
            panel("left image", Content::Picture(now.left.clone())),
            panel("right image", Content::Picture(now.right.clone())),
            panel(
                "disparity",
                Content::Map { field: disparity, name: "disparity (px)".to_owned(), range },
            ),
        ],
    }
}

/// Name of a line: `DCCE/DIFF`.
fn name(contender: ImageContender) -> &'static str {
    match (contender.method, contender.approach) {
        (Method::Dcce, Approach::Differential) => "DCCE/DIFF",
        (Method::Dv, Approach::Differential) => "DV/DIFF",
        (Method::Dcce, Approach::Discrete) => "DCCE/DISC",
        (Method::Dv, Approach::Discrete) => "DV/DISC",
        (Method::Ml, _) => "maximum likelihood",
        _ => "(22)/DISC",
    }
}

fn axis(path: usize) -> Axis {
    Axis::log(if path == 0 { "|tZ| (mm per frame)" } else { "|ΩY| (° per frame)" })
}

/// A line over the sequences of a path.
fn series(
    name: String,
    line: Line,
    path: usize,
    value: impl Fn(&str) -> Option<(f64, Option<f64>)>,
) -> Series {
    let point = |letter: &&str| {
        let (y, standard_error) = value(letter)?;
        Some(Point { x: speed(&lab_name(letter))?, y, standard_error })
    };
    Series { name, line, points: PATHS[path].iter().filter_map(point).collect() }
}

fn vz(results: &RealResults<'_>, path: usize) -> Panel {
    let pixel = |approach, method| ImageContender::new(approach, method, ImageEstimator::Pixel);
    let (diff, disc) = (Approach::Differential, Approach::Discrete);
    let contenders = [
        pixel(diff, Method::Dcce),
        pixel(diff, Method::Dv),
        pixel(disc, Method::Dcce),
        pixel(disc, Method::Dv),
    ];
    let ours = |contender: ImageContender| {
        series(name(contender).to_owned(), Line::Solid, path, |letter| {
            let found = results.lab(letter, Some(contender), Quantity::Vz)?;
            // The standard error of a signed mean that hovers about zero says little of its size.
            if path == 0 {
                Some((found.erm_signed?.abs(), None))
            } else {
                Some((found.erm_abs?, found.standard_error))
            }
        })
    };
    let papers = |contender: ImageContender| {
        let table = if contender.approach == diff { &TABLE_3 } else { &TABLE_6 };
        let which = usize::from(contender.method == Method::Dv);
        series(name(contender).to_owned(), Line::Dashed, path, |letter| {
            let row = table.iter().find(|row| row.letter == letter)?;
            Some((row.erm_percent[which].abs(), None))
        })
    };
    let lines = contenders.iter().copied().chain([ImageContender::BEST]).map(ours);
    Panel {
        title: ["(a) translating, E to I", "(b) turning, A to D"][path].to_owned(),
        content: Content::Plot {
            x: axis(path),
            y: Axis::log("ERM (%)"),
            series: lines.chain(contenders.iter().copied().map(papers)).collect(),
        },
    }
}

fn phi(results: &RealResults<'_>, path: usize, i: usize, quantity: Quantity) -> Panel {
    let ls = |approach, method| ImageContender::new(approach, method, ImageEstimator::Ls);
    let contenders = [
        ls(Approach::Differential, Method::Dcce),
        ls(Approach::Differential, Method::Dv),
        ls(Approach::Discrete, Method::Linear22),
    ];
    let relative = (path == 0 && quantity == Quantity::Tz) || (path == 1 && quantity == Quantity::Wy);
    let ours = |contender: ImageContender| {
        series(name(contender).to_owned(), Line::Solid, path, |letter| {
            let found = results.lab(letter, Some(contender), quantity)?;
            let y = if relative { found.erm_abs? } else { found.eam };
            Some((y, found.standard_error))
        })
    };
    let papers = |contender: ImageContender| {
        series(name(contender).to_owned(), Line::Dashed, path, |letter| {
            let value = match contender.method {
                Method::Dcce => TABLES_4_5.iter().find(|row| row.letter == letter)?.dcce[i],
                Method::Dv => TABLES_4_5.iter().find(|row| row.letter == letter)?.dv[i],
                _ => TABLE_7.iter().find(|row| row.0 == letter)?.1[i],
            };
            let truth = in_mm_deg(&two_frames(&lab_name(letter))?.phi_cyclopean(0)?)[i];
            let error = (value - truth).abs();
            Some((if relative { 100.0 * error / truth.abs() } else { error }, None))
        })
    };
    let lines = contenders.iter().copied().chain([ImageContender::BEST]).map(ours);
    let symbol = quantity.heading();
    let letter = ["a", "b", "c", "d", "e", "f"][i];
    let y = if relative { format!("ERM of {} (%)", quantity.symbol()) } else { format!("EAM of {symbol}") };
    Panel {
        title: format!("({letter}) {}", quantity.symbol()),
        content: Content::Plot {
            x: axis(path),
            y: Axis::log(y),
            series: lines.chain(contenders.iter().copied().map(papers)).collect(),
        },
    }
}
