//! Solid texture: a random function of the point in space, filtered exactly by the pixel that sees it.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, UnitSphere};
use rand_pcg::Pcg64Mcg;

/// Shortest wavelength, in metres.
const SHORTEST_M: f64 = 0.015;
/// Longest wavelength, in metres.
const LONGEST_M: f64 = 0.9;

/// Standard deviation of the pixel's Gaussian aperture (optics and sensor area together), in pixels.
const APERTURE_PX: f64 = 0.5;
/// Amplitude grows with this power of the wavelength: 1.5 times from the shortest to the longest.
const AMPLITUDE_EXPONENT: f64 = 0.1;
/// Waves side by side in a block: as many as a vector register holds.
const LANES: usize = 8;
/// Blocks of waves: 128 waves together, so that each octave has more than twenty.
const WAVE_BLOCKS: usize = 16;
/// q/4 per (cycles per pixel)² of the aperture's attenuation exp(−q), q = ½ (2π σ)² (cycles per pixel)². It is taken as
/// (1 − q/4)⁴, which ends at 1.1 px.
const QUARTER_ATTENUATION: f32 = (0.125 * TAU * TAU * APERTURE_PX * APERTURE_PX) as f32;

/// 1.5·2²³: adding and subtracting it rounds a number to the nearest integer.
const ROUNDER: f32 = 12_582_912.0;

/// Plane waves side by side, so that the sum over them vectorises.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Waves {
    /// Wave vector, in cycles per metre.
    k: [[f32; LANES]; 3],
    /// Phase at the origin, in cycles.
    phase: [f32; LANES],
    amplitude: [f32; LANES],
}

/// A seeded sum of 128 plane waves: zero mean, unit variance, every octave well present.
///
/// A function of the point alone, so it has no seams and looks the same from everywhere. A plane wave
/// seen through a Gaussian aperture is the same wave with a smaller amplitude; so each pixel shows the
/// exact mean over its (skewed, stretched) footprint on the surface, and images do not alias.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    seed: u64,
    waves: Vec<Waves>,
}

impl Texture {
    /// Waves of random directions and phases; wavelengths log-uniform from 15 mm to 0.9 m.
    pub fn new(seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut waves =
            vec![Waves { k: [[0.0; LANES]; 3], phase: [0.0; LANES], amplitude: [0.0; LANES] }; WAVE_BLOCKS];
        let (mut place, mut variance) = (0.0, 0.0);
        for block in &mut waves {
            for lane in 0..LANES {
                // Stratified, so that no octave is left empty by chance.
                let share = (place + rng.random::<f64>()) / (WAVE_BLOCKS * LANES) as f64;
                let wavelength = LONGEST_M * (SHORTEST_M / LONGEST_M).powf(share);
                let direction: [f64; 3] = UnitSphere.sample(&mut rng);
                for (k, c) in block.k.iter_mut().zip(direction) {
                    k[lane] = (c / wavelength) as f32;
                }
                block.phase[lane] = rng.random();
                let amplitude = wavelength.powf(AMPLITUDE_EXPONENT);
                block.amplitude[lane] = amplitude as f32;
                variance += 0.5 * amplitude * amplitude;
                place += 1.0;
            }
        }
        let unit = (1.0 / variance.sqrt()) as f32;
        waves.iter_mut().flat_map(|block| &mut block.amplitude).for_each(|a| *a *= unit);
        Self { seed, waves }
    }

    /// The seed it was made from.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Value at point `p` (metres) seen by a pixel whose steps right and down move the point by `du`, `dv`.
    pub fn value(&self, p: &Vector3<f64>, du: &Vector3<f64>, dv: &Vector3<f64>) -> f64 {
        let [p, du, dv] = [p, du, dv].map(|v| [v.x as f32, v.y as f32, v.z as f32]);
        let mut sums = [0.0_f32; LANES];
        for block in &self.waves {
            block.add(&p, &du, &dv, &mut sums);
        }
        sums.iter().map(|&s| f64::from(s)).sum()
    }
}

impl Waves {
    #[inline]
    fn add(&self, p: &[f32; 3], du: &[f32; 3], dv: &[f32; 3], sums: &mut [f32; LANES]) {
        for (lane, sum) in sums.iter_mut().enumerate() {
            let [x, y, z] = [self.k[0][lane], self.k[1][lane], self.k[2][lane]];
            let a = x * du[0] + y * du[1] + z * du[2];
            let b = x * dv[0] + y * dv[1] + z * dv[2];
            let w = (1.0 - QUARTER_ATTENUATION * (a * a + b * b)).max(0.0);
            let w = w * w;
            *sum += self.amplitude[lane] * w * w * cosine(x * p[0] + y * p[1] + z * p[2] + self.phase[lane]);
        }
    }
}

/// cos(2π c) to 4e-6, without branches or library calls so that it vectorises; |c| below 4 million cycles.
#[inline]
fn cosine(cycles: f32) -> f32 {
    let r = cycles - ((cycles + ROUNDER) - ROUNDER);
    let x = std::f32::consts::TAU * (0.25 - r.abs());
    let s = x * x;
    x * (1.0
        - s * (1.0 / 6.0) * (1.0 - s * (1.0 / 20.0) * (1.0 - s * (1.0 / 42.0) * (1.0 - s * (1.0 / 72.0)))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cosine_is_the_cosine() {
        for i in -3000..3000 {
            let c = f64::from(i) * 0.00317;
            assert!((f64::from(cosine(c as f32)) - (TAU * c).cos()).abs() < 1e-5, "{c}");
        }
    }

    #[test]
    fn unit_variance_and_every_octave_present() {
        let texture = Texture::new(1);
        let (z, n) = (Vector3::zeros(), 200_000);
        let at = |i: i32| Vector3::new(0.0137, -0.0071, 0.0093) * f64::from(i);
        let values: Vec<f64> = (0..n).map(|i| texture.value(&at(i), &z, &z)).collect();
        let mean = values.iter().sum::<f64>() / f64::from(n);
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(n);
        assert!(mean.abs() < 0.02 && (variance - 1.0).abs() < 0.03, "{mean} {variance}");
        for octave in 0..5 {
            let (low, high) = (SHORTEST_M * 2f64.powi(octave), SHORTEST_M * 2f64.powi(octave + 1));
            let norms = texture
                .waves
                .iter()
                .flat_map(|w| (0..LANES).map(|l| f64::from(w.k[0][l].hypot(w.k[1][l]).hypot(w.k[2][l]))));
            let count = norms.filter(|k| (low..high).contains(&(1.0 / k))).count();
            assert!((20..=23).contains(&count), "{octave} {count}");
        }
    }

    #[test]
    fn aperture_is_the_mean_over_the_footprint() {
        // Against a brute-force Gaussian mean over the parallelogram of (du, dv).
        let texture = Texture::new(2);
        let (p, du, dv) =
            (Vector3::new(0.3, -0.2, 4.0), Vector3::new(0.004, 0.001, 0.0), Vector3::new(0.001, 0.002, 0.02));
        let (mut sum, mut weights) = (0.0, 0.0);
        for i in -60..=60 {
            for j in -60..=60 {
                let (a, b) = (f64::from(i) / 30.0, f64::from(j) / 30.0);
                let w = (-0.5 * (a * a + b * b) / (APERTURE_PX * APERTURE_PX)).exp();
                let at = p + a * du + b * dv;
                sum += w * texture.value(&at, &Vector3::zeros(), &Vector3::zeros());
                weights += w;
            }
        }
        // (1 − q/4)⁴ stands for exp(−q): within .07 for any one wave.
        let filtered = texture.value(&p, &du, &dv);
        assert!((filtered - sum / weights).abs() < 0.07, "{filtered} {}", sum / weights);
    }
}
