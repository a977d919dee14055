//! Connected regions of the cells of a grid, and where they lie in the image.

use serde::{Deserialize, Serialize};

/// A rectangle of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct PixelBounds {
    /// Its leftmost column.
    pub u: usize,
    /// Its uppermost row.
    pub v: usize,
    /// Width, in pixels.
    pub width: usize,
    /// Height, in pixels.
    pub height: usize,
}

/// An image divided into square cells, numbered row by row; those at the right and the lower edge may be cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Cells {
    size_px: usize,
    image: (usize, usize),
    columns: usize,
}

impl Cells {
    /// Cells of `size_px` × `size_px` pixels (at least 1) over an image of `(width, height)`.
    pub(crate) fn tiling(image: (usize, usize), size_px: usize) -> Self {
        let size_px = size_px.max(1);
        Self { size_px, image, columns: image.0.div_ceil(size_px) }
    }

    /// Side of a cell, in pixels.
    pub(crate) fn size_px(&self) -> usize {
        self.size_px
    }

    /// Cells in a row.
    pub(crate) fn columns(&self) -> usize {
        self.columns
    }

    /// Number of cells.
    pub(crate) fn count(&self) -> usize {
        self.columns * self.image.1.div_ceil(self.size_px)
    }

    /// The cell of a pixel inside the image.
    #[inline(always)]
    pub(crate) fn index(&self, u: usize, v: usize) -> usize {
        v / self.size_px * self.columns + u / self.size_px
    }

    /// First pixel of a cell.
    pub(crate) fn corner(&self, cell: usize) -> (usize, usize) {
        (cell % self.columns * self.size_px, cell / self.columns * self.size_px)
    }

    /// The least rectangle around some cells, inside the image; `None` of none.
    pub(crate) fn bounds(&self, cells: &[usize]) -> Option<PixelBounds> {
        let corners = || cells.iter().map(|&cell| self.corner(cell));
        let (left, right) = (corners().map(|c| c.0).min()?, corners().map(|c| c.0).max()?);
        let (top, bottom) = (corners().map(|c| c.1).min()?, corners().map(|c| c.1).max()?);
        let end = |last: usize, n: usize| (last + self.size_px).min(n);
        Some(PixelBounds {
            u: left,
            v: top,
            width: end(right, self.image.0) - left,
            height: end(bottom, self.image.1) - top,
        })
    }

    /// The cells beside one, by an edge.
    fn beside(&self, cell: usize) -> [Option<usize>; 4] {
        let column = cell % self.columns;
        [
            (column > 0).then(|| cell - 1),
            (column + 1 < self.columns).then_some(cell + 1),
            cell.checked_sub(self.columns),
            Some(cell + self.columns).filter(|&below| below < self.count()),
        ]
    }

    /// Number of cells of a region that have all four neighbours in it.
    pub(crate) fn enclosed(&self, region: &[usize]) -> usize {
        let mut sorted = region.to_vec();
        sorted.sort_unstable();
        let inside = |cell: Option<usize>| cell.is_some_and(|cell| sorted.binary_search(&cell).is_ok());
        region.iter().filter(|&&cell| self.beside(cell).into_iter().all(inside)).count()
    }

    /// The connected regions of the cells that are `member`: neighbours by an edge belong together where they
    /// are `joined`, which must be symmetric. Regions in the order of their first cell.
    pub(crate) fn regions(
        &self,
        member: impl Fn(usize) -> bool,
        joined: impl Fn(usize, usize) -> bool,
    ) -> Vec<Vec<usize>> {
        let count = self.count();
        let mut open: Vec<bool> = (0..count).map(member).collect();
        let mut regions = Vec::new();
        for first in 0..count {
            if !std::mem::take(&mut open[first]) {
                continue;
            }
            let mut region = vec![first];
            let mut next = 0;
            while let Some(&cell) = region.get(next) {
                next += 1;
                for other in self.beside(cell).into_iter().flatten() {
                    if open[other] && joined(cell, other) {
                        open[other] = false;
                        region.push(other);
                    }
                }
            }
            regions.push(region);
        }
        regions
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_joined_over_edges_but_not_corners() {
        // 5 × 3 cells; the last column and row are cut.
        let cells = Cells::tiling((18, 11), 4);
        assert_eq!((cells.columns(), cells.count()), (5, 15));
        let level = [
            1, 1, 0, 2, 2, //
            0, 1, 0, 1, 0, //
            1, 0, 1, 1, 1,
        ];
        let mut regions = cells.regions(|i| level[i] > 0, |a, b| level[a] == level[b]);
        regions.iter_mut().for_each(|region| region.sort_unstable());
        assert_eq!(regions, [vec![0, 1, 6], vec![3, 4], vec![8, 12, 13, 14], vec![10]]);
        let bounds = |u, v, width, height| Some(PixelBounds { u, v, width, height });
        assert_eq!(cells.bounds(&regions[0]), bounds(0, 0, 8, 8));
        assert_eq!(cells.bounds(&regions[2]), bounds(8, 4, 10, 7));
        assert_eq!(cells.bounds(&[]), None);
        assert_eq!((cells.index(17, 10), cells.corner(14)), (14, (16, 8)));
    }

    #[test]
    fn enclosed_cells_have_four_neighbours() {
        let cells = Cells::tiling((20, 16), 4);
        // A block of 4 × 3 cells at the left edge, and a row of 5.
        let block: Vec<usize> = (0..3).flat_map(|row| (0..4).map(move |column| 5 * row + column)).collect();
        assert_eq!(cells.enclosed(&block), 2);
        assert_eq!(cells.enclosed(&[15, 16, 17, 18, 19]), 0);
    }

    #[test]
    fn an_image_without_pixels_has_no_cells() {
        assert!(Cells::tiling((0, 7), 4).regions(|_| true, |_, _| true).is_empty());
    }
}
