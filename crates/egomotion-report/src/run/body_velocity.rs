//! The camera's own motion per second, with the signs that a driver expects.

use egomotion::geometry::Twist;
use maud::{Markup, html};

use super::charts::{self, COMPONENT_CHART_SIZE};
use super::interval::Interval;
use super::report::FrameRow;
use super::time_series::TimeSeries;
use super::timeline::Timeline;
use crate::chart::number::{DEGREES, Unit, length, significant};

/// A component of the camera's velocity: its name, what its negative is, the component of φ and its sign.
///
/// The camera moves by exp(φ)⁻¹ = exp(−φ); Y points down, so that upwards keeps φ's sign. Turning about Y from Z
/// to X is to the right, about X from Y to Z is nose up, about Z from X to Y leans to the right.
struct Component {
    name: &'static str,
    negative: &'static str,
    phi: usize,
    sign: f64,
}

const COMPONENTS: [Component; 6] = [
    Component { name: "Forward", negative: "backward", phi: 2, sign: -1.0 },
    Component { name: "To the right", negative: "to the left", phi: 0, sign: -1.0 },
    Component { name: "Upward", negative: "downward", phi: 1, sign: 1.0 },
    Component { name: "Turning right (yaw)", negative: "left", phi: 4, sign: -1.0 },
    Component { name: "Nose up (pitch)", negative: "nose down", phi: 3, sign: -1.0 },
    Component { name: "Leaning right (roll)", negative: "leaning left", phi: 5, sign: -1.0 },
];

/// Speed of the camera at a row, in metres per second; `None` unless the whole shift is known.
pub(crate) fn speed_m_s(row: &FrameRow) -> Option<f64> {
    let dt = row.interval_s()?;
    let shift = [row.component(0)?.0, row.component(1)?.0, row.component(2)?.0];
    Some(shift.iter().map(|v| v * v).sum::<f64>().sqrt() / dt)
}

/// The unit of speeds up to the run's greatest.
pub(crate) fn speed_unit(rows: &[FrameRow]) -> Unit {
    length(rows.iter().filter_map(speed_m_s).fold(0.0, f64::max))
}

/// The six components, speeds in `metres` per second.
pub(crate) fn velocity_series(timeline: &Timeline<'_>, metres: Unit) -> Vec<TimeSeries> {
    COMPONENTS.iter().enumerate().map(|(k, component)| component.series(timeline, metres, k)).collect()
}

impl Component {
    fn unit(&self, metres: Unit) -> Unit {
        if self.phi < 3 { metres } else { DEGREES }
    }

    fn series(&self, timeline: &Timeline<'_>, metres: Unit, k: usize) -> TimeSeries {
        let unit = self.unit(metres);
        let rate = |row: &FrameRow| Some(self.sign * unit.factor / row.interval_s()?);
        let value = |row: &&FrameRow| {
            let ((value, sigma), rate) = row.component(self.phi).zip(rate(row))?;
            Some(Interval::around(value * rate, sigma * rate.abs()))
        };
        let truth = |row: &&FrameRow| Some(Twist::vector(&row.truth?)[self.phi] * rate(row)?);
        TimeSeries {
            id: format!("body-{k}"),
            name: self.name.to_owned(),
            unit: format!("{}/s", unit.name),
            values: timeline.rows.iter().map(value).collect(),
            truths: timeline.rows.iter().map(truth).collect(),
        }
    }
}

/// The six charts.
pub(crate) fn charts(timeline: &Timeline<'_>, all: &[TimeSeries]) -> Markup {
    html! {
        div class="charts" {
            @for (component, series) in COMPONENTS.iter().zip(all) {
                figure {
                    figcaption {
                        b { (component.name) } " " span class="unit" { (series.unit) }
                        span class="sign" {
                            "negative: " (component.negative)
                            @if series.usual_band().is_finite() { "; known to ±" (significant(series.usual_band(), 2)) " " (series.unit) }
                        }
                    }
                    (charts::chart(timeline, series, &charts::axes(timeline, charts::value_range(series), COMPONENT_CHART_SIZE), COMPONENT_CHART_SIZE))
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use egomotion::geometry::RigidMotion;
    use nalgebra::{Vector3, Vector6};

    use super::super::album::Album;
    use super::super::tests::Run;
    use super::*;

    #[test]
    fn signs_are_those_of_a_driver() {
        // The camera goes 2 m forward, 0.1 m right, 0.05 m up, and turns right, nose up, right side down.
        let own = Vector6::new(0.1, -0.05, 2.0, 0.01, 0.02, 0.03);
        let moved: RigidMotion = Twist::from_vector(&own).exp();
        let ahead = moved.rotation * Vector3::z();
        let right = moved.rotation * Vector3::x();
        assert!(ahead.x > 0.0 && ahead.y < 0.0 && right.y > 0.0);
        assert!(moved.translation.z > 1.9 && moved.translation.x > 0.0 && moved.translation.y < 0.0);
        // The scene's motion is the inverse; rows are 0.1 s apart.
        let run = Run::of(&[moved.inverse().log().vector()]);
        let album = Album::of(2);
        let timeline = Timeline::of(&run.report(&album));
        let expected = [20.0, 1.0, 0.5, 0.2_f64.to_degrees(), 0.1_f64.to_degrees(), 0.3_f64.to_degrees()];
        for (series, expected) in velocity_series(&timeline, speed_unit(&run.rows)).iter().zip(expected) {
            let value = series.values[1].unwrap();
            assert!((value.value - expected).abs() < 1e-9, "{}: {value:?}", series.name);
            // σ is 1 mm or 1 mrad an interval, so the band is four times ten of them wide.
            let sigma = if series.unit == "m/s" { 0.01 } else { 0.01_f64.to_degrees() };
            assert!((value.high - value.low - 4.0 * sigma).abs() < 1e-9, "{}", series.name);
            assert!((series.truths[1].unwrap() - expected).abs() < 1e-9);
        }
    }
}
