//! The Karlsruhe sequences: KITTI's folders, and `insdata.txt` of a GPS/INS as the truth.

use std::path::Path;

use egomotion::geometry::RigidMotion;
use nalgebra::{Matrix3, Vector3};

use super::{Recognised, kitti_odometry};
use crate::source::layout::DatasetLayout;
use crate::{IoError, read};

/// The folder as a Karlsruhe sequence; `None` if it has no `insdata.txt`, or no images.
pub(super) fn recognise(folder: &Path, calibration: Option<&Path>) -> Result<Option<Recognised>, IoError> {
    let file = folder.join("insdata.txt");
    if !file.is_file() {
        return Ok(None);
    }
    let Some(Recognised { reason, mut sequences, .. }) = kitti_odometry::recognise(folder, calibration)?
    else {
        return Ok(None);
    };
    let poses = read_poses(&file)?;
    for frame in sequences.iter_mut().flat_map(|sequence| &mut sequence.frames) {
        frame.truth = poses.get(frame.index).copied();
    }
    Ok(Some(Recognised {
        layout: DatasetLayout::Karlsruhe,
        reason: format!("{reason}, and insdata.txt"),
        sequences,
    }))
}

/// The pose of each row: columns 5 to 7 are x, y, z in metres, 10 the yaw in radians from x towards y.
///
/// How the camera sits on the car is not told, so it is taken to look along the yaw, level, from the place of
/// the GPS. The camera of these sequences really looks some degrees up or down, and the car pitches and rolls:
/// only yaw and place can be judged by these poses.
fn read_poses(file: &Path) -> Result<Vec<RigidMotion>, IoError> {
    let text = read::text(file)?;
    let pose = |(line, content): (usize, &str)| {
        let refuse =
            |reason| IoError::new(file, reason, "give the 10 columns of the sequences").at_line(line);
        let row = read::numbers(content).map_err(refuse)?;
        let [_, _, _, _, x, y, z, _, _, yaw, ..] = row[..] else {
            return Err(refuse(format!("the row has {} numbers, not 10", row.len())));
        };
        let (sine, cosine) = yaw.sin_cos();
        // Columns: right, down and forward of the camera; the world's z is up.
        let rotation = Matrix3::new(sine, 0.0, cosine, -cosine, 0.0, sine, 0.0, -1.0, 0.0);
        Ok(RigidMotion { rotation, translation: Vector3::new(x, y, z) })
    };
    read::lines(&text).map(pose).collect()
}
