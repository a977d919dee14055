//! What was recorded at other times than the images: the nearest files, and poses in between.

use std::path::{Path, PathBuf};

use egomotion::geometry::RigidMotion;
use nalgebra::{Rotation3, UnitQuaternion};

use crate::tables::trajectory::Pose;
use crate::{IoError, read};

/// Times no further apart than this are equal, in seconds: as a float a time stamp of today is rounded to 2.4e-7 s.
const TIME_ROUNDING_S: f64 = 1e-6;

/// The pose at a time: linear in position, spherical in rotation; `None` outside the poses or between two that are
/// further apart than `max_gap_s`.
///
/// `poses` in order of time.
pub(super) fn interpolated_pose(poses: &[Pose], time_s: f64, max_gap_s: f64) -> Option<RigidMotion> {
    let time = |pose: &Pose| pose.time_s.unwrap_or(f64::NAN);
    let next = poses.partition_point(|pose| time(pose) < time_s - TIME_ROUNDING_S);
    let after = poses.get(next)?;
    if time(after) <= time_s + TIME_ROUNDING_S {
        return Some(after.world_from_camera);
    }
    let before = poses.get(next.checked_sub(1)?)?;
    let gap = time(after) - time(before);
    let share = (time_s - time(before)) / gap;
    let (a, b) = (&before.world_from_camera, &after.world_from_camera);
    let quaternion =
        |m: &RigidMotion| UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(m.rotation));
    let rotation = quaternion(a).try_slerp(&quaternion(b), share, 1e-12).unwrap_or_else(|| quaternion(a));
    (gap <= max_gap_s).then(|| RigidMotion {
        rotation: rotation.to_rotation_matrix().into_inner(),
        translation: a.translation + share * (b.translation - a.translation),
    })
}

/// Time stamps and files of a list: `time path` a line, in order of time.
pub(super) fn read_stamped_files(list: &Path) -> Result<Vec<(f64, PathBuf)>, IoError> {
    let folder = list.parent().unwrap_or(Path::new(""));
    let text = read::text(list)?;
    let mut files = Vec::new();
    for (line, content) in read::lines(&text) {
        let refuse = |reason: String| IoError::new(list, reason, "give `time file` a line").at_line(line);
        let (time, name) = content
            .split_once([' ', '\t', ','])
            .ok_or_else(|| refuse("has no file beside the time stamp".into()))?;
        let time = read::number(time).map_err(refuse)?;
        files.push((time, folder.join(name.trim())));
    }
    files.sort_by(|a: &(f64, PathBuf), b| a.0.total_cmp(&b.0));
    files.dedup_by(|a, b| a.0 == b.0);
    Ok(files)
}

/// For each time the index of the other that belongs to it, no further away than `max_gap_s`; the nearest pairs
/// come first, and each is used once. Both in order.
pub(super) fn associate(times: &[f64], others: &[f64], max_gap_s: f64) -> Vec<Option<usize>> {
    let mut candidates = Vec::new();
    for (k, time) in times.iter().enumerate() {
        let first = others.partition_point(|other| *other < time - max_gap_s);
        let near = others[first..].iter().take_while(|other| **other <= time + max_gap_s);
        candidates.extend(near.enumerate().map(|(i, other)| ((other - time).abs(), k, first + i)));
    }
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut found, mut used) = (vec![None; times.len()], vec![false; others.len()]);
    for (_, k, other) in candidates {
        if found[k].is_none() && !used[other] {
            (found[k], used[other]) = (Some(other), true);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn the_nearest_belong_together_and_each_once() {
        let found = associate(&[0.0, 0.033, 0.066, 0.5], &[0.014, 0.047, 0.06], 0.02);
        assert_eq!(found, [Some(0), Some(1), Some(2), None]);
        assert_eq!(associate(&[0.0, 0.01], &[0.009], 0.02), [None, Some(0)]);
        assert_eq!(associate(&[], &[1.0], 0.02), []);
    }

    #[test]
    fn poses_are_interpolated_and_gaps_stay_open() {
        let pose = |time: f64, angle: f64, x: f64| Pose {
            time_s: Some(time),
            world_from_camera: RigidMotion {
                rotation: Rotation3::from_axis_angle(&Vector3::z_axis(), angle).into_inner(),
                translation: Vector3::new(x, 0.0, 0.0),
            },
        };
        let poses = [pose(1.0, 0.0, 0.0), pose(1.1, 0.4, 2.0), pose(3.0, 0.0, 0.0)];
        let between = interpolated_pose(&poses, 1.025, 0.2).unwrap();
        assert!((between.translation.x - 0.5).abs() < 1e-9);
        assert!((between.log().omega.z - 0.1).abs() < 1e-9);
        for rounded in [1.1, 1.1 - 2e-7, 1.1 + 2e-7] {
            assert_eq!(interpolated_pose(&poses, rounded, 0.05).unwrap(), poses[1].world_from_camera);
        }
        assert!(interpolated_pose(&poses, 3.0 + 2e-7, 0.05).is_some());
        assert!([0.9, 2.0, 3.1].iter().all(|&t| interpolated_pose(&poses, t, 0.2).is_none()));
        assert_eq!(interpolated_pose(&poses, 1.025, 0.05), None);
        assert_eq!(interpolated_pose(&[], 0.0, 0.2), None);
    }
}
