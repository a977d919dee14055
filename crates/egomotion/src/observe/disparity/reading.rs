//! Disparity read from a map between its pixels, as that of the one surface that is there.

use nalgebra::{Matrix2, Vector2};

use super::DisparityMap;
use crate::geometry::{Field, Gaussian, Grid};

/// Half the side of the window that is looked at, in pixels: a larger one averages more noise and bends more.
const RADIUS: usize = 2;
/// A neighbour is of the same surface whose disparity differs by no more than this, in pixels, for each pixel of
/// distance, beside noise: as steep as a surface can be that both cameras see.
const STEEPEST_SURFACE: f64 = 1.0;
/// Noise that still belongs to a surface, in standard deviations.
const SURFACE_NOISE_SIGMAS: f64 = 3.0;
/// Half the side of the window of [`DisparityMap::slope`], in pixels. A larger one has less noise, and more of a curved
/// surface's third derivative. With noise of correlation 0.6 over two pixels the variance is a tenth of a difference's.
const SLOPE_RADIUS: usize = 4;
/// A pixel belongs to the surface of a slope that lies off its plane by no more than this, in pixels, beside noise: what a
/// curved surface does within the window.
const CURVED_PX: f64 = 0.25;
/// Variance of the slope of a plane through the small window, in units of σ²: 9 pixels share an error, and x² is 2 in the
/// mean over 25 of them.
const NEAR_SLOPE_VARIANCE: f64 = CORRELATION_AREA_PX / 50.0;
/// Least share of the window that a slope is made of. Curvature cancels where both sides are seen; at half of the window
/// it would not.
const LEAST_SLOPE_SHARE: f64 = 0.6;
/// Fewest pixels that make a slope.
const FEWEST_SLOPE_PIXELS: f64 = 6.0;
/// Errors of neighbours are taken as one over so many pixels: depth is measured in windows.
const CORRELATION_AREA_PX: f64 = 9.0;

/// What a map says at a place between its pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// u_left − u_right, in pixels.
    pub shift: f64,
    /// Its variance, in px².
    pub variance: f64,
    /// Its change per pixel in u and in v.
    pub slope: (f64, f64),
}

impl DisparityMap {
    /// Disparity at (u, v), in pixels, of the surface that the nearest pixel shows; `None` where that one is missing.
    ///
    /// A plane through the pixels of the window that are of this surface: nothing is interpolated across a depth
    /// edge. Where the window shows another surface too, the place may be of that one, and the variance says so.
    pub fn read(&self, u: f64, v: f64) -> Option<Reading> {
        let (width, height) = self.shift.size();
        let inside = |c: f64, n: usize| c > -0.5 && c < n as f64 - 0.5;
        if !(inside(u, width) && inside(v, height)) {
            return None;
        }
        let (u0, v0) = (u.round() as usize, v.round() as usize);
        let centre = f64::from(self.shift.get(u0, v0)?);
        let sigma = f64::from(self.sigma.get(u0, v0)?);
        let (mut plane, mut others, mut furthest) = (PlaneFit::default(), 0.0, 0.0_f64);
        for row in v0.saturating_sub(RADIUS)..(v0 + RADIUS + 1).min(height) {
            for column in u0.saturating_sub(RADIUS)..(u0 + RADIUS + 1).min(width) {
                let Some(d) = self.shift.get(column, row) else { continue };
                let (x, y) = (column as f64 - u, row as f64 - v);
                let apart = f64::from(d) - centre;
                let distance = (column.abs_diff(u0) as f64).hypot(row.abs_diff(v0) as f64);
                if apart.abs() <= STEEPEST_SURFACE * distance + SURFACE_NOISE_SIGMAS * sigma {
                    plane.add(x, y, apart);
                } else {
                    others += 1.0;
                    furthest = furthest.max(apart.abs());
                }
            }
        }
        let (value, slope, misfit) = plane.fit().unwrap_or((0.0, (0.0, 0.0), 0.0));
        let share = others / (others + plane.count);
        let independent = (plane.count / CORRELATION_AREA_PX).max(1.0);
        // What the fit leaves beyond the noise is the surface's own shape.
        let shape = (misfit - sigma * sigma).max(0.0);
        let variance = sigma * sigma / independent + shape + share * furthest * furthest;
        Some(Reading { shift: centre + value, variance, slope })
    }

    /// The slope of the surface around (u, v) with its covariance, (∂/∂u, ∂/∂v) in px/px; `None` at its borders.
    ///
    /// A plane through a window of 9 × 9 pixels. Errors of neighbours are shared, as those of matched windows are.
    pub(crate) fn slope(&self, u: f64, v: f64) -> Option<Gaussian<2>> {
        let near = self.read(u, v)?;
        let (width, height) = self.shift.size();
        let (u0, v0) = (u.round() as usize, v.round() as usize);
        let sigma = f64::from(self.sigma.get(u0, v0)?);
        let mut plane = PlaneFit::default();
        for row in v0.saturating_sub(SLOPE_RADIUS)..(v0 + SLOPE_RADIUS + 1).min(height) {
            for column in u0.saturating_sub(SLOPE_RADIUS)..(u0 + SLOPE_RADIUS + 1).min(width) {
                let Some(d) = self.shift.get(column, row) else { continue };
                let (x, y) = (column as f64 - u, row as f64 - v);
                let off = f64::from(d) - near.shift;
                let expected = near.slope.0 * x + near.slope.1 * y;
                // The slope that is expected is as uncertain as a plane through 5 × 5 pixels.
                let noise = sigma * (1.0 + NEAR_SLOPE_VARIANCE * (x * x + y * y)).sqrt();
                if (off - expected).abs() <= CURVED_PX + SURFACE_NOISE_SIGMAS * noise {
                    plane.add(x, y, off);
                }
            }
        }
        let side = (2 * SLOPE_RADIUS + 1) as f64;
        if plane.count < LEAST_SLOPE_SHARE * side * side {
            return None;
        }
        let (_, slope, _) = plane.fit()?;
        let cov = plane.slope_cofactors()? * (sigma * sigma * CORRELATION_AREA_PX);
        Some(Gaussian { mean: Vector2::new(slope.0, slope.1), cov })
    }

    /// Disparity handed in by somebody else, as by a depth camera, with the standard deviation of each value where it
    /// is no edge.
    ///
    /// Depth edges of such a map seldom lie where the image has them: around one the standard deviation grows by
    /// half the jump.
    pub fn given(shift: Field, sigma_px: impl Fn(f32) -> f32) -> Self {
        let (width, height) = shift.size();
        let sigma = Grid::from_fn(width, height, |u, v| {
            shift
                .get(u, v)
                .map_or(f32::NAN, |d| sigma_px(d).hypot(0.5 * jump(&shift, (u, v), d, sigma_px(d))))
        });
        Self { sigma: Field::from_grid(sigma), shift }
    }
}

/// The largest step beyond a surface's from a pixel to its neighbours.
fn jump(shift: &Field, (u, v): (usize, usize), d: f32, sigma: f32) -> f32 {
    let (width, height) = shift.size();
    let mut largest = 0.0_f32;
    for row in v.saturating_sub(1)..(v + 2).min(height) {
        for there in &shift.row(row)[u.saturating_sub(1)..(u + 2).min(width)] {
            let step = (there - d).abs();
            if step > STEEPEST_SURFACE as f32 + SURFACE_NOISE_SIGMAS as f32 * sigma {
                largest = largest.max(step);
            }
        }
    }
    largest
}

/// Sums for a plane z = a + b x + c y.
#[derive(Debug, Clone, Copy, Default)]
struct PlaneFit {
    count: f64,
    x: f64,
    y: f64,
    z: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    xz: f64,
    yz: f64,
    zz: f64,
}

impl PlaneFit {
    fn add(&mut self, x: f64, y: f64, z: f64) {
        self.count += 1.0;
        self.x += x;
        self.y += y;
        self.z += z;
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
        self.xz += x * z;
        self.yz += y * z;
        self.zz += z * z;
    }

    /// Covariance of the slope for independent values of variance 1; `None` of a line of points.
    fn slope_cofactors(&self) -> Option<Matrix2<f64>> {
        let about = |sum: f64, a: f64, b: f64| sum - a * b / self.count;
        let xy = about(self.xy, self.x, self.y);
        Matrix2::new(about(self.xx, self.x, self.x), xy, xy, about(self.yy, self.y, self.y)).try_inverse()
    }

    /// Value at the origin, slope, and mean squared residual; `None` of few points or of a line of them.
    fn fit(&self) -> Option<(f64, (f64, f64), f64)> {
        if self.count < FEWEST_SLOPE_PIXELS {
            return None;
        }
        let (mx, my, mz) = (self.x / self.count, self.y / self.count, self.z / self.count);
        let about = |sum: f64, a: f64, b: f64| sum - self.count * a * b;
        let (xx, xy, yy) = (about(self.xx, mx, mx), about(self.xy, mx, my), about(self.yy, my, my));
        let (xz, yz, zz) = (about(self.xz, mx, mz), about(self.yz, my, mz), about(self.zz, mz, mz));
        let determinant = xx * yy - xy * xy;
        if determinant <= 1e-3 * (xx + yy) * (xx + yy) {
            return None;
        }
        let b = (yy * xz - xy * yz) / determinant;
        let c = (xx * yz - xy * xz) / determinant;
        let residual = (zz - b * xz - c * yz).max(0.0) / (self.count - 3.0);
        Some((mz - b * mx - c * my, (b, c), residual))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(f: impl Fn(usize, usize) -> f32) -> DisparityMap {
        let shift = Field::from_grid(Grid::from_fn(20, 16, f));
        let sigma = Field::from_grid(Grid::filled(20, 16, 0.1));
        DisparityMap { shift, sigma }
    }

    #[test]
    fn a_plane_is_read_between_its_pixels() {
        let map = map(|u, v| 10.0 + 0.3 * u as f32 - 0.2 * v as f32);
        for (u, v) in [(9.3, 7.6), (0.0, 0.0), (19.4, 15.2)] {
            let reading = map.read(u, v).unwrap();
            assert!((reading.shift - (10.0 + 0.3 * u - 0.2 * v)).abs() < 1e-4, "{reading:?}");
            assert!((reading.slope.0 - 0.3).abs() < 1e-4 && (reading.slope.1 + 0.2).abs() < 1e-4);
            assert!(reading.variance <= 0.011 && reading.variance > 0.0);
        }
        assert_eq!(map.read(-0.6, 3.0), None);
        assert_eq!(map.read(f64::NAN, 3.0), None);
    }

    #[test]
    fn a_slope_knows_the_noise_of_its_window() {
        let plane = |u: usize, v: usize| 10.0 + 0.3 * u as f32 - 0.2 * v as f32;
        let slope = map(plane).slope(9.3, 7.6).unwrap();
        assert!((slope.mean - Vector2::new(0.3, -0.2)).amax() < 1e-5, "{slope:?}");
        // Neighbours share their error over an area: noise is made of squares of 3 × 3 pixels.
        let mut squares = [0.0; 2];
        let trials: u32 = 400;
        for trial in 0..trials {
            let noise = |u: usize, v: usize| {
                let hash = (u as u32 / 3 * 7919 + v as u32 / 3 * 104_729)
                    .wrapping_add(trial.wrapping_mul(15_485_863))
                    .wrapping_mul(2_654_435_761);
                let hash = (hash ^ (hash >> 15)).wrapping_mul(2_246_822_519);
                // Uniform, of standard deviation 0.1.
                ((f64::from(hash ^ (hash >> 13)) / f64::from(u32::MAX) - 0.5) * 0.1 * 12f64.sqrt()) as f32
            };
            let found = map(|u, v| plane(u, v) + noise(u, v)).slope(10.0, 7.0).unwrap();
            squares[0] += (found.mean.x - 0.3).powi(2) / found.cov.m11;
            squares[1] += (found.mean.y + 0.2).powi(2) / found.cov.m22;
        }
        // Nine squares fill the window, at −3, 0 and 3: their slope has 0.9 of the stated variance, as 81 · 18 · 3/540² is
        // 0.9 · 9/540. A mean of 400 squares scatters by 7 %.
        let ratios = squares.map(|sum| sum / f64::from(trials));
        assert!(ratios.iter().all(|ratio| (0.9 - 0.25..0.9 + 0.25).contains(ratio)), "{ratios:?}");
        let edge = map(|u, _| if u < 10 { 20.0 } else { 5.0 });
        assert_eq!(edge.slope(9.0, 8.0), None);
    }

    #[test]
    fn nothing_is_interpolated_across_an_edge() {
        let map = map(|u, _| if u < 10 { 20.0 } else { 5.0 });
        for (u, expected) in [(9.4, 20.0), (9.6, 5.0)] {
            let reading = map.read(u, 8.0).unwrap();
            assert!((reading.shift - expected).abs() < 1e-6);
            // It may as well be the other side.
            assert!(reading.variance.sqrt() > 5.0, "{reading:?}");
        }
        assert!(map.read(5.0, 8.0).unwrap().variance < 0.011);
    }

    #[test]
    fn a_hole_stays_one_and_an_edge_is_uncertain() {
        let holes = map(|u, v| if (u, v) == (8, 8) { f32::NAN } else { 7.0 });
        assert_eq!(holes.read(8.2, 7.9), None);
        assert!((holes.read(8.6, 8.0).unwrap().shift - 7.0).abs() < 1e-6);
        let given = DisparityMap::given(map(|u, _| if u < 10 { 20.0 } else { 5.0 }).shift, |_| 0.1);
        assert_eq!(given.sigma.get(4, 4), Some(0.1));
        assert!(given.sigma.get(9, 4).unwrap() > 7.0 && given.sigma.get(10, 4).unwrap() > 7.0);
    }
}
