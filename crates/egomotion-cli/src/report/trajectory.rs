//! The path of the camera from above, and how sure it is.

use egomotion::geometry::{RigidMotion, Twist};
use maud::{Markup, html};
use nalgebra::{Matrix2, Matrix6, Vector3};

use super::Report;
use crate::chart::number::length;
use crate::chart::plot::{Axes, MARGIN, Scale, extent, path};

/// Width of the chart, in SVG units.
const WIDTH: f64 = 380.0;
/// Least and greatest height.
const HEIGHTS: (f64, f64) = (260.0, 390.0);
/// About so many ellipses along the path.
const ELLIPSES: usize = 10;
/// 95 % quantile of χ² with two degrees of freedom.
const CHI2_95: f64 = 5.991_464_547_107_979;

/// The chart with a sentence on the ellipses.
pub fn chart(report: &Report<'_>) -> Markup {
    let truth = report.truth.map(|truth| aligned(truth, report.poses)).unwrap_or_default();
    let axes = equal_axes(report.poses, &truth);
    let height = axes.y.at(axes.y.range().0).unwrap_or(HEIGHTS.0) + MARGIN[3];
    let place = |pose: &RigidMotion| axes.at(pose.translation.x, pose.translation.z);
    let covariances = position_covariances(report);
    let ellipses: Vec<Ellipse> = spaced(report.poses.len(), ELLIPSES)
        .filter_map(|k| {
            Ellipse::new(place(report.poses.get(k)?)?, &(*covariances.get(k)?)?, pixels_per_metre(&axes))
        })
        .filter(|ellipse| ellipse.radii.0 > 1.2)
        .collect();
    let ends = [report.poses.first().zip(Some("start")), report.poses.last().zip(Some("end"))];
    html! {
        svg viewBox=(format!("0 0 {WIDTH} {height:.1}")) role="img" aria-label="path of the camera from above" {
            (axes.grid("X, to the right (m)", "Z, forward (m)", (5, 6)))
            path class="true" d=(path(truth.iter().map(place))) {}
            @for ellipse in &ellipses { (ellipse.markup()) }
            path class="line" d=(path(report.poses.iter().map(place))) {}
            @for (pose, name) in ends.into_iter().flatten() {
                @if let Some((x, y)) = place(pose) {
                    circle class=(name) cx=(format!("{x:.1}")) cy=(format!("{y:.1}")) r="4.5" {}
                    text x=(format!("{:.1}", x + 9.0)) y=(format!("{:.1}", y + 4.0)) { (name) }
                }
            }
            (camera(report, &axes))
        }
        p class="small" { (sentence(&covariances, !ellipses.is_empty())) }
    }
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
    let tall = (inside * high / wide).clamp(HEIGHTS.0 - top - MARGIN[3], HEIGHTS.1 - top - MARGIN[3]);
    let metres_per_px = (wide / inside).max(high / tall);
    let around = |(lo, hi): (f64, f64), px: f64| {
        let (middle, half) = (0.5 * (lo + hi), 0.5 * px * metres_per_px);
        (middle - half, middle + half)
    };
    Axes {
        x: Scale::linear(around(x, inside), (MARGIN[0], MARGIN[0] + inside)),
        y: Scale::linear(around(z, tall), (top + tall, top)),
    }
}

fn pixels_per_metre(axes: &Axes) -> f64 {
    let (lo, hi) = axes.x.range();
    axes.inside()[2] / (hi - lo)
}

/// The camera as a triangle that follows the slider.
fn camera(report: &Report<'_>, axes: &Axes) -> Markup {
    let transform = |pose: &RigidMotion| {
        let (x, y) = axes.at(pose.translation.x, pose.translation.z)?;
        let ahead = pose.rotation * Vector3::z();
        let angle = ahead.x.atan2(ahead.z).to_degrees();
        angle.is_finite().then(|| format!("translate({x:.1} {y:.1}) rotate({angle:.1})"))
    };
    let row_of_pose = |row: usize| row + report.poses.len().saturating_sub(report.frames.len());
    let at: Vec<String> = report
        .shown_rows()
        .into_iter()
        .map(|row| row.and_then(|row| transform(report.poses.get(row_of_pose(row))?)))
        .map(|at| at.unwrap_or_else(|| "translate(-99 0)".into()))
        .collect();
    html! {
        @if let Some(first) = at.first() {
            path class="camera" transform=(first) data-at=(at.join(";")) d="M0 -11L7 6H-7Z" {}
        }
    }
}

/// Up to about `n` indices below `len`, evenly spaced, the last among them.
fn spaced(len: usize, n: usize) -> impl Iterator<Item = usize> {
    let step = len.div_ceil(n.max(1)).max(1);
    (0..len).rev().step_by(step)
}

/// Covariance of (X, Z) in m² at every pose, added up from those of φ; `None` from where it is unknown.
///
/// With T' = T exp(φ)⁻¹ and φ = φ̂ + δ the error of the pose, seen from the world, grows by −Ad(T') J δ.
fn position_covariances(report: &Report<'_>) -> Vec<Option<Matrix2<f64>>> {
    let mut sum = Some(Matrix6::<f64>::zeros());
    let mut answered_s = None;
    let first = report.poses.len().saturating_sub(report.frames.len());
    let mut all: Vec<Option<Matrix2<f64>>> = vec![Some(Matrix2::zeros()); first.min(report.poses.len())];
    for (row, pose) in report.frames.iter().zip(report.poses.iter().skip(first)) {
        let last_s: &mut Option<f64> = &mut answered_s;
        if let (Some(motion), Some(dt)) = (&row.motion, row.dt_s) {
            // An interval that does not reach back to the last answer leaves a gap of unknown motion.
            let whole = last_s.is_none_or(|last| row.time_s - dt <= last + 1e-6 * dt.abs().max(1e-3));
            let known = whole && motion.theta.cov.iter().all(|v| v.is_finite());
            let phi = Twist::from_vector(&motion.theta.mean);
            let by_phi = adjoint(pose) * phi.left_jacobian();
            sum = sum.filter(|_| known).map(|s| s + by_phi * motion.theta.cov * by_phi.transpose());
        }
        if row.motion.is_some() || !row.asks() || last_s.is_none() {
            *last_s = Some(row.time_s);
        }
        all.push(sum.map(|s| {
            let by_pose = RigidMotion::point_jacobian(&pose.translation);
            let position = by_pose * s * by_pose.transpose();
            Matrix2::new(position[(0, 0)], position[(0, 2)], position[(2, 0)], position[(2, 2)])
        }));
    }
    all
}

/// Ad(T): a small motion (t, Ω) in the camera's frame, seen from the world.
fn adjoint(pose: &RigidMotion) -> Matrix6<f64> {
    let mut ad = Matrix6::zeros();
    ad.fixed_view_mut::<3, 3>(0, 0).copy_from(&pose.rotation);
    ad.fixed_view_mut::<3, 3>(3, 3).copy_from(&pose.rotation);
    ad.fixed_view_mut::<3, 3>(0, 3).copy_from(&(pose.translation.cross_matrix() * pose.rotation));
    ad
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

fn sentence(covariances: &[Option<Matrix2<f64>>], visible: bool) -> String {
    let Some(Some(last)) = covariances.last() else {
        return "How sure the last position is cannot be said: some motion on the way is not fully known."
            .into();
    };
    let Some([(long, _), _]) = half_axes(last) else { return String::new() };
    let unit = length(long);
    let drawn = if visible {
        "Ellipses hold the position with 95 %"
    } else {
        "The 95 % ellipses are too small to draw"
    };
    format!(
        "{drawn}; they grow because every step adds its uncertainty (taken as independent), at the end to ±{} along the longer axis.",
        unit.show(long * unit.factor, 2)
    )
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::super::tests::{Run, motion};
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
    fn covariance_of_the_position_is_that_of_differences() {
        let mut phis: Vec<Vector6<f64>> = (0..5)
            .map(|k| Vector6::new(0.1, -0.05, -0.4, 0.02, 0.3, -0.1) * (1.0 + 0.3 * f64::from(k)))
            .collect();
        let mut run = Run::of(&phis);
        let cov = Matrix6::from_fn(|i, j| if i == j { 1e-4 * (1 + i) as f64 } else { 2e-5 });
        for row in &mut run.rows {
            if let Some(estimate) = &mut row.motion {
                estimate.theta.cov = cov;
            }
        }
        run.poses = poses(&phis);
        let found = position_covariances(&run.report()).last().copied().flatten().unwrap();
        let mut expected = Matrix2::zeros();
        for k in 0..phis.len() {
            let mut jacobian = nalgebra::SMatrix::<f64, 2, 6>::zeros();
            for c in 0..6 {
                let mut at = |step: f64| {
                    phis[k][c] += step;
                    let end = poses(&phis)[phis.len()].translation;
                    phis[k][c] -= step;
                    nalgebra::Vector2::new(end.x, end.z)
                };
                jacobian.set_column(c, &((at(1e-6) - at(-1e-6)) / 2e-6));
            }
            expected += jacobian * cov * jacobian.transpose();
        }
        assert!((found - expected).norm() < 1e-6 * expected.norm(), "{found} {expected}");
    }

    #[test]
    fn a_gap_that_no_interval_bridges_ends_the_ellipses() {
        let phis = vec![Vector6::new(0.0, 0.0, -0.1, 0.0, 0.0, 0.0); 4];
        let mut run = Run::of(&phis);
        run.rows[2].motion = None;
        run.rows[2].status = "few_rows".into();
        let known =
            |run: &Run| position_covariances(&run.report()).iter().map(Option::is_some).collect::<Vec<_>>();
        assert_eq!(known(&run), [true, true, true, false, false]);
        run.rows[3].dt_s = Some(0.2);
        assert_eq!(known(&run), [true; 5]);
        run.rows[4].motion = Some(motion(&phis[0], f64::INFINITY));
        assert_eq!(known(&run), [true, true, true, true, false]);
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
