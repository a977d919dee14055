//! The variance of a function of independent noisy inputs: drawn, and by Taylor to second order.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Draws of a chunk. Each chunk has a generator of its own, so that the answer does not depend on threads.
///
/// Another size gives other draws; a smaller one seeds more generators.
const CHUNK_DRAWS: usize = 10_000;
/// Largest number of inputs of a function: that of the raw inputs of the differential DCCE.
const LARGEST_INPUTS: usize = 9;
/// Step of the numerical derivatives, in standard deviations of the input.
///
/// Larger steps see higher derivatives, smaller ones lose digits.
const DERIVATIVE_STEP: f64 = 0.25;

/// One noisy input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Input {
    /// Its exact value.
    pub mean: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// A function of at most nine independent Gaussian inputs.
#[derive(Debug, Clone)]
pub(super) struct NoisyFunction<F> {
    inputs: Vec<Input>,
    function: F,
}

/// The variance found by drawing, with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DrawnVariance {
    /// Variance about the mean of the draws.
    pub variance: f64,
    /// Its standard error from the fourth moment, √((μ₄ − σ⁴)/n): right for heavy tails too.
    pub standard_error: f64,
    /// Draws.
    pub draws: usize,
}

impl<F: Fn(&[f64]) -> f64 + Sync> NoisyFunction<F> {
    /// A function of `inputs` (mean, σ); those after the ninth are left out.
    pub(super) fn new(inputs: impl IntoIterator<Item = (f64, f64)>, function: F) -> Self {
        let inputs =
            inputs.into_iter().take(LARGEST_INPUTS).map(|(mean, sigma)| Input { mean, sigma }).collect();
        Self { inputs, function }
    }

    /// The function at the inputs' means moved by `shift` standard deviations each.
    fn shifted(&self, shift: impl Fn(usize) -> f64) -> f64 {
        let mut at = [0.0; LARGEST_INPUTS];
        for (i, (at, input)) in at.iter_mut().zip(&self.inputs).enumerate() {
            *at = input.mean + input.sigma * shift(i);
        }
        (self.function)(&at[..self.inputs.len()])
    }

    /// Variance over `draws` draws of all inputs.
    pub(super) fn drawn(&self, draws: usize, seed: u64) -> DrawnVariance {
        let exact = self.shifted(|_| 0.0);
        let chunk = |c: usize| {
            let mut rng = Pcg64Mcg::seed_from_u64(mixed_seed(&[seed, c as u64]));
            let mut sums = [0.0; 4];
            for _ in 0..CHUNK_DRAWS.min(draws - c * CHUNK_DRAWS) {
                let mut at = [0.0; LARGEST_INPUTS];
                for (at, input) in at.iter_mut().zip(&self.inputs) {
                    let unit: f64 = StandardNormal.sample(&mut rng);
                    *at = input.mean + input.sigma * unit;
                }
                add_powers(&mut sums, (self.function)(&at[..self.inputs.len()]) - exact);
            }
            sums
        };
        let chunks: Vec<_> = (0..draws.div_ceil(CHUNK_DRAWS)).into_par_iter().map(chunk).collect();
        DrawnVariance::from_powers(&chunks, draws)
    }

    /// Variance to the fourth order of the σ: J Σ Jᵀ + ½ tr(H Σ H Σ) + Σ_i J_i σ_i² Σ_j T_ijj σ_j².
    ///
    /// J, H and T are the first three derivatives, taken numerically.
    pub(super) fn second_order(&self) -> f64 {
        let n = self.inputs.len();
        let at = |moves: &[(usize, f64)]| {
            let along = |i: usize| moves.iter().filter(|m| m.0 == i).map(|m| m.1).sum::<f64>();
            self.shifted(|i| DERIVATIVE_STEP * along(i))
        };
        let mut variance = 0.0;
        for i in 0..n {
            let [plus, minus] = [1.0, -1.0].map(|s| at(&[(i, s)]));
            let slope = (plus - minus) / (2.0 * DERIVATIVE_STEP);
            let (mut bends, mut thirds) = (0.0, 0.0);
            for j in 0..n {
                // i = j gives steps of two, and with them the same formulas.
                let [[pp, pm], [mp, mm]] = [1.0, -1.0].map(|s| [1.0, -1.0].map(|t| at(&[(i, s), (j, t)])));
                let bend = (pp - pm - mp + mm) / (4.0 * DERIVATIVE_STEP * DERIVATIVE_STEP);
                let third = (pp - 2.0 * plus + pm - mp + 2.0 * minus - mm) / (2.0 * DERIVATIVE_STEP.powi(3));
                bends += bend * bend;
                thirds += third;
            }
            variance += slope * slope + 0.5 * bends + slope * thirds;
        }
        variance
    }
}

impl DrawnVariance {
    /// From the sums of the first four powers of the deviations, chunk by chunk.
    fn from_powers(chunks: &[[f64; 4]], draws: usize) -> Self {
        let n = draws as f64;
        let [m1, m2, m3, m4] = chunks
            .iter()
            .fold([0.0; 4], |sum, chunk| std::array::from_fn(|k| sum[k] + chunk[k]))
            .map(|s| s / n);
        let variance = m2 - m1 * m1;
        let fourth = m4 - 4.0 * m1 * m3 + 6.0 * m1 * m1 * m2 - 3.0 * m1.powi(4);
        Self { variance, standard_error: ((fourth - variance * variance).max(0.0) / n).sqrt(), draws }
    }

    /// Variance of a list of values about their mean.
    pub(super) fn of(values: &[f64]) -> Self {
        let shift = values.first().copied().unwrap_or(0.0);
        let mut sums = [0.0; 4];
        values.iter().for_each(|v| add_powers(&mut sums, v - shift));
        Self::from_powers(&[sums], values.len())
    }
}

fn add_powers(sums: &mut [f64; 4], deviation: f64) {
    let square = deviation * deviation;
    for (sum, power) in sums.iter_mut().zip([deviation, square, square * deviation, square * square]) {
        *sum += power;
    }
}

/// One seed from several numbers, by the finaliser of SplitMix64.
pub(super) fn mixed_seed(words: &[u64]) -> u64 {
    words.iter().fold(0x9e37_79b9_7f4a_7c15, |state, word| {
        let z = (state ^ word).wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}

#[cfg(test)]
mod tests {
    use egomotion::geometry::Gaussian;
    use egomotion::motion::depth_velocity as vz;
    use egomotion::observe::DepthChange;
    use nalgebra::{Matrix2, Matrix4};

    use super::*;

    #[test]
    fn second_order_of_functions_with_known_variance() {
        // A product is exact to second order; 1/x has variance e²(1 + 8 e²)/x² to fourth order in e.
        let product = NoisyFunction::new([(2.0, 0.5), (-3.0, 0.7)], |x: &[f64]| x[0] * x[1]);
        let exact = 4.0 * 0.49 + 9.0 * 0.25 + 0.25 * 0.49;
        assert!((product.second_order() - exact).abs() < 1e-10, "{}", product.second_order());
        let e: f64 = 0.01;
        let inverse = NoisyFunction::new([(5.0, 5.0 * e)], |x: &[f64]| 1.0 / x[0]).second_order();
        let exact = e * e * (1.0 + 8.0 * e * e) / 25.0;
        assert!((inverse / exact - 1.0).abs() < 2e-5, "{inverse} {exact}");
    }

    #[test]
    fn draws_find_the_variance_and_say_how_well() {
        // A square of a unit normal has variance 2 and fourth central moment 60.
        let drawn = NoisyFunction::new([(0.0, 1.0)], |x: &[f64]| x[0] * x[0]).drawn(100_000, 1);
        let error = (56.0_f64 / 1e5).sqrt();
        assert!((drawn.variance - 2.0).abs() < 5.0 * error, "{drawn:?}");
        assert!((drawn.standard_error / error - 1.0).abs() < 0.15, "{drawn:?}");
    }

    #[test]
    fn the_same_draws_on_any_number_of_threads() {
        let noisy = NoisyFunction::new([(1.0, 0.1), (2.0, 0.2)], |x: &[f64]| x[0] / x[1]);
        let on = |n| {
            rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(|| noisy.drawn(25_001, 7))
        };
        assert_eq!(on(1), on(3));
        assert_ne!(on(1), noisy.drawn(25_001, 8));
        assert_eq!(on(1).draws, 25_001);
    }

    /// Exact for jointly drawn, correlated gradients and flows, which the study's own cases do not have.
    #[test]
    fn product_of_correlated_noises() {
        let gradient = Matrix2::new(0.04, 0.015, 0.015, 0.09);
        let flow = Matrix2::new(0.25, -0.1, -0.1, 0.16);
        let mut depth = Gaussian::independent([2.0, 0.3, -0.2, 0.1], [0.0, 0.0, 0.0, 0.01]);
        depth.cov.fixed_view_mut::<2, 2>(1, 1).copy_from(&gradient);
        let change = DepthChange {
            x_px: 0.0,
            y_px: 0.0,
            depth,
            flow: Gaussian { mean: [0.5, -0.4].into(), cov: flow },
        };
        let (g, v) = (gradient.cholesky().unwrap().l(), flow.cholesky().unwrap().l());
        // A polynomial of second degree in its inputs: Taylor's second order is exact.
        let exact = NoisyFunction::new([(0.0, 1.0); 5], |n: &[f64]| {
            let mut drawn = change;
            let slope = g * nalgebra::Vector2::new(n[0], n[1]);
            drawn.depth.mean += nalgebra::Vector4::new(0.0, slope.x, slope.y, 0.1 * n[4]);
            drawn.flow.mean += v * nalgebra::Vector2::new(n[2], n[3]);
            drawn.depth.cov = Matrix4::zeros();
            vz::dcce(&drawn).vz().value()
        });
        let (with, without) = (vz::dcce_variance_with_product(&change), vz::dcce(&change).vz().variance());
        assert!((exact.second_order() / with - 1.0).abs() < 1e-9, "{} {with}", exact.second_order());
        assert!(with > 1.1 * without);
    }
}
