//! The change of disparity of one surface patch between two stereo frames, found from all four images.
//!
//! The difference of two disparity maps adds the errors of both. Here the same window is followed in
//! time by either camera: the left one sees it move by u_L, the right one by u_R, and the disparity
//! changes by exactly u_L − u_R: the Δv of (9) over a finite interval. How a window is biased by the
//! shape of its surface is the same before and after, and cancels.

use super::patch::{Freedom, Patch, Settling};
use super::stereo_pyramid::StereoPyramid;
use crate::geometry::distribution::CHI2_1_P9973;
use crate::geometry::{Gaussian, Image};

/// When a window is located: two hundredths of a pixel are below what noise leaves.
const SETTLING: Settling = Settling { iterations: 12, step_px: 0.02 };
/// Largest mean squared difference of two windows, in units of the window's own variance.
const LARGEST_RESIDUAL: f64 = 0.2;
/// A window found further from where flow leads, in pixels, is another one.
const FARTHEST_FROM_FLOW_PX: f64 = 1.5;
/// Rows by which the two cameras may disagree about the vertical motion beside noise, in pixels.
const ROWS_APART_PX: f64 = 0.5;
/// A change of disparity further from what was expected, in pixels, belongs to another surface.
const LARGEST_SURPRISE_PX: f64 = 3.0;

/// A patch of the left image and how it moves, in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PatchMotion {
    /// Pixel (u, v) of the left image at t.
    pub at: (f64, f64),
    /// u_left − u_right at t.
    pub shift: f64,
    /// Flow of the left image.
    pub flow: (f64, f64),
}

/// d′ − d of the patch at a pixel with its variance, in pixels: from the first of the `expected` changes
/// that leads to one.
///
/// `None` near the border, without texture, or where a window is not found again.
pub(crate) fn disparity_change(
    before: &StereoPyramid,
    after: &StereoPyramid,
    patch: &PatchMotion,
    expected: &[f64],
) -> Option<Gaussian<1>> {
    let (u, v) = patch.at;
    let guess = (u + patch.flow.0, v + patch.flow.1);
    let left = follow(&before.left_spline, &after.left_spline, (u, v), guess)?;
    let right_patch = Patch::new(&before.right_spline, u - patch.shift, v)?;
    expected.iter().find_map(|change| {
        let guess = (left.u - patch.shift - change, left.v);
        let right = locate(&right_patch, &after.right_spline, guess)?;
        let (moved_left, moved_right) = (left.u - u, right.u - (u - patch.shift));
        let apart = (right.v - left.v).powi(2);
        let plausible = apart < ROWS_APART_PX.powi(2) + CHI2_1_P9973 * (left.variance_v + right.variance_v);
        let value = moved_left - moved_right;
        (plausible && (value - change).abs() < LARGEST_SURPRISE_PX)
            .then(|| Gaussian::scalar(value, left.variance_u + right.variance_u))
    })
}

/// A window located again, with the variances of its place.
struct LocatedWindow {
    u: f64,
    v: f64,
    variance_u: f64,
    variance_v: f64,
}

fn follow(from: &Image, to: &Image, at: (f64, f64), guess: (f64, f64)) -> Option<LocatedWindow> {
    locate(&Patch::new(from, at.0, at.1)?, to, guess)
}

fn locate(patch: &Patch, to: &Image, guess: (f64, f64)) -> Option<LocatedWindow> {
    let located = patch.locate(to, guess, Freedom::Plane, SETTLING)?;
    let near = (located.u - guess.0).hypot(located.v - guess.1) < FARTHEST_FROM_FLOW_PX;
    let alike = located.residual < LARGEST_RESIDUAL * patch.contrast().powi(2);
    if !(near && alike) {
        return None;
    }
    let localisation = patch.localisation()?;
    let noise = located.residual / localisation.left_over;
    let (variance_u, variance_v) = (noise * localisation.plane.m11, noise * localisation.plane.m22);
    Some(LocatedWindow { u: located.u, v: located.v, variance_u, variance_v })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Grid;

    #[test]
    fn the_change_is_found_to_a_few_hundredths_of_a_pixel() {
        let grey = |u: f64, v: f64| {
            let wave = |a: f64, b: f64, c: f64| (a * u + b * v + c).sin();
            (120.0 + 30.0 * wave(0.7, 0.2, 0.0) + 25.0 * wave(-0.3, 0.6, 1.0) + 20.0 * wave(0.2, 0.9, 2.0))
                as f32
        };
        // The surface lies at disparity 12 before and 13.3 after, and moves by (2.4, −1.1) in the left image.
        let image = |du: f64, dv: f64| Grid::from_fn(120, 90, |u, v| grey(u as f64 - du, v as f64 - dv));
        let before = StereoPyramid::new(&image(0.0, 0.0), &image(-12.0, 0.0), 2);
        let after = StereoPyramid::new(&image(2.4, -1.1), &image(2.4 - 13.3, -1.1), 2);
        let seen = PatchMotion { at: (60.0, 45.0), shift: 12.0, flow: (2.2, -1.0) };
        let change = disparity_change(&before, &after, &seen, &[0.8]).unwrap();
        assert!((change.value() - 1.3).abs() < 0.02, "{}", change.value());
        assert!(change.variance() > 0.0 && change.variance() < 0.01);
        // Rows that disagree are no match.
        let lower = StereoPyramid::new(&image(2.4, -1.1), &image(2.4 - 13.3, 0.2), 2);
        assert_eq!(disparity_change(&before, &lower, &seen, &[0.8]), None);
    }
}
