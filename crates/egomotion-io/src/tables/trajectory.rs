//! Trajectories: TUM rows (`timestamp tx ty tz qx qy qz qw`), KITTI rows (12 numbers, a 3×4 matrix) and EuRoC's CSV
//! (`nanoseconds, tx, ty, tz, qw, qx, qy, qz`, more columns allowed).

use std::path::Path;

use egomotion::geometry::RigidMotion;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use crate::{IoError, read, write};

/// A pose of a trajectory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Time stamp, in seconds; KITTI's rows have none.
    pub time_s: Option<f64>,
    /// Pose of the camera in the world.
    pub world_from_camera: RigidMotion,
}

/// Which of the row formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrajectoryFormat {
    /// `timestamp tx ty tz qx qy qz qw`: 8 numbers a row.
    Tum,
    /// `tx ty tz qx qy qz qw`: 7 numbers a row.
    TumWithoutTime,
    /// The upper 3×4 of the pose matrix, row by row: 12 numbers a row.
    Kitti,
    /// `nanoseconds, tx, ty, tz, qw, qx, qy, qz, …`: at least 8 numbers between commas.
    Euroc,
}

/// Largest entry of R Rᵀ − I that still passes for a rotation: files round R to few digits, and what is no rotation
/// at all is much further off.
const ROTATION_TOLERANCE: f64 = 1e-2;

/// A trajectory of either format; see [`parse`].
///
/// # Errors
/// The file cannot be read, or [`parse`] refuses it.
pub fn read(path: &Path, format: Option<TrajectoryFormat>) -> Result<Vec<Pose>, IoError> {
    parse(&read::text(path)?, format, path)
}

/// The poses of a text, in order; `#` starts a comment; `path` names it in errors.
///
/// Without a format every row's own length tells it. KITTI's matrices are kept to the digit, as the
/// reference programs do; they are rotations only as far as the file's rounding goes.
///
/// # Errors
/// Names the line: a wrong count of numbers, a number that is not finite, no rotation, or no pose at all.
pub fn parse(text: &str, format: Option<TrajectoryFormat>, path: &Path) -> Result<Vec<Pose>, IoError> {
    let (shape, advice) = match format {
        Some(TrajectoryFormat::Tum) => ("8", "give `timestamp tx ty tz qx qy qz qw`"),
        Some(TrajectoryFormat::TumWithoutTime) => ("7", "give `tx ty tz qx qy qz qw`"),
        Some(TrajectoryFormat::Kitti) => ("12", "give the 12 numbers of a 3x4 matrix"),
        Some(TrajectoryFormat::Euroc) => ("8 or more", "give `nanoseconds, tx, ty, tz, qw, qx, qy, qz`"),
        None => ("8 or 12", "give TUM rows (8 numbers), KITTI rows (12 numbers) or EuRoC's CSV"),
    };
    let pose = |line: &str| -> Result<Pose, String> {
        if format == Some(TrajectoryFormat::Euroc) || (format.is_none() && line.contains(',')) {
            return euroc_pose(line);
        }
        let row = read::numbers(line)?;
        match (format, row.len()) {
            (None | Some(TrajectoryFormat::Tum), 8) => tum_pose(&row),
            (Some(TrajectoryFormat::TumWithoutTime), 7) => {
                Ok(Pose { time_s: None, ..tum_pose(&[&[0.0], row.as_slice()].concat())? })
            }
            (None | Some(TrajectoryFormat::Kitti), 12) => kitti_pose(&row),
            (_, n) => Err(format!("the row has {n} numbers, not {shape}")),
        }
    };
    let located = |(n, line)| pose(line).map_err(|reason| IoError::new(path, reason, advice).at_line(n));
    let poses = read::lines(text).map(located).collect::<Result<Vec<_>, _>>()?;
    if poses.is_empty() {
        return Err(IoError::new(path, "holds no pose", advice));
    }
    Ok(poses)
}

/// A pose from the 12 numbers of its 3×4 matrix, row by row.
fn kitti_pose(m: &[f64]) -> Result<Pose, String> {
    let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    let error = (rotation * rotation.transpose() - Matrix3::identity()).amax();
    // Written so that an overflow to NaN is refused too.
    if !(error < ROTATION_TOLERANCE && rotation.determinant() > 0.0) {
        return Err("the matrix is not a rotation".into());
    }
    let world_from_camera = RigidMotion { rotation, translation: Vector3::new(m[3], m[7], m[11]) };
    Ok(Pose { time_s: None, world_from_camera })
}

/// A pose from `timestamp tx ty tz qx qy qz qw`.
fn tum_pose(m: &[f64]) -> Result<Pose, String> {
    let quaternion = Quaternion::new(m[7], m[4], m[5], m[6]);
    let unit = UnitQuaternion::try_new(quaternion, 1e-6).filter(|q| (q.norm() - 1.0).abs() < 1e-6);
    let rotation = unit.ok_or("the quaternion is zero")?.to_rotation_matrix().into_inner();
    let world_from_camera = RigidMotion { rotation, translation: Vector3::new(m[1], m[2], m[3]) };
    Ok(Pose { time_s: Some(m[0]), world_from_camera })
}

/// A pose from `nanoseconds, tx, ty, tz, qw, qx, qy, qz, …`.
fn euroc_pose(line: &str) -> Result<Pose, String> {
    let mut fields = line.split(',').map(str::trim);
    let stamp = fields.next().unwrap_or_default();
    // Nanoseconds since 1970 have more digits than a float: whole seconds are split off first.
    let nanoseconds: i128 =
        stamp.parse().map_err(|_| format!("\"{stamp}\" is not a time stamp in whole nanoseconds"))?;
    let row: Vec<f64> = fields.take(7).map(read::number).collect::<Result<_, _>>()?;
    if row.len() != 7 {
        return Err(format!("the row has {} numbers, not 8 or more", row.len() + 1));
    }
    let pose = tum_pose(&[0.0, row[0], row[1], row[2], row[4], row[5], row[6], row[3]])?;
    let billion = 1_000_000_000;
    let time_s = (nanoseconds / billion) as f64 + (nanoseconds % billion) as f64 * 1e-9;
    Ok(Pose { time_s: Some(time_s), ..pose })
}

/// One row of EuRoC's CSV, without the end of line.
fn euroc_row(time_s: f64, world_from_camera: &RigidMotion) -> String {
    let (t, q) = (&world_from_camera.translation, world_from_camera.quaternion());
    let nanoseconds = (time_s.fract() * 1e9).round() as i128 + time_s.trunc() as i128 * 1_000_000_000;
    format!("{nanoseconds},{:?},{:?},{:?},{:?},{:?},{:?},{:?}", t.x, t.y, t.z, q.w, q.i, q.j, q.k)
}

/// One TUM row, without the end of line; numbers are written so that they read back the same.
fn tum_row(time_s: f64, world_from_camera: &RigidMotion) -> String {
    let (t, q) = (&world_from_camera.translation, world_from_camera.quaternion());
    format!("{time_s} {:?} {:?} {:?} {:?} {:?} {:?} {:?}", t.x, t.y, t.z, q.i, q.j, q.k, q.w)
}

/// One KITTI row, without the end of line; numbers are written so that they read back the same.
pub fn kitti_row(world_from_camera: &RigidMotion) -> String {
    let (r, t) = (&world_from_camera.rotation, &world_from_camera.translation);
    let numbers = (0..3).flat_map(|i| [r[(i, 0)], r[(i, 1)], r[(i, 2)], t[i]]);
    numbers.map(|number| format!("{number:e}")).collect::<Vec<_>>().join(" ")
}

/// Write a trajectory in TUM's format.
///
/// # Errors
/// The file cannot be written, or a pose has no time stamp.
pub fn write_tum(path: &Path, poses: &[Pose]) -> Result<(), IoError> {
    write_timed(path, "", poses, tum_row)
}

fn write_timed(
    path: &Path,
    head: &str,
    poses: &[Pose],
    row: fn(f64, &RigidMotion) -> String,
) -> Result<(), IoError> {
    let mut text = head.to_owned();
    for (i, pose) in poses.iter().enumerate() {
        let Some(time_s) = pose.time_s else {
            let reason = format_args!("pose {i} has no time stamp").to_string();
            return Err(IoError::new(path, reason, "write KITTI rows instead"));
        };
        text += &row(time_s, &pose.world_from_camera);
        text.push('\n');
    }
    write::bytes(path, text.as_bytes())
}

/// Write a trajectory in EuRoC's format.
///
/// # Errors
/// The file cannot be written, or a pose has no time stamp.
pub fn write_euroc(path: &Path, poses: &[Pose]) -> Result<(), IoError> {
    let head = "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w [],q_x [],q_y [],q_z []\n";
    write_timed(path, head, poses, euroc_row)
}

/// Write a trajectory in KITTI's format.
///
/// # Errors
/// The file cannot be written.
pub fn write_kitti(path: &Path, poses: &[Pose]) -> Result<(), IoError> {
    let text: String = poses.iter().map(|pose| kitti_row(&pose.world_from_camera) + "\n").collect();
    write::bytes(path, text.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use egomotion::geometry::Twist;

    fn poses() -> Vec<Pose> {
        let at = |k: f64| {
            let twist = Twist { t: Vector3::new(k, -0.3 * k, 1e-9), omega: Vector3::new(0.1, -0.7, 0.2) * k };
            Pose { time_s: Some(1_403_636_579.763_555_5 + k), world_from_camera: twist.exp() }
        };
        [0.0, 0.05, 1.0, 3.9].map(at).to_vec()
    }

    #[test]
    fn both_formats_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let (tum, kitti) = (folder.path().join("tum.txt"), folder.path().join("kitti.txt"));
        write_tum(&tum, &poses()).unwrap();
        write_kitti(&kitti, &poses()).unwrap();
        let (from_tum, from_kitti) = (read(&tum, None).unwrap(), read(&kitti, None).unwrap());
        for ((given, tum), kitti) in poses().iter().zip(from_tum).zip(from_kitti) {
            assert_eq!((tum.time_s, kitti.time_s), (given.time_s, None));
            assert_eq!(kitti.world_from_camera, given.world_from_camera);
            assert_eq!(tum.world_from_camera.translation, given.world_from_camera.translation);
            assert!((tum.world_from_camera.rotation - given.world_from_camera.rotation).amax() < 1e-14);
        }
        assert!(write_tum(&tum, &read(&kitti, None).unwrap()).is_err());
    }

    #[test]
    fn euroc_rows_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("data.csv");
        write_euroc(&path, &poses()).unwrap();
        for (given, found) in poses().iter().zip(read(&path, None).unwrap()) {
            // A float holds seconds since 1970 to a quarter of a microsecond.
            assert!((found.time_s.unwrap() - given.time_s.unwrap()).abs() < 5e-7);
            assert_eq!(found.world_from_camera.translation, given.world_from_camera.translation);
            assert!((found.world_from_camera.rotation - given.world_from_camera.rotation).amax() < 1e-14);
        }
        // As the set has it: w comes first, and velocities and biases follow.
        let row = "1403636580838555648,4.6,-1.7,0.8,0.5,-0.5,0.5,-0.5,0,0,0,0,0,0,0,0,0";
        let pose = parse(row, None, Path::new("data.csv")).unwrap()[0];
        assert_eq!(pose.time_s, Some(1_403_636_580.838_555_6));
        assert!((pose.world_from_camera.rotation * Vector3::x() + Vector3::y()).norm() < 1e-12);
        let refused = |text: &str| parse(text, None, Path::new("d.csv")).unwrap_err().to_string();
        assert!(
            refused("1.5,0,0,0,1,0,0,0")
                .contains("d.csv:1: \"1.5\" is not a time stamp in whole nanoseconds")
        );
        assert!(refused("15,0,0,0,1,0,0").contains("d.csv:1: the row has 7 numbers, not 8 or more"));
    }

    #[test]
    fn a_quaternion_turns_the_right_way() {
        // A quarter turn about Z carries X to Y; the quaternion needs no unit length.
        let text = "# time ...\n\n1.5 1 2 3 0 0 2 2 # end\n";
        let pose = parse(text, Some(TrajectoryFormat::Tum), Path::new("t.txt")).unwrap()[0];
        assert!((pose.world_from_camera.apply(&Vector3::x()) - Vector3::new(1.0, 3.0, 3.0)).norm() < 1e-12);
        assert_eq!(pose.time_s, Some(1.5));
    }

    #[test]
    fn a_bad_row_is_named_by_its_line() {
        let refused = |text: &str| parse(text, None, Path::new("t.txt")).unwrap_err().to_string();
        let good = "1 0 0 0 0 1 0 0 0 0 1 0\n";
        assert!(
            refused(&format!("{good}# note\n1 2 3\n"))
                .contains("t.txt:3: the row has 3 numbers, not 8 or 12")
        );
        assert!(refused(&good.replacen('1', "x", 1)).contains("t.txt:1: \"x\" is not a number"));
        assert!(refused(&good.replacen('0', "nan", 1)).contains("t.txt:1: \"nan\" is not a finite number"));
        assert!(refused("2 0 0 0 0 1 0 0 0 0 1 0").contains("t.txt:1: the matrix is not a rotation"));
        assert!(refused("1 0 0 0 0 1 0 0 0 0 -1 0").contains("not a rotation"));
        assert!(refused("1 0 0 0 0 0 0 0").contains("t.txt:1: the quaternion is zero"));
        assert!(refused("# nothing\n").contains("t.txt: holds no pose"));
        let kitti = parse(good, Some(TrajectoryFormat::Tum), Path::new("t.txt")).unwrap_err().to_string();
        assert!(kitti.contains("the row has 12 numbers, not 8"), "{kitti}");
    }
}
