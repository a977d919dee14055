//! ROS CameraInfo as YAML (`camera_calibration` writes `left.yaml`, `right.yaml`): one file a camera, both
//! with the rectification that ROS would use, from which the pose between them follows.

use std::path::{Path, PathBuf};

use egomotion::geometry::{Distortion, RigidMotion, StereoRig};
use nalgebra::{Matrix3, Vector3};

use super::StereoCalibration;
use super::camera::{CameraModel, RawPair, coefficients, comma_separated, distortion, whole_size};
use super::document::{Document, Entry};
use crate::{IoError, read, write};

/// One camera, the rotation that rectifies it, and its 3×4 projection after that.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraInfo {
    /// The camera as it is.
    pub camera: CameraModel,
    /// Rotation from the camera's frame to the rectified one.
    pub rectification: Matrix3<f64>,
    /// The projection of the rectified camera, row by row.
    pub projection: [f64; 12],
}

/// One camera's file.
///
/// # Errors
/// The file cannot be read, or names the line and key that is missing or wrong.
pub fn read(path: &Path) -> Result<CameraInfo, IoError> {
    parse(&read::text(path)?, path)
}

/// The same from a text; `path` names it in errors.
///
/// # Errors
/// Names the line and key that is missing or wrong.
pub fn parse(text: &str, path: &Path) -> Result<CameraInfo, IoError> {
    info(&Document::yaml(text, path)?.root(path))
}

pub(super) fn recognise(root: &Entry<'_>) -> bool {
    root.find(&["camera_matrix", "K", "k"]).is_some() && root.find(&["projection_matrix", "P", "p"]).is_some()
}

fn info(root: &Entry<'_>) -> Result<CameraInfo, IoError> {
    let (w, h) = (root.get(&["image_width", "width"])?, root.get(&["image_height", "height"])?);
    let size = whole_size(w.number()?, h.number()?)
        .ok_or_else(|| w.refuse("is no image size", "give whole numbers of pixels"))?;
    let lens = distortion(
        root.find(&["distortion_model", "camera_model"]).as_ref(),
        &root.get(&["distortion_coefficients", "D", "d"])?,
    )?;
    let camera = CameraModel::of_matrix(&root.get(&["camera_matrix", "K", "k"])?, lens, Some(size))?;
    let turn = root.get(&["rectification_matrix", "R", "r"])?;
    let rectification = turn.rigid(turn.matrix()?, Vector3::zeros())?.rotation;
    let projection = root.get(&["projection_matrix", "P", "p"])?.numbers()?;
    Ok(CameraInfo { camera, rectification, projection })
}

/// The files of the left and the right camera, given one of them or their folder.
pub(super) fn partners(path: &Path) -> Result<(PathBuf, PathBuf), IoError> {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let swaps =
        [("left", "right"), ("cam0", "cam1"), ("camera0", "camera1"), ("infra1", "infra2"), ("_l", "_r")];
    for (left, right) in swaps {
        for (own, other, is_left) in [(left, right, true), (right, left, false)] {
            let partner = path.with_file_name(name.replace(own, other));
            if name.contains(own) && partner.is_file() {
                return Ok(if is_left { (path.into(), partner) } else { (partner, path.into()) });
            }
        }
    }
    Err(IoError::new(
        path,
        "is a CameraInfo of one camera, and the other's is not beside it",
        "name them left.yaml and right.yaml, and give either",
    ))
}

/// The calibration that two files tell.
///
/// Without any distortion and turn the images are already rectified: then f, cx, cy and the baseline
/// are those of the projections.
///
/// # Errors
/// As [`read()`]; and what of the two does not fit together.
pub(super) fn read_pair(left: &Path, right: &Path) -> Result<StereoCalibration, IoError> {
    let (l, r) = (read(left)?, read(right)?);
    let p = &r.projection;
    let refuse =
        |reason: &str| Err(IoError::new(right, reason, "give the projections of a calibrated stereo pair"));
    if !(p[0] > 0.0 && p[5] > 0.0 && l.projection[0] > 0.0) {
        return refuse("projection_matrix: the focal length is not positive");
    }
    let baseline_m = (l.projection[3] - p[3]) / p[0];
    if baseline_m <= 0.0 {
        return refuse(
            "projection_matrix: its fourth number, −fx b, gives no positive baseline; left and right may be swapped",
        );
    }
    let plain = |info: &CameraInfo| {
        info.camera.distortion == Distortion::None && (info.rectification - Matrix3::identity()).amax() < 1e-9
    };
    if plain(&l) && plain(&r) {
        let (width_px, height_px) = l.camera.size.unwrap_or_default();
        let q = &l.projection;
        return Ok(StereoCalibration::Rectified(StereoRig {
            focal_px: q[0],
            focal_y_px: q[5],
            cx_px: q[2],
            cy_px: q[6],
            doffs_px: p[2] - q[2],
            baseline_m,
            width_px,
            height_px,
        }));
    }
    // The rectified frames are parallel: X_right = X_left − (b, 0, 0).
    let still = |rotation| RigidMotion { rotation, translation: Vector3::zeros() };
    let shift =
        RigidMotion { rotation: Matrix3::identity(), translation: Vector3::new(-baseline_m, 0.0, 0.0) };
    let right_from_left = still(r.rectification).inverse().after(&shift).after(&still(l.rectification));
    Ok(StereoCalibration::Raw(RawPair {
        left: l.camera,
        right: r.camera,
        right_from_left,
        body_from_left: None,
    }))
}

/// Write one camera, such that [`read()`] gives it back.
///
/// # Errors
/// The file cannot be written, or the camera has no size.
pub fn write(path: &Path, info: &CameraInfo) -> Result<(), IoError> {
    let (width, height) = info.camera.size.ok_or_else(|| {
        IoError::new(path, "the camera has no image size, which CameraInfo needs", "give its size")
    })?;
    let model = match info.camera.distortion {
        Distortion::Equidistant { .. } => "equidistant",
        Distortion::Rational { .. } => "rational_polynomial",
        _ => "plumb_bob",
    };
    let mut lens = coefficients(&info.camera.distortion);
    if model == "plumb_bob" {
        lens.resize(5, 0.0);
    }
    let matrix = |name: &str, rows: usize, numbers: &[f64]| {
        let cols = numbers.len() / rows;
        format!("{name}:\n  rows: {rows}\n  cols: {cols}\n  data: [{}]\n", comma_separated(numbers))
    };
    let text = format!(
        "image_width: {width}\nimage_height: {height}\ncamera_name: camera\n{}distortion_model: {model}\n{}{}{}",
        matrix("camera_matrix", 3, &info.camera.matrix()),
        matrix("distortion_coefficients", 1, &lens),
        matrix("rectification_matrix", 3, info.rectification.transpose().as_slice()),
        matrix("projection_matrix", 3, &info.projection),
    );
    write::bytes(path, text.as_bytes())
}
