//! EuRoC's `sensor.yaml`: one file a camera, its pose in the body as T_BS.

use std::path::Path;

use egomotion::geometry::{Distortion, RigidMotion};

use super::camera::{CameraModel, RawPair, coefficients, comma_separated, distortion, row_major_4x4, size};
use super::document::{Document, Entry};
use crate::{IoError, read, write};

/// A camera and its pose in the body, body_from_camera.
///
/// # Errors
/// The file cannot be read, or names the line and key that is missing or wrong.
pub(crate) fn read(path: &Path) -> Result<(CameraModel, RigidMotion), IoError> {
    parse(&read::text(path)?, path)
}

/// The same from a text; `path` names it in errors.
///
/// # Errors
/// Names the line and key that is missing or wrong.
pub fn parse(text: &str, path: &Path) -> Result<(CameraModel, RigidMotion), IoError> {
    camera(&Document::yaml(text, path)?.root(path))
}

/// The pair of two `sensor.yaml`, the left camera's first.
///
/// # Errors
/// As [`read()`].
pub(crate) fn read_pair(left: &Path, right: &Path) -> Result<RawPair, IoError> {
    let ((left, body_from_left), (right, body_from_right)) = (read(left)?, read(right)?);
    let right_from_left = body_from_right.inverse().after(&body_from_left);
    Ok(RawPair { left, right, right_from_left, body_from_left: Some(body_from_left) })
}

pub(super) fn camera(root: &Entry<'_>) -> Result<(CameraModel, RigidMotion), IoError> {
    if let Some(model) = root.find(&["camera_model"])
        && model.text()? != "pinhole"
    {
        return Err(
            model.refuse(format_args!("{:?} is not supported", model.text()?), "give a pinhole camera")
        );
    }
    let [fx, fy, cx, cy] = root.get(&["intrinsics"])?.numbers()?;
    let lens =
        distortion(root.find(&["distortion_model"]).as_ref(), &root.get(&["distortion_coefficients"])?)?;
    let size = root.find(&["resolution"]).as_ref().map(size).transpose()?;
    let model = CameraModel { focal_px: (fx, fy), centre_px: (cx, cy), distortion: lens, size };
    Ok((model, root.get(&["T_BS"])?.motion()?))
}

/// Write one camera and its pose, such that reading gives them back.
///
/// # Errors
/// The file cannot be written, or the format has no name for the distortion.
pub fn write(path: &Path, camera: &CameraModel, body_from_camera: &RigidMotion) -> Result<(), IoError> {
    let model = match camera.distortion {
        Distortion::Equidistant { .. } => "equidistant",
        Distortion::None | Distortion::RadialTangential { .. } => "radial-tangential",
        Distortion::Rational { .. } => {
            return Err(IoError::new(
                path,
                "EuRoC's format has no rational distortion",
                "write OpenCV's format",
            ));
        }
    };
    let ((fx, fy), (cx, cy)) = (camera.focal_px, camera.centre_px);
    let size = camera.size.map_or(String::new(), |(w, h)| format!("resolution: [{w}, {h}]\n"));
    let text = format!(
        "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [{}]\n{size}camera_model: pinhole\n\
         intrinsics: [{}]\ndistortion_model: {model}\ndistortion_coefficients: [{}]\n",
        comma_separated(&row_major_4x4(body_from_camera)),
        comma_separated(&[fx, fy, cx, cy]),
        comma_separated(&coefficients(&camera.distortion)),
    );
    write::bytes(path, text.as_bytes())
}
