//! Depth images as sensors make them of exact depth: noise that neighbours share, steps, shadows.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use super::truth_maps::{IN_RIGHT, TruthMaps};
use crate::geometry::{Field, Grid};

/// What measures depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DepthPrinciple {
    /// Triangulation against a projector at the right camera's place: noise and steps of its disparity.
    Triangulation {
        /// Baseline times focal length, in metre pixels.
        product_m_px: f64,
        /// Standard deviation of disparity, in pixels.
        sigma_px: f64,
        /// Disparity is rounded to multiples of this, in pixels; 0 is not rounded.
        step_px: f64,
    },
    /// Time of flight: σ_Z = `constant_m` + `per_m` Z.
    TimeOfFlight {
        /// At distance 0, in metres.
        constant_m: f64,
        /// Growth per metre of distance.
        per_m: f64,
    },
    /// Rendered, and stored with the 11 significant bits of half-precision numbers.
    HalfPrecision,
}

/// A sensor that makes depth images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthSensing {
    /// What measures.
    pub principle: DepthPrinciple,
    /// Half the side of the windows in which it measures, in pixels: within them pixels share their noise.
    pub window_radius_px: usize,
    /// Seed of the noise.
    pub seed: u64,
}

impl DepthSensing {
    /// Kinect v1: 580 px, 75 mm, disparity in steps of 1/8 px with half of that as σ (Khoshelham and Elberink 2012).
    pub fn kinect(seed: u64) -> Self {
        let principle = DepthPrinciple::Triangulation {
            product_m_px: 580.0 * 0.075,
            sigma_px: 1.0 / 16.0,
            step_px: 0.125,
        };
        Self { principle, window_radius_px: 1, seed }
    }

    /// A time-of-flight camera in good light.
    pub fn time_of_flight(seed: u64) -> Self {
        let principle = DepthPrinciple::TimeOfFlight { constant_m: 2e-3, per_m: 1e-3 };
        Self { principle, window_radius_px: 0, seed }
    }

    /// Depth of a renderer.
    pub fn half_precision() -> Self {
        Self { principle: DepthPrinciple::HalfPrecision, window_radius_px: 0, seed: 0 }
    }

    /// The depth image of frame number `frame`, in metres.
    ///
    /// What a projector does not light has no depth.
    pub fn measure(&self, truth: &TruthMaps, frame: u64) -> Field {
        let (width, height) = truth.depth.size();
        let noise = self.noise((width, height), frame);
        let at = |u: usize, v: usize| {
            let z = f64::from(truth.depth.get(u, v)?);
            let unit = f64::from(noise.at(u, v));
            let measured = match self.principle {
                DepthPrinciple::Triangulation { product_m_px, sigma_px, step_px } => {
                    if truth.visible.at(u, v) & IN_RIGHT == 0 {
                        return None;
                    }
                    let d = product_m_px / z + sigma_px * unit;
                    product_m_px / if step_px > 0.0 { (d / step_px).round() * step_px } else { d }
                }
                DepthPrinciple::TimeOfFlight { constant_m, per_m } => z + (constant_m + per_m * z) * unit,
                DepthPrinciple::HalfPrecision => half_precision(z),
            };
            Some(measured as f32).filter(|z| z.is_finite() && *z > 0.0)
        };
        Field::from_grid(Grid::from_fn(width, height, |u, v| at(u, v).unwrap_or(f32::NAN)))
    }

    /// Unit noise, the mean over windows scaled to variance 1.
    fn noise(&self, (width, height): (usize, usize), frame: u64) -> Grid<f32> {
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed ^ frame.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let (radius, side) = (self.window_radius_px, 2 * self.window_radius_px + 1);
        let white = Grid::from_fn(width + 2 * radius, height + 2 * radius, |_, _| {
            let unit: f32 = StandardNormal.sample(&mut rng);
            unit
        });
        let across = Grid::from_fn(width, height + 2 * radius, |u, v| {
            white.row(v)[u..u + side].iter().sum::<f32>() / (side as f32).sqrt()
        });
        Grid::from_fn(width, height, |u, v| {
            (v..v + side).map(|row| across.at(u, row)).sum::<f32>() / (side as f32).sqrt()
        })
    }
}

/// The nearest number with 11 significant bits.
fn half_precision(z: f64) -> f64 {
    let step = (z.abs().log2().floor() - 10.0).exp2();
    (z / step).round() * step
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{RigidMotion, StereoRig};
    use crate::sim::{Scene, View};

    #[test]
    fn noise_is_as_large_as_stated_and_shared_by_neighbours() {
        let sensing = DepthSensing { window_radius_px: 1, ..DepthSensing::kinect(4) };
        let noise = sensing.noise((200, 150), 3);
        let mean = |product: &dyn Fn(usize, usize) -> f32| {
            let all = (0..149 * 150).map(|i| (i % 150, i / 150)).map(|(u, v)| f64::from(product(u, v)));
            all.sum::<f64>() / (149.0 * 150.0)
        };
        let variance = mean(&|u, v| noise.at(u, v).powi(2));
        let neighbours = mean(&|u, v| noise.at(u, v) * noise.at(u + 1, v));
        // 22 350 pixels, a ninth as many independent ones: standard errors are .03.
        assert!(
            (variance - 1.0).abs() < 0.1 && (neighbours - 2.0 / 3.0).abs() < 0.1,
            "{variance} {neighbours}"
        );
        assert_ne!(noise, sensing.noise((200, 150), 4));
    }

    #[test]
    fn depth_has_steps_and_shadows() {
        let rig = StereoRig::new(250.0, (79.5, 59.5), 0.075, (160, 120)).unwrap();
        let truth = View::new(&Scene::demo_room(), &rig, RigidMotion::identity()).truth_maps(None);
        let depth = DepthSensing::kinect(1).measure(&truth, 0);
        let steps = depth.grid().values().iter().filter(|z| !z.is_nan()).map(|z| 580.0 * 0.075 * 8.0 / z);
        assert!(steps.clone().all(|d| (d - d.round()).abs() < 1e-3));
        assert!(depth.count() < truth.depth.count() && 10 * depth.count() > 9 * truth.depth.count());
        let exact = DepthSensing::half_precision().measure(&truth, 0);
        for (z, truth) in exact.grid().values().iter().zip(truth.depth.grid().values()) {
            assert!((z - truth).abs() <= truth / 2048.0 && (z.to_bits() & 0x1fff) == 0, "{z} {truth}");
        }
    }
}
