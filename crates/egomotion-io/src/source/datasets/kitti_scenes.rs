//! KITTI's stereo and flow set of 2012 and scene flow set of 2015: independent scenes of a few frames.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::{KITTI_INTERVAL_S, Recognised};
use crate::IoError;
use crate::calibration::{self, CameraPair, KittiCalibration, StereoCalibration};
use crate::source::disparity_file::{DisparityEncoding, DisparityFile};
use crate::source::layout::DatasetLayout;
use crate::source::listing;
use crate::source::sequence::{Clock, Sequence, TruthFiles};

/// Number of the frame of a scene that the true maps belong to: `000002_10.png` has them, in both sets.
const TRUTH_FRAME: usize = 10;

/// Where a set keeps its files.
struct SceneSet {
    layout: DatasetLayout,
    left: &'static str,
    right: &'static str,
    pair: CameraPair,
    calibration: &'static [&'static str],
    disparity: &'static str,
    next_disparity: Option<&'static str>,
}

/// The 2012 set in grey and in colour, and the 2015 set, in order of preference.
const SCENE_SETS: [SceneSet; 3] = [
    SceneSet {
        layout: DatasetLayout::KittiStereoFlow2012,
        left: "image_0",
        right: "image_1",
        pair: CameraPair::Grey,
        calibration: &["calib"],
        disparity: "disp_occ",
        next_disparity: None,
    },
    SceneSet {
        layout: DatasetLayout::KittiStereoFlow2012,
        left: "colored_0",
        right: "colored_1",
        pair: CameraPair::Colour,
        calibration: &["calib"],
        disparity: "disp_occ",
        next_disparity: None,
    },
    SceneSet {
        layout: DatasetLayout::KittiSceneFlow2015,
        left: "image_2",
        right: "image_3",
        pair: CameraPair::Colour,
        calibration: &["calib_cam", "calib_cam_to_cam"],
        disparity: "disp_occ_0",
        next_disparity: Some("disp_occ_1"),
    },
];

/// ImagesByFrame by (scene, frame).
type ImagesByFrame = BTreeMap<(usize, usize), PathBuf>;

/// The folder, or `training/` in it, as a set of scenes; `None` if no image is named like `000002_10.png`.
pub(super) fn recognise(folder: &Path, calibration: Option<&Path>) -> Result<Option<Recognised>, IoError> {
    let training = folder.join("training");
    let (folder, place) = if training.is_dir() { (&*training, "training/") } else { (folder, "") };
    for set in &SCENE_SETS {
        let left = listing::numbered(&folder.join(set.left), scene_and_frame)?;
        let right = listing::numbered(&folder.join(set.right), scene_and_frame)?;
        if left.is_empty() && right.is_empty() {
            continue;
        }
        let (l, r) = (folder.join(set.left), folder.join(set.right));
        listing::check_both((&l, left.is_empty()), (&r, right.is_empty()), "000000_10.png, 000000_11.png …")?;
        let scenes: std::collections::BTreeSet<usize> =
            left.keys().chain(right.keys()).map(|(scene, _)| *scene).collect();
        let sequence = |scene| set.sequence(folder, scene, &left, &right, calibration);
        let sequences = scenes.into_iter().map(sequence).collect::<Result<_, _>>()?;
        let reason = format!("{place}{} and {place}{} hold PNG files named SCENE_FRAME", set.left, set.right);
        return Ok(Some(Recognised { layout: set.layout, reason, sequences }));
    }
    Ok(None)
}

/// 2 and 10 of `000002_10`.
fn scene_and_frame(stem: &str) -> Option<(usize, usize)> {
    let (scene, frame) = stem.split_once('_')?;
    Some((listing::digits(scene)?, listing::digits(frame)?))
}

impl SceneSet {
    fn sequence(
        &self,
        folder: &Path,
        scene: usize,
        left: &ImagesByFrame,
        right: &ImagesByFrame,
        calibration: Option<&Path>,
    ) -> Result<Sequence, IoError> {
        let of_scene = |images: &ImagesByFrame| {
            let range = images.range((scene, 0)..=(scene, usize::MAX));
            range.map(|((_, frame), path)| (*frame, path.clone())).collect()
        };
        let mut frames = listing::pairs(&folder.join(self.left), &of_scene(left), &of_scene(right));
        let first = frames.first().map_or(0, |f| f.index);
        frames.iter_mut().for_each(|f| f.time_s = KITTI_INTERVAL_S * (f.index - first) as f64);

        let name = format!("{scene:06}");
        let own = self.calibration_file(folder, &name);
        let file = calibration.unwrap_or(&own);
        let calibration = match calibration {
            Some(file) => calibration::read(file)?,
            None => StereoCalibration::Kitti(KittiCalibration::read(file)?),
        };
        let pair = calibration.pair(self.pair, listing::image_size(&frames)?, file)?;
        let truth_files = self.truth(folder, &name);
        let clock = Clock::Assumed { interval_s: KITTI_INTERVAL_S };
        Ok(Sequence {
            rectification: pair.rectification,
            truth_files,
            ..Sequence::new(name, frames, clock, Some(pair.rig))
        })
    }

    /// The first of the set's calibration folders that has the file, or else the first.
    fn calibration_file(&self, folder: &Path, scene: &str) -> PathBuf {
        let files = self.calibration.iter().map(|place| folder.join(place).join(format!("{scene}.txt")));
        files.rev().reduce(|found, file| if file.is_file() { file } else { found }).unwrap_or_default()
    }

    fn truth(&self, folder: &Path, scene: &str) -> Option<TruthFiles> {
        let map = |place: &str| {
            Some(folder.join(place).join(format!("{scene}_{TRUTH_FRAME}.png"))).filter(|file| file.is_file())
        };
        let true_disparity =
            |place: &str| map(place).map(|file| DisparityFile { file, encoding: DisparityEncoding::Kitti });
        let disparity = true_disparity(self.disparity);
        let next_disparity = self.next_disparity.and_then(true_disparity);
        let flow = map("flow_occ");
        let any = disparity.is_some() || next_disparity.is_some() || flow.is_some();
        any.then_some(TruthFiles { index: TRUTH_FRAME, disparity, next_disparity, flow })
    }
}
