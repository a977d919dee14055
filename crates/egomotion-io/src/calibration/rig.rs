//! Our own `rig.toml`.
//!
//! Rectified images:
//!
//! ```toml
//! focal_px = 707.09
//! cx_px = 601.89          # principal point of the left camera
//! cy_px = 183.11
//! baseline_m = 0.5372
//! # focal_y_px = 707.09   # if pixels are not square
//! # doffs_px = 0.0        # cx of the right camera minus cx of the left one
//! ```
//!
//! Raw images:
//!
//! ```toml
//! right_from_left = [      # 4×4, row by row, metres: takes points of the left camera's frame to the right one's
//!     1, 0, 0, -0.11,
//!     0, 1, 0, 0,
//!     0, 0, 1, 0,
//!     0, 0, 0, 1,
//! ]
//!
//! [left]
//! focal_px = [458.654, 457.296]
//! centre_px = [367.215, 248.375]
//! distortion_model = "radial-tangential"   # or "rational_polynomial", "equidistant", "none"
//! distortion = [-0.283, 0.0739, 0.0002, 1.8e-05]   # k1 k2 p1 p2 [k3 [k4 k5 k6]], or k1 k2 k3 k4
//! size_px = [752, 480]
//!
//! [right]
//! # the same
//! ```

use std::path::Path;

use egomotion::geometry::{Distortion, StereoRig};

use super::StereoCalibration;
use super::camera::{CameraModel, RawPair, coefficients, comma_separated, distortion, row_major_4x4, size};
use super::document::{Document, Entry};
use crate::{IoError, read, write};

/// The calibration of a file.
///
/// # Errors
/// The file cannot be read, or names the line and key that is missing or wrong.
pub fn read(path: &Path) -> Result<StereoCalibration, IoError> {
    parse(&read::text(path)?, path)
}

/// The same from a text; `path` names it in errors.
///
/// # Errors
/// Names the line and key that is missing or wrong.
pub fn parse(text: &str, path: &Path) -> Result<StereoCalibration, IoError> {
    let document = Document::toml(text, path)?;
    let root = document.root(path);
    match root.find(&["left"]) {
        None => rectified(&root).map(StereoCalibration::Rectified),
        Some(left) => {
            let right_from_left = root.get(&["right_from_left"])?.motion()?;
            let (left, right) = (camera(&left)?, camera(&root.get(&["right"])?)?);
            Ok(StereoCalibration::Raw(RawPair { left, right, right_from_left, body_from_left: None }))
        }
    }
}

fn rectified(root: &Entry<'_>) -> Result<StereoRig, IoError> {
    let number = |name| root.get(&[name])?.number();
    let or = |name, default| root.find(&[name]).map_or(Ok(default), |entry| entry.number());
    let focal_px = number("focal_px")?;
    let (width_px, height_px) = root.find(&["size_px"]).as_ref().map(size).transpose()?.unwrap_or_default();
    Ok(StereoRig {
        focal_px,
        focal_y_px: or("focal_y_px", focal_px)?,
        cx_px: number("cx_px")?,
        cy_px: number("cy_px")?,
        doffs_px: or("doffs_px", 0.0)?,
        baseline_m: number("baseline_m")?,
        width_px,
        height_px,
    })
}

fn camera(entry: &Entry<'_>) -> Result<CameraModel, IoError> {
    let [fx, fy] = entry.get(&["focal_px"])?.numbers()?;
    let [cx, cy] = entry.get(&["centre_px"])?.numbers()?;
    let lens = match entry.find(&["distortion"]) {
        Some(coefficients) => distortion(entry.find(&["distortion_model"]).as_ref(), &coefficients)?,
        None => Distortion::None,
    };
    let size = entry.find(&["size_px"]).as_ref().map(size).transpose()?;
    Ok(CameraModel { focal_px: (fx, fy), centre_px: (cx, cy), distortion: lens, size })
}

/// Write a calibration, such that [`read()`] gives it back.
///
/// # Errors
/// The file cannot be written, or is KITTI's, which is not one pair.
pub fn write(path: &Path, calibration: &StereoCalibration) -> Result<(), IoError> {
    let sized =
        |size: Option<(usize, usize)>| size.map_or(String::new(), |(w, h)| format!("size_px = [{w}, {h}]\n"));
    let text = match calibration {
        StereoCalibration::Rectified(rig) => {
            let size = (rig.width_px > 0).then_some((rig.width_px, rig.height_px));
            format!(
                "focal_px = {:?}\nfocal_y_px = {:?}\ncx_px = {:?}\ncy_px = {:?}\ndoffs_px = {:?}\nbaseline_m = {:?}\n{}",
                rig.focal_px,
                rig.focal_y_px,
                rig.cx_px,
                rig.cy_px,
                rig.doffs_px,
                rig.baseline_m,
                sized(size)
            )
        }
        StereoCalibration::Raw(pair) => {
            let camera = |name: &str, camera: &CameraModel| {
                let model = match camera.distortion {
                    Distortion::None => "none",
                    Distortion::RadialTangential { .. } => "radial-tangential",
                    Distortion::Rational { .. } => "rational_polynomial",
                    Distortion::Equidistant { .. } => "equidistant",
                };
                let ((fx, fy), (cx, cy)) = (camera.focal_px, camera.centre_px);
                format!(
                    "\n[{name}]\nfocal_px = [{fx:?}, {fy:?}]\ncentre_px = [{cx:?}, {cy:?}]\n\
                     distortion_model = \"{model}\"\ndistortion = [{}]\n{}",
                    comma_separated(&coefficients(&camera.distortion)),
                    sized(camera.size)
                )
            };
            let pose = comma_separated(&row_major_4x4(&pair.right_from_left));
            format!(
                "right_from_left = [{pose}]\n{}{}",
                camera("left", &pair.left),
                camera("right", &pair.right)
            )
        }
        StereoCalibration::Kitti(_) => {
            return Err(IoError::new(path, "KITTI's calibration holds two pairs", "write the rig of one"));
        }
    };
    write::bytes(path, text.as_bytes())
}
