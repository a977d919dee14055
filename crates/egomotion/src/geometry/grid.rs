//! Planes of pixels: images, and dense fields whose missing values are explicit.

use rayon::prelude::*;

/// A row-major plane of `width` × `height` values.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid<T> {
    width: usize,
    height: usize,
    values: Vec<T>,
}

/// A grey image: grey levels as f32, whatever the number of bits they came with.
pub type Image = Grid<f32>;

impl<T: Copy> Grid<T> {
    /// A plane filled with one value.
    pub fn filled(width: usize, height: usize, value: T) -> Self {
        Self { width, height, values: vec![value; width * height] }
    }

    /// A plane from row-major values; `None` if their number is not `width` × `height`.
    pub fn from_values(width: usize, height: usize, values: Vec<T>) -> Option<Self> {
        (values.len() == width * height).then_some(Self { width, height, values })
    }

    /// A plane computed from each pixel (u, v).
    pub fn from_fn(width: usize, height: usize, mut f: impl FnMut(usize, usize) -> T) -> Self {
        let values = (0..width * height).map(|i| f(i % width, i / width)).collect();
        Self { width, height, values }
    }

    /// Width, in pixels.
    #[inline(always)]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height, in pixels.
    #[inline(always)]
    pub fn height(&self) -> usize {
        self.height
    }

    /// (width, height), in pixels.
    #[inline(always)]
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// All values, row by row.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// All values, row by row.
    pub fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    /// Row `v`, for 0 ≤ v < height.
    #[inline(always)]
    pub fn row(&self, v: usize) -> &[T] {
        &self.values[v * self.width..(v + 1) * self.width]
    }

    /// Row `v`, for 0 ≤ v < height.
    pub fn row_mut(&mut self, v: usize) -> &mut [T] {
        &mut self.values[v * self.width..(v + 1) * self.width]
    }

    /// Value at pixel (u, v), which must lie inside.
    #[inline(always)]
    pub fn at(&self, u: usize, v: usize) -> T {
        self.values[v * self.width + u]
    }

    /// Set the value at pixel (u, v), which must lie inside.
    pub fn set(&mut self, u: usize, v: usize, value: T) {
        self.values[v * self.width + u] = value;
    }

    /// The four pixels around (u, v) and the weights of the bilinear mean; `None` outside.
    #[inline(always)]
    fn corners(&self, u: f64, v: f64) -> Option<([T; 4], [f64; 4])> {
        let inside = |c: f64, n: usize| c >= 0.0 && c <= n as f64 - 1.0;
        if !(inside(u, self.width) && inside(v, self.height)) {
            return None;
        }
        let (u0, v0) = (u as usize, v as usize);
        let (u1, v1) = ((u0 + 1).min(self.width - 1), (v0 + 1).min(self.height - 1));
        let (a, b) = (u - u0 as f64, v - v0 as f64);
        let values = [self.at(u0, v0), self.at(u1, v0), self.at(u0, v1), self.at(u1, v1)];
        Some((values, [(1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b]))
    }
}

impl Grid<f32> {
    /// Bilinear value at (u, v), in pixels; `None` outside.
    #[inline(always)]
    pub fn sample(&self, u: f64, v: f64) -> Option<f64> {
        let (values, weights) = self.corners(u, v)?;
        Some(values.iter().zip(weights).map(|(&value, w)| w * f64::from(value)).sum())
    }
}

/// A dense field of f32 in which a pixel may have no value.
///
/// Missing pixels are NaN inside, so that a kernel can stream the plane; outside they are `None`.
#[derive(Debug, Clone, PartialEq)]
pub struct Field(Grid<f32>);

impl Field {
    /// A field without any value.
    pub fn missing(width: usize, height: usize) -> Self {
        Self(Grid::filled(width, height, f32::NAN))
    }

    /// A field from a plane in which every value that is not finite counts as missing.
    pub fn from_grid(mut grid: Grid<f32>) -> Self {
        grid.values_mut().iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = f32::NAN);
        Self(grid)
    }

    /// The plane, missing pixels as NaN.
    pub fn grid(&self) -> &Grid<f32> {
        &self.0
    }

    /// Width, in pixels.
    #[inline(always)]
    pub fn width(&self) -> usize {
        self.0.width()
    }

    /// Height, in pixels.
    #[inline(always)]
    pub fn height(&self) -> usize {
        self.0.height()
    }

    /// (width, height), in pixels.
    #[inline(always)]
    pub fn size(&self) -> (usize, usize) {
        self.0.size()
    }

    /// Value at pixel (u, v), which must lie inside.
    #[inline(always)]
    pub fn get(&self, u: usize, v: usize) -> Option<f32> {
        Some(self.0.at(u, v)).filter(|value| !value.is_nan())
    }

    /// Set or clear the value at pixel (u, v), which must lie inside.
    pub fn set(&mut self, u: usize, v: usize, value: Option<f32>) {
        self.0.set(u, v, value.unwrap_or(f32::NAN));
    }

    /// Row `v`, missing pixels as NaN.
    #[inline(always)]
    pub fn row(&self, v: usize) -> &[f32] {
        self.0.row(v)
    }

    /// Row `v`, missing pixels as NaN.
    pub fn row_mut(&mut self, v: usize) -> &mut [f32] {
        self.0.row_mut(v)
    }

    /// Bilinear value at (u, v); `None` outside, or where one of the pixels it needs is missing.
    #[inline(always)]
    pub fn sample(&self, u: f64, v: f64) -> Option<f64> {
        let (width, height) = self.size();
        let inside = |c: f64, n: usize| c >= 0.0 && c <= n as f64 - 1.0;
        if !(inside(u, width) && inside(v, height)) {
            return None;
        }
        let (u0, v0) = (u as usize, v as usize);
        let across = |v: usize| {
            let row = self.row(v.min(height - 1));
            blend(row[u0].into(), row[(u0 + 1).min(width - 1)].into(), u - u0 as f64)
        };
        Some(blend(across(v0), across(v0 + 1), v - v0 as f64)).filter(|value| !value.is_nan())
    }

    /// Bilinear value at (u, v), and central differences of such values one pixel each way; `None` outside, or
    /// where one of the pixels they need is missing.
    #[inline(always)]
    pub(crate) fn sample_with_gradient(&self, u: f64, v: f64) -> Option<(f64, (f64, f64))> {
        let (width, height) = self.size();
        let inside = |c: f64, n: usize| c >= 1.0 && c + 1.0 <= n as f64 - 1.0;
        if !(inside(u, width) && inside(v, height)) {
            return None;
        }
        let (u0, v0) = (u as usize, v as usize);
        let (a, b) = (u - u0 as f64, v - v0 as f64);
        let across = |row: usize, from: usize| {
            let row = self.row((v0 + row - 1).min(height - 1));
            let value = |i: usize| f64::from(row[(u0 + from + i - 1).min(width - 1)]);
            blend(value(0), value(1), a)
        };
        let column = [across(0, 1), across(1, 1), across(2, 1), across(3, 1)];
        let (left, right) = (blend(across(1, 0), across(2, 0), b), blend(across(1, 2), across(2, 2), b));
        let (above, below) = (blend(column[0], column[1], b), blend(column[2], column[3], b));
        let gradient = (0.5 * (right - left), 0.5 * (below - above));
        let value = blend(column[1], column[2], b);
        (!(value + gradient.0 + gradient.1).is_nan()).then_some((value, gradient))
    }

    /// Central differences (∂/∂u, ∂/∂v) over one pixel each way; `None` where a neighbour is missing.
    pub fn gradient(&self, u: usize, v: usize) -> Option<(f32, f32)> {
        if u == 0 || v == 0 || u + 1 >= self.width() || v + 1 >= self.height() {
            return None;
        }
        let du = 0.5 * (self.0.at(u + 1, v) - self.0.at(u - 1, v));
        let dv = 0.5 * (self.0.at(u, v + 1) - self.0.at(u, v - 1));
        Some((du, dv)).filter(|(a, b)| !a.is_nan() && !b.is_nan())
    }

    /// All rows in parallel, missing pixels as NaN.
    pub fn rows_mut(&mut self) -> impl IndexedParallelIterator<Item = &mut [f32]> {
        let width = self.width().max(1);
        self.0.values.par_chunks_mut(width)
    }

    /// Number of pixels that have a value.
    pub fn count(&self) -> usize {
        self.0.values().iter().filter(|v| !v.is_nan()).count()
    }

    /// Share of the pixels that have a value, 0 … 1.
    pub fn density(&self) -> f64 {
        self.count() as f64 / self.0.values().len().max(1) as f64
    }
}

/// (1 − w) p + w q; q may be missing where its weight is zero.
#[inline(always)]
fn blend(p: f64, q: f64, w: f64) -> f64 {
    if w > 0.0 { p + w * (q - p) } else { p }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_has_its_gradient_where_all_pixels_are_known() {
        let mut field = Field::from_grid(Grid::from_fn(6, 5, |u, v| 2.0 * u as f32 - 3.0 * v as f32));
        assert_eq!(field.sample_with_gradient(2.25, 1.5), Some((0.0, (2.0, -3.0))));
        assert_eq!(field.sample_with_gradient(4.0, 3.0), Some((-1.0, (2.0, -3.0))));
        assert_eq!(field.sample_with_gradient(4.1, 3.0), None);
        assert_eq!(field.sample_with_gradient(0.9, 3.0), None);
        assert_eq!(field.sample_with_gradient(f64::NAN, 3.0), None);
        field.set(4, 2, None);
        assert_eq!(field.sample_with_gradient(2.25, 1.5), None);
        assert_eq!(field.sample_with_gradient(2.0, 1.5), Some((-0.5, (2.0, -3.0))));
    }

    #[test]
    fn bilinear_reproduces_a_plane_and_respects_holes() {
        let mut field = Field::from_grid(Grid::from_fn(5, 4, |u, v| 2.0 * u as f32 - 3.0 * v as f32));
        assert_eq!(field.sample(1.25, 2.5), Some(2.0 * 1.25 - 3.0 * 2.5));
        assert_eq!(field.sample(4.0, 3.0), Some(-1.0));
        assert_eq!(field.sample(4.1, 3.0), None);
        assert_eq!(field.sample(-0.1, f64::NAN), None);
        assert_eq!(field.gradient(2, 2), Some((2.0, -3.0)));
        field.set(2, 2, None);
        assert_eq!(field.sample(1.5, 1.5), None);
        assert_eq!(field.sample(1.0, 1.5), Some(2.0 - 4.5));
        assert_eq!(field.gradient(3, 2), None);
        assert_eq!(field.count(), 19);
    }
}
