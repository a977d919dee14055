//! Figures 11 to 14, the paper's values as broken lines beside ours.

use super::data::speed;
use super::{Results, lab_name};
use crate::real::lab::LabStudy;
use crate::real::printed::{TABLE_3, TABLE_6, TABLE_7, TABLES_4_5};
use crate::real::record::in_mm_deg;
use crate::real::way::{Estimator, Quantity, Way};
use crate::{Axis, Content, Figure, Line, Panel, Point, Series};
use egomotion::pipeline::{Approach, Method};
use egomotion::sim::Sequence;

/// Translating along Z only, and turning only.
const PATHS: [&[&str]; 2] = [&["E", "F", "G", "H", "I"], &["A", "B", "C", "D"]];
/// The sequence whose images are shown.
const SHOWN: &str = "lab-G";

/// Figures 11 to 14.
pub(super) fn all(study: &LabStudy, results: &Results<'_>) -> Vec<Figure> {
    let mut figures: Vec<Figure> = images(study).into_iter().collect();
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

fn images(study: &LabStudy) -> Option<Figure> {
    let (frames, measured) = study.example(SHOWN)?;
    let [_, now, _] = frames;
    let disparity = measured.rounded[1].shift.clone();
    let known = disparity.grid().values().iter().copied().filter(|d| d.is_finite());
    let range = known.fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), d| (lo.min(d), hi.max(d)));
    let panel = |title: &str, content| Panel { title: title.to_owned(), content };
    Some(Figure {
        id: "figure-11".to_owned(),
        title: "Figure 11. Intensity images and their disparity map".to_owned(),
        caption: "The room of the sequences lab-A to lab-M as the sensor gives it, and its computed disparity in steps of 1/16 px; \
                  blank where nothing can be matched."
            .to_owned(),
        columns: 3,
        panels: vec![
            panel("left image", Content::Picture(now.left)),
            panel("right image", Content::Picture(now.right)),
            panel(
                "disparity",
                Content::Map { field: disparity, name: "disparity (px)".to_owned(), range },
            ),
        ],
    })
}

/// Name of a line: `DCCE/DIFF`.
fn name(way: Way) -> &'static str {
    match (way.method, way.approach) {
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

fn vz(results: &Results<'_>, path: usize) -> Panel {
    let pixel = |approach, method| Way::new(approach, method, Estimator::Pixel);
    let (diff, disc) = (Approach::Differential, Approach::Discrete);
    let ways = [
        pixel(diff, Method::Dcce),
        pixel(diff, Method::Dv),
        pixel(disc, Method::Dcce),
        pixel(disc, Method::Dv),
    ];
    let measured = |way: Way| {
        series(name(way).to_owned(), Line::Solid, path, |letter| {
            let found = results.lab(letter, Some(way), Quantity::Vz)?;
            // The standard error of a signed mean that hovers about zero says little of its size.
            if path == 0 {
                Some((found.erm_signed?.abs(), None))
            } else {
                Some((found.erm_abs?, found.standard_error))
            }
        })
    };
    let printed = |way: Way| {
        let table = if way.approach == diff { &TABLE_3 } else { &TABLE_6 };
        let which = usize::from(way.method == Method::Dv);
        series(name(way).to_owned(), Line::Dashed, path, |letter| {
            let row = table.iter().find(|row| row.letter == letter)?;
            Some((row.erm_percent[which].abs(), None))
        })
    };
    let lines = ways.iter().copied().chain([Way::BEST]).map(measured);
    Panel {
        title: ["(a) translating, E to I", "(b) turning, A to D"][path].to_owned(),
        content: Content::Plot {
            x: axis(path),
            y: Axis::log("ERM (%)"),
            series: lines.chain(ways.iter().copied().map(printed)).collect(),
        },
    }
}

fn phi(results: &Results<'_>, path: usize, i: usize, quantity: Quantity) -> Panel {
    let ls = |approach, method| Way::new(approach, method, Estimator::Ls);
    let ways = [
        ls(Approach::Differential, Method::Dcce),
        ls(Approach::Differential, Method::Dv),
        ls(Approach::Discrete, Method::Linear22),
    ];
    let relative = (path == 0 && quantity == Quantity::Tz) || (path == 1 && quantity == Quantity::Wy);
    let measured = |way: Way| {
        series(name(way).to_owned(), Line::Solid, path, |letter| {
            let found = results.lab(letter, Some(way), quantity)?;
            let y = if relative { found.erm_abs? } else { found.eam };
            Some((y, found.standard_error))
        })
    };
    let printed = |way: Way| {
        series(name(way).to_owned(), Line::Dashed, path, |letter| {
            let value = match way.method {
                Method::Dcce => TABLES_4_5.iter().find(|row| row.letter == letter)?.dcce[i],
                Method::Dv => TABLES_4_5.iter().find(|row| row.letter == letter)?.dv[i],
                _ => TABLE_7.iter().find(|row| row.0 == letter)?.1[i],
            };
            let truth =
                in_mm_deg(&Sequence::named(&lab_name(letter), None, Some(2), 1.0)?.phi_cyclopean(0)?)[i];
            let error = (value - truth).abs();
            Some((if relative { 100.0 * error / truth.abs() } else { error }, None))
        })
    };
    let lines = ways.iter().copied().chain([Way::BEST]).map(measured);
    let symbol = quantity.heading();
    let letter = ["a", "b", "c", "d", "e", "f"][i];
    let y = if relative {
        format!("ERM of {} (%)", symbol.split(' ').next().unwrap_or_default())
    } else {
        format!("EAM of {symbol}")
    };
    Panel {
        title: format!("({letter}) {}", symbol.split(' ').next().unwrap_or_default()),
        content: Content::Plot {
            x: axis(path),
            y: Axis::log(y),
            series: lines.chain(ways.iter().copied().map(printed)).collect(),
        },
    }
}
