//! True poses with time stamps in nanoseconds, interpolated to the time of a frame.

use std::path::Path;

use egomotion::geometry::{RigidMotion, Twist};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::{IoError, read};

/// Poses in order of time.
pub(super) struct StampedPoses(Vec<(i64, RigidMotion)>);

/// Between poses further apart than this the motion is not known, in nanoseconds.
const LARGEST_GAP_NS: i64 = 100_000_000;

impl StampedPoses {
    /// EuRoC's `data.csv`: `ns, x, y, z, qw, qx, qy, qz, …`.
    pub(super) fn euroc(file: &Path) -> Result<Self, IoError> {
        Self::read(file, "give rows of `ns, x, y, z, qw, qx, qy, qz`", |line| {
            let words: Vec<&str> = line.split(',').map(str::trim).collect();
            let [stamp, values @ ..] = &words[..] else { return Err("the row is empty".into()) };
            let stamp = stamp.parse().map_err(|_| format!("{stamp:?} is no time stamp in nanoseconds"))?;
            let v: Vec<f64> = values.iter().take(7).map(|w| read::number(w)).collect::<Result<_, _>>()?;
            let [x, y, z, qw, qx, qy, qz] = v[..] else {
                return Err("the row has less than 8 numbers".into());
            };
            Ok((stamp, pose([x, y, z], [qx, qy, qz, qw])?))
        })
    }

    /// TUM's rows, `s x y z qx qy qz qw`; more than double precision of the time stamp is kept.
    pub(super) fn tum(file: &Path) -> Result<Self, IoError> {
        Self::read(file, "give rows of `s x y z qx qy qz qw`", |line| {
            let (stamp, values) = line.split_once(char::is_whitespace).ok_or("the row has one number")?;
            let [x, y, z, qx, qy, qz, qw] = read::numbers(values)?[..] else {
                return Err("the row has not 8 numbers".into());
            };
            Ok((nanoseconds(stamp)?, pose([x, y, z], [qx, qy, qz, qw])?))
        })
    }

    fn read(
        file: &Path,
        advice: &str,
        row: impl Fn(&str) -> Result<(i64, RigidMotion), String>,
    ) -> Result<Self, IoError> {
        let text = read::text(file)?;
        let located = |(n, line)| row(line).map_err(|reason| IoError::new(file, reason, advice).at_line(n));
        let mut poses = read::lines(&text).map(located).collect::<Result<Vec<_>, _>>()?;
        poses.sort_by_key(|(stamp, _)| *stamp);
        Ok(Self(poses))
    }

    /// The pose at a time, between its neighbours at constant velocity; `None` outside of the poses or in a gap.
    pub(super) fn at(&self, stamp: i64) -> Option<RigidMotion> {
        let next = self.0.partition_point(|(s, _)| *s < stamp);
        let (after, b) = self.0.get(next)?;
        if *after == stamp {
            return Some(*b);
        }
        let (before, a) = self.0.get(next.checked_sub(1)?)?;
        let gap = after.checked_sub(*before).filter(|gap| *gap <= LARGEST_GAP_NS)?;
        let part = (stamp - before) as f64 / gap as f64;
        let turn =
            RigidMotion { rotation: a.rotation.transpose() * b.rotation, translation: Vector3::zeros() };
        let omega = turn.log().omega * part;
        Some(RigidMotion {
            rotation: a.rotation * Twist { t: Vector3::zeros(), omega }.exp().rotation,
            translation: a.translation.lerp(&b.translation, part),
        })
    }
}

/// A pose from a place and (x, y, z, w) of a quaternion.
fn pose(place: [f64; 3], [x, y, z, w]: [f64; 4]) -> Result<RigidMotion, String> {
    let unit = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6);
    let rotation = unit.filter(|q| (q.norm() - 1.0).abs() < 1e-6).ok_or("the quaternion is zero")?;
    Ok(RigidMotion { rotation: rotation.to_rotation_matrix().into_inner(), translation: place.into() })
}

/// Nanoseconds of a number of seconds in decimals.
fn nanoseconds(text: &str) -> Result<i64, String> {
    let refuse = || format!("{:?} is no time stamp in seconds", text.chars().take(40).collect::<String>());
    let (whole, part) = text.split_once('.').unwrap_or((text, ""));
    let digits = |t: &str| t.bytes().all(|b| b.is_ascii_digit());
    if !(digits(whole) && digits(part)) {
        // An exponent or a sign: double precision is what there is.
        let seconds = read::number(text)?;
        return if seconds.abs() < 9e9 { Ok((seconds * 1e9).round() as i64) } else { Err(refuse()) };
    }
    let nine: String = part.chars().chain("000000000".chars()).take(9).collect();
    let seconds: i64 = whole.parse().map_err(|_| refuse())?;
    let rest: i64 = nine.parse().map_err(|_| refuse())?;
    seconds.checked_mul(1_000_000_000).and_then(|ns| ns.checked_add(rest)).ok_or_else(refuse)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_between_two_move_evenly() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("t.txt");
        std::fs::write(&file, "# s\n100.000000001 0 0 0 0 0 0 1\n100.05 1 2 3 0 0 0.19866933079506122 0.9800665778412416\n101 9 9 9 0 0 0 1\n").unwrap();
        let poses = StampedPoses::tum(&file).unwrap();
        assert_eq!(poses.at(100_000_000_001).unwrap().translation, Vector3::zeros());
        let middle = poses.at(100_025_000_000).unwrap();
        assert!((middle.translation - Vector3::new(0.5, 1.0, 1.5)).norm() < 1e-6);
        assert!((middle.log().omega - Vector3::new(0.0, 0.0, 0.2)).norm() < 1e-6);
        // In the gap, before the first and after the last.
        assert!([100_500_000_000, 99_000_000_000, 102_000_000_000].iter().all(|&t| poses.at(t).is_none()));
        std::fs::write(&file, "1,0,0,0,1,0,0,0\n2,0,0,0,1,0,0\n").unwrap();
        let error = StampedPoses::euroc(&file).err().unwrap().to_string();
        assert!(error.contains("t.txt:2: the row has less than 8 numbers"), "{error}");
    }
}
