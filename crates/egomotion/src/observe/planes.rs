//! Several planes of one size, handed out in strips of rows.

use crate::geometry::Grid;

/// N row-major planes of f32 of one size.
#[derive(Debug, Clone)]
pub(crate) struct Planes<const N: usize> {
    width: usize,
    height: usize,
    planes: [Vec<f32>; N],
}

impl<const N: usize> Default for Planes<N> {
    fn default() -> Self {
        Self { width: 0, height: 0, planes: std::array::from_fn(|_| Vec::new()) }
    }
}

impl<const N: usize> Planes<N> {
    /// Planes filled with one value.
    pub fn filled(width: usize, height: usize, value: f32) -> Self {
        Self { width, height, planes: std::array::from_fn(|_| vec![value; width * height]) }
    }

    /// Make them of this size; what they hold is then anything.
    pub fn resize(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.planes.iter_mut().for_each(|plane| plane.resize(width * height, f32::NAN));
    }

    /// Row `v` of plane `n`, both inside.
    pub fn row(&self, n: usize, v: usize) -> &[f32] {
        &self.planes[n][v * self.width..(v + 1) * self.width]
    }

    /// Value of plane `n` at pixel (u, v), inside.
    pub fn at(&self, n: usize, u: usize, v: usize) -> f32 {
        self.planes[n][v * self.width + u]
    }

    /// (width, height), in pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// All planes in strips of so many rows, the last perhaps lower.
    pub fn strips(&mut self, rows: usize) -> Vec<[&mut [f32]; N]> {
        let mut strips = self.planes.each_mut().map(|plane| plane.chunks_mut((rows * self.width).max(1)));
        let count = self.height.div_ceil(rows.max(1));
        (0..count).map(|_| strips.each_mut().map(|strip| strip.next().unwrap_or_default())).collect()
    }

    /// The planes themselves.
    pub fn into_grids(self) -> [Grid<f32>; N] {
        let (width, height) = (self.width, self.height);
        self.planes.map(|plane| {
            Grid::from_values(width, height, plane).unwrap_or_else(|| Grid::filled(width, height, f32::NAN))
        })
    }
}
