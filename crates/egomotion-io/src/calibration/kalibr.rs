//! Kalibr's camera chain: `cam0`, `cam1` in one YAML file, T_cn_cnm1 from one camera to the next.

use std::path::Path;

use egomotion::geometry::Distortion;

use super::camera::{CameraModel, RawPair, coefficients, comma_separated, distortion, row_major_4x4, size};
use super::document::{Document, Entry};
use crate::{IoError, read, write};

/// The pair cam0, cam1 of a file.
///
/// # Errors
/// The file cannot be read, or names the line and key that is missing or wrong.
pub(crate) fn read(path: &Path) -> Result<RawPair, IoError> {
    parse(&read::text(path)?, path)
}

/// The same from a text; `path` names it in errors.
///
/// # Errors
/// Names the line and key that is missing or wrong, or the camera model that is not supported.
pub fn parse(text: &str, path: &Path) -> Result<RawPair, IoError> {
    pair(&Document::yaml(text, path)?.root(path))
}

pub(super) fn pair(root: &Entry<'_>) -> Result<RawPair, IoError> {
    let (first, second) = (root.get(&["cam0"])?, root.get(&["cam1"])?);
    let imu = |cam: &Entry<'_>| cam.find(&["T_cam_imu"]).map(|t| t.motion()).transpose();
    let body_from_left = imu(&first)?.map(|camera_from_body| camera_from_body.inverse());
    let right_from_left = match (second.find(&["T_cn_cnm1"]), body_from_left, imu(&second)?) {
        (Some(chained), ..) => chained.motion()?,
        (None, Some(body_from_left), Some(right_from_body)) => right_from_body.after(&body_from_left),
        (None, ..) => second.get(&["T_cn_cnm1"])?.motion()?,
    };
    Ok(RawPair { left: camera(&first)?, right: camera(&second)?, right_from_left, body_from_left })
}

fn camera(cam: &Entry<'_>) -> Result<CameraModel, IoError> {
    let model = cam.get(&["camera_model"])?;
    if model.text()? != "pinhole" {
        let reason = format_args!("{:?} is not supported, only pinhole", model.text()?).to_string();
        let advice = "calibrate again with pinhole-radtan or pinhole-equi, which hold for most lenses";
        return Err(model.refuse(reason, advice));
    }
    let [fx, fy, cx, cy] = cam.get(&["intrinsics"])?.numbers()?;
    let name = cam.get(&["distortion_model"])?;
    let lens = distortion(Some(&name), &cam.get(&["distortion_coeffs"])?)?;
    let size = cam.find(&["resolution"]).as_ref().map(size).transpose()?;
    Ok(CameraModel { focal_px: (fx, fy), centre_px: (cx, cy), distortion: lens, size })
}

/// Write a pair, such that reading gives it back.
///
/// # Errors
/// The file cannot be written, or the format has no name for the distortion.
pub fn write(path: &Path, pair: &RawPair) -> Result<(), IoError> {
    let rows = |motion: &egomotion::geometry::RigidMotion| {
        let rows = row_major_4x4(motion);
        rows.chunks(4).map(|row| format!("  - [{}]\n", comma_separated(row))).collect::<String>()
    };
    let mut text = String::new();
    for (name, camera) in [("cam0", &pair.left), ("cam1", &pair.right)] {
        let mut lens = coefficients(&camera.distortion);
        let model = match camera.distortion {
            Distortion::Equidistant { .. } => "equidistant",
            Distortion::None => "none",
            Distortion::RadialTangential { k: [_, _, 0.0], .. } => "radtan",
            _ => {
                let reason = "Kalibr's format has no k3 and no rational distortion";
                return Err(IoError::new(path, reason, "write OpenCV's format"));
            }
        };
        lens.truncate(4);
        let ((fx, fy), (cx, cy)) = (camera.focal_px, camera.centre_px);
        text += &format!("{name}:\n");
        if name == "cam1" {
            text += &format!("  T_cn_cnm1:\n{}", rows(&pair.right_from_left));
        } else if let Some(body_from_left) = &pair.body_from_left {
            text += &format!("  T_cam_imu:\n{}", rows(&body_from_left.inverse()));
        }
        text += &format!(
            "  camera_model: pinhole\n  intrinsics: [{}]\n  distortion_model: {model}\n  distortion_coeffs: [{}]\n",
            comma_separated(&[fx, fy, cx, cy]),
            comma_separated(&lens)
        );
        if let Some((w, h)) = camera.size {
            text += &format!("  resolution: [{w}, {h}]\n");
        }
    }
    write::bytes(path, text.as_bytes())
}
