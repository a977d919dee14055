//! The layout of KITTI's raw recordings, synchronised and rectified: one drive, one sequence.

use std::path::{Path, PathBuf};

use egomotion::geometry::RigidMotion;
use nalgebra::{Matrix3, Rotation3, Vector3};

use super::Recognised;
use crate::calibration::{CameraPair, KittiCalibration};
use crate::source::layout::DatasetLayout;
use crate::source::listing;
use crate::source::sequence::{Clock, FrameFiles, Sequence};
use crate::{IoError, read};

/// Radius in metres of the sphere of the Mercator projection, as in the development kit of the set: the equator's of WGS 84.
const EARTH_RADIUS_M: f64 = 6_378_137.0;
/// Length of a day in seconds.
const DAY_S: f64 = 86_400.0;

/// The folder as a raw drive; `None` if it has no `image_00/data` … `image_03/data`.
pub(super) fn recognise(folder: &Path, calibration: Option<&Path>) -> Result<Option<Recognised>, IoError> {
    let Some(pair) = pair_of(folder) else { return Ok(None) };
    let [left_folder, right_folder] = data_folders(folder, pair);
    let left = listing::numbered(&left_folder, listing::digits)?;
    let right = listing::numbered(&right_folder, listing::digits)?;
    listing::check_both(
        (&left_folder, left.is_empty()),
        (&right_folder, right.is_empty()),
        "0000000000.png, 0000000001.png …",
    )?;
    let mut frames = listing::pairs(&left_folder, &left, &right);
    let file = calibration.map_or_else(|| beside(folder, "calib_cam_to_cam.txt"), Path::to_owned);
    let cameras = KittiCalibration::read(&file)?;
    let rig = cameras.rig(pair, listing::image_size(&frames)?)?;
    stamp(&mut frames, &left_folder.with_file_name("timestamps.txt"))?;
    if folder.join("oxts").join("data").is_dir() {
        add_truth(&mut frames, folder, &file, cameras.left_centre(pair)?)?;
    }
    let [l, r] = pair.cameras();
    let reason = format!("it holds image_{l:02}/data and image_{r:02}/data with numbered PNG files");
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let sequence = Sequence::new(name, frames, Clock::Measured, Some(rig));
    Ok(Some(Recognised { layout: DatasetLayout::KittiRaw, reason, sequences: vec![sequence] }))
}

/// The grey pair if it is whole, else the colour pair, else the one that has begun.
fn pair_of(folder: &Path) -> Option<CameraPair> {
    let pairs = [CameraPair::Grey, CameraPair::Colour];
    let has = |pair: &CameraPair| data_folders(folder, *pair).map(|f| f.is_dir());
    let whole = pairs.into_iter().find(|pair| has(pair) == [true, true]);
    whole.or_else(|| pairs.into_iter().find(|pair| has(pair) != [false, false]))
}

fn data_folders(folder: &Path, pair: CameraPair) -> [PathBuf; 2] {
    pair.cameras().map(|camera| folder.join(format!("image_{camera:02}")).join("data"))
}

/// A file of the drive's day: in the folder itself or, as the set has it, in the one above.
fn beside(folder: &Path, name: &str) -> PathBuf {
    let inside = folder.join(name);
    let above = folder.parent().map(|parent| parent.join(name));
    above.filter(|file| file.is_file() && !inside.is_file()).unwrap_or(inside)
}

/// Put the time stamps on the frames, in seconds since the first line.
fn stamp(frames: &mut [FrameFiles], file: &Path) -> Result<(), IoError> {
    let text = read::text(file)?;
    let advice = "give one time stamp `2011-09-26 13:02:25.951199337` a line for each image";
    let time = |(line, content): (usize, &str)| {
        let refused =
            || IoError::new(file, format_args!("\"{content}\" is not a time stamp"), advice).at_line(line);
        seconds(content).ok_or_else(refused)
    };
    let times = read::lines(&text).map(time).collect::<Result<Vec<_>, _>>()?;
    let first = times.first().copied().unwrap_or_default();
    let mut last = f64::NEG_INFINITY;
    for frame in frames {
        let Some(&time) = times.get(frame.index) else {
            let reason =
                format_args!("ends after {} time stamps, image {} has none", times.len(), frame.index);
            return Err(IoError::new(file, reason, advice));
        };
        frame.time_s = time - first;
        if frame.time_s <= last {
            let reason = format_args!("the time of image {} does not come after the one before", frame.index);
            return Err(IoError::new(file, reason, "give time stamps that increase"));
        }
        last = frame.time_s;
    }
    Ok(())
}

/// Seconds since the year 0 of `2011-09-26 13:02:25.951199337`.
fn seconds(stamp: &str) -> Option<f64> {
    let (date, time) = stamp.split_once([' ', 'T'])?;
    let numbers = |text: &str, mark: char| -> Option<[f64; 3]> {
        let numbers: Vec<f64> =
            text.split(mark).map(|word| read::number(word).ok()).collect::<Option<_>>()?;
        numbers.try_into().ok()
    };
    let [year, month, day] = numbers(date, '-')?;
    let [hours, minutes, seconds] = numbers(time, ':')?;
    let valid = (1.0..=12.0).contains(&month) && (1.0..=31.0).contains(&day) && (0.0..9999.0).contains(&year);
    // Days since the year 0 began on 1 March, so that a leap day is a year's last.
    let (year, month) = if month > 2.0 { (year, month - 3.0) } else { (year - 1.0, month + 9.0) };
    let leap = (year / 4.0).floor() - (year / 100.0).floor() + (year / 400.0).floor();
    let days = 365.0 * year + leap + ((153.0 * month + 2.0) / 5.0).floor() + day;
    valid.then_some(days * DAY_S + hours * 3600.0 + minutes * 60.0 + seconds)
}

/// Put the poses of the inertial system on the frames, as poses of the left rectified camera.
///
/// `cam_to_cam` is the calibration in use; those of the inertial system and the laser lie beside the recording. Without
/// them there is no truth.
fn add_truth(
    frames: &mut [FrameFiles],
    folder: &Path,
    cam_to_cam: &Path,
    centre: Vector3<f64>,
) -> Result<(), IoError> {
    let [imu_to_velo, velo_to_cam] =
        ["calib_imu_to_velo.txt", "calib_velo_to_cam.txt"].map(|name| beside(folder, name));
    if !(imu_to_velo.is_file() && velo_to_cam.is_file()) {
        return Ok(());
    }
    let Some(rectified) = matrix(&keys(cam_to_cam, "R_rect_00", 9)?) else { return Ok(()) };
    let rectified = RigidMotion { rotation: rectified, translation: Vector3::zeros() };
    let camera_from_imu = rectified.after(&motion(&velo_to_cam)?).after(&motion(&imu_to_velo)?);
    let left = RigidMotion { rotation: Matrix3::identity(), translation: centre };
    let imu_from_left = camera_from_imu.inverse().after(&left);
    let files = listing::texts(&folder.join("oxts").join("data"), listing::digits)?;
    let mut origin = None;
    for frame in frames {
        let Some(file) = files.get(&frame.index) else { continue };
        let row = oxts(file)?;
        let origin =
            origin.get_or_insert((row[0].to_radians().cos(), position(&row, row[0].to_radians().cos())));
        let [roll, pitch, yaw] = [row[3], row[4], row[5]];
        let world_from_imu = RigidMotion {
            // nalgebra's order: about x by roll, then y by pitch, then z by yaw.
            rotation: Rotation3::from_euler_angles(roll, pitch, yaw).into_inner(),
            translation: position(&row, origin.0) - origin.1,
        };
        frame.truth = Some(world_from_imu.after(&imu_from_left));
    }
    Ok(())
}

/// East, north and up by Mercator's projection, at the `scale` of the drive's first latitude, in metres.
fn position(oxts: &[f64], scale: f64) -> Vector3<f64> {
    let [latitude, longitude] = [oxts[0].to_radians(), oxts[1].to_radians()];
    let north = (std::f64::consts::FRAC_PI_4 + 0.5 * latitude).tan().ln();
    Vector3::new(scale * EARTH_RADIUS_M * longitude, scale * EARTH_RADIUS_M * north, oxts[2])
}

/// Latitude, longitude (°), altitude (m), roll, pitch, yaw (rad) and the rest of one packet.
fn oxts(file: &Path) -> Result<Vec<f64>, IoError> {
    let text = read::text(file)?;
    let refuse = |reason: String| IoError::new(file, reason, "give the 30 numbers of an oxts packet");
    let row = read::numbers(text.lines().next().unwrap_or_default()).map_err(refuse)?;
    if row.len() < 6 {
        return Err(refuse(format!("{} numbers, not 30", row.len())));
    }
    Ok(row)
}

/// `R` and `T` of a calibration file.
fn motion(file: &Path) -> Result<RigidMotion, IoError> {
    let refuse =
        |key: &str| IoError::new(file, format_args!("the key {key} is missing"), "give KITTI's calibration");
    let rotation = matrix(&keys(file, "R", 9)?).ok_or_else(|| refuse("R"))?;
    let translation = keys(file, "T", 3)?;
    let [x, y, z] = translation[..] else { return Err(refuse("T")) };
    Ok(RigidMotion { rotation, translation: Vector3::new(x, y, z) })
}

fn matrix(rows: &[f64]) -> Option<Matrix3<f64>> {
    (rows.len() == 9).then(|| Matrix3::from_row_slice(rows))
}

/// The `count` numbers of a line `KEY: …`; empty without such a line.
fn keys(file: &Path, key: &str, count: usize) -> Result<Vec<f64>, IoError> {
    let text = read::text(file)?;
    let found = read::lines(&text).find_map(|(line, content)| {
        content.split_once(':').filter(|(k, _)| k.trim() == key).map(|(_, v)| (line, v))
    });
    let Some((line, values)) = found else { return Ok(Vec::new()) };
    let refuse = |reason: String| {
        IoError::new(file, format_args!("{key}: {reason}"), format_args!("give {count} numbers"))
            .at_line(line)
    };
    let values = read::numbers(values).map_err(refuse)?;
    if values.len() == count {
        Ok(values)
    } else {
        Err(refuse(format!("{} numbers, not {count}", values.len())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_stamps_count_through_days_and_leap_years() {
        let at = |stamp: &str| seconds(stamp).unwrap();
        assert_eq!(at("2011-09-26 13:02:26.5") - at("2011-09-26 13:02:25.25"), 1.25);
        assert_eq!(at("2011-10-01 00:00:01") - at("2011-09-30 23:59:59"), 2.0);
        assert_eq!(at("2012-03-01 00:00:00") - at("2012-02-28 00:00:00"), 2.0 * DAY_S);
        assert_eq!(at("2012-01-01 00:00:00") - at("2011-12-31 00:00:00"), DAY_S);
        assert_eq!(at("2001-03-01 00:00:00") - at("2000-03-01 00:00:00"), 365.0 * DAY_S);
        for wrong in ["", "12", "2011-09-26", "2011-13-26 00:00:00", "2011-09 00:00:00", "x-09-26 00:00:00"] {
            assert_eq!(seconds(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn a_hundred_thousandth_of_a_degree_is_a_metre() {
        let scale = 49.0_f64.to_radians().cos();
        let at = |latitude: f64, longitude: f64| position(&[latitude, longitude, 110.0], scale);
        let (here, north, east) = (at(49.0, 8.4), at(49.00001, 8.4), at(49.0, 8.40001));
        let metre = EARTH_RADIUS_M * 1e-5_f64.to_radians();
        assert!(((north - here) - Vector3::new(0.0, metre, 0.0)).norm() < 1e-5);
        assert!(((east - here) - Vector3::new(metre * scale, 0.0, 0.0)).norm() < 1e-5);
    }
}
