//! The path of the camera from above, its height over time, and how sure both are.

use egomotion::geometry::RigidMotion;
use maud::{Markup, html};
use nalgebra::{Matrix2, Matrix3, Matrix6, Vector3};

use super::interval::Interval;
use super::report::Report;
use super::time_series::TimeSeries;
use super::timeline::Timeline;
use crate::chart::axes::{Axes, AxisScale, MARGIN, extent, path};
use crate::chart::number::{Unit, length};

/// Width of the chart, in SVG units, which are pixels on a phone.
const WIDTH: f64 = 400.0;
/// Least and greatest height of the chart, in SVG units: a straight path still has room for its labels, and a long one
/// fits on a screen.
const HEIGHT_RANGE: (f64, f64) = (250.0, 400.0);
/// About so many ellipses along the path: with more they cover each other.
const ELLIPSE_COUNT: usize = 10;
/// Most points of the path, several a pixel of its chart: more make the page larger alone.
const MAX_PATH_POINTS: usize = 3000;
/// 95 % quantile of χ² with two degrees of freedom.
const CHI2_95: f64 = 5.991_464_547_107_979;

/// Where the camera was, and how sure that is, at every row.
pub(crate) struct CameraPath<'a> {
    poses: &'a [RigidMotion],
    truth: Vec<RigidMotion>,
    covariances: Vec<Option<Matrix3<f64>>>,
}

impl<'a> CameraPath<'a> {
    /// The path of a run.
    pub(crate) fn of(report: &Report<'a>) -> Self {
        Self {
            poses: report.poses,
            truth: report.truth.map(|truth| aligned(truth, report.poses)).unwrap_or_default(),
            covariances: report.poses.iter().zip(report.pose_covariances).map(position_covariance).collect(),
        }
    }

    /// Half of the longest axis of the last position's 95 % ellipse seen from above, in metres.
    pub(crate) fn end_within_m(&self) -> Option<f64> {
        let [(long, _), _] = half_axes(&from_above((*self.covariances.last()?)?))?;
        Some(long)
    }

    /// The view from above.
    pub(crate) fn chart(&self, report: &Report<'_>) -> Markup {
        let axes = equal_axes(self.poses, &self.truth);
        let height = axes.y.at(axes.y.range().0).unwrap_or(HEIGHT_RANGE.0) + MARGIN[3];
        let place = |pose: &RigidMotion| axes.at(pose.translation.x, pose.translation.z);
        let few = self.poses.len().div_ceil(MAX_PATH_POINTS).max(1);
        let thinned = |poses: &'_ [RigidMotion]| -> String {
            path(poses.iter().step_by(few).chain(poses.last()).map(place))
        };
        let ellipse = |k: usize| {
            let cov = from_above((*self.covariances.get(k)?)?);
            Ellipse::new(place(self.poses.get(k)?)?, &cov, pixels_per_metre(&axes))
        };
        let ellipses: Vec<Ellipse> =
            spaced(self.poses.len(), ELLIPSE_COUNT).filter_map(ellipse).filter(|e| e.radii.0 > 1.2).collect();
        let ends = [self.poses.first().zip(Some("start")), self.poses.last().zip(Some("end"))];
        html! {
            svg viewBox=(format!("0 0 {WIDTH} {height:.1}")) role="img" aria-label="path of the camera from above" {
                (axes.grid("to the right (m)", "forward (m)", (5, 6)))
                path class="true" d=(thinned(&self.truth)) {}
                @for ellipse in &ellipses { (ellipse.markup()) }
                path class="line" d=(thinned(self.poses)) {}
                @for (pose, name) in ends.into_iter().flatten() {
                    @if let Some((x, y)) = place(pose) {
                        circle class=(name) cx=(format!("{x:.1}")) cy=(format!("{y:.1}")) r="4" {}
                        text x=(format!("{:.1}", x + 9.0)) y=(format!("{:.1}", y + 4.0)) { (name) }
                    }
                }
                (self.camera(report, &axes))
            }
            p class="small" { (self.sentence(!ellipses.is_empty())) }
        }
    }

    /// Height above the start over time.
    pub(crate) fn height(&self, report: &Report<'_>, timeline: &Timeline<'_>) -> TimeSeries {
        let all = self.poses.iter().chain(&self.truth);
        let unit: Unit =
            length(all.map(|p| p.translation.y.abs()).filter(|y| y.is_finite()).fold(0.0, f64::max));
        let step = report.frames.len().div_ceil(timeline.rows.len().max(1)).max(1);
        let value = |k: usize| {
            // Y points down.
            let height = -self.poses.get(k)?.translation.y * unit.factor;
            let sigma = self.covariances.get(k)?.map_or(f64::INFINITY, |cov| cov[(1, 1)].sqrt());
            height.is_finite().then(|| Interval::around(height, sigma * unit.factor))
        };
        let truth =
            |k: usize| Some(-self.truth.get(k)?.translation.y * unit.factor).filter(|y| y.is_finite());
        let rows = || (0..report.frames.len()).step_by(step);
        TimeSeries {
            id: "height".into(),
            name: "Height above the start".into(),
            unit: unit.name.into(),
            values: rows().map(value).collect(),
            truths: rows().map(truth).collect(),
        }
    }

    /// The camera as a triangle that follows the slider.
    fn camera(&self, report: &Report<'_>, axes: &Axes) -> Markup {
        let transform = |pose: &RigidMotion| {
            let (x, y) = axes.at(pose.translation.x, pose.translation.z)?;
            let ahead = pose.rotation * Vector3::z();
            let angle = ahead.x.atan2(ahead.z).to_degrees();
            angle.is_finite().then(|| format!("{x:.1} {y:.1} {angle:.1}"))
        };
        let at: Vec<String> = report
            .slider_positions()
            .iter()
            .map(|position| self.poses.get(position.row).and_then(transform))
            .map(|at| at.unwrap_or_else(|| "-99 0 0".into()))
            .collect();
        html! {
            @if !at.is_empty() { path class="camera" data-pose=(at.join(";")) d="M0 -11L7 6H-7Z" {} }
        }
    }

    fn sentence(&self, visible: bool) -> String {
        let Some(long) = self.end_within_m() else {
            return "How sure the last position is cannot be said: some motion on the way is not fully known.".into();
        };
        let unit = length(long);
        let drawn = match visible {
            true => "The shaded ellipses hold the position with 95 % probability",
            false => "The 95 % ellipses of the position are too small to be seen here",
        };
        format!(
            "{drawn}. They grow, because every step adds its own uncertainty (steps are taken as independent): at the end to ±{} along the longer axis.",
            unit.show(long * unit.factor, 2)
        )
    }
}

/// The part of a covariance that is seen from above, (X, Z).
fn from_above(cov: Matrix3<f64>) -> Matrix2<f64> {
    Matrix2::new(cov[(0, 0)], cov[(0, 2)], cov[(2, 0)], cov[(2, 2)])
}

/// A list of poses moved as a whole, so that its first is that of `to`.
fn aligned(poses: &[RigidMotion], to: &[RigidMotion]) -> Vec<RigidMotion> {
    let (Some(first), Some(start)) = (poses.first(), to.first()) else { return Vec::new() };
    let there = start.after(&first.inverse());
    poses.iter().map(|pose| there.after(pose)).collect()
}

/// Axes on which a metre is as long to the right as forward.
fn equal_axes(poses: &[RigidMotion], truth: &[RigidMotion]) -> Axes {
    let of = |k: usize| extent(poses.iter().chain(truth).map(|p| p.translation[k])).unwrap_or((0.0, 0.0));
    let (x, z) = (of(0), of(2));
    let room = 0.08 * (x.1 - x.0).max(z.1 - z.0).max(1e-3);
    let (wide, high) = (x.1 - x.0 + 2.0 * room, z.1 - z.0 + 2.0 * room);
    let inside = WIDTH - MARGIN[0] - MARGIN[1];
    let top = MARGIN[2] + 14.0;
    let tall =
        (inside * high / wide).clamp(HEIGHT_RANGE.0 - top - MARGIN[3], HEIGHT_RANGE.1 - top - MARGIN[3]);
    let metres_per_px = (wide / inside).max(high / tall);
    let around = |(lo, hi): (f64, f64), px: f64| {
        let (middle, half) = (0.5 * (lo + hi), 0.5 * px * metres_per_px);
        (middle - half, middle + half)
    };
    Axes {
        x: AxisScale::linear(around(x, inside), (MARGIN[0], MARGIN[0] + inside)),
        y: AxisScale::linear(around(z, tall), (top + tall, top)),
    }
}

fn pixels_per_metre(axes: &Axes) -> f64 {
    let (lo, hi) = axes.x.range();
    axes.inside()[2] / (hi - lo)
}

/// Up to about `n` indices below `len`, evenly spaced, the last among them.
fn spaced(len: usize, n: usize) -> impl Iterator<Item = usize> {
    let step = len.div_ceil(n.max(1)).max(1);
    (0..len).rev().step_by(step)
}

/// Covariance of a position in the world, in m²; `None` where it is not known.
fn position_covariance((pose, cov): (&RigidMotion, &Matrix6<f64>)) -> Option<Matrix3<f64>> {
    let of_translation = cov.fixed_view::<3, 3>(0, 0);
    let known = of_translation.iter().all(|v| v.is_finite());
    known.then(|| pose.rotation * of_translation * pose.rotation.transpose())
}

/// A 95 % ellipse, in SVG units and degrees.
struct Ellipse {
    centre: (f64, f64),
    radii: (f64, f64),
    angle_deg: f64,
}

impl Ellipse {
    fn new(centre: (f64, f64), cov: &Matrix2<f64>, pixels_per_metre: f64) -> Option<Self> {
        let [(long, direction), (short, _)] = half_axes(cov)?;
        // Forward is up, so the angle turns the other way.
        let angle_deg = (-direction.1).atan2(direction.0).to_degrees();
        Some(Self { centre, radii: (long * pixels_per_metre, short * pixels_per_metre), angle_deg })
    }

    fn markup(&self) -> Markup {
        let ((x, y), (rx, ry)) = (self.centre, self.radii);
        html! {
            ellipse class="ellipse" rx=(format!("{rx:.2}")) ry=(format!("{ry:.2}"))
                transform=(format!("translate({x:.1} {y:.1}) rotate({:.1})", self.angle_deg)) {}
        }
    }
}

/// Half axes of the 95 % ellipse in metres, the longer first, and their directions (X, Z).
fn half_axes(cov: &Matrix2<f64>) -> Option<[(f64, (f64, f64)); 2]> {
    if !cov.iter().all(|v| v.is_finite()) {
        return None;
    }
    let eigen = cov.symmetric_eigen();
    let axis = |k: usize| {
        let direction = eigen.eigenvectors.column(k);
        ((CHI2_95 * eigen.eigenvalues[k].max(0.0)).sqrt(), (direction[0], direction[1]))
    };
    let long = usize::from(eigen.eigenvalues[1] > eigen.eigenvalues[0]);
    Some([axis(long), axis(1 - long)])
}

#[cfg(test)]
mod tests {
    use egomotion::geometry::Twist;
    use nalgebra::Vector6;

    use super::*;

    /// Poses from motions, as the trajectory is built.
    fn poses(phis: &[Vector6<f64>]) -> Vec<RigidMotion> {
        let mut all = vec![RigidMotion::identity()];
        for phi in phis {
            let last = all[all.len() - 1];
            all.push(last.after(&Twist::from_vector(phi).exp().inverse()));
        }
        all
    }

    #[test]
    fn what_is_uncertain_ahead_is_so_where_the_camera_looks() {
        let right =
            Twist { omega: Vector3::new(0.0, std::f64::consts::FRAC_PI_2, 0.0), t: Vector3::zeros() }.exp();
        let cov = Matrix6::from_diagonal(&Vector6::new(1.0, 2.0, 9.0, 0.0, 0.0, 0.0));
        let seen = position_covariance((&right, &cov)).unwrap();
        assert!((seen - Matrix3::from_diagonal(&Vector3::new(9.0, 2.0, 1.0))).amax() < 1e-12, "{seen}");
        let unknown = Matrix6::from_diagonal_element(f64::INFINITY);
        assert_eq!(position_covariance((&right, &unknown)), None);
    }

    #[test]
    fn truth_starts_where_the_estimate_does() {
        let phis = vec![Vector6::new(0.1, 0.0, -0.2, 0.0, 0.2, 0.0); 3];
        let estimate = poses(&phis);
        let elsewhere = Twist::from_vector(&Vector6::new(5.0, 1.0, 2.0, 0.3, 0.2, 0.1)).exp();
        let truth: Vec<_> = estimate.iter().map(|pose| elsewhere.after(pose)).collect();
        for (a, b) in aligned(&truth, &estimate).iter().zip(&estimate) {
            assert!((a.translation - b.translation).norm() < 1e-12);
        }
    }
}
