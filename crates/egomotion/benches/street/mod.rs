//! The street that benches look at: two stereo frames of KITTI odometry sequence 06.

use std::path::PathBuf;

use egomotion::geometry::{Image, StereoRig};

/// Left and right image of frame `first`, then of the next one, with their rig; `None`, and a word about
/// it, where the data are missing.
pub fn two_frames(first: usize) -> Option<([Image; 4], StereoRig)> {
    let images =
        [(0, first), (1, first), (0, first + 1), (1, first + 1)].map(|(side, frame)| image(side, frame));
    let [Some(a), Some(b), Some(c), Some(d)] = images else {
        println!("SKIPPED: no KITTI odometry sequence 06");
        return None;
    };
    let rig = StereoRig::new(707.0912, (601.8873, 183.1104), 0.5372, a.size()).unwrap();
    Some(([a, b, c, d], rig))
}

fn image(side: usize, frame: usize) -> Option<Image> {
    let data = std::env::var_os("EGOMOTION_DATA").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let path = data.join(format!("kitti_odometry/sequences/06/image_{side}/{frame:06}.png"));
    egomotion_io::image::read(&path).ok()
}
