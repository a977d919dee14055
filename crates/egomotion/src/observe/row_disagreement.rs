//! How well a pair is rectified: by how much matches of left and right lie on different rows.
//!
//! A rectified pair shows every point on one row. What is left of vertical disparity tells how
//! good the calibration is, and is the only part of its error that the images themselves show.

use rayon::prelude::*;

use super::observation::StereoTrack;
use super::patch::{Freedom, Patch, Settling};
use super::stereo_pyramid::StereoPyramid;
use crate::geometry::{StereoRig, upper_median};

/// Regions into which the image is divided each way: a calibration error varies over the image.
const REGIONS: usize = 3;
/// Fewest matches that make a region's median.
const LEAST_MATCHES: usize = 8;
/// Most matches looked at; more do not make the median better than the regions differ.
const MOST_MATCHES: usize = 500;
/// Rows further apart than this, in pixels, are mismatches.
const LARGEST_DISAGREEMENT_PX: f64 = 3.0;

/// When a match is located: two hundredths of a pixel are well below what calibrations are judged by.
const SETTLING: Settling = Settling { iterations: 25, step_px: 0.02 };

/// Root mean square over the regions of the image of the median vertical disparity, in pixels.
///
/// `tracks` give places and disparities in the frame. `None` with too few matches everywhere.
pub fn row_disagreement(frame: &StereoPyramid, tracks: &[StereoTrack], rig: &StereoRig) -> Option<f64> {
    let stride = tracks.len().div_ceil(MOST_MATCHES).max(1);
    let found: Vec<(usize, f64)> = tracks
        .par_iter()
        .step_by(stride)
        .filter_map(|track| {
            let [x, y, d] = track.before.mean.into();
            let (u, v) = rig.pixel_from_image(x, y);
            let patch = Patch::new(&frame.left_spline, u, v)?;
            let start = (u - rig.shift_from_disparity(d), v);
            let right = patch.locate(&frame.right_spline, start, Freedom::Plane, SETTLING)?;
            let column = (u as usize * REGIONS / rig.width_px.max(1)).min(REGIONS - 1);
            let row = (v as usize * REGIONS / rig.height_px.max(1)).min(REGIONS - 1);
            ((right.v - v).abs() < LARGEST_DISAGREEMENT_PX).then_some((row * REGIONS + column, right.v - v))
        })
        .collect();
    let medians: Vec<f64> = (0..REGIONS * REGIONS)
        .filter_map(|region| {
            let mut rows: Vec<f64> = found.iter().filter(|(r, _)| *r == region).map(|(_, dv)| *dv).collect();
            upper_median(&mut rows, f64::total_cmp).filter(|_| rows.len() >= LEAST_MATCHES)
        })
        .collect();
    let square: f64 = medians.iter().map(|m| m * m).sum();
    (!medians.is_empty()).then(|| (square / medians.len() as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Gaussian, Grid};
    use nalgebra::Vector3;

    /// A pair with disparity 10 px whose right image is lower by `down` px.
    fn disagreement(down: f64) -> Option<f64> {
        let grey = |u: f64, v: f64| {
            let wave = |a: f64, b: f64, c: f64| (a * u + b * v + c).sin();
            (120.0 + 25.0 * wave(0.7, 0.2, 0.0) + 25.0 * wave(-0.3, 0.6, 1.0) + 20.0 * wave(0.2, 0.9, 2.0))
                as f32
        };
        let rig = StereoRig::new(300.0, (99.5, 74.5), 0.1, (200, 150)).ok()?;
        let left = Grid::from_fn(200, 150, |u, v| grey(u as f64, v as f64));
        let right = Grid::from_fn(200, 150, |u, v| grey(u as f64 + 10.0, v as f64 - down));
        let tracks: Vec<StereoTrack> = (0..160)
            .map(|i| {
                let (x, y) =
                    rig.image_from_pixel(30.0 + (i % 16) as f64 * 9.0, 20.0 + (i / 16) as f64 * 12.0);
                let end = Gaussian { mean: Vector3::new(x, y, 10.0), cov: nalgebra::Matrix3::identity() };
                StereoTrack { before: end, after: end }
            })
            .collect();
        row_disagreement(&StereoPyramid::new(&left, &right, 3), &tracks, &rig)
    }

    #[test]
    fn a_vertical_offset_is_found() {
        assert!(disagreement(0.0).unwrap() < 0.01);
        for down in [0.4, -0.8] {
            assert!((disagreement(down).unwrap() - down.abs()).abs() < 0.02);
        }
    }
}
