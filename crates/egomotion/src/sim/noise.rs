//! The sensor: gain, noise that grows with the light, rounding to 8 bits.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use super::render::StereoImages;
use crate::geometry::Image;

/// A pair of cameras that are not perfect, and not equal. `--noise sensor` is the default value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorNoise {
    /// Standard deviation of the noise in the dark, in grey levels; 0 switches it off.
    pub read_sigma: f64,
    /// Variance per grey level of light, in grey levels; 0 switches it off.
    pub shot_gain: f64,
    /// Gain of the right camera relative to the left; 1 switches it off.
    pub right_gain: f64,
    /// Offset of the right camera, in grey levels; 0 switches it off.
    pub right_offset: f64,
    /// Whether grey levels are rounded to integers and held within 0 … 255.
    pub eight_bit: bool,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for SensorNoise {
    fn default() -> Self {
        Self {
            read_sigma: 1.5,
            shot_gain: 0.02,
            right_gain: 1.03,
            right_offset: 2.0,
            eight_bit: true,
            seed: 0,
        }
    }
}

impl SensorNoise {
    /// A perfect sensor: every part switched off.
    pub fn none() -> Self {
        Self {
            read_sigma: 0.0,
            shot_gain: 0.0,
            right_gain: 1.0,
            right_offset: 0.0,
            eight_bit: false,
            seed: 0,
        }
    }

    /// The same sensor with another seed.
    pub fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// What the cameras deliver for frame number `frame`; each frame and camera has noise of its own.
    ///
    /// The right camera's gain and offset come first, the noise is that of the resulting grey level.
    pub fn expose(&self, images: &StereoImages, frame: u64) -> StereoImages {
        let camera = |image: &Image, right: bool| self.camera(image, frame, right);
        let (left, right) = rayon::join(|| camera(&images.left, false), || camera(&images.right, true));
        StereoImages { left, right }
    }

    fn camera(&self, image: &Image, frame: u64, right: bool) -> Image {
        let (gain, offset) = if right { (self.right_gain, self.right_offset) } else { (1.0, 0.0) };
        // Streams apart: the golden ratio spreads frames, the generator's own mixing does the rest.
        let stream = frame.wrapping_mul(2).wrapping_add(u64::from(right)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed ^ stream);
        let mut exposed = image.clone();
        for grey in exposed.values_mut() {
            let light = gain * f64::from(*grey) + offset;
            let variance = self.read_sigma * self.read_sigma + self.shot_gain * light.max(0.0);
            let unit: f64 = StandardNormal.sample(&mut rng);
            let value = light + variance.sqrt() * unit;
            *grey = if self.eight_bit { value.round().clamp(0.0, 255.0) } else { value } as f32;
        }
        exposed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Grid;

    fn flat(grey: f32) -> StereoImages {
        StereoImages { left: Grid::filled(200, 100, grey), right: Grid::filled(200, 100, grey) }
    }

    fn moments(image: &Image) -> (f64, f64) {
        let n = image.values().len() as f64;
        let mean = image.values().iter().map(|&v| f64::from(v)).sum::<f64>() / n;
        (mean, image.values().iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>() / n)
    }

    #[test]
    fn mean_and_variance_are_those_of_the_model() {
        let noisy = SensorNoise::default().with_seed(5).expose(&flat(100.0), 3);
        // 1.5² + .02 I, and 1/12 of rounding; standard errors are .014 and .044 at 20 000 pixels.
        let (mean, variance) = moments(&noisy.left);
        assert!(
            (mean - 100.0).abs() < 0.07 && (variance - (2.25 + 2.0 + 1.0 / 12.0)).abs() < 0.2,
            "{mean} {variance}"
        );
        let (mean, variance) = moments(&noisy.right);
        assert!(
            (mean - 105.0).abs() < 0.07 && (variance - (2.25 + 2.1 + 1.0 / 12.0)).abs() < 0.2,
            "{mean} {variance}"
        );
        assert!(noisy.left.values().iter().all(|v| v.fract() == 0.0));
    }

    #[test]
    fn parts_switch_off_and_seeds_matter() {
        assert_eq!(SensorNoise::none().expose(&flat(77.3), 0), flat(77.3));
        let noise = SensorNoise::default();
        let [a, b, c, d] =
            [(0, 0), (0, 0), (1, 0), (0, 1)].map(|(s, k)| noise.with_seed(s).expose(&flat(90.0), k));
        assert_eq!(a, b);
        assert!(a.left != c.left && a.left != d.left && a.right != d.right);
        let unrounded = SensorNoise { read_sigma: 0.0, shot_gain: 0.0, eight_bit: false, ..noise };
        let right = unrounded.expose(&flat(100.0), 0).right;
        assert!(right.values().iter().all(|v| (v - 105.0).abs() < 1e-4));
    }
}
