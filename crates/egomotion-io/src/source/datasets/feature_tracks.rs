//! Stereo tracks with their rig in an `.npz`, perhaps with true poses beside it; there are no images.

use std::path::{Path, PathBuf};

use super::{KITTI_INTERVAL_S, Recognised};
use crate::IoError;
use crate::source::layout::DatasetLayout;
use crate::source::sequence::{Clock, FrameFiles, Sequence};
use crate::tables::tracks;
use crate::tables::trajectory::{self, TrajectoryFormat};

/// A folder with one `.npz`, or that file; `None` if there is none, or several.
pub(super) fn recognise(path: &Path, calibration: Option<&Path>) -> Result<Option<Recognised>, IoError> {
    let Some(file) = archive(path)? else { return Ok(None) };
    if let Some(calibration) = calibration {
        return Err(IoError::new(calibration, "is not needed: tracks bring their rig", "leave it out"));
    }
    let table = tracks::read(&file)?;
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let poses_file = file.with_file_name(format!("poses_{stem}.txt"));
    let poses = match poses_file.is_file() {
        true => trajectory::read(&poses_file, Some(TrajectoryFormat::Kitti))?,
        false => Vec::new(),
    };
    let measured = !table.times_s.is_empty();
    let frame = |index: usize| FrameFiles {
        index,
        left: file.clone(),
        right: None,
        depth: None,
        time_s: table.times_s.get(&index).copied().unwrap_or(KITTI_INTERVAL_S * index as f64),
        truth: poses.get(index).map(|pose| pose.world_from_camera),
    };
    let frames: Vec<FrameFiles> = table.frames.keys().map(|&index| frame(index)).collect();
    if frames.is_empty() {
        return Err(IoError::new(&file, "holds no frame", "give tracks of at least two frames"));
    }
    let clock = if measured { Clock::Measured } else { Clock::Assumed { interval_s: KITTI_INTERVAL_S } };
    let sequence = Sequence { tracks: Some(file.clone()), ..Sequence::new(stem, frames, clock, table.rig) };
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Some(Recognised {
        layout: DatasetLayout::FeatureTracks,
        reason: format!("{name} holds stereo tracks"),
        sequences: vec![sequence],
    }))
}

fn archive(path: &Path) -> Result<Option<PathBuf>, IoError> {
    let is_archive = |path: &Path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npz"));
    if path.is_file() {
        return Ok(Some(path.to_owned()).filter(|path| is_archive(path)));
    }
    let failed = |error: std::io::Error| IoError::system(path, "list", &error);
    let mut found = Vec::new();
    for entry in path.read_dir().map_err(failed)? {
        found.push(entry.map_err(failed)?.path());
    }
    found.retain(|file| is_archive(file) && file.is_file());
    // Middlebury keeps a disparity map as .npz: there are images beside it.
    Ok(found.pop().filter(|file| found.is_empty() && has_features(file)))
}

/// Whether the archive has tracks; one that cannot be read is named when it is.
fn has_features(file: &Path) -> bool {
    let content = crate::maps::npz::read(file).unwrap_or_default();
    crate::maps::npz::Npz::open(&content, file).is_ok_and(|npz| npz.has("features"))
}
