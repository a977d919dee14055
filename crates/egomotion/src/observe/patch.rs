//! A small window of an image, located in another one to a fraction of a pixel.
//!
//! Inverse-compositional Lucas–Kanade on images given as spline coefficients ([`super::spline`]).
//! Both windows are reduced to zero mean and equal contrast, so that gain and offset between cameras or exposures do not matter.

use nalgebra::{Matrix2, Vector2};

use super::spline;
use crate::geometry::Image;

/// Half the side of a window, in pixels.
pub const RADIUS: usize = 5;
/// Side of a window.
const SIDE: usize = 2 * RADIUS + 1;
/// Number of pixels of a window.
const AREA: usize = SIDE * SIDE;
/// Side of a window with the margin that its gradient needs.
const WIDE: usize = SIDE + 2;

/// Along which directions a patch may move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Freedom {
    /// Anywhere in the image.
    Plane,
    /// Along its row only: the epipolar line of a rectified pair.
    Row,
}

/// A window of an image, ready to be located elsewhere.
#[derive(Debug, Clone)]
pub struct Patch {
    values: [f32; AREA],
    du: [f32; AREA],
    dv: [f32; AREA],
    /// Σ ∇I ∇Iᵀ over the window.
    tensor: Matrix2<f64>,
    contrast: f32,
}

/// Where a patch was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Located {
    /// Column of the centre, in pixels.
    pub u: f64,
    /// Row of the centre, in pixels.
    pub v: f64,
    /// Mean squared difference of the two windows, in grey levels² of the patch's own image.
    pub residual: f64,
}

impl Patch {
    /// The window of an image (as spline coefficients) around (u, v), in pixels; `None` near the border or without any contrast.
    pub fn new(image: &Image, u: f64, v: f64) -> Option<Self> {
        let mut wide = [0.0; WIDE * WIDE];
        sample_window::<WIDE>(image, u, v, 1.0, &mut wide)?;
        let (mut values, mut du, mut dv) = ([0.0; AREA], [0.0; AREA], [0.0; AREA]);
        for row in 0..SIDE {
            for column in 0..SIDE {
                let (i, w) = (row * SIDE + column, (row + 1) * WIDE + column + 1);
                values[i] = wide[w];
                du[i] = 0.5 * (wide[w + 1] - wide[w - 1]);
                dv[i] = 0.5 * (wide[w + WIDE] - wide[w - WIDE]);
            }
        }
        let contrast = standardise(&mut values)?;
        let dot =
            |a: &[f32; AREA], b: &[f32; AREA]| f64::from(a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>());
        let cross = dot(&du, &dv);
        let tensor = Matrix2::new(dot(&du, &du), cross, cross, dot(&dv, &dv));
        Some(Self { values, du, dv, tensor, contrast })
    }

    /// Covariance of the window's place per unit variance of a grey level, free in the plane; `None` for an edge.
    pub fn covariance_shape(&self) -> Option<Matrix2<f64>> {
        self.tensor.try_inverse()
    }

    /// Variance of the window's place along its row per unit variance of a grey level.
    pub fn row_variance_shape(&self) -> f64 {
        self.tensor[(0, 0)].recip()
    }

    /// Standard deviation of the grey levels in the window.
    pub fn contrast(&self) -> f64 {
        f64::from(self.contrast)
    }

    /// Find the window in `image` (as spline coefficients) from a start (u, v), in pixels.
    ///
    /// `scale` is the expected magnification there. `None` if it leaves the image, has no contrast
    /// there, is not locatable, or has not settled after `iterations`.
    pub fn locate(
        &self,
        image: &Image,
        (mut u, mut v): (f64, f64),
        scale: f64,
        freedom: Freedom,
        iterations: usize,
    ) -> Option<Located> {
        let inverse = match freedom {
            Freedom::Plane => self.covariance_shape()?,
            Freedom::Row => Matrix2::new(self.row_variance_shape(), 0.0, 0.0, 0.0),
        };
        if !inverse.iter().all(|x| x.is_finite()) {
            return None;
        }
        let mut window = [0.0; AREA];
        for _ in 0..iterations {
            sample_window::<SIDE>(image, u, v, scale, &mut window)?;
            let contrast = standardise(&mut window)?;
            // Contrasts may differ between cameras, but not by this much if it is the same surface.
            let gain = self.contrast / contrast;
            if !(0.33..3.0).contains(&gain) {
                return None;
            }
            let (mut pull_u, mut pull_v, mut sum) = (0.0_f32, 0.0_f32, 0.0_f32);
            for (((&value, &there), &du), &dv) in self.values.iter().zip(&window).zip(&self.du).zip(&self.dv)
            {
                let difference = value - gain * there;
                pull_u += du * difference;
                pull_v += dv * difference;
                sum += difference * difference;
            }
            let step = inverse * Vector2::new(f64::from(pull_u), f64::from(pull_v)) * scale;
            (u, v) = (u + step.x, v + step.y);
            if step.norm() < 0.01 {
                return Some(Located { u, v, residual: f64::from(sum) / AREA as f64 });
            }
        }
        None
    }
}

/// Reduce to zero mean; the standard deviation, or `None` if it vanishes.
fn standardise(values: &mut [f32; AREA]) -> Option<f32> {
    let mean = values.iter().sum::<f32>() / AREA as f32;
    let mut square = 0.0;
    for value in values.iter_mut() {
        *value -= mean;
        square += *value * *value;
    }
    let deviation = (square / AREA as f32).sqrt();
    (deviation > 0.1 && deviation.is_finite()).then_some(deviation)
}

/// Sample an N×N window of spacing `scale` around (u, v); `None` unless it lies inside with a margin.
fn sample_window<const N: usize>(image: &Image, u: f64, v: f64, scale: f64, out: &mut [f32]) -> Option<()> {
    let half = (N / 2) as f64 * scale;
    let (width, height) = image.size();
    let inside = |c: f64, n: usize| c - half >= 1.0 && c + half < n as f64 - 2.0;
    if !(inside(u, width) && inside(v, height)) {
        return None;
    }
    let place = |c: f64, k: usize| {
        let at = c - half + k as f64 * scale;
        (at as usize - 1, spline::weights((at - at.floor()) as f32))
    };
    let columns: [(usize, [f32; 4]); N] = std::array::from_fn(|k| place(u, k));
    let first = columns[0].0;
    let span = columns[N - 1].0 + 4 - first;
    // Magnifications of up to about 4 fit; a patch that grows more is not followed.
    let mut line = [0.0_f32; 64];
    let line = line.get_mut(..span)?;
    for (row, out) in out.chunks_exact_mut(N).enumerate() {
        let (top, w) = place(v, row);
        let source: [&[f32]; 4] = std::array::from_fn(|k| &image.row(top + k)[first..first + span]);
        for (i, value) in line.iter_mut().enumerate() {
            *value = w[0] * source[0][i] + w[1] * source[1][i] + w[2] * source[2][i] + w[3] * source[3][i];
        }
        for (value, (at, w)) in out.iter_mut().zip(&columns) {
            let s = &line[at - first..at - first + 4];
            *value = w[0] * s[0] + w[1] * s[1] + w[2] * s[2] + w[3] * s[3];
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Grid;

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
            let found = patch.locate(&image(shift, 1.1, 7.0), (40.0, 41.0), 1.0, Freedom::Plane, 20).unwrap();
            assert!((found.u - 40.0 - shift.0).abs() < 0.01, "{found:?} {shift:?}");
            assert!((found.v - 41.0 - shift.1).abs() < 0.01, "{found:?} {shift:?}");
        }
        let along = patch.locate(&image((1.4, 0.0), 1.0, 0.0), (40.0, 41.0), 1.0, Freedom::Row, 20).unwrap();
        assert!((along.u - 41.4).abs() < 0.01 && along.v == 41.0, "{along:?}");
    }

    #[test]
    fn a_magnified_patch_is_found_with_its_scale() {
        let zoomed = spline::coefficients(&Grid::from_fn(96, 80, |u, v| {
            texture(40.0 + (u as f64 - 43.0) / 1.1, 41.0 + (v as f64 - 40.0) / 1.1)
        }));
        let patch = Patch::new(&image((0.0, 0.0), 1.0, 0.0), 40.0, 41.0).unwrap();
        let found = patch.locate(&zoomed, (42.0, 41.0), 1.1, Freedom::Plane, 20).unwrap();
        assert!((found.u - 43.0).abs() < 0.02 && (found.v - 40.0).abs() < 0.02, "{found:?}");
    }

    #[test]
    fn borders_and_flat_windows_are_refused() {
        let image = image((0.0, 0.0), 1.0, 0.0);
        assert!(Patch::new(&image, 5.0, 40.0).is_none());
        assert!(Patch::new(&image, f64::NAN, 40.0).is_none());
        assert!(Patch::new(&Grid::filled(64, 64, 9.0), 30.0, 30.0).is_none());
        let patch = Patch::new(&image, 40.0, 40.0).unwrap();
        assert!(patch.locate(&image, (2.0, 40.0), 1.0, Freedom::Plane, 20).is_none());
        assert!(patch.locate(&Grid::filled(96, 80, 1.0), (40.0, 40.0), 1.0, Freedom::Row, 20).is_none());
    }

    #[test]
    fn stated_covariance_matches_the_scatter_under_noise() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, Normal};
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        let noise = Normal::new(0.0, 2.0).unwrap();
        let grey = |(a, b): (f64, f64)| Grid::from_fn(96, 80, |u, v| texture(u as f64 - a, v as f64 - b));
        let (clean, shifted) = (grey((0.0, 0.0)), grey((0.37, 0.61)));
        let mut squares = [0.0; 2];
        let n = 400;
        for _ in 0..n {
            let mut noisy = |image: &Image| {
                let mut out = image.clone();
                out.values_mut().iter_mut().for_each(|v| *v += noise.sample(&mut rng) as f32);
                spline::coefficients(&out)
            };
            let patch = Patch::new(&noisy(&clean), 40.0, 41.0).unwrap();
            let found = patch.locate(&noisy(&shifted), (40.0, 41.0), 1.0, Freedom::Plane, 30).unwrap();
            // Both windows carry noise, so the difference has twice the variance of one place.
            let shape = patch.covariance_shape().unwrap() * (2.0 * 4.0);
            squares[0] += (found.u - 40.37).powi(2) / shape[(0, 0)] / f64::from(n);
            squares[1] += (found.v - 41.61).powi(2) / shape[(1, 1)] / f64::from(n);
        }
        assert!(squares.iter().all(|s| (0.6..1.4).contains(s)), "{squares:?}");
    }
}
