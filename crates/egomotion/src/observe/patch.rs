//! A small window of an image, located in another one to a fraction of a pixel.
//!
//! Inverse-compositional Lucas–Kanade on images given as spline coefficients ([`super::spline`]).
//! Both windows are reduced to zero mean and equal contrast, so that gain and offset between cameras or exposures do not matter.

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use super::window::{self, LANES, ONES, PIXELS, SIDE, Window, dot, smoothed_products, standardise, total};
use crate::geometry::Image;
use crate::simd::vectorised;

pub(super) use super::window::RADIUS;

/// Ratios of the contrasts of two windows that may show one surface: cameras differ, but not by more.
const SAME_SURFACE_GAIN: std::ops::Range<f32> = 0.33..3.0;
/// Variance that smoothing by (1 2 1)/4 in both directions leaves of white noise of variance 1: (6/16)².
const SMOOTHED_VARIANCE: f64 = 36.0 / 256.0;
/// How much noise of that variance fitting the mean and the contrast takes from a window: both are
/// patterns so coarse that smoothing leaves nearly all of their share, 0.9 and 0.8.
const ABSORBED_BY_CONTRAST: f64 = 1.7;

/// Along which directions a patch may move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Freedom {
    /// Anywhere in the image.
    Plane,
    /// Along its row only: the epipolar line of a rectified pair.
    Row,
}

/// When a localisation ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settling {
    /// Most iterations.
    pub iterations: usize,
    /// A step shorter than this is the last, in pixels.
    pub step_px: f64,
}

/// A window of an image, ready to be located elsewhere.
#[derive(Debug, Clone)]
pub(crate) struct Patch {
    values: Window,
    /// Derivatives, less what a change of brightness or contrast explains.
    du: Window,
    dv: Window,
    /// Σ ∇I ∇Iᵀ of these over the window.
    tensor: Matrix2<f64>,
    contrast: f32,
}

/// How the place of a window answers to noise, per unit variance of white noise in an image before
/// it was smoothed by (1 2 1)/4 in both directions ([`super::pyramid::smooth`]).
///
/// Smoothing makes neighbours move together: noise that has become weak still moves a place as
/// far. With g the derivatives and K the smoothing, Σ (K g)(K g)ᵀ takes the place of Σ g gᵀ.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Localisation {
    /// Covariance of (u, v), free in the plane.
    pub plane: Matrix2<f64>,
    /// Covariance of that (u, v) with the u found along the row alone.
    pub plane_row: Vector2<f64>,
    /// Variance of u found along the row alone.
    pub row: f64,
    /// Mean squared noise left in a window after brightness, contrast and place were fitted.
    pub left_over: f64,
}

/// Where a patch was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Located {
    /// Column of the centre, in pixels.
    pub u: f64,
    /// Row of the centre, in pixels.
    pub v: f64,
    /// Mean squared difference of the two windows, in grey levels² of the patch's own image.
    pub residual: f64,
}

impl Patch {
    /// The window of an image (as spline coefficients) around (u, v), in pixels; `None` near the border or without any contrast.
    pub(crate) fn new(image: &Image, u: f64, v: f64) -> Option<Self> {
        plain_patch(image, u, v)
    }

    /// The same of the image magnified by `scale` around (u, v): what another image that shows the
    /// surface so much larger is compared with.
    pub(crate) fn magnified(image: &Image, u: f64, v: f64, scale: f64) -> Option<Self> {
        spaced_patch(image, u, v, scale.recip())
    }

    /// From the window with the margin of a pixel that its gradient needs.
    #[inline(always)]
    fn from_wide(wide: &[[f32; LANES]; SIDE + 2]) -> Option<Self> {
        let mut patch = Self {
            values: [[0.0; LANES]; SIDE],
            du: [[0.0; LANES]; SIDE],
            dv: [[0.0; LANES]; SIDE],
            tensor: Matrix2::zeros(),
            contrast: 0.0,
        };
        for row in 0..SIDE {
            let (above, here, below) = (&wide[row], &wide[row + 1], &wide[row + 2]);
            for i in 0..SIDE {
                patch.values[row][i] = here[i + 1];
                patch.du[row][i] = 0.5 * (here[i + 2] - here[i]);
                patch.dv[row][i] = 0.5 * (below[i + 1] - above[i + 1]);
            }
        }
        patch.contrast = standardise(&mut patch.values)?;
        patch.values.iter_mut().for_each(|row| row[SIDE..].fill(0.0));
        // Left in, they would let the place answer to a change of brightness, and shorten every step.
        let square = PIXELS * patch.contrast * patch.contrast;
        for slope in [&mut patch.du, &mut patch.dv] {
            let mean = dot(slope, &ONES) as f32 / PIXELS;
            let along = dot(slope, &patch.values) as f32 / square;
            for row in 0..SIDE {
                for i in 0..LANES {
                    slope[row][i] -= mean * ONES[row][i] + along * patch.values[row][i];
                }
            }
        }
        let cross = dot(&patch.du, &patch.dv);
        patch.tensor = Matrix2::new(dot(&patch.du, &patch.du), cross, cross, dot(&patch.dv, &patch.dv));
        Some(patch)
    }

    /// How noise moves the window's place; `None` for an edge.
    pub(crate) fn localisation(&self) -> Option<Localisation> {
        let inverse = self.tensor.try_inverse()?;
        let [uu, uv, vv] = smoothed_products(&self.du, &self.dv);
        let noise = Matrix2::new(uu, uv, uv, vv);
        let to_place = inverse * noise;
        let by_row = self.tensor.m11.recip();
        let absorbed = (ABSORBED_BY_CONTRAST + to_place.trace()) / f64::from(PIXELS);
        Some(Localisation {
            plane: to_place * inverse,
            plane_row: to_place.column(0) * by_row,
            row: uu * by_row * by_row,
            left_over: SMOOTHED_VARIANCE - absorbed,
        })
    }

    /// Standard deviation of the grey levels in the window.
    pub(crate) fn contrast(&self) -> f64 {
        f64::from(self.contrast)
    }

    /// Smaller eigenvalue of the mean of ∇I ∇Iᵀ, in (grey levels per pixel)².
    pub(crate) fn strength(&self) -> f64 {
        let t = &self.tensor;
        let half = 0.5 * (t[(0, 0)] - t[(1, 1)]);
        (0.5 * t.trace() - half.hypot(t[(0, 1)])) / f64::from(PIXELS)
    }

    /// Find the window in `image` (as spline coefficients) from a start (u, v), in pixels.
    ///
    /// `None` if it leaves the image, has no contrast there, is not locatable, or has not settled.
    pub(crate) fn locate(
        &self,
        image: &Image,
        start: (f64, f64),
        freedom: Freedom,
        settling: Settling,
    ) -> Option<Located> {
        let inverse = match freedom {
            Freedom::Plane => self.tensor.try_inverse()?,
            Freedom::Row => Matrix2::new(self.tensor.m11.recip(), 0.0, 0.0, 0.0),
        };
        if !inverse.iter().all(|x| x.is_finite()) {
            return None;
        }
        descend(self, image, start, &inverse, settling)
    }

    /// Σ ∇I ΔI and Σ ΔI² of the difference ΔI from another window of which the contrast is multiplied by `gain`.
    #[inline(always)]
    fn pull(&self, there: &Window, gain: f32) -> ((f64, f64), f64) {
        let (mut u, mut v, mut square) = ([0.0_f32; LANES], [0.0_f32; LANES], [0.0_f32; LANES]);
        for row in 0..SIDE {
            let (value, there) = (&self.values[row], &there[row]);
            let (du, dv) = (&self.du[row], &self.dv[row]);
            for i in 0..LANES {
                let difference = value[i] - gain * there[i];
                u[i] += du[i] * difference;
                v[i] += dv[i] * difference;
                square[i] += difference * difference;
            }
        }
        ((total(&u), total(&v)), total(&square))
    }
}

vectorised! {
plain_patch(image: &Image, u: f64, v: f64) -> Option<Patch> {
    Patch::from_wide(&window::sample(image, u, v)?)
}
}

vectorised! {
spaced_patch(image: &Image, u: f64, v: f64, spacing: f64) -> Option<Patch> {
    Patch::from_wide(&window::sample_spaced(image, u, v, spacing)?)
}
}

vectorised! {
/// Gauss–Newton from a start, with the inverse of the patch's tensor.
descend(
    patch: &Patch,
    image: &Image,
    start: (f64, f64),
    inverse: &Matrix2<f64>,
    settling: Settling,
) -> Option<Located> {
    let (mut u, mut v) = start;
    for _ in 0..settling.iterations {
        let mut there: Window = window::sample(image, u, v)?;
        let contrast = standardise(&mut there)?;
        let gain = patch.contrast / contrast;
        if !SAME_SURFACE_GAIN.contains(&gain) {
            return None;
        }
        let (pull, square) = patch.pull(&there, gain);
        let step = (
            inverse.m11 * pull.0 + inverse.m12 * pull.1,
            inverse.m21 * pull.0 + inverse.m22 * pull.1,
        );
        (u, v) = (u + step.0, v + step.1);
        if step.0 * step.0 + step.1 * step.1 < settling.step_px * settling.step_px {
            return Some(Located { u, v, residual: square / f64::from(PIXELS) });
        }
    }
    None
}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Grid;
    use crate::observe::pyramid::smooth;
    use crate::observe::spline;

    const SETTLING: Settling = Settling { iterations: 30, step_px: 0.01 };

    fn texture(u: f64, v: f64) -> f32 {
        (100.0
            + 30.0 * (0.7 * u + 0.2 * v).sin()
            + 25.0 * (0.5 * v - 0.3 * u + 1.0).sin()
            + 20.0 * (0.25 * u + 0.4 * v).cos()) as f32
    }

    fn image(shift: (f64, f64), gain: f32, offset: f32) -> Image {
        spline::coefficients(&Grid::from_fn(96, 80, |u, v| {
            gain * texture(u as f64 - shift.0, v as f64 - shift.1) + offset
        }))
    }

    #[test]
    fn a_shift_is_found_to_a_hundredth_of_a_pixel() {
        let patch = Patch::new(&image((0.0, 0.0), 1.0, 0.0), 40.0, 41.0).unwrap();
        for shift in [(0.3, -0.4), (1.7, 1.2), (-0.5, 0.0)] {
            let found =
                patch.locate(&image(shift, 1.1, 7.0), (40.0, 41.0), Freedom::Plane, SETTLING).unwrap();
            assert!((found.u - 40.0 - shift.0).abs() < 0.01, "{found:?} {shift:?}");
            assert!((found.v - 41.0 - shift.1).abs() < 0.01, "{found:?} {shift:?}");
        }
        let along = patch.locate(&image((1.4, 0.0), 1.0, 0.0), (40.0, 41.0), Freedom::Row, SETTLING).unwrap();
        assert!((along.u - 41.4).abs() < 0.01 && along.v == 41.0, "{along:?}");
    }

    #[test]
    fn a_magnified_patch_is_found_with_its_scale() {
        let zoomed = spline::coefficients(&Grid::from_fn(96, 80, |u, v| {
            texture(40.0 + (u as f64 - 43.0) / 1.1, 41.0 + (v as f64 - 40.0) / 1.1)
        }));
        let patch = Patch::magnified(&image((0.0, 0.0), 1.0, 0.0), 40.0, 41.0, 1.1).unwrap();
        let found = patch.locate(&zoomed, (42.0, 41.0), Freedom::Plane, SETTLING).unwrap();
        assert!((found.u - 43.0).abs() < 0.02 && (found.v - 40.0).abs() < 0.02, "{found:?}");
    }

    #[test]
    fn borders_and_flat_windows_are_refused() {
        let image = image((0.0, 0.0), 1.0, 0.0);
        assert!(Patch::new(&image, 5.0, 40.0).is_none());
        assert!(Patch::new(&image, f64::NAN, 40.0).is_none());
        assert!(Patch::new(&Grid::filled(64, 64, 9.0), 30.0, 30.0).is_none());
        let patch = Patch::new(&image, 40.0, 40.0).unwrap();
        assert!(patch.locate(&image, (2.0, 40.0), Freedom::Plane, SETTLING).is_none());
        assert!(patch.locate(&Grid::filled(96, 80, 1.0), (40.0, 40.0), Freedom::Row, SETTLING).is_none());
    }

    #[test]
    fn stated_covariance_matches_the_scatter_under_noise() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, Normal};
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        let noise = Normal::new(0.0, 2.0).unwrap();
        let grey = |(a, b): (f64, f64)| Grid::from_fn(96, 80, |u, v| texture(u as f64 - a, v as f64 - b));
        let (clean, shifted) = (grey((0.0, 0.0)), grey((0.37, 0.61)));
        let (mut squares, mut residual) = ([0.0; 2], 0.0);
        let n = 400;
        for _ in 0..n {
            let mut noisy = |image: &Image| {
                let mut out = image.clone();
                out.values_mut().iter_mut().for_each(|v| *v += noise.sample(&mut rng) as f32);
                spline::coefficients(&smooth(&out))
            };
            let patch = Patch::new(&noisy(&clean), 40.0, 41.0).unwrap();
            let found = patch.locate(&noisy(&shifted), (40.0, 41.0), Freedom::Plane, SETTLING).unwrap();
            // Both windows carry noise, so the difference has twice the variance of one place.
            let localisation = patch.localisation().unwrap();
            let shape = localisation.plane * (2.0 * 4.0);
            residual += found.residual / localisation.left_over / (2.0 * 4.0) / f64::from(n);
            squares[0] += (found.u - 40.37).powi(2) / shape[(0, 0)] / f64::from(n);
            squares[1] += (found.v - 41.61).powi(2) / shape[(1, 1)] / f64::from(n);
        }
        assert!(squares.iter().all(|s| (0.8..1.25).contains(s)), "{squares:?}");
        assert!((0.85..1.15).contains(&residual), "{residual}");
    }
}
