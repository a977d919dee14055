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
            let above = y.saturating_sub(radius);
            let heights = &weights[above + radius - y..=last + radius - y];
            for n in 0..N {
                let row = |k: usize| &ring[(above + k) % weights.len()][n][..];
                weighted_sum(&mut columns[n][radius..radius + width], heights, row);
                weighted_sum(&mut sums[n], weights, |k| &columns[n][k..k + width]);
            }
            consume(y, &sums, out);
        }
    });
}

/// Σ weights[k] × terms(k), each as long as `sum`; sixteen sums at a time stay in registers.
fn weighted_sum<'a>(sum: &mut [f32], weights: &[f32], terms: impl Fn(usize) -> &'a [f32]) {
    const LANES: usize = 16;
    let (blocks, rest) = sum.as_chunks_mut::<LANES>();
    let done = blocks.len() * LANES;
    for (b, block) in blocks.iter_mut().enumerate() {
        let mut lanes = [0.0_f32; LANES];
        for (k, weight) in weights.iter().enumerate() {
            if let Some(term) = terms(k)[b * LANES..].first_chunk::<LANES>() {
                for i in 0..LANES {
                    lanes[i] += weight * term[i];
                }
            }
        }
        *block = lanes;
    }
    for (i, sum) in rest.iter_mut().enumerate() {
        *sum = weights.iter().enumerate().map(|(k, weight)| weight * terms(k)[done + i]).sum();
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
