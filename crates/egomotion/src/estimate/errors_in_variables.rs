//! The depth change constraint with noise in its regressors.
//!
//! In disparity, (11) times −d²/(b f) reads e = d_t + d_x u + d_y v − s = 0, where (u, v, s) is how (x, y, d) of the
//! point moves under φ: velocities, or the finite motion of the discrete form, which is exact on planes. It is linear
//! in what was measured but for d, so that nothing is lost by inverting a noisy disparity.
//!
//! Its derivative by φ, g = (d_x, d_y, −1) ∂(u, v, s)/∂φ, is as noisy as e, and partly by the same noise: least
//! squares, Σ g e/V = 0, attenuates. The part of g that is independent of e is ĝ = g − c e/V, with c = cov(g, e) and V =
//! var(e): g at the measurement moved on to the constraint. Then Σ w(e²/V) ĝ e/V is zero in the mean at the true φ, for
//! *any* weight (the conditional score of Stefanski and Carroll 1987; for w = 1 the minimum of Σ e²/V, as Chojnacki et
//! al. 2000 have it). Only the covariances' shape matters, not their scale. The derivative of the score is that of
//! exact regressors, Σ w (ĝ ĝᵀ − cov ĝ)/V: the corrected normal equations (Fuller 1987).
//!
//! What is left is the error of differences in place of derivatives: on a surface that is curved along the way a point
//! goes in an interval, d_t has a part of third order (of second in the discrete form), which no noise model tells.
//!
//! Noise alone fills the plain normal equations up to full rank. A direction is determined only where what is left of
//! them after the correction exceeds what the noise's own scatter could leave.

use nalgebra::{DMatrix, DVector, Matrix4, Matrix6, RowVector3, SMatrix, SVector, Vector3, Vector4, Vector6};
use rayon::prelude::*;

use super::blocks::{self, BlockScore, Blocks};
use super::m_estimator::{LEAST_SCALE2, StudentT};
use super::{Estimate, MotionEstimate, Observability, Unsolvable, median};
use crate::geometry::{Gaussian, RigidMotion, StereoRig, Twist};
use crate::observe::DepthChange;

/// What the rate of a depth change is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Velocities: everything at t.
    Differential,
    /// A finite motion: the gradient and the later disparity at t′, (17).
    Discrete,
}

/// One observation in disparity: (d, d_x, d_y, d_t) at (x, y) with its covariance.
#[derive(Debug, Clone, Copy)]
struct DisparityChange {
    x: f64,
    y: f64,
    mean: Vector4<f64>,
    cov: Matrix4<f64>,
}

impl DisparityChange {
    /// Undo (32), (33) and (35), by the same Jacobian; `None` unless both disparities are positive.
    fn of(change: &DepthChange, form: Form, bf: f64) -> Option<Self> {
        let [z, zx, zy, zt] = change.depth.mean.into();
        // The gradient belongs to the later depth in the discrete form.
        let later = if form == Form::Discrete { z + zt } else { z };
        let (d, after) = (bf / z, bf / later);
        let slope = |d: f64| -d * d / bf;
        let (dx, dy) = (slope(after) * zx, slope(after) * zy);
        // ∂d_i/∂z through the slope −d²/(b f), whose derivative is 2 d³/(b f)².
        let bend = 2.0 * after.powi(3) / (bf * bf);
        let (jacobian, dt) = match form {
            Form::Differential => (
                Matrix4::new(
                    slope(d),
                    0.0,
                    0.0,
                    0.0, //
                    bend * zx,
                    slope(d),
                    0.0,
                    0.0, //
                    bend * zy,
                    0.0,
                    slope(d),
                    0.0, //
                    bend * zt,
                    0.0,
                    0.0,
                    slope(d),
                ),
                slope(d) * zt,
            ),
            Form::Discrete => (
                Matrix4::new(
                    slope(d),
                    0.0,
                    0.0,
                    0.0, //
                    bend * zx,
                    slope(after),
                    0.0,
                    bend * zx, //
                    bend * zy,
                    0.0,
                    slope(after),
                    bend * zy, //
                    slope(after) - slope(d),
                    0.0,
                    0.0,
                    slope(after),
                ),
                after - d,
            ),
        };
        let gaussian = change.depth.propagate(Vector4::new(d, dx, dy, dt), &jacobian);
        let usable =
            d > 0.0 && after > 0.0 && gaussian.cov.iter().chain(gaussian.mean.iter()).all(|v| v.is_finite());
        usable.then_some(Self { x: change.x_px, y: change.y_px, mean: gaussian.mean, cov: gaussian.cov })
    }
}

/// An observation at φ.
#[derive(Debug, Clone, Copy)]
struct Linearised {
    /// e/√V.
    standard: f64,
    /// ĝ/√V: regressors free of e's noise.
    regressor: Vector6<f64>,
    /// The covariance of `regressor`.
    noise: Matrix6<f64>,
    /// c/V: what e takes of its noise to g.
    common: Vector6<f64>,
}

impl Linearised {
    /// g/√V, as it was measured.
    fn plain(&self) -> Vector6<f64> {
        self.regressor + self.common * self.standard
    }
}

/// Which estimating equations are summed up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Equations {
    /// Σ (w g e − s² c)/V: linear in φ but for V, so that they find their way from any start; they need the noise's scale.
    Moments,
    /// Σ w ĝ e/V.
    Conditional,
}

/// The motion about which observations are linearised.
struct At<'a> {
    phi: Twist,
    motion: RigidMotion,
    /// ∂δ/∂φ of the small motion δ that follows.
    by_phi: Matrix6<f64>,
    form: Form,
    rig: &'a StereoRig,
}

impl<'a> At<'a> {
    fn new(phi: Twist, form: Form, rig: &'a StereoRig) -> Self {
        let by_phi = match form {
            Form::Differential => Matrix6::identity(),
            Form::Discrete => phi.left_jacobian(),
        };
        Self { motion: phi.exp(), phi, by_phi, form, rig }
    }

    /// Where (x, y, d) is when velocities act on it, and (u, v, s), how it moves.
    fn moved(&self, xyd: &Vector3<f64>) -> Option<(Vector3<f64>, Vector3<f64>)> {
        match self.form {
            Form::Differential => Some((*xyd, self.rig.velocity_jacobian(xyd) * self.phi.vector())),
            Form::Discrete => {
                let later = self.rig.project(&self.motion.apply(&self.rig.point(xyd)?))?;
                Some((later, later - xyd))
            }
        }
    }

    fn linearise(&self, change: &DisparityChange) -> Option<Linearised> {
        let [d, dx, dy, dt] = change.mean.into();
        let xyd = Vector3::new(change.x, change.y, d);
        let (place, shift) = self.moved(&xyd)?;
        let direction = RowVector3::new(dx, dy, -1.0);
        let e = dt + (direction * shift)[0];
        let velocities = self.rig.velocity_jacobian(&place);
        let g = (direction * velocities).transpose();
        // How both change with d: (u, v, s) exactly, the regressors to first order in the motion.
        let step = 1e-4 * d;
        let shift_by_d = (self.moved(&(xyd + Vector3::z() * step))?.1
            - self.moved(&(xyd - Vector3::z() * step))?.1)
            / (2.0 * step);
        let by_d = (direction * velocities_by_disparity(&place, self.rig)).transpose();
        let e_by = Vector4::new((direction * shift_by_d)[0], shift.x, shift.y, 1.0);
        let g_by = SMatrix::<f64, 6, 4>::from_columns(&[
            by_d,
            velocities.row(0).transpose(),
            velocities.row(1).transpose(),
            Vector6::zeros(),
        ]);
        let spread = change.cov * e_by;
        let variance = e_by.dot(&spread);
        if !(variance > 0.0 && variance.is_finite()) {
            return None;
        }
        let common = g_by * spread;
        let regressor = g - common * (e / variance);
        let noise = g_by * change.cov * g_by.transpose() - common * common.transpose() / variance;
        let root = variance.sqrt().recip();
        Some(Linearised {
            standard: e * root,
            regressor: regressor * root,
            noise: noise / variance,
            common: common / variance,
        })
    }
}

/// ∂/∂d of [`StereoRig::velocity_jacobian`].
fn velocities_by_disparity(xyd: &Vector3<f64>, rig: &StereoRig) -> SMatrix<f64, 3, 6> {
    let (f, bf, [x, y, d]) = (rig.focal_px, rig.depth_disparity_product(), (*xyd).into());
    SMatrix::from_columns(&[
        Vector3::new(f, 0.0, 0.0) / bf,
        Vector3::new(0.0, f, 0.0) / bf,
        Vector3::new(-x, -y, -2.0 * d) / bf,
        Vector3::new(0.0, 0.0, -y / f),
        Vector3::new(0.0, 0.0, x / f),
        Vector3::zeros(),
    ])
}

/// Observations that are summed by one thread.
const STRIP: usize = 2048;

/// What all observations say at φ.
struct Sums {
    /// −Σ w ĝ e/V, by φ.
    score: Vector6<f64>,
    /// Σ w (ĝ ĝᵀ − s² cov ĝ)/V.
    information: Matrix6<f64>,
    /// The same, with the weights' own change.
    bread: Matrix6<f64>,
    /// Σ w s² cov ĝ/V.
    noise: Matrix6<f64>,
    /// Σ n nᵀ over the rows, n the 21 numbers of what each adds to `noise`.
    noise_square: SMatrix<f64, 21, 21>,
    /// Σ w e²/V.
    square: f64,
    used: usize,
    inliers: usize,
}

/// How observations are weighed.
#[derive(Debug, Clone, Copy)]
struct Weighing<'a> {
    kernel: &'a StudentT,
    /// Squared scale s² of e²/V by which the kernel weighs.
    scale2: f64,
    /// Variance of e²/V's normal core, of which s² is a share: factor of all stated covariances.
    variance2: f64,
}

impl<'a> Weighing<'a> {
    fn new(kernel: &'a StudentT, scale2: f64) -> Self {
        Self { kernel, scale2, variance2: scale2 / kernel.gaussian_scale2() }
    }
}

/// Every so many rows the squares of their noise are taken, which stand for the others'.
const SAMPLED: usize = 16;

/// Squared residual, in units of its scaled variance, beyond which a row is no inlier: χ²₁(0.99).
const INLIER_Q: f64 = 6.635;

impl Sums {
    fn zero() -> Self {
        let zero = Matrix6::zeros();
        Self {
            score: Vector6::zeros(),
            information: zero,
            bread: zero,
            noise: zero,
            noise_square: SMatrix::zeros(),
            square: 0.0,
            used: 0,
            inliers: 0,
        }
    }

    fn over(changes: &[DisparityChange], at: &At<'_>, weighing: &Weighing<'_>, equations: Equations) -> Self {
        let strips: Vec<Self> = changes
            .par_chunks(STRIP)
            .map(|strip| {
                let mut sums = Self::zero();
                strip
                    .iter()
                    .filter_map(|c| at.linearise(c))
                    .for_each(|row| sums.add(&row, weighing, equations));
                sums
            })
            .collect();
        let mut whole = strips.into_iter().fold(Self::zero(), |mut sum, part| {
            sum.score += part.score;
            sum.information += part.information;
            sum.bread += part.bread;
            sum.noise += part.noise;
            sum.noise_square += part.noise_square;
            sum.square += part.square;
            sum.used += part.used;
            sum.inliers += part.inliers;
            sum
        });
        let by = &at.by_phi;
        whole.score = by.transpose() * whole.score;
        for matrix in [&mut whole.information, &mut whole.bread, &mut whole.noise] {
            *matrix = by.transpose() * *matrix * by;
        }
        whole
    }

    fn add(&mut self, row: &Linearised, weighing: &Weighing<'_>, equations: Equations) {
        let Weighing { kernel, scale2, variance2 } = *weighing;
        let q = row.standard * row.standard / scale2;
        let weight = kernel.weight(q, 1.0);
        let slope = weight - kernel.curvature(q, 1.0) * q;
        let noise = row.noise * variance2;
        let (regressor, bias, shared) = match equations {
            Equations::Moments => {
                (row.plain(), row.common * scale2, row.common * row.common.transpose() * scale2)
            }
            Equations::Conditional => (row.regressor, Vector6::zeros(), Matrix6::zeros()),
        };
        let outer = regressor * regressor.transpose();
        self.score -= weight * row.standard * regressor - bias;
        self.information += weight * (outer - noise) - shared;
        self.bread += slope * (outer - noise) - shared;
        self.noise += weight * noise;
        if self.used.is_multiple_of(SAMPLED) {
            let noise = triangle(|i, j| weight * noise[(i, j)]);
            self.noise_square.ger(SAMPLED as f64, &noise, &noise, 1.0);
        }
        self.square += weight * row.standard * row.standard;
        self.used += 1;
        self.inliers += usize::from(q <= INLIER_Q);
    }
}

/// φ from depth changes whose gradients are noisy, from a start.
///
/// With `blocks` the covariance is block-wise. Without them the observations must be pixels of maps whose pixels have
/// noise of their own, and rows are correlated as their central differences share pixels.
///
/// # Errors
/// [`Unsolvable`] with too few observations, without any determined direction, or when it does not settle.
pub fn errors_in_variables(
    changes: &[DepthChange],
    form: Form,
    rig: &StereoRig,
    start: &Twist,
    blocks: Option<&Blocks>,
    kernel: &StudentT,
) -> Result<MotionEstimate, Unsolvable> {
    let bf = rig.depth_disparity_product();
    let usable: Vec<DisparityChange> =
        changes.iter().filter_map(|change| DisparityChange::of(change, form, bf)).collect();
    let mut search = Search { changes: &usable, form, rig, kernel, phi: *start, scale2: 1.0 };
    search.settle(Equations::Moments)?;
    search.settle(Equations::Conditional)?;
    let answer = Answer { changes: &usable, at: search.at(), weighing: Weighing::new(kernel, search.scale2) };
    answer.estimate(changes.len(), blocks)
}

/// Where the iteration is.
struct Search<'a> {
    changes: &'a [DisparityChange],
    form: Form,
    rig: &'a StereoRig,
    kernel: &'a StudentT,
    phi: Twist,
    scale2: f64,
}

impl<'a> Search<'a> {
    fn at(&self) -> At<'a> {
        At::new(self.phi, self.form, self.rig)
    }

    fn settle(&mut self, equations: Equations) -> Result<(), Unsolvable> {
        self.scale2 = first_scale2(self.changes, &self.at(), self.kernel);
        for _ in 0..self.kernel.iterations {
            if equations == Equations::Moments {
                // Far from the end the residuals are motion as well as noise, of which too much would be taken away.
                self.scale2 = self.scale2.min(self.kernel.gaussian_scale2());
            }
            let sums =
                Sums::over(self.changes, &self.at(), &Weighing::new(self.kernel, self.scale2), equations);
            if sums.used < 6 {
                return Err(Unsolvable::FewRows { rows: sums.used, needed: 6 });
            }
            let delta = determined(&sums, &self.at().by_phi)?.solve(&sums.information, &sums.score)?;
            self.phi = Twist::from_vector(&(self.phi.vector() + delta));
            self.scale2 = (sums.square / (sums.used - 6).max(1) as f64).max(LEAST_SCALE2);
            let moved = delta.component_mul(&sums.information.diagonal().map(|v| v.max(0.0).sqrt())).amax();
            if moved <= self.kernel.tolerance * self.scale2.sqrt() {
                return Ok(());
            }
        }
        match equations {
            // It was but a start.
            Equations::Moments => Ok(()),
            Equations::Conditional => Err(Unsolvable::NotConverged),
        }
    }
}

/// A robust first scale of e²/V: its median over that of χ²₁.
fn first_scale2(changes: &[DisparityChange], at: &At<'_>, kernel: &StudentT) -> f64 {
    let mut squares: Vec<f64> =
        changes.iter().filter_map(|c| Some(at.linearise(c)?.standard.powi(2))).collect();
    if squares.is_empty() {
        1.0
    } else {
        (kernel.gaussian_scale2() * median(&mut squares) / 0.455).max(LEAST_SCALE2)
    }
}

/// A direction is determined whose information exceeds so many standard errors of its correction.
const CERTAIN: f64 = 2.5;

/// How much the squares of neighbouring rows' noise add to the scatter of the correction: at most half again as much,
/// since central differences two pixels apart are correlated by −½.
const NEIGHBOURS: f64 = 1.5;

/// The upper triangle of a symmetric 6×6 matrix, row by row.
fn triangle(entry: impl Fn(usize, usize) -> f64) -> SVector<f64, 21> {
    SVector::from_iterator((0..6).flat_map(|i| (i..6).map(move |j| (i, j))).map(|(i, j)| entry(i, j)))
}

/// Eigen-analysis of the corrected information, tested against what scatters of its correction.
fn determined(sums: &Sums, by_phi: &Matrix6<f64>) -> Result<Observability, Unsolvable> {
    Observability::beyond_noise(&sums.information, &sums.noise, |direction: &Vector6<f64>| {
        // The square of a normal number of variance C has the variance 2 C²; C is the rows' noise along the direction.
        let q = by_phi * direction;
        let along = triangle(|i, j| if i == j { q[i] * q[i] } else { 2.0 * q[i] * q[j] });
        CERTAIN * (2.0 * NEIGHBOURS * along.dot(&(sums.noise_square * along)).max(0.0)).sqrt()
    })
}

/// Where the iteration has settled.
struct Answer<'a> {
    changes: &'a [DisparityChange],
    at: At<'a>,
    weighing: Weighing<'a>,
}

impl Answer<'_> {
    fn estimate(&self, rows: usize, blocks: Option<&Blocks>) -> Result<MotionEstimate, Unsolvable> {
        let sums = Sums::over(self.changes, &self.at, &self.weighing, Equations::Conditional);
        let observability = determined(&sums, &self.at.by_phi)?;
        let inverse = sums.bread.cholesky().map(|bread| bread.inverse());
        let cov = match blocks {
            Some(blocks) => blocks::covariance(&self.by_block(blocks), inverse.as_ref(), &observability),
            None => {
                let w = observability.whitening();
                let spread = match inverse.filter(|_| w.ncols() == 6) {
                    Some(inverse) => dynamic(&(inverse * sums.information)) * &w,
                    None => w.clone(),
                };
                let cov = &spread * self.stencil_scatter(&w) * spread.transpose();
                blocks::with_unknowns(SMatrix::from_column_slice(cov.as_slice()), &observability.observed())
            }
        };
        Ok(Estimate {
            theta: Gaussian { mean: observability.known(&self.at.phi.vector()), cov },
            observed: observability.observed(),
            undetermined: observability.undetermined(),
            rows,
            inliers: sums.inliers,
            residual_scale: self.weighing.scale2.sqrt(),
        })
    }

    /// What one observation adds to the sums, by φ.
    fn of(&self, change: &DisparityChange) -> Option<Sums> {
        let row = self.at.linearise(change)?;
        let mut sums = Sums::zero();
        sums.add(&row, &self.weighing, Equations::Conditional);
        sums.score = self.at.by_phi.transpose() * sums.score;
        sums.information = self.at.by_phi.transpose() * sums.information * self.at.by_phi;
        Some(sums)
    }

    fn by_block(&self, blocks: &Blocks) -> Vec<BlockScore<6>> {
        let mut scores = vec![BlockScore::default(); blocks.count()];
        for change in self.changes {
            if let Some(one) = self.of(change) {
                let block = &mut scores[blocks.index(change.x, change.y)];
                block.information += one.information;
                block.score += one.score;
            }
        }
        scores
    }

    /// Second moment of the whitened total score, over pairs of rows that share pixels.
    fn stencil_scatter(&self, w: &DMatrix<f64>) -> DMatrix<f64> {
        let (width, height) = (self.at.rig.width_px, self.at.rig.height_px);
        let mut places: Vec<Option<DVector<f64>>> = vec![None; width * height];
        let mut alone = DMatrix::zeros(w.ncols(), w.ncols());
        for change in self.changes {
            let Some(one) = self.of(change) else { continue };
            let score = w.transpose() * DVector::from_column_slice(one.score.as_slice());
            alone += &score * score.transpose();
            let (u, v) = self.at.rig.pixel_from_image(change.x, change.y);
            let (u, v) = (u.round(), v.round());
            if u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64 {
                places[v as usize * width + u as usize] = Some(score);
            }
        }
        let mut pairs = DMatrix::zeros(w.ncols(), w.ncols());
        for (place, score) in places.iter().enumerate().filter_map(|(i, s)| Some((i, s.as_ref()?))) {
            for (right, down) in SHARING {
                let u = (place % width) as isize + right;
                let other =
                    (0..width as isize).contains(&u).then(|| place as isize + right + down * width as isize);
                if let Some(Some(other)) = other.and_then(|i| places.get(usize::try_from(i).ok()?)) {
                    pairs += score * other.transpose();
                }
            }
        }
        let both = &alone + &pairs + pairs.transpose();
        // Of few rows the products of neighbours may outweigh the squares.
        if both.clone().cholesky().is_some() { both } else { alone }
    }
}

/// Half of the offsets at which two stencils of five pixels share a pixel; the other half mirrors them.
const SHARING: [(isize, isize); 6] = [(1, 0), (2, 0), (0, 1), (0, 2), (1, 1), (-1, 1)];

fn dynamic(matrix: &Matrix6<f64>) -> DMatrix<f64> {
    DMatrix::from_column_slice(6, 6, matrix.as_slice())
}
