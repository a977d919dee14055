//! The paper's two steps for binocular flow: (14) for tZ, ΩX, ΩY, then (3) for the other three.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use super::fit::LinearFit;
use super::row::Row;
use crate::estimate::certainty::blocks::BlockScore;
use crate::estimate::certainty::covariance::{covariance, with_unobserved};
use crate::estimate::certainty::observability::Observability;
use crate::estimate::motion_estimate::{Estimate, MotionEstimate};
use crate::estimate::unsolvable::Unsolvable;
use crate::geometry::Gaussian;

/// Places of (tZ, ΩX, ΩY) in φ: what binocular flow determines.
const FIRST: [usize; 3] = [2, 3, 4];
/// Places of (tX, tY, ΩZ) in φ: what is left to image flow.
const SECOND: [usize; 3] = [0, 1, 5];

fn part(v: &Vector6<f64>, places: [usize; 3]) -> Vector3<f64> {
    Vector3::from_fn(|i, _| v[places[i]])
}

/// φ in two steps: `solve` finds (tZ, ΩX, ΩY) from the rows `dv`, then (tX, tY, ΩZ) from the rows `flow`.
///
/// The error of the first step is carried into the covariance of the second. Where the first does not find all
/// its three (a level ground does not tell tZ from ΩX), the second subtracts an arbitrary motion, so that none of
/// its own are observed either.
///
/// # Errors
/// Those of `solve`.
pub fn two_step(
    dv: &[Row<6>],
    flow: &[Row<6>],
    solve: impl Fn(&[Row<3>]) -> Result<LinearFit<3>, Unsolvable>,
) -> Result<MotionEstimate, Unsolvable> {
    let first_rows: Vec<Row<3>> =
        dv.iter().map(|r| Row { a: part(&r.a, FIRST), b: r.b, sigma: r.sigma, block: r.block }).collect();
    let first = solve(&first_rows)?;
    let second_rows: Vec<Row<3>> = flow
        .iter()
        .map(|r| Row {
            a: part(&r.a, SECOND),
            b: r.b - part(&r.a, FIRST).dot(&first.theta),
            sigma: r.sigma,
            block: r.block,
        })
        .collect();
    let second = solve(&second_rows)?;

    let mut system = StackedSystem::new(dv.iter().chain(flow).map(|r| r.block + 1).max().unwrap_or(0));
    system.add(&first_rows, &first, FIRST);
    system.add(&second_rows, &second, SECOND);
    system.couple(flow, &second);
    let (mut cov, observability) = system.covariance()?;
    let (mut observed, mut undetermined) = (observability.observed(), observability.undetermined());
    let mut mean = Vector6::zeros();
    for i in 0..3 {
        mean[FIRST[i]] = first.theta[i];
        mean[SECOND[i]] = second.theta[i];
    }
    if first.observability.rank() < 3 {
        SECOND.into_iter().for_each(|i| observed[i] = false);
        undetermined = undetermined.with_components(SECOND);
        cov = with_unobserved(cov, &observed);
    }
    for i in (0..6).filter(|&i| !observed[i]) {
        mean[i] = f64::NAN;
    }
    Ok(Estimate {
        theta: Gaussian { mean, cov },
        observed,
        undetermined,
        rows: dv.len() + flow.len(),
        inliers: first.inliers + second.inliers,
        residual_scale: second.residual_scale,
    })
}

/// Factor that brings a step's score to units of its residuals' σ.
///
/// The first step's rows may be in 1/m and the second's in pixels: without it neither scatter could be
/// compared with the other, as shrinkage does.
fn unit_of_score(fit: &LinearFit<3>) -> f64 {
    let unit = fit.residual_scale.powi(-2);
    if unit.is_finite() && unit > 0.0 { unit } else { 1.0 }
}

/// Both steps as one system of estimating equations, whose derivative is block triangular.
struct StackedSystem {
    scores: Vec<BlockScore<6>>,
    bread: Matrix6<f64>,
}

impl StackedSystem {
    fn new(blocks: usize) -> Self {
        Self { scores: vec![BlockScore::default(); blocks], bread: Matrix6::zeros() }
    }

    fn add(&mut self, rows: &[Row<3>], fit: &LinearFit<3>, places: [usize; 3]) {
        let mut information = Matrix3::zeros();
        let unit = unit_of_score(fit);
        for (row, &weight) in rows.iter().zip(&fit.weights) {
            let weight = weight * unit;
            let (outer, score) =
                (weight * row.a * row.a.transpose(), weight * row.residual(&fit.theta) * row.a);
            information += outer;
            let block = &mut self.scores[row.block];
            for i in 0..3 {
                block.score[places[i]] += score[i];
                for j in 0..3 {
                    block.information[(places[i], places[j])] += outer[(i, j)];
                }
            }
        }
        let bread = fit.bread.map_or(information, |bread| bread * unit);
        for i in 0..3 {
            for j in 0..3 {
                self.bread[(places[i], places[j])] += bread[(i, j)];
            }
        }
    }

    /// How the second step's score changes with the first step's answer.
    fn couple(&mut self, flow: &[Row<6>], second: &LinearFit<3>) {
        let unit = unit_of_score(second);
        let (mut coupling, mut information) = (Matrix3::zeros(), Matrix3::zeros());
        for (row, &weight) in flow.iter().zip(&second.weights) {
            let a = part(&row.a, SECOND);
            coupling += weight * unit * a * part(&row.a, FIRST).transpose();
            information += weight * a * a.transpose();
        }
        // Robust weights give way, to the first step's error as to the second's unknowns: bread over information.
        if let Some(ratio) =
            second.bread.zip(information.try_inverse()).map(|(bread, inverse)| bread * inverse)
        {
            coupling = ratio * coupling;
        }
        for i in 0..3 {
            for j in 0..3 {
                self.bread[(SECOND[i], FIRST[j])] += coupling[(i, j)];
            }
        }
    }

    fn covariance(&self) -> Result<(Matrix6<f64>, Observability), Unsolvable> {
        let total: Matrix6<f64> = self.scores.iter().map(|block| block.information).sum();
        let observability = Observability::of(&total)?;
        let inverse = self.bread.try_inverse();
        Ok((covariance(&self.scores, inverse.as_ref(), &observability), observability))
    }
}
