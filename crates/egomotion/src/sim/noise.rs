//! The sensor: the optics' blur and vignetting, gain, noise that grows with the light, rounding to 8 bits.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::blur::{self, blurred, reach_px};
use super::render::{StereoImages, View};
use crate::geometry::{Image, StereoRig};

/// Most of the corners' light that vignetting takes, as a share: with all of it gone the fall-off has no end.
const MAX_VIGNETTING: f64 = 0.99;
/// Largest gain, offset in grey levels, noise or variance of a sensor: beyond, images of 8 bits show nothing.
const LARGEST_LEVEL: f64 = 1e3;

/// A pair of cameras that are not perfect, and not equal. `--noise sensor` is the default value.
///
/// In the order in which they act: blur, vignetting, the right camera's gain and offset, noise, rounding.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorNoise {
    /// Standard deviation of the optics' Gaussian point spread function, in pixels; 0 switches it off.
    pub blur_px: f64,
    /// Share of the light that the image's corners lose, below 1; 0 switches it off. The light falls off from the
    /// image's centre as cos⁴ of the angle to the axis does, (1 + k r²)⁻².
    pub vignetting: f64,
    /// Gain of the right camera relative to the left; 1 switches it off.
    pub right_gain: f64,
    /// Offset of the right camera, in grey levels; 0 switches it off.
    pub right_offset: f64,
    /// Standard deviation of the noise in the dark, in grey levels; 0 switches it off.
    pub read_sigma: f64,
    /// Variance per grey level of light, in grey levels; 0 switches it off.
    pub shot_gain: f64,
    /// Whether grey levels are rounded to integers and held within 0 … 255.
    pub eight_bit: bool,
    /// Seed of the noise; TOML holds those below 2⁶³.
    pub seed: u64,
}

/// A quantity of a sensor that no sensor has.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("{quantity} {value} is not within {low} … {high}")]
pub struct SensorError {
    /// Field of [`SensorNoise`].
    pub quantity: &'static str,
    /// What it is.
    pub value: f64,
    /// Least value that it may have.
    pub low: f64,
    /// Greatest value that it may have.
    pub high: f64,
}

impl Default for SensorNoise {
    fn default() -> Self {
        Self {
            blur_px: 0.0,
            vignetting: 0.0,
            right_gain: 1.03,
            right_offset: 2.0,
            read_sigma: 1.5,
            shot_gain: 0.02,
            eight_bit: true,
            seed: 0,
        }
    }
}

impl SensorNoise {
    /// A perfect sensor: every part switched off.
    pub fn none() -> Self {
        Self {
            blur_px: 0.0,
            vignetting: 0.0,
            right_gain: 1.0,
            right_offset: 0.0,
            read_sigma: 0.0,
            shot_gain: 0.0,
            eight_bit: false,
            seed: 0,
        }
    }

    /// The same sensor with another seed.
    pub fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// Whether there can be such a sensor.
    ///
    /// # Errors
    /// [`SensorError`] names the first quantity that is out of its bounds, or no number.
    pub fn check(&self) -> Result<(), SensorError> {
        let bounds = [
            ("blur_px", self.blur_px, 0.0, blur::MAX_SIGMA_PX),
            ("vignetting", self.vignetting, 0.0, MAX_VIGNETTING),
            ("right_gain", self.right_gain, 0.0, LARGEST_LEVEL),
            ("right_offset", self.right_offset, -LARGEST_LEVEL, LARGEST_LEVEL),
            ("read_sigma", self.read_sigma, 0.0, LARGEST_LEVEL),
            ("shot_gain", self.shot_gain, 0.0, LARGEST_LEVEL),
        ];
        let bad = bounds.into_iter().find(|(_, value, low, high)| !(low..=high).contains(&value));
        bad.map_or(Ok(()), |(quantity, value, low, high)| Err(SensorError { quantity, value, low, high }))
    }

    /// What the cameras deliver of a view at frame number `frame`: [`View::render`] with `samples`, exposed.
    ///
    /// The view is rendered beyond the image's borders as far as the blur reaches, so that light comes in from
    /// there too.
    pub fn photograph(&self, view: &View<'_>, samples: usize, frame: u64) -> StereoImages {
        let margin = reach_px(self.blur_px);
        let rig = StereoRig {
            cx_px: view.rig.cx_px + margin as f64,
            cy_px: view.rig.cy_px + margin as f64,
            width_px: view.rig.width_px + 2 * margin,
            height_px: view.rig.height_px + 2 * margin,
            ..*view.rig
        };
        let wide = View::new(view.scene, &rig, view.world_from_cyclopean);
        self.expose_within(&wide.render(samples), margin, frame)
    }

    /// What the cameras deliver of rendered images at frame number `frame`; each frame and camera has noise of
    /// its own. Blur knows no light from beyond the images' borders: [`SensorNoise::photograph`] does.
    pub fn expose(&self, images: &StereoImages, frame: u64) -> StereoImages {
        self.expose_within(images, 0, frame)
    }

    /// The images without the `margin` pixels on each side, exposed.
    fn expose_within(&self, images: &StereoImages, margin: usize, frame: u64) -> StereoImages {
        let camera = |image: &Image, right: bool| {
            let sharp = self.blur_px == 0.0 && margin == 0;
            let image = if sharp { image.clone() } else { blurred(image, self.blur_px, margin) };
            self.camera(image, frame, right)
        };
        let (left, right) = rayon::join(|| camera(&images.left, false), || camera(&images.right, true));
        StereoImages { left, right }
    }

    /// Vignetting, gain and offset, noise, rounding. The noise is that of the grey level after gain and offset.
    fn camera(&self, mut image: Image, frame: u64, right: bool) -> Image {
        let (gain, offset) = if right { (self.right_gain, self.right_offset) } else { (1.0, 0.0) };
        // Streams apart: the golden ratio spreads frames, the generator's own mixing does the rest.
        let stream = frame.wrapping_mul(2).wrapping_add(u64::from(right)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed ^ stream);
        let (width, light_at) = (image.width(), self.fall_off(image.size()));
        for (i, grey) in image.values_mut().iter_mut().enumerate() {
            let light = gain * light_at(i % width, i / width) * f64::from(*grey) + offset;
            let variance = self.read_sigma * self.read_sigma + self.shot_gain * light.max(0.0);
            let unit: f64 = StandardNormal.sample(&mut rng);
            let value = light + variance.sqrt() * unit;
            *grey = if self.eight_bit { value.round().clamp(0.0, 255.0) } else { value } as f32;
        }
        image
    }

    /// Share of the light that vignetting leaves at each pixel: 1 at the centre, 1 − `vignetting` in the corners.
    fn fall_off(&self, (width, height): (usize, usize)) -> impl Fn(usize, usize) -> f64 + use<> {
        let centre = |size: usize| 0.5 * (size as f64 - 1.0);
        let (cu, cv) = (centre(width), centre(height));
        let corner = (1.0 - self.vignetting.clamp(0.0, MAX_VIGNETTING)).powf(-0.5) - 1.0;
        let k = corner / (cu * cu + cv * cv).max(f64::MIN_POSITIVE);
        move |u, v| (1.0 + k * ((u as f64 - cu).powi(2) + (v as f64 - cv).powi(2))).powi(-2)
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

    #[test]
    fn the_sensor_of_the_study_has_no_optics() {
        // EQUATIONS: variance 1.5² + .02 I, right gain 1.03 and offset 2, rounded; nothing else.
        let SensorNoise {
            blur_px,
            vignetting,
            right_gain,
            right_offset,
            read_sigma,
            shot_gain,
            eight_bit,
            ..
        } = SensorNoise::default();
        assert_eq!([blur_px, vignetting, right_gain, right_offset], [0.0, 0.0, 1.03, 2.0]);
        assert_eq!(([read_sigma, shot_gain], eight_bit), ([1.5, 0.02], true));
    }

    #[test]
    fn vignetting_falls_off_as_cos4_and_comes_before_gain_and_offset() {
        let vignetted =
            SensorNoise { vignetting: 0.36, right_gain: 2.0, right_offset: 7.0, ..SensorNoise::none() };
        let image = Grid::filled(201, 151, 50.0);
        let StereoImages { left, right } =
            vignetted.expose(&StereoImages { left: image.clone(), right: image }, 0);
        assert!((left.at(100, 75) - 50.0).abs() < 1e-4);
        for (u, v) in [(0, 0), (200, 0), (0, 150), (200, 150)] {
            assert!((left.at(u, v) - 32.0).abs() < 1e-4, "{}", left.at(u, v));
            assert!((right.at(u, v) - 71.0).abs() < 1e-4, "{}", right.at(u, v));
        }
        // cos⁴ of the angle whose cos⁴ is .64 in the corner, 125 px away: tan² = 1/4.
        let angle = (0.5_f64 * 60.0 / 125.0).atan();
        assert!((f64::from(left.at(160, 75)) - 50.0 * angle.cos().powi(4)).abs() < 1e-4);
        assert_eq!(left.at(40, 75), left.at(160, 75));
    }

    #[test]
    fn blur_lets_light_in_over_the_borders() {
        use crate::geometry::RigidMotion;
        use crate::sim::Scene;
        let scene = Scene::demo_room();
        let rig = |more: usize| {
            let centre = (31.5 + more as f64, 23.5 + more as f64);
            StereoRig::new(90.0, centre, 0.13, (64 + 2 * more, 48 + 2 * more)).unwrap()
        };
        let sensor = SensorNoise { blur_px: 1.5, ..SensorNoise::none() };
        let [small, wide] = [rig(0), rig(20)];
        let [small, wide] = [small, wide]
            .map(|rig| sensor.photograph(&View::new(&scene, &rig, RigidMotion::identity()), 1, 0));
        for (a, b) in [(&small.left, &wide.left), (&small.right, &wide.right)] {
            assert_eq!(a.size(), (64, 48));
            let apart = (0..64 * 48).map(|i| (i % 64, i / 64));
            let worst = apart.map(|(u, v)| (a.at(u, v) - b.at(u + 20, v + 20)).abs()).fold(0.0, f32::max);
            assert!(worst < 0.01, "{worst}");
        }
    }

    #[test]
    fn noise_is_not_blurred() {
        let sensor = SensorNoise { blur_px: 2.0, shot_gain: 0.0, ..SensorNoise::default() };
        let image = sensor.expose(&flat(100.0), 0).left;
        let (mean, variance) = moments(&image);
        assert!(
            (mean - 100.0).abs() < 0.07 && (variance - 2.25 - 1.0 / 12.0).abs() < 0.15,
            "{mean} {variance}"
        );
        let pairs = image.values().iter().zip(&image.values()[1..]);
        let product: f64 = pairs.map(|(a, b)| (f64::from(*a) - mean) * (f64::from(*b) - mean)).sum();
        // White: the correlation of neighbours is 0 ± .007.
        assert!((product / 20_000.0 / variance).abs() < 0.03);
    }

    #[test]
    fn what_no_sensor_has_is_refused_by_name() {
        let sensor = SensorNoise::default();
        assert_eq!(sensor.check(), Ok(()));
        assert_eq!(SensorNoise::none().check(), Ok(()));
        for (bad, name) in [
            (SensorNoise { blur_px: -1.0, ..sensor }, "blur_px -1"),
            (SensorNoise { vignetting: 1.0, ..sensor }, "vignetting 1"),
            (SensorNoise { read_sigma: f64::NAN, ..sensor }, "read_sigma NaN"),
            (SensorNoise { right_gain: f64::INFINITY, ..sensor }, "right_gain inf"),
        ] {
            assert!(bad.check().unwrap_err().to_string().starts_with(name), "{name}");
        }
    }
}
