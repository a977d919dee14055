//! Variance formulas against draws, as tables and figures.

use super::case::VarianceCase;
use super::formula::{Family, FormulaKind, Inputs};
use crate::{Axis, Cell, Content, Figure, Line, Panel, Point, Series, Table};
use egomotion::metrics::quantile;

/// Relative noise of disparity σ_d/d up to which first order is promised to hold.
///
/// The second order of 1/d² is 10 (σ_d/d)², 0.4 % at this value; a larger one promises what formulas do not keep.
const FIRST_ORDER_LIMIT: f64 = 0.02;
/// Ratios of empirical to predicted variance within which a formula is said to hold: 3 % to each side.
const HOLDING_RATIOS: (f64, f64) = (0.97, 1.03);
/// Ends of the line of a ratio in the figure, in σ_d/d.
const RATIO_LINE: [f64; 2] = [5e-4, 0.12];
/// Name of the axis of ratios.
const RATIO_AXIS: &str = "empirical/predicted";
/// Least share of the product of noises over first order that is shown: draws find it to about a third of that.
const LEAST_PRODUCT: f64 = 0.01;
/// Largest share of the product of noises over first order that its rule is drawn to.
const LARGEST_PRODUCT: f64 = 0.5;

impl FormulaKind {
    /// Its word in tables and legends.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Printed => "printed",
            Self::FirstOrder => "first order",
            Self::Corrected => "corrected",
            Self::SecondOrder => "second order",
        }
    }
}

impl Inputs {
    /// Its word in tables.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Independent => "independent",
        }
    }
}

/// Every case.
pub(super) fn data(cases: &[&VarianceCase]) -> Table {
    let mut table = Table::new(
        "variances",
        "Every variance formula against draws",
        "Variances in mm² (of a disparity in px²). Inputs `raw`: disparities and flows are drawn, as the \
         estimator meets them; `independent`: intermediates are drawn each on their own, as the paper \
         assumes them to be. `lo` and `hi`: 95 % interval of the ratio, from the fourth moment.",
        &[
            ("formula", "formula"),
            ("kind", "kind"),
            ("inputs", "inputs"),
            ("quantity", "quantity"),
            ("sequence", "sequence"),
            ("step", "STEP"),
            ("pose", "pose"),
            ("u", "u (px)"),
            ("v", "v (px)"),
            ("z_m", "Z (m)"),
            ("flow_px", "|v| (px)"),
            ("sigma_d_px", "σ_d (px)"),
            ("sigma_v_px", "σ_v (px)"),
            ("round", "ROUND"),
            ("sigma_d_over_d", "σ_d/d"),
            ("predicted", "predicted"),
            ("empirical", "empirical"),
            ("ratio", "ratio"),
            ("lo", "lo"),
            ("hi", "hi"),
            ("draws", "draws"),
        ],
    );
    table.rows = cases.iter().map(|case| row(case)).collect();
    table
}

fn row(case: &VarianceCase) -> Vec<Cell> {
    let place = case.place.as_ref();
    let (lo, hi) = case.interval();
    vec![
        case.formula.as_str().into(),
        case.kind.word().into(),
        case.inputs.word().into(),
        case.quantity.as_str().into(),
        case.sequence.as_str().into(),
        case.step.into(),
        place.map(|p| f64::from(p.pose)).into(),
        place.map(|p| p.pixel.0).into(),
        place.map(|p| p.pixel.1).into(),
        place.map(|p| p.depth_m).into(),
        place.map(|p| p.flow_px).into(),
        place.map(|p| p.sigma_disparity_px).into(),
        place.map(|p| p.sigma_flow_px).into(),
        case.levels.into(),
        place.map(|p| p.relative).into(),
        case.predicted.into(),
        case.empirical.into(),
        case.ratio().into(),
        lo.into(),
        hi.into(),
        case.draws.into(),
    ]
}

/// The cases of one formula, in the order in which formulas first occur.
fn groups<'a>(cases: &[&'a VarianceCase]) -> Vec<Vec<&'a VarianceCase>> {
    let key = |c: &VarianceCase| (c.formula.clone(), c.kind, c.inputs, c.family);
    let mut groups: Vec<Vec<&VarianceCase>> = Vec::new();
    for &case in cases.iter().filter(|case| case.place.is_some()) {
        match groups.iter_mut().find(|group| group.first().is_some_and(|first| key(first) == key(case))) {
            Some(group) => group.push(case),
            None => groups.push(vec![case]),
        }
    }
    groups
}

/// Ratios of each formula, at small and at large relative noise.
pub(super) fn summary(cases: &[&VarianceCase]) -> Table {
    let mut table = Table::new(
        "variances-summary",
        "Empirical over predicted variance, per formula",
        "Places, poses, motions and noise are drawn at random from the usable pixels of A, B and C. \
         Corrected: (39c+) and (47c+) add the product of gradient's and flow's noise to (39c) and (47c), \
         which leave it out (first order). Second order adds all terms to the fourth order of the noise.",
        &[
            ("estimator", "estimator"),
            ("formula", "formula"),
            ("kind", "kind"),
            ("inputs", "inputs"),
            ("noise", "σ_d/d"),
            ("cases", "cases"),
            ("min", "least ratio"),
            ("median", "median ratio"),
            ("max", "largest ratio"),
            ("inside_percent", "within 0.97–1.03 (%)"),
        ],
    );
    for group in groups(cases) {
        for (name, small) in [("at most .02", true), ("beyond .02", false)] {
            let of: Vec<f64> = group
                .iter()
                .filter(|c| (c.relative() <= FIRST_ORDER_LIMIT) == small)
                .map(|c| c.ratio())
                .collect();
            let (Some(first), Some(median)) = (group.first(), quantile(&of, 0.5)) else { continue };
            let inside = of.iter().filter(|r| (HOLDING_RATIOS.0..=HOLDING_RATIOS.1).contains(*r)).count();
            table.rows.push(vec![
                first.family.name().into(),
                first.formula.as_str().into(),
                first.kind.word().into(),
                first.inputs.word().into(),
                name.into(),
                of.len().into(),
                quantile(&of, 0.0).into(),
                median.into(),
                quantile(&of, 1.0).into(),
                (100.0 * inside as f64 / of.len() as f64).into(),
            ]);
        }
    }
    table
}

/// (52) over all points of a view without any noise: a mean over places, not over repeats.
pub(super) fn rounding(cases: &[&VarianceCase]) -> Table {
    let mut table = Table::new(
        "rounding",
        "Rounding error of disparity over the points of a view, (52)",
        "Places drawn over the whole image, no noise. step²/12 needs disparities that spread over many \
         levels: slanted surfaces are those that span ten or more. The front wall faces the camera and has \
         hardly more than one disparity, so one error. Repeated at one place the error does not vary at \
         all: with noise (52) holds from about σ = step/2 on.",
        &[
            ("sequence", "sequence"),
            ("points", "points"),
            ("round", "ROUND"),
            ("predicted_px2", "step²/12 (px²)"),
            ("empirical_px2", "found (px²)"),
            ("ratio", "ratio"),
            ("lo", "lo"),
            ("hi", "hi"),
            ("draws", "places"),
        ],
    );
    for case in cases.iter().filter(|case| case.place.is_none()) {
        let (lo, hi) = case.interval();
        let numbers = [case.predicted, case.empirical, case.ratio(), lo, hi].map(Cell::from);
        let head = [case.sequence.as_str().into(), case.quantity.as_str().into(), case.levels.into()];
        table.rows.push(head.into_iter().chain(numbers).chain([case.draws.into()]).collect());
    }
    table
}

/// Whether ratios of this estimator's printed formulas spread over decades.
fn wide(family: &Family) -> bool {
    matches!(family, Family::DcceDiscrete | Family::Rounding)
}

/// Ratio against σ_d/d, a panel for each estimator.
pub(super) fn figure(cases: &[&VarianceCase]) -> Figure {
    let raw: Vec<&VarianceCase> =
        cases.iter().copied().filter(|c| c.inputs == Inputs::Raw && c.place.is_some()).collect();
    let panel = |family: &Family| {
        let of: Vec<&VarianceCase> = raw.iter().copied().filter(|case| case.family == *family).collect();
        let bounds = [HOLDING_RATIOS.0, 1.0, HOLDING_RATIOS.1].map(|ratio| {
            Series::through("1 ± 0.03", Line::Reference, RATIO_LINE.map(|relative| (relative, ratio)))
        });
        let kinds =
            [FormulaKind::Printed, FormulaKind::FirstOrder, FormulaKind::SecondOrder, FormulaKind::Corrected];
        let series = kinds.into_iter().filter_map(|kind| {
            let found: Vec<&VarianceCase> = of.iter().copied().filter(|case| case.kind == kind).collect();
            marks(kind.word(), &found, |case| (case.relative(), case.ratio()))
        });
        Panel {
            title: family.name().to_owned(),
            content: Content::Plot {
                x: Axis::log("σ_d/d"),
                y: if wide(family) { Axis::log(RATIO_AXIS) } else { Axis::linear(RATIO_AXIS) },
                series: bounds.into_iter().chain(series).collect(),
            },
        }
    };
    Figure {
        id: "figure-variances".to_owned(),
        title: "Variance formulas against draws".to_owned(),
        caption: "Empirical over predicted variance at random places of A, B and C, against the relative \
                  noise of disparity; bars are ± 2 standard errors. Corrected variances lie within 3 % up to \
                  σ_d/d = 0.02; beyond, second order carries on. Printed formulas that miss: (39) by the product \
                  of noises, (47) by that of d_t with ½σ²_d and at large motion, (49) at large motion, (52) \
                  where the noise is less than half a level."
            .to_owned(),
        columns: 2,
        panels: Family::ALL.iter().map(panel).collect(),
    }
}

/// The product of noises that (39c) and (47c) leave out, against the excess of the empirical variance.
pub(super) fn product_figure(cases: &[&VarianceCase]) -> Figure {
    let mut found: [Vec<(&VarianceCase, f64)>; 2] = Default::default();
    for pair in cases.windows(2) {
        let &[first, next] = pair else { continue };
        if first.kind != FormulaKind::FirstOrder || first.relative() > FIRST_ORDER_LIMIT {
            continue;
        }
        // An experiment lists its corrected variance after that of first order.
        let product = next.predicted / first.predicted - 1.0;
        if product > LEAST_PRODUCT {
            found[usize::from(first.family == Family::DcceDiscrete)].push((first, product));
        }
    }
    let drawn = ["(39c), DCCE DIFF", "(47c), DCCE DISC"].into_iter().zip(&found).map(|(name, found)| {
        let points = found.iter().map(|&(case, x)| Point {
            x,
            y: case.ratio() - 1.0,
            standard_error: Some(case.standard_error / case.predicted),
        });
        let mut points: Vec<Point> = points.collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        Series { name: name.to_owned(), line: Line::Marks, points }
    });
    let rule = Series::through(
        "the product",
        Line::Reference,
        [LEAST_PRODUCT, LARGEST_PRODUCT].map(|share| (share, share)),
    );
    Figure {
        id: "figure-product".to_owned(),
        title: "What first order leaves out of DCCE".to_owned(),
        caption:
            "A noisy gradient times noisy flow: empirical variance over (39c) and (47c), at σ_d/d up to \
                  0.02, against the product's share that (39c+) and (47c+) add. It reaches 2σ²_v/(1 + |v|²) \
                  in the differential form and does not vanish with σ_d, because all of (39c) that matters \
                  on a flat surface is proportional to σ²_d too."
                .to_owned(),
        columns: 1,
        panels: vec![Panel {
            title: "DCCE".to_owned(),
            content: Content::Plot {
                x: Axis::log("product of noises over first order"),
                y: Axis::log("empirical/first order − 1"),
                series: [rule].into_iter().chain(drawn).collect(),
            },
        }],
    }
}

fn marks(name: &str, cases: &[&VarianceCase], place: impl Fn(&VarianceCase) -> (f64, f64)) -> Option<Series> {
    let point = |case: &&VarianceCase| {
        let (x, y) = place(case);
        Point { x, y, standard_error: Some(case.standard_error / case.predicted) }
    };
    let mut points: Vec<Point> = cases.iter().map(point).collect();
    points.sort_by(|a, b| a.x.total_cmp(&b.x));
    (!points.is_empty()).then(|| Series { name: name.to_owned(), line: Line::Marks, points })
}
