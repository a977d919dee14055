//! The discrete motion P′ = R P + T from point pairs, equation (22): unconstrained, and with R a rotation.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use super::certainty::covariance::jackknife;
use super::certainty::undetermined::UndeterminedDirections;
use super::linear::lmeds::{LmedsOptions, robust_scale};
use super::motion_estimate::{Estimate, MotionEstimate};
use super::random_subsets::{random_subsets, subsets_needed};
use super::student_t::{LEAST_SCALE2, StudentT};
use super::unsolvable::Unsolvable;
use crate::geometry::distribution::CHI2_3_P50;
use crate::geometry::{Gaussian, RigidMotion, StereoRig, Twist, median};
use crate::observe::StereoTrack;

/// The spread of points counts as zero along a direction below this share of their largest one, or of their squared
/// distance from the camera, whose rounding errors it then is.
const SPREAD_TOLERANCE: f64 = 1e-12;
/// A pair is an inlier of least median of squares with more than this share of the largest weight.
const INLIER_WEIGHT_SHARE: f64 = 0.1;
/// A pair is an inlier of Student's t with more than this robust weight; a residual of zero has 1.75 where ν is 4.
const INLIER_STUDENT_WEIGHT: f64 = 0.25;
/// Least squared distance, in m², that makes an outlier: residuals of an exact fit are rounding errors, and a scale of
/// zero must not reject them all.
const LEAST_CUT2_M2: f64 = 1e-24;

/// One point before and after the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointPair {
    /// P at t, in metres, left camera.
    pub before: Vector3<f64>,
    /// P′ at t′.
    pub after: Vector3<f64>,
    /// Mean variance of a component of P′ − (R P + T), in m².
    pub variance: f64,
    /// Block of neighbouring pixels.
    pub block: usize,
}

impl PointPair {
    /// The points that a track measures; `None` unless both disparities are positive.
    pub fn from_track(track: &StereoTrack, rig: &StereoRig, block: usize) -> Option<Self> {
        let variance = |end: &Gaussian<3>| {
            let j = rig.point_jacobian(&end.mean);
            (j * end.cov * j.transpose()).trace() / 3.0
        };
        Some(Self {
            before: rig.point(&track.before.mean)?,
            after: rig.point(&track.after.mean)?,
            variance: variance(&track.before) + variance(&track.after),
            block,
        })
    }
}

/// Which matrices R are allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Any 3×3 matrix: the linear regression (22) in 12 unknowns.
    Affine,
    /// Rotations only, by SVD.
    Rigid,
}

/// P′ = M P + T.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alignment {
    /// M; a rotation in the rigid form.
    pub linear: Matrix3<f64>,
    /// T, in metres.
    pub translation: Vector3<f64>,
}

impl Alignment {
    fn residual(&self, pair: &PointPair) -> Vector3<f64> {
        pair.after - self.linear * pair.before - self.translation
    }

    fn square(&self, pair: &PointPair) -> f64 {
        self.residual(pair).norm_squared()
    }

    /// The way to another alignment, stretched.
    fn away_to(&self, other: &Self, stretch: &Matrix3<f64>) -> Self {
        Self {
            linear: self.linear + stretch * (other.linear - self.linear),
            translation: self.translation + stretch * (other.translation - self.translation),
        }
    }

    /// The rigid motion with the rotation nearest to M.
    pub fn motion(&self) -> Option<RigidMotion> {
        let rotation = RigidMotion::nearest_rotation(&self.linear)?;
        Some(RigidMotion { rotation, translation: self.translation })
    }

    /// Velocities by the instantaneous form (27), from M as it is.
    pub fn instantaneous(&self) -> Twist {
        RigidMotion { rotation: self.linear, translation: self.translation }.instantaneous()
    }
}

/// Weighted sums over point pairs, which determine both forms.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Moments {
    weight: f64,
    before: Vector3<f64>,
    after: Vector3<f64>,
    spread: Matrix3<f64>,
    cross: Matrix3<f64>,
}

impl Moments {
    /// Sums over weighted pairs.
    pub fn of_weighted_pairs<'a>(pairs: impl IntoIterator<Item = (&'a PointPair, f64)>) -> Self {
        let mut sums = Self::default();
        for (pair, w) in pairs {
            sums.weight += w;
            sums.before += w * pair.before;
            sums.after += w * pair.after;
            sums.spread += w * pair.before * pair.before.transpose();
            sums.cross += w * pair.after * pair.before.transpose();
        }
        sums
    }

    fn without(&self, part: &Self) -> Self {
        Self {
            weight: self.weight - part.weight,
            before: self.before - part.before,
            after: self.after - part.after,
            spread: self.spread - part.spread,
            cross: self.cross - part.cross,
        }
    }

    /// The best alignment of a form; `None` where the points do not determine it.
    pub fn align(&self, form: Form) -> Option<Alignment> {
        if self.weight <= 0.0 {
            return None;
        }
        let (p, q) = (self.before / self.weight, self.after / self.weight);
        let spread = self.spread / self.weight - p * p.transpose();
        let cross = self.cross / self.weight - q * p.transpose();
        // Collinear points leave a rotation undetermined, coplanar ones a matrix; equal ones leave rounding
        // errors of the squared distance from the camera.
        let rounding = SPREAD_TOLERANCE * self.spread.trace() / self.weight;
        let eigen = spread.symmetric_eigenvalues();
        let (smallest, largest) = (eigen.min(), eigen.max());
        let middle = eigen.sum() - smallest - largest;
        let needed = if form == Form::Affine { smallest } else { middle };
        if needed.is_nan() || needed <= rounding.max(SPREAD_TOLERANCE * largest) {
            return None;
        }
        let linear = match form {
            Form::Affine => cross * spread.try_inverse()?,
            Form::Rigid => RigidMotion::nearest_rotation(&cross)?,
        };
        Some(Alignment { linear, translation: q - linear * p })
    }
}

/// How an alignment treats outliers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fitting {
    /// Least squares, all pairs alike, as in the paper.
    LeastSquares,
    /// Least median of squares of the distances |P′ − (M P + T)|, then least squares of the inliers.
    Lmeds(LmedsOptions),
    /// Student's t in units of each pair's own standard deviation.
    MEstimator(StudentT),
}

/// φ by alignment of point pairs, velocities by (25)–(28), covariance by leaving out one block at a time.
///
/// # Errors
/// [`Unsolvable`] with too few pairs, or when they lie in one plane (affine) or on one line.
pub fn align(pairs: &[PointPair], form: Form, fitting: &Fitting) -> Result<MotionEstimate, Unsolvable> {
    let subset = if form == Form::Affine { 4 } else { 3 };
    if pairs.len() < subset {
        return Err(Unsolvable::FewRows { rows: pairs.len(), needed: subset });
    }
    let (weights, scale, stretch) = match fitting {
        Fitting::LeastSquares => (vec![1.0; pairs.len()], None, Matrix3::identity()),
        Fitting::Lmeds(options) => {
            let (weights, scale) = lmeds_weights(pairs, form, subset, options)?;
            (weights, Some(scale), Matrix3::identity())
        }
        Fitting::MEstimator(kernel) => {
            let (weights, scale, slope) = student_weights(pairs, form, kernel)?;
            (weights, Some(scale), stretch(form, &slope))
        }
    };
    let whole = Moments::of_weighted_pairs(pairs.iter().zip(weights.iter().copied()));
    let alignment = whole.align(form).ok_or(Unsolvable::Unobservable)?;
    let phi = |a: &Alignment| a.motion().map(|m| m.log().vector());
    let mean = phi(&alignment).ok_or(Unsolvable::NotFinite)?;
    let residual = || {
        let freedom = (3 * pairs.len()).saturating_sub(3 * subset).max(1) as f64;
        (pairs.iter().map(|pair| alignment.square(pair)).sum::<f64>() / freedom).sqrt()
    };
    let cut = INLIER_WEIGHT_SHARE * weights.iter().copied().fold(0.0, f64::max);
    Ok(Estimate {
        theta: Gaussian { mean, cov: leave_one_out(pairs, &weights, form, &whole, &alignment, &stretch) },
        observed: [true; 6],
        undetermined: UndeterminedDirections::default(),
        rows: pairs.len(),
        inliers: match fitting {
            Fitting::MEstimator(_) => {
                pairs.iter().zip(&weights).filter(|(p, w)| **w * p.variance > INLIER_STUDENT_WEIGHT).count()
            }
            _ => weights.iter().filter(|&&w| w > cut).count(),
        },
        residual_scale: scale.unwrap_or_else(residual),
    })
}

/// The jackknife over blocks: the estimate without each of them, away from `alignment` by `stretch`.
fn leave_one_out(
    pairs: &[PointPair],
    weights: &[f64],
    form: Form,
    whole: &Moments,
    alignment: &Alignment,
    stretch: &Matrix3<f64>,
) -> Matrix6<f64> {
    debug_assert_eq!(pairs.len(), weights.len());
    let count = pairs.iter().map(|pair| pair.block + 1).max().unwrap_or(0);
    let mut members: Vec<Vec<(&PointPair, f64)>> = vec![Vec::new(); count];
    for (pair, &weight) in pairs.iter().zip(weights) {
        members[pair.block].push((pair, weight));
    }
    let left_out: Option<Vec<Vector6<f64>>> = members
        .into_iter()
        .filter(|block| !block.is_empty())
        .map(|block| {
            let rest = whole.without(&Moments::of_weighted_pairs(block)).align(form);
            Some(alignment.away_to(&rest?, stretch).motion()?.log().vector())
        })
        .collect();
    // A block without which nothing is determined may be off by anything.
    jackknife(&left_out.unwrap_or_default())
}

/// Weights of 1 or 0, and the robust scale, by least median of squares.
fn lmeds_weights(
    pairs: &[PointPair],
    form: Form,
    subset: usize,
    options: &LmedsOptions,
) -> Result<(Vec<f64>, f64), Unsolvable> {
    let count = subsets_needed(options.confidence, options.outliers, subset as u32);
    let mut best: Option<(f64, Alignment)> = None;
    let mut squares = vec![0.0; pairs.len()];
    // Subsets of four serve both forms: a rotation uses the first three.
    if pairs.len() >= 4 {
        for four in random_subsets::<4>(pairs.len(), count, options.seed) {
            let chosen = four[..subset].iter().map(|&i| (&pairs[i], 1.0));
            let Some(alignment) = Moments::of_weighted_pairs(chosen).align(form) else { continue };
            squares.iter_mut().zip(pairs).for_each(|(s, pair)| *s = alignment.square(pair));
            let middle = median(&mut squares);
            if best.is_none_or(|(m, _)| middle < m) {
                best = Some((middle, alignment));
            }
        }
    }
    let (middle, mut alignment) = best.ok_or(Unsolvable::Unobservable)?;
    let scale = robust_scale(middle, pairs.len(), subset);
    let limit = (options.cut * scale).powi(2).max(LEAST_CUT2_M2);
    let mut weights = Vec::new();
    for _ in 0..options.reweights.max(1) {
        let next: Vec<f64> =
            pairs.iter().map(|pair| f64::from(u8::from(alignment.square(pair) <= limit))).collect();
        if next == weights {
            break;
        }
        weights = next;
        alignment = Moments::of_weighted_pairs(pairs.iter().zip(weights.iter().copied()))
            .align(form)
            .ok_or(Unsolvable::Unobservable)?;
    }
    Ok((weights, scale))
}

/// How much further an estimate moves when a block is left out than it does while the weights are held.
///
/// `slope` is the mean derivative of the robust score by the residual as a share of the mean weight. A matrix
/// has three regressions of its own, one for each axis; a rotation ties them together.
fn stretch(form: Form, slope: &Matrix3<f64>) -> Matrix3<f64> {
    debug_assert!(slope.trace() != 0.0, "without a slope no residual says anything of the motion");
    let mean = Matrix3::identity() * (3.0 / slope.trace());
    match form {
        Form::Affine => slope.try_inverse().unwrap_or(mean),
        Form::Rigid => mean,
    }
}

/// Weights, scale, and the slope that [`stretch`] needs.
fn student_weights(
    pairs: &[PointPair],
    form: Form,
    kernel: &StudentT,
) -> Result<(Vec<f64>, f64, Matrix3<f64>), Unsolvable> {
    debug_assert!(
        pairs.iter().all(|pair| pair.variance > 0.0),
        "the weight of a pair is its inverse variance"
    );
    let mut slope = Matrix3::identity();
    let mut weights: Vec<f64> = pairs.iter().map(|pair| pair.variance.recip()).collect();
    let mut squares: Vec<f64> = Vec::with_capacity(pairs.len());
    // A robust first scale.
    let mut scale2 = None;
    for _ in 0..kernel.iterations {
        let alignment = Moments::of_weighted_pairs(pairs.iter().zip(weights.iter().copied()))
            .align(form)
            .ok_or(Unsolvable::Unobservable)?;
        squares.clear();
        squares.extend(pairs.iter().map(|pair| alignment.square(pair) / pair.variance));
        let s2 = scale2.unwrap_or_else(|| median(&mut squares.clone()) / CHI2_3_P50).max(LEAST_SCALE2);
        let robust: Vec<f64> = squares.iter().map(|q| kernel.weight(q / s2, 3.0)).collect();
        let sum: f64 = robust.iter().zip(&squares).map(|(w, q)| w * q).sum();
        slope = mean_slope(pairs, &alignment, &robust, |q| kernel.curvature(q / s2, 3.0) / s2);
        scale2 = Some((sum / (3 * pairs.len()) as f64).max(LEAST_SCALE2));
        let next: Vec<f64> = robust.iter().zip(pairs).map(|(w, pair)| w / pair.variance).collect();
        let settled = next.iter().zip(&weights).all(|(a, b)| (a - b).abs() <= kernel.tolerance * a.max(*b));
        weights = next;
        if settled {
            break;
        }
    }
    Ok((weights, scale2.unwrap_or(1.0).sqrt(), slope))
}

/// Σ (w I − κ r rᵀ)/Σ w over pairs, r in units of each pair's σ and κ the curvature at r².
fn mean_slope(
    pairs: &[PointPair],
    alignment: &Alignment,
    weights: &[f64],
    curvature: impl Fn(f64) -> f64,
) -> Matrix3<f64> {
    let (mut bend, mut total) = (Matrix3::zeros(), 0.0);
    for (pair, w) in pairs.iter().zip(weights) {
        let r = alignment.residual(pair);
        bend += (curvature(r.norm_squared() / pair.variance) * r * r.transpose())
            / (pair.variance * pair.variance);
        total += w / pair.variance;
    }
    Matrix3::identity() - bend / total
}
