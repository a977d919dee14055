//! Formulas for an instant, used on finite motions: (27) for the rotation, T for t, and (3) for the displacement.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::sequences::{PAPER_SEQUENCES, PAPER_STEPS, two_frames};
use crate::synthetic::{SyntheticWorld, UsablePixel};
use crate::{Axis, Cell, Content, Figure, Line, Panel, Series, Table};
use egomotion::geometry::image_flow;
use egomotion::metrics::quantile;

/// Half the narrow field of view as a share of the focal length: 7° to each side.
///
/// Adiv's conditions ask for a narrow view; a smaller one keeps them better, with fewer pixels.
const NARROW_HALF_VIEW: f64 = 0.125;

/// Errors of the formulas at one motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct InstantaneousError {
    /// The sequence.
    pub sequence: String,
    /// Multiple of its motion.
    pub step: f64,
    /// Angle of rotation, in degrees.
    pub angle_deg: f64,
    /// |Ω̂ − Ω|/|Ω| of (27), in percent; `None` without rotation.
    pub omega_percent: Option<f64>,
    /// |T − t|/|t|, T taken for t, in percent; `None` without translation.
    pub translation_percent: Option<f64>,
    /// Median of |(3) − displacement| over the image, in percent of the displacement.
    pub flow_percent: f64,
    /// The same over the narrow field of view.
    pub narrow_percent: f64,
    /// Median of |tZ|/Z over the image.
    pub approach: f64,
}

/// Errors for A, B and C at every STEP.
pub(super) fn errors() -> Vec<InstantaneousError> {
    let settings = PAPER_SEQUENCES.into_iter().flat_map(|name| PAPER_STEPS.map(|step| (name, step)));
    settings.filter_map(|(name, step)| error(name, step)).collect()
}

fn error(name: &str, step: f64) -> Option<InstantaneousError> {
    let sequence = two_frames(name)?;
    let world = SyntheticWorld::new(&sequence.scene, &sequence.rig, &sequence.phi_cyclopean(0)?, 0, step);
    let phi = world.phi;
    let motion = phi.exp();
    let percent = |error: Vector3<f64>, truth: Vector3<f64>| {
        (truth.norm() > 0.0).then(|| 100.0 * error.norm() / truth.norm())
    };
    let flow_error = |p: &UsablePixel| {
        let shift = (p.later_xyd - p.xyd).xy();
        let flow = image_flow(&phi, p.xyd.x, p.xyd.y, p.point.z, world.rig.focal_px);
        100.0 * (flow - shift).norm() / shift.norm()
    };
    let median = |of: &dyn Fn(&UsablePixel) -> f64, inside: f64| {
        let half = inside * world.rig.focal_px;
        let near = world.pixels().iter().filter(|p| p.xyd.xy().amax() <= half);
        quantile(&near.map(of).filter(|v| v.is_finite()).collect::<Vec<_>>(), 0.5)
    };
    Some(InstantaneousError {
        sequence: name.to_owned(),
        step,
        angle_deg: phi.omega.norm().to_degrees(),
        omega_percent: percent(motion.instantaneous().omega - phi.omega, phi.omega),
        translation_percent: percent(motion.translation - phi.t, phi.t),
        flow_percent: median(&flow_error, f64::INFINITY)?,
        narrow_percent: median(&flow_error, NARROW_HALF_VIEW)?,
        approach: median(&|p: &UsablePixel| phi.t.z.abs() / p.point.z, f64::INFINITY)?,
    })
}

pub(super) fn table(errors: &[&InstantaneousError]) -> Table {
    let columns = [
        ("sequence", "sequence"),
        ("step", "STEP"),
        ("angle_deg", "rotation (°)"),
        ("approach", "|tZ|/Z, median"),
        ("omega_percent", "Ω by (27): error (%)"),
        ("translation_percent", "T for t: error (%)"),
        ("flow_percent", "(3) for the displacement, whole image: error (%)"),
        ("narrow_percent", "the same within 7° of the axis (%)"),
    ];
    let caption = "On exact motions: what remains is the formulas' own error.";
    let mut table =
        Table::new("instantaneous", "Formulas for an instant on finite motions", caption, &columns);
    let row = |e: &&InstantaneousError| {
        let numbers =
            [Some(e.step), Some(e.angle_deg), Some(e.approach), e.omega_percent, e.translation_percent];
        let flows = [Some(e.flow_percent), Some(e.narrow_percent)];
        let cells = numbers.into_iter().chain(flows).map(Cell::from);
        std::iter::once(Cell::from(e.sequence.as_str())).chain(cells).collect()
    };
    table.rows = errors.iter().map(row).collect();
    table
}

/// A line of a panel for each sequence: the end of its name, its values, how it is drawn.
type PlottedLine<'a> = (&'a str, &'a dyn Fn(&InstantaneousError) -> Option<f64>, Line);

pub(super) fn figure(errors: &[&InstantaneousError]) -> Figure {
    let panel = |title: &str, name: &str, lines: &[PlottedLine<'_>]| {
        let of = |sequence: &'static str| {
            lines.iter().map(move |(suffix, value, line)| {
                let points = errors
                    .iter()
                    .filter(|e| e.sequence == sequence)
                    .filter_map(|e| Some((e.step, value(e).filter(|y| *y > 0.0)?)));
                Series::through(&format!("{sequence}{suffix}"), *line, points)
            })
        };
        let series = PAPER_SEQUENCES.into_iter().flat_map(of).filter(|s| !s.points.is_empty());
        Panel {
            title: title.to_owned(),
            content: Content::Plot { x: Axis::log("STEP"), y: Axis::log(name), series: series.collect() },
        }
    };
    Figure {
        id: "figure-instantaneous".to_owned(),
        title: "Section 4.3. When the formulas for an instant may be used on finite motions".to_owned(),
        caption: "Exact motions of A, B and C times STEP. (27) reads Ω off R; its error depends on the angle alone, \
                  not on depth or field of view. T differs from t by about ½ Ω × t. Adiv's conditions, small tZ/Z \
                  and a narrow view, bear on (3) for the displacement: broken lines are within 7° of the axis."
            .to_owned(),
        columns: 3,
        panels: vec![
            panel("(a) Ω by (27)", "error (%)", &[("", &|e| e.omega_percent, Line::Solid)]),
            panel("(b) T taken for t", "error (%)", &[("", &|e| e.translation_percent, Line::Solid)]),
            panel(
                "(c) displacement by (3)",
                "median error (%)",
                &[
                    ("", &|e| Some(e.flow_percent), Line::Solid),
                    (", narrow view", &|e| Some(e.narrow_percent), Line::Dashed),
                ],
            ),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_grow_as_the_series_say() {
        let at = |step| error("C", step).unwrap();
        let (small, large) = (at(1.0), at(8.0));
        // The antisymmetric part of R is (sin θ/θ) [Ω].
        for found in [&small, &large] {
            let theta = found.angle_deg.to_radians();
            let expected = 100.0 * (1.0 - theta.sin() / theta);
            assert!((found.omega_percent.unwrap() / expected - 1.0).abs() < 1e-6, "{found:?}");
        }
        // T − t = ½ Ω × t + ….
        let phi = two_frames("C").unwrap().phi(0).unwrap();
        let expected = 50.0 * phi.omega.cross(&phi.t).norm() / phi.t.norm();
        assert!((small.translation_percent.unwrap() / expected - 1.0).abs() < 0.01);
        assert!(large.flow_percent > 5.0 * small.flow_percent);
        let turning = error("B", 8.0).unwrap();
        assert!(turning.narrow_percent < turning.flow_percent, "{turning:?}");
    }
}
