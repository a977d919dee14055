//! KITTI calibration files: lines `KEY: 12 numbers` of 3×4 projection matrices.
//!
//! The odometry set and the 2012 set call them `P0` … `P3`, the raw and 2015 sets `P_rect_00` …
//! `P_rect_03` (`calib_cam_to_cam.txt`); 0 and 1 are the grey pair, 2 and 3 the colour pair.

use std::path::{Path, PathBuf};

use egomotion::geometry::StereoRig;
use nalgebra::Vector3;

use crate::{IoError, read, write};

/// Write the grey pair of a rig as P0 and P1, such that [`KittiCalibration::rig`] gives the rig back.
///
/// # Errors
/// The file cannot be written.
pub(crate) fn write_grey_pair(path: &Path, rig: &StereoRig) -> Result<(), IoError> {
    let row = |cx: f64, last: f64| {
        let (fx, fy, cy) = (rig.focal_px, rig.focal_y_px, rig.cy_px);
        // Written so that the numbers read back the same.
        format!("{fx:e} 0 {cx:e} {last:e} 0 {fy:e} {cy:e} 0 0 0 1 0")
    };
    let (left, right) = (row(rig.cx_px, 0.0), row(rig.cx_px + rig.doffs_px, -rig.depth_disparity_product()));
    write::bytes(path, format!("P0: {left}\nP1: {right}\n").as_bytes())
}

/// Which of KITTI's two pairs of cameras.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraPair {
    /// Cameras 0 and 1.
    Grey,
    /// Cameras 2 and 3.
    Colour,
}

/// A 3×4 projection matrix, row by row, with the key it was found under.
#[derive(Debug, Clone, PartialEq)]
struct Projection {
    key: String,
    line: usize,
    entries: [f64; 12],
}

/// The projection matrices of a calibration file.
#[derive(Debug, Clone, PartialEq)]
pub struct KittiCalibration {
    path: PathBuf,
    projections: Vec<Projection>,
}

impl KittiCalibration {
    /// The projection matrices of a file; see [`KittiCalibration::parse`].
    ///
    /// # Errors
    /// The file cannot be read, or a matrix in it is not 12 finite numbers.
    pub fn read(path: &Path) -> Result<Self, IoError> {
        Self::parse(&read::text(path)?, path)
    }

    /// The projection matrices of a text; other keys are ignored; `path` names it in errors.
    ///
    /// # Errors
    /// Names the line and the key of a matrix that is not 12 finite numbers.
    pub fn parse(text: &str, path: &Path) -> Result<Self, IoError> {
        let mut projections = Vec::new();
        for (line, content) in read::lines(text) {
            let Some((key, values)) = content.split_once(':') else { continue };
            let key = key.trim();
            if !(0..4).any(|camera| names(camera).contains(&key.to_owned())) {
                continue;
            }
            let refuse = |reason: String| {
                IoError::new(
                    path,
                    format_args!("{key}: {reason}"),
                    "give the 12 numbers of a 3x4 projection matrix",
                )
                .at_line(line)
            };
            let values = read::numbers(values).map_err(refuse)?;
            let entries =
                values.try_into().map_err(|v: Vec<f64>| refuse(format!("{} numbers, not 12", v.len())))?;
            projections.push(Projection { key: key.into(), line, entries });
        }
        Ok(Self { path: path.to_owned(), projections })
    }

    /// The rectified rig of a pair of cameras, for images of `size` (width, height) in pixels.
    ///
    /// The baseline is (P_left\[3\] − P_right\[3\])/f, and doffs = cx_right − cx_left.
    ///
    /// # Errors
    /// Names the key that is missing, the focal length or baseline that is not positive, or the pair
    /// whose focal lengths or rows do not agree, so that it is not rectified.
    pub fn rig(&self, pair: CameraPair, size: (usize, usize)) -> Result<StereoRig, IoError> {
        let [left, right] = pair.cameras().map(|camera| self.projection(camera));
        let (left, right) = (left?, right?);
        let [l, r] = [left, right].map(|p| &p.entries);
        let same = |i: usize, tolerance: f64| (l[i] - r[i]).abs() <= tolerance;
        if !(same(0, 1e-6 * l[0].abs()) && same(5, 1e-6 * l[5].abs()) && same(6, 1e-3)) {
            let reason = format_args!("{} and {} differ in f or cy", left.key, right.key).to_string();
            return Err(IoError::new(&self.path, reason, "give the projections of a rectified pair"));
        }
        let rig = StereoRig {
            focal_px: l[0],
            focal_y_px: l[5],
            cx_px: l[2],
            cy_px: l[6],
            doffs_px: r[2] - l[2],
            baseline_m: (l[3] - r[3]) / l[0],
            width_px: size.0,
            height_px: size.1,
        };
        rig.check().map_err(|error| {
            let (reason, advice) =
                (format!("{}, {}: {error}", left.key, right.key), "correct the calibration");
            IoError::new(&self.path, reason, advice).at_line(right.line)
        })?;
        Ok(rig)
    }

    /// Centre of the left camera of a pair in the frame of camera 0, in metres, −K⁻¹ p₄.
    ///
    /// # Errors
    /// Names the key that is missing, or whose focal length is zero.
    pub fn left_centre(&self, pair: CameraPair) -> Result<Vector3<f64>, IoError> {
        let found = self.projection(pair.cameras()[0])?;
        let p = &found.entries;
        let z = p[11];
        let centre = -Vector3::new((p[3] - p[2] * z) / p[0], (p[7] - p[6] * z) / p[5], z);
        if centre.iter().all(|c| c.is_finite()) {
            return Ok(centre);
        }
        let reason = format_args!("{}: focal length is not positive", found.key).to_string();
        Err(IoError::new(&self.path, reason, "correct the calibration").at_line(found.line))
    }

    fn projection(&self, camera: usize) -> Result<&Projection, IoError> {
        let keys = names(camera);
        let found = self.projections.iter().find(|p| keys.contains(&p.key));
        found.ok_or_else(|| {
            let reason = format_args!("the key {} (or {}) is missing", keys[0], keys[1]).to_string();
            IoError::new(&self.path, reason, "give KITTI's projection matrices of both cameras")
        })
    }
}

impl CameraPair {
    /// Numbers of the left and the right camera.
    pub(crate) fn cameras(self) -> [usize; 2] {
        match self {
            Self::Grey => [0, 1],
            Self::Colour => [2, 3],
        }
    }
}

/// Whether a line of the text gives a projection by one of the names.
pub(super) fn recognise(text: &str) -> bool {
    let keys = read::lines(text).filter_map(|(_, line)| Some(line.split_once(':')?.0.trim()));
    keys.take(1000).any(|key| (0..4).any(|camera| names(camera).iter().any(|name| name == key)))
}

/// The names of a camera's projection in the sets.
fn names(camera: usize) -> [String; 2] {
    [format!("P{camera}"), format!("P_rect_0{camera}")]
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (1242, 375);
    const LEFT: &str = "700 0 600 0 0 700 180 0 0 0 1 0";
    const RIGHT: &str = "700 0 603 -350 0 700 180 0 0 0 1 0";

    fn rig(text: &str) -> Result<StereoRig, String> {
        let calibration = KittiCalibration::parse(text, Path::new("calib.txt")).map_err(|e| e.to_string())?;
        calibration.rig(CameraPair::Grey, SIZE).map_err(|e| e.to_string())
    }

    #[test]
    fn baseline_is_the_difference_of_the_fourth_entries() {
        let text = "calib_time: 09-Jan-2012 13:57:47\nS_rect_02: 1 2\nP_rect_02: 700 0 600 35 0 700 180 7 0 0 1 0.01\n\
                    P_rect_03: 700 0 600 -315 0 700 180 0 0 0 1 0\n";
        let calibration = KittiCalibration::parse(text, Path::new("c.txt")).unwrap();
        let rig = calibration.rig(CameraPair::Colour, SIZE).unwrap();
        assert!((rig.baseline_m - 0.5).abs() < 1e-12);
        // K c + p₄ = 0: the camera's centre projects to nothing.
        let c = calibration.left_centre(CameraPair::Colour).unwrap();
        assert!((700.0 * c.x + 600.0 * c.z + 35.0).abs() < 1e-9);
        assert!((700.0 * c.y + 180.0 * c.z + 7.0).abs() < 1e-9 && c.z == -0.01);
    }

    #[test]
    fn a_usable_pair_gives_its_rig() {
        let rig = rig(&format!("P0: {LEFT}\nP1: {RIGHT}\n")).unwrap();
        assert_eq!((rig.focal_px, rig.focal_y_px, rig.cx_px, rig.cy_px), (700.0, 700.0, 600.0, 180.0));
        assert_eq!((rig.baseline_m, rig.doffs_px, rig.width_px, rig.height_px), (0.5, 3.0, 1242, 375));
    }

    #[test]
    fn a_written_rig_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("calib.txt");
        let given = StereoRig {
            focal_px: 5.0 / 0.012,
            focal_y_px: 400.0 / 3.0,
            cx_px: 159.5 + 1.0 / 7.0,
            cy_px: 119.5,
            doffs_px: 0.1 + 0.2,
            baseline_m: 0.13,
            width_px: 320,
            height_px: 240,
        };
        write_grey_pair(&path, &given).unwrap();
        let back = KittiCalibration::read(&path).unwrap().rig(CameraPair::Grey, (320, 240)).unwrap();
        let numbers = |r: &StereoRig| [r.focal_px, r.focal_y_px, r.cx_px, r.cy_px, r.doffs_px, r.baseline_m];
        for (a, b) in numbers(&given).into_iter().zip(numbers(&back)) {
            assert!((a - b).abs() <= 1e-12, "{given:?} {back:?}");
        }
        assert!(write_grey_pair(&folder.path().join("none").join("calib.txt"), &given).is_err());
    }

    #[test]
    fn what_is_wrong_is_named_by_file_and_key() {
        let refused = |left: &str, right: &str| rig(&format!("P0: {left}\nP1: {right}\n")).unwrap_err();
        assert!(
            rig(&format!("P0: {LEFT}"))
                .unwrap_err()
                .contains("calib.txt: the key P1 (or P_rect_01) is missing")
        );
        assert!(rig("").unwrap_err().contains("the key P0"));
        assert!(refused(LEFT, "1 2 3").contains("calib.txt:2: P1: 3 numbers, not 12"));
        assert!(
            refused(&LEFT.replace("600", "nan"), RIGHT)
                .contains("calib.txt:1: P0: \"nan\" is not a finite number")
        );
        assert!(refused(LEFT, LEFT).contains("calib.txt:2: P0, P1: baseline 0 m is not positive"));
        assert!(
            refused(RIGHT, LEFT).contains("baseline -0.5 m is not positive; left and right may be swapped")
        );
        let zero = |row: &str| row.replace("700", "0");
        assert!(refused(&zero(LEFT), &zero(RIGHT)).contains("P0, P1: focal length 0 px is not positive"));
        assert!(refused(LEFT, &RIGHT.replace("700", "710")).contains("P0 and P1 differ in f or cy"));
    }
}
