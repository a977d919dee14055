//! The least-squares step of one window: how far the grey levels move its disparity, and how surely.
//!
//! B. Lucas, T. Kanade, IJCAI 1981, in one dimension. The variance of the step is that of the grey
//! levels' difference, taken from the residual, over the sum of the squared slopes.

/// Windows summed side by side.
pub(super) const LANES: usize = 8;
/// Weight of the whole image's noise against a window's own, in pixels of the window.
const NOISE_PRIOR_PIXELS: f32 = 8.0;

/// Pixels of the same surface below which a window says nothing.
const FEWEST_PIXELS: f32 = 6.0;
/// Least noise variance against the variance of the slopes: what f32 sums can tell from nothing.
const LEAST_NOISE: f32 = 1e-6;

/// A pixel of a window.
#[derive(Debug, Clone, Copy)]
pub(super) struct WindowPixel {
    /// Its index in a plane less the index of the window's centre.
    pub offset: isize,
    /// Greatest difference of disparity from the centre's on the same surface, in pixels.
    pub tolerance: f32,
}

/// The eight values from `start` on.
pub(super) fn lanes(plane: &[f32], start: usize) -> [f32; LANES] {
    let values = &plane[start..start + LANES];
    std::array::from_fn(|lane| values[lane])
}

/// Sums over eight windows: of the pixels of the same surface, their slopes g, differences e and products.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    count: [f32; LANES],
    g: [f32; LANES],
    e: [f32; LANES],
    gg: [f32; LANES],
    ge: [f32; LANES],
    ee: [f32; LANES],
}

/// What the grey levels of a window say of its disparity.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fit {
    /// Correction of the disparity, in pixels, times `information`.
    pub pull: f32,
    /// Inverse variance of the correction, px⁻².
    pub information: f32,
    /// Noise variance of the difference of two grey levels; NaN if the window has too few pixels.
    pub noise: f32,
}

impl Sums {
    /// Gather the sums of the eight windows whose centres begin at index `at`.
    pub(super) fn gather(
        window: &[WindowPixel],
        at: usize,
        disparity: &[f32],
        difference: &[f32],
        slope: &[f32],
    ) -> Self {
        let mut sums = Self::default();
        let centre = lanes(disparity, at);
        for &WindowPixel { offset, tolerance } in window {
            let at = at.wrapping_add_signed(offset);
            let (near, e, g) = (lanes(disparity, at), lanes(difference, at), lanes(slope, at));
            for lane in 0..LANES {
                let weight = if (near[lane] - centre[lane]).abs() <= tolerance { 1.0 } else { 0.0 };
                let (wg, we) = (weight * g[lane], weight * e[lane]);
                sums.count[lane] += weight;
                sums.g[lane] += wg;
                sums.e[lane] += we;
                sums.gg[lane] += wg * g[lane];
                sums.ge[lane] += wg * e[lane];
                sums.ee[lane] += we * e[lane];
            }
        }
        sums
    }

    /// Least squares of e = offset − g δ, whose offset takes up a difference of brightness.
    pub(super) fn fit(&self, lane: usize, typical_noise: Option<f32>) -> Fit {
        let n = self.count[lane];
        if n < FEWEST_PIXELS {
            return Fit { pull: 0.0, information: 0.0, noise: f32::NAN };
        }
        let gg = (self.gg[lane] - self.g[lane] * self.g[lane] / n).max(0.0);
        let ge = self.ge[lane] - self.g[lane] * self.e[lane] / n;
        let ee = (self.ee[lane] - self.e[lane] * self.e[lane] / n).max(0.0);
        let residual = (ee - if gg > 0.0 { ge * ge / gg } else { 0.0 }).max(0.0);
        let own = residual / (n - 2.0);
        let noise = match typical_noise {
            Some(typical) => (residual + NOISE_PRIOR_PIXELS * typical) / (n - 2.0 + NOISE_PRIOR_PIXELS),
            None => own,
        }
        .max(LEAST_NOISE * gg / n);
        // Noise makes slopes of its own, ¼ of the variance of the difference: they are no texture.
        let texture = (gg - 0.25 * n * noise).max(0.0);
        let scale = if texture > 0.0 { texture / (gg * noise) } else { 0.0 };
        Fit { pull: -ge * scale, information: gg * scale, noise: own }
    }
}
