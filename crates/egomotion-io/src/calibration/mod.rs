//! Calibration files of stereo pairs, one module a format; [`read()`] recognises which.

mod camera;
mod document;
pub mod euroc;
pub mod kalibr;
pub(crate) mod kitti;
pub mod opencv;
pub mod rig;
pub mod ros;

use std::fmt;
use std::path::Path;

use egomotion::geometry::{StereoRectification, StereoRig};

pub use camera::{CameraModel, RawPair};
pub use kitti::{CameraPair, KittiCalibration};

use crate::{IoError, read};
use document::Document;

/// What a calibration file says.
// There is one a source: its size does not matter.
#[allow(clippy::large_enum_variant)]
#[derive(Debug, Clone, PartialEq)]
pub enum StereoCalibration {
    /// KITTI's projections of rectified images, of a grey pair, a colour pair or both.
    Kitti(KittiCalibration),
    /// The rig of rectified images; of size 0×0 where the file does not tell it.
    Rectified(StereoRig),
    /// Two cameras as they are: their images must be rectified.
    Raw(RawPair),
}

/// A rig, and how raw images become its.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct CalibratedPair {
    /// The rectified rig.
    pub rig: StereoRig,
    /// How to rectify the images; `None` if they are.
    pub rectification: Option<StereoRectification>,
}

/// A format of calibration files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum CalibrationFormat {
    Kitti,
    Euroc,
    Kalibr,
    OpenCv,
    Ros,
    Rig,
}

/// The formats in words, for the errors of a file that has none of them.
const KNOWN_FORMATS: &str = "give KITTI's calib.txt or calib_cam_to_cam.txt, EuRoC's sensor.yaml, a Kalibr camchain, OpenCV's stereo \
                     YAML or XML (M1 D1 M2 D2 R T), ROS CameraInfo (left.yaml, right.yaml) or a rig.toml";

/// The calibration of a stereo pair: a file of any known format, told by its content, or a folder with
/// those of both cameras (`left.yaml` and `right.yaml`, or EuRoC's `cam0` and `cam1`).
///
/// # Errors
/// The file cannot be read or has no known format; or names the line and key that is missing or wrong.
pub fn read(path: &Path) -> Result<StereoCalibration, IoError> {
    if !path.is_dir() {
        return parse(&read::text(path)?, path);
    }
    let left = ["left.yaml", "cam0/sensor.yaml", "mav0/cam0/sensor.yaml", "rig.toml", "calib.txt"];
    let found = left.iter().map(|name| path.join(name)).find(|file| file.is_file());
    let file = found.ok_or_else(|| {
        IoError::new(path, "is a folder without a calibration that is known", KNOWN_FORMATS)
    })?;
    parse(&read::text(&file)?, &file)
}

/// The same from a text; `path` names it in errors and leads to the other camera's file, where a format has
/// one for each.
///
/// # Errors
/// As [`read()`].
pub fn parse(text: &str, path: &Path) -> Result<StereoCalibration, IoError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let (format, document) = recognise(text, path)?;
    let document = document.unwrap_or_else(Document::empty);
    let root = document.root(path);
    match format {
        CalibrationFormat::Kitti => KittiCalibration::parse(text, path).map(StereoCalibration::Kitti),
        CalibrationFormat::Rig => rig::parse(text, path),
        CalibrationFormat::OpenCv => opencv::pair(&root, path).map(StereoCalibration::Raw),
        CalibrationFormat::Kalibr => kalibr::pair(&root).map(StereoCalibration::Raw),
        CalibrationFormat::Euroc => {
            let (left, right) = euroc_partners(path)?;
            euroc::read_pair(&left, &right).map(StereoCalibration::Raw)
        }
        CalibrationFormat::Ros => {
            let (left, right) = ros::partners(path)?;
            ros::read_pair(&left, &right)
        }
    }
}

/// What a text is by its content, with the tree that was read on the way.
fn recognise(text: &str, path: &Path) -> Result<(CalibrationFormat, Option<Document>), IoError> {
    if kitti::recognise(text) {
        return Ok((CalibrationFormat::Kitti, None));
    }
    if looks_like_toml(text) {
        return Ok((CalibrationFormat::Rig, None));
    }
    let xml = text.trim_start().starts_with('<');
    let document = if xml { Document::xml(text, path) } else { Document::yaml(text, path) };
    // What is not even YAML is of no known format, and a parser's reason would not help.
    let document = document.map_err(|error| IoError { advice: KNOWN_FORMATS.into(), ..error })?;
    let root = document.root(path);
    let format = if root.find(&["T_BS"]).is_some() {
        CalibrationFormat::Euroc
    } else if root.find(&["cam0"]).is_some() {
        CalibrationFormat::Kalibr
    } else if ros::recognise(&root) {
        CalibrationFormat::Ros
    } else if opencv::recognise(&root) {
        CalibrationFormat::OpenCv
    } else {
        return Err(IoError::new(path, "is no calibration that is known", KNOWN_FORMATS));
    };
    Ok((format, Some(document)))
}

/// Whether the first line that says something is a table or `key = value`.
fn looks_like_toml(text: &str) -> bool {
    let first = read::lines(text).map(|(_, line)| line).find(|line| *line != "---");
    first.is_some_and(|line| {
        let key = line.split('=').next().unwrap_or_default();
        line.starts_with('[') || (key.len() < line.len() && !key.contains([':', '<', '%']))
    })
}

/// `sensor.yaml` of cam0 and cam1, given either.
fn euroc_partners(path: &Path) -> Result<(std::path::PathBuf, std::path::PathBuf), IoError> {
    let cameras = path.parent().and_then(Path::parent);
    let name = path.file_name().unwrap_or_default();
    let files = cameras.map(|folder| ["cam0", "cam1"].map(|cam| folder.join(cam).join(name)));
    match files {
        Some([left, right]) if left.is_file() && right.is_file() => Ok((left, right)),
        _ => ros::partners(path).map_err(|_| {
            let reason = "is the calibration of one camera, and the other's is not in cam0 or cam1 beside it";
            IoError::new(path, reason, "keep EuRoC's folders: cam0/sensor.yaml and cam1/sensor.yaml")
        }),
    }
}

impl StereoCalibration {
    /// The rig for images of `size` (width, height), and how they are rectified; `pair` is which of KITTI's
    /// pairs they are; `path` names the file in errors.
    ///
    /// # Errors
    /// What does not fit: the size, a focal length, the pose between the cameras.
    pub fn pair(
        &self,
        pair: CameraPair,
        size: (usize, usize),
        path: &Path,
    ) -> Result<CalibratedPair, IoError> {
        let refuse =
            |reason: &dyn fmt::Display| IoError::new(path, reason, "give the calibration of these images");
        match self {
            Self::Kitti(calibration) => {
                Ok(CalibratedPair { rig: calibration.rig(pair, size)?, rectification: None })
            }
            Self::Rectified(rig) => {
                let own = (rig.width_px, rig.height_px);
                if own != (0, 0) && own != size {
                    let ((w, h), (wi, hi)) = (own, size);
                    return Err(refuse(&format!("is for {w}x{h} pixels, the images have {wi}x{hi}")));
                }
                let rig = StereoRig { width_px: size.0, height_px: size.1, ..*rig };
                rig.check().map_err(|error| refuse(&error))?;
                Ok(CalibratedPair { rig, rectification: None })
            }
            Self::Raw(raw) => {
                let rectification = raw.rectification(size).map_err(|reason| refuse(&reason))?;
                Ok(CalibratedPair { rig: *rectification.rig(), rectification: Some(rectification) })
            }
        }
    }
}
