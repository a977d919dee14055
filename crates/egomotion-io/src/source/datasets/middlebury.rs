//! Stereo pairs without a second time, in the layouts of the Middlebury sets: disparity, and no motion.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use egomotion::geometry::StereoRig;

use super::Recognised;
use crate::calibration::{self, CameraPair};
use crate::source::disparity_file::{DisparityEncoding, DisparityFile};
use crate::source::layout::DatasetLayout;
use crate::source::listing;
use crate::source::sequence::{Clock, FrameFiles, Sequence, TruthFiles};
use crate::{IoError, image, read};

/// File names of the sets without extensions: left image, right image, and the left one's disparity in grey levels.
const PAIR_NAMES: [(&str, &str, &str); 3] =
    [("im2", "im6", "disp2"), ("view1", "view5", "disp1"), ("im0", "im1", "disp0GT")];

/// The files of a stereo pair.
struct PairFiles {
    left: PathBuf,
    right: PathBuf,
    /// Name without extension of the left image's disparity in grey levels; empty where the set has none.
    disparity_stem: &'static str,
}

/// The folder as a pair, or the folders in it as pairs; `None` if there is none.
pub(super) fn recognise(folder: &Path, calibration: Option<&Path>) -> Result<Option<Recognised>, IoError> {
    let mut folders = vec![folder.to_owned()];
    if pair_in(folder)?.is_none() {
        folders = listing::folders(folder)?;
    }
    let scales = scales(folder)?;
    let mut sequences = Vec::new();
    for place in &folders {
        if let Some(pair) = pair_in(place)? {
            sequences.push(sequence(place, pair, &scales, calibration)?);
        }
    }
    if sequences.is_empty() {
        return Ok(None);
    }
    let reason =
        "it holds stereo pairs (im2, im6 or view1, view5 or im0, im1 or NAME_left, NAME_right) of one time";
    Ok(Some(Recognised { layout: DatasetLayout::StereoPairs, reason: reason.into(), sequences }))
}

fn pair_in(folder: &Path) -> Result<Option<PairFiles>, IoError> {
    let images = listing::numbered(folder, |stem| Some(stem.to_owned()))?;
    for (left, right, disparity_stem) in PAIR_NAMES {
        if let (Some(left), Some(right)) = (images.get(left), images.get(right)) {
            return Ok(Some(PairFiles { left: left.clone(), right: right.clone(), disparity_stem }));
        }
    }
    let named = images.iter().find_map(|(stem, left)| {
        let right = images.get(&format!("{}_right", stem.strip_suffix("_left")?))?;
        Some(PairFiles { left: left.clone(), right: right.clone(), disparity_stem: "" })
    });
    Ok(named)
}

fn sequence(
    folder: &Path,
    PairFiles { left, right, disparity_stem }: PairFiles,
    scales: &BTreeMap<String, f64>,
    calibration: Option<&Path>,
) -> Result<Sequence, IoError> {
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let own = folder.join("calib.txt");
    let mut rectification = None;
    let rig = match calibration {
        Some(file) => {
            let pair = calibration::read(file)?.pair(CameraPair::Grey, image::size(&left)?, file)?;
            rectification = pair.rectification;
            Some(pair.rig)
        }
        None if own.is_file() => rig(&own, image::size(&left)?)?,
        None => None,
    };
    let disparity = true_disparity(folder, &left, disparity_stem, scales.get(&name).copied());
    let truth_files = disparity.map(|disparity| TruthFiles {
        index: 0,
        disparity: Some(disparity),
        next_disparity: None,
        flow: None,
    });
    let frame = FrameFiles { index: 0, left, right: Some(right), depth: None, time_s: 0.0, truth: None };
    let clock = Clock::Assumed { interval_s: 0.0 };
    Ok(Sequence { rectification, truth_files, ..Sequence::new(name, vec![frame], clock, rig) })
}

/// The true disparity of the left image, where there is one and its scale is known.
fn true_disparity(folder: &Path, left: &Path, grey_stem: &str, per_px: Option<f64>) -> Option<DisparityFile> {
    let stem = left.file_stem()?.to_str()?;
    let float = folder.join("disp0.pfm");
    let array = folder.join(format!("{}_disp.npz", stem.trim_end_matches("_left")));
    let grey = folder.join(format!("{grey_stem}.png"));
    let found = |file: PathBuf, encoding| file.is_file().then_some(DisparityFile { file, encoding });
    found(float, DisparityEncoding::Pfm)
        .or_else(|| found(array, DisparityEncoding::Npz))
        .or_else(|| found(grey, DisparityEncoding::Levels { per_px: per_px? }))
}

/// Levels for each pixel by the pair's name, from `datasets.xml` in the folder or beside it: rows `teddy "4" "0"`.
fn scales(folder: &Path) -> Result<BTreeMap<String, f64>, IoError> {
    let places = [Some(folder), folder.parent()];
    let mut files = places.into_iter().flatten().map(|place| place.join("datasets.xml"));
    let Some(file) = files.find(|file| file.is_file()) else { return Ok(BTreeMap::new()) };
    let text = read::text(&file)?;
    let row = |(_, line): (usize, &str)| {
        let mut words = line.split_whitespace();
        let (name, scale) = (words.next()?, words.next()?);
        let scale = scale.trim_matches('"').parse::<f64>().ok().filter(|s| s.is_finite() && *s > 0.0)?;
        Some((name.to_owned(), scale))
    };
    Ok(read::lines(&text).filter_map(row).collect())
}

/// The rig of a `calib.txt` of 2014 (`cam0=[f 0 cx; 0 f cy; 0 0 1]`, `doffs=`, `baseline=` in millimetres); `None` if it
/// is another file of that name.
fn rig(file: &Path, (width_px, height_px): (usize, usize)) -> Result<Option<StereoRig>, IoError> {
    let text = read::text(file)?;
    let value = |key: &str| {
        read::lines(&text).find_map(|(line, content)| {
            let (name, value) = content.split_once('=')?;
            (name.trim() == key).then_some((line, value.trim()))
        })
    };
    let Some((line, cam0)) = value("cam0") else { return Ok(None) };
    let advice = "give the calibration of a Middlebury pair (cam0=[…], doffs=…, baseline=… in mm)";
    let refuse = |line, reason: String| IoError::new(file, reason, advice).at_line(line);
    let numbers =
        read::numbers(&cam0.replace(['[', ']', ';'], " ")).map_err(|reason| refuse(line, reason))?;
    let &[focal_px, _, cx_px, _, focal_y_px, cy_px, ..] = numbers.as_slice() else {
        return Err(refuse(line, format!("cam0 has {} numbers, not 9", numbers.len())));
    };
    let number = |key: &str| {
        let (line, word) =
            value(key).ok_or_else(|| IoError::new(file, format_args!("the key {key} is missing"), advice))?;
        read::number(word).map_err(|reason| refuse(line, format!("{key}: {reason}")))
    };
    let rig = StereoRig {
        focal_px,
        focal_y_px,
        cx_px,
        cy_px,
        doffs_px: number("doffs")?,
        baseline_m: 1e-3 * number("baseline")?,
        width_px,
        height_px,
    };
    rig.check().map_err(|error| refuse(line, error.to_string()))?;
    Ok(Some(rig))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_calibration_of_2014() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("calib.txt");
        let text = "cam0=[3979.911 0 1244.772; 0 3979.911 1019.507; 0 0 1]\n\
                    cam1=[3979.911 0 1369.115; 0 3979.911 1019.507; 0 0 1]\n\
                    doffs=124.343\nbaseline=193.001\nwidth=2964\nheight=2000\nndisp=270\n";
        std::fs::write(&file, text).unwrap();
        let found = rig(&file, (2964, 2000)).unwrap().unwrap();
        assert_eq!((found.focal_px, found.cx_px, found.cy_px), (3979.911, 1244.772, 1019.507));
        assert_eq!((found.doffs_px, found.baseline_m), (124.343, 1e-3 * 193.001));
        std::fs::write(&file, "P0: 1 2 3\n").unwrap();
        assert_eq!(rig(&file, (4, 3)).unwrap(), None);
        for (text, reason) in [
            ("cam0=[1 2]\n", "calib.txt:1: cam0 has 2 numbers"),
            ("cam0=[9 0 1; 0 9 1; 0 0 1]\ndoffs=x\n", "calib.txt:2: doffs: \"x\" is not a number"),
            ("cam0=[9 0 1; 0 9 1; 0 0 1]\ndoffs=1\n", "the key baseline is missing"),
            ("cam0=[9 0 1; 0 9 1; 0 0 1]\ndoffs=1\nbaseline=-3\n", "is not positive"),
        ] {
            std::fs::write(&file, text).unwrap();
            let error = rig(&file, (4, 3)).unwrap_err().to_string();
            assert!(error.contains(reason), "{error}");
        }
    }
}
