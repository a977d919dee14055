//! Weighted sums over the window around every pixel, for several quantities at once.

use rayon::prelude::*;

/// Rows that are made at a time; fixed, so that the answer does not depend on the threads.
const STRIP: usize = 32;

/// Rows of N quantities.
pub(super) type Rows<const N: usize> = [Vec<f32>; N];

/// For each row y of a plane of `width` × `height`: let `produce(y, rows)` write the N quantities of its
/// pixels, and give `consume(y, sums, out)` their sums over the window with separable `weights` (an odd
/// number of them), together with the row of `out` to fill. The window is cut at the border.
///
/// `produce` is called more than once for a row, and must not depend on the order.
pub(super) fn window_sums<const N: usize, T: Send>(
    (width, height): (usize, usize),
    weights: &[f32],
    out: &mut [T],
    produce: impl Fn(usize, &mut Rows<N>) + Sync,
    consume: impl Fn(usize, &Rows<N>, &mut [T]) + Sync,
) {
    let radius = weights.len() / 2;
    let rows = |length: usize| -> Rows<N> { std::array::from_fn(|_| vec![0.0_f32; length]) };
    out.par_chunks_mut(STRIP * width.max(1)).enumerate().for_each(|(strip, out)| {
        // A ring of produced rows: row y is at y modulo the window's height.
        let mut ring: Vec<Rows<N>> = (0..weights.len()).map(|_| rows(width)).collect();
        let mut columns = rows(width + 2 * radius);
        let mut sums = rows(width);
        let top = strip * STRIP;
        let mut next = top.saturating_sub(radius);
        for (i, out) in out.chunks_mut(width).enumerate() {
            let y = top + i;
            let last = (y + radius).min(height - 1);
            while next <= last {
                produce(next, &mut ring[next % weights.len()]);
                next += 1;
            }
            columns.iter_mut().for_each(|c| c[radius..radius + width].fill(0.0));
            for row in y.saturating_sub(radius)..=last {
                let weight = weights[row + radius - y];
                for (column, values) in columns.iter_mut().zip(&ring[row % weights.len()]) {
                    add_scaled(&mut column[radius..radius + width], values, weight);
                }
            }
            for (sum, column) in sums.iter_mut().zip(&columns) {
                sum.fill(0.0);
                for (k, &weight) in weights.iter().enumerate() {
                    add_scaled(sum, &column[k..k + width], weight);
                }
            }
            consume(y, &sums, out);
        }
    });
}

/// sum += weight × values.
fn add_scaled(sum: &mut [f32], values: &[f32], weight: f32) {
    for (s, v) in sum.iter_mut().zip(values) {
        *s += weight * v;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_equal_the_direct_ones() {
        let (width, height) = (13, 71);
        let value = |x: usize, y: usize| ((x * 7 + y * 13) % 11) as f32;
        let weights = [0.1_f32, 0.3, 0.5, 0.7, 0.2];
        let mut out = vec![0.0_f32; width * height];
        window_sums::<1, f32>(
            (width, height),
            &weights,
            &mut out,
            |y, [row]| row.iter_mut().enumerate().for_each(|(x, r)| *r = value(x, y)),
            |_, [sums], out| out.copy_from_slice(sums),
        );
        for y in 0..height {
            for x in 0..width {
                let mut direct = 0.0;
                for (j, wy) in weights.iter().enumerate() {
                    for (i, wx) in weights.iter().enumerate() {
                        let (px, py) = (x + i, y + j);
                        if (2..width + 2).contains(&px) && (2..height + 2).contains(&py) {
                            direct += wx * wy * value(px - 2, py - 2);
                        }
                    }
                }
                assert!((out[y * width + x] - direct).abs() < 1e-3, "({x}, {y})");
            }
        }
    }
}
