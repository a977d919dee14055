//! One file for each dataset layout: how a folder is recognised, and what it then holds.

mod euroc;
mod feature_tracks;
mod karlsruhe;
mod kitti_odometry;
mod kitti_raw;
mod kitti_scenes;
mod middlebury;
mod plain;
mod tartanair;
mod tum_rgbd;

use std::path::Path;

use super::layout::DatasetLayout;
use super::sequence::Sequence;
use crate::IoError;
pub(in crate::source) use plain::holds_images_only;

/// Interval of KITTI's cameras in seconds, assumed where a set has no time stamps: they take 10 images a second.
const KITTI_INTERVAL_S: f64 = 0.1;

/// A folder or file whose layout is known.
pub(super) struct Recognised {
    pub(super) layout: DatasetLayout,
    /// Why it was taken for this layout, for people.
    pub(super) reason: String,
    /// The sequences, never empty.
    pub(super) sequences: Vec<Sequence>,
}

/// The recording that a single file holds; `None` if no layout is one file of this kind.
pub(super) fn recognise_file(path: &Path, calibration: Option<&Path>) -> Result<Option<Recognised>, IoError> {
    feature_tracks::recognise(path, calibration)
}

/// The recording that a folder holds, by the first layout that knows it; `None` if none does.
pub(super) fn recognise_folder(
    folder: &Path,
    calibration: Option<&Path>,
) -> Result<Option<Recognised>, IoError> {
    for layout in [
        kitti_scenes::recognise,
        euroc::recognise,
        karlsruhe::recognise,
        kitti_odometry::recognise,
        kitti_raw::recognise,
        tum_rgbd::recognise,
        tartanair::recognise,
        feature_tracks::recognise,
        middlebury::recognise,
        plain::recognise,
    ] {
        if let Some(recognised) = layout(folder, calibration)? {
            return Ok(Some(recognised));
        }
    }
    Ok(None)
}
