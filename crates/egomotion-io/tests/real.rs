//! The readers on real datasets, against what their documentation says.
use std::io::Write;
use std::path::PathBuf;

use egomotion::geometry::RigidMotion;
use egomotion::metrics::{relative_pose_error, travelled_m};
use egomotion_io::source::{Clock, DatasetLayout};
use egomotion_io::{IoError, Source, flo, flow_png, image};

/// A folder of the real data; `None`, and a line that says so, where it is missing.
fn data(name: &str) -> Option<PathBuf> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let folder =
        std::env::var_os("EGOMOTION_DATA").map_or_else(|| PathBuf::from(default), PathBuf::from).join(name);
    if !folder.exists() {
        // Not `println!`, which the test harness hides when a test passes.
        let _ = writeln!(std::io::stdout(), "SKIPPED {name}: {} is missing", folder.display());
        return None;
    }
    Some(folder)
}

fn near(value: f64, expected: f64, within: f64) {
    assert!((value - expected).abs() <= within, "{value} is not {expected} ± {within}");
}

#[test]
fn kitti_odometry_06() -> Result<(), IoError> {
    let Some(folder) = data("kitti_odometry/sequences/06") else { return Ok(()) };
    let source = Source::open(&folder)?;
    assert_eq!((source.layout, source.sequences.len()), (DatasetLayout::KittiOdometry, 1));
    let sequence = &source.sequences[0];
    assert_eq!((sequence.name.as_str(), sequence.frames.len(), sequence.clock), ("06", 51, Clock::Measured));
    let rig = sequence.rig.unwrap();
    near(rig.focal_px, 707.0912, 1e-9);
    near(rig.baseline_m, 0.5372, 5e-5);
    assert_eq!((rig.width_px, rig.height_px, rig.doffs_px), (1226, 370, 0.0));
    assert!(sequence.frames.iter().all(|f| f.right.is_some()));
    assert_eq!((sequence.frames[50].index, sequence.frames[50].time_s), (50, 5.195994));
    // About 1.2 m a frame.
    let truth: Vec<RigidMotion> = sequence.frames.iter().filter_map(|f| f.truth).collect();
    assert_eq!(truth.len(), 51);
    near(travelled_m(&truth)[50] / 50.0, 1.2, 0.1);
    assert_eq!(relative_pose_error(&truth, &truth).unwrap().t_max_m, 0.0);
    let left = image::read(&sequence.frames[0].left)?;
    assert_eq!(left.size(), (1226, 370));
    assert_eq!(image::size(sequence.frames[7].right.as_ref().unwrap())?, (1226, 370));
    Ok(())
}

#[test]
fn karlsruhe_and_rectified_euroc_in_kittis_folders() -> Result<(), IoError> {
    if let Some(folder) = data("karlsruhe_0019") {
        let source = Source::open(&folder)?;
        let sequence = &source.sequences[0];
        assert_eq!((source.layout, sequence.frames.len()), (DatasetLayout::Karlsruhe, 45));
        near(sequence.rig.unwrap().focal_px, 645.24, 0.005);
        near(sequence.rig.unwrap().baseline_m, 0.5707, 5e-5);
        // It drives forwards: along Z of the camera, about a metre a frame, hardly sideways.
        let truth: Vec<RigidMotion> = sequence.frames.iter().filter_map(|f| f.truth).collect();
        assert_eq!(truth.len(), 45);
        let whole = truth[0].inverse().after(&truth[44]).translation;
        assert!(whole.z > 20.0 && whole.x.abs() < 0.2 * whole.z && whole.y.abs() < 1.0, "{whole}");
    }
    if let Some(folder) = data("euroc_v101_static") {
        let source = Source::open(&folder)?;
        let sequence = &source.sequences[0];
        assert_eq!((sequence.frames.len(), sequence.clock), (12, Clock::Measured));
        near(sequence.rig.unwrap().focal_px, 436.2, 0.05);
        near(sequence.rig.unwrap().baseline_m, 0.1101, 5e-5);
        assert!(sequence.frames.iter().all(|f| f.truth.is_some()));
    }
    Ok(())
}

/// Raw images: the calibration of `sensor.yaml`, and the truth of the camera as it is rectified.
#[test]
fn euroc_mh01_raw() -> Result<(), IoError> {
    let Some(folder) = data("euroc_mh01") else { return Ok(()) };
    let source = Source::open(&folder)?;
    assert_eq!(Source::open(&folder.join("mav0"))?.sequences, source.sequences);
    let sequence = &source.sequences[0];
    assert_eq!(
        (source.layout, sequence.frames.len(), sequence.clock),
        (DatasetLayout::Euroc, 60, Clock::Measured)
    );
    let pair = sequence.rectification.as_ref().unwrap();
    assert_eq!(pair.left().focal_px(), (458.654, 457.296));
    let rig = sequence.rig.unwrap();
    assert_eq!((*pair.rig(), rig.doffs_px, rig.width_px, rig.height_px), (rig, 0.0, 752, 480));
    // OpenCV's stereoRectify says 436.2 px with alpha 0, and this baseline.
    near(rig.focal_px, 436.2, 10.0);
    near(rig.baseline_m, 0.110_077_842, 1e-8);
    assert!(sequence.frames.iter().all(|f| f.right.is_some()));
    near(sequence.frames[1].time_s - sequence.frames[0].time_s, 0.05, 1e-6);
    let truth = sequence.frames[0].truth.unwrap();
    // The first row of the truth, turned by the rectification about the same place.
    near(truth.translation.x, 4.7308101897, 1e-12);
    Ok(())
}

#[test]
fn kitti_scene_flow_2015() -> Result<(), IoError> {
    let Some(folder) = data("kitti_scene_flow_2015") else { return Ok(()) };
    let source = Source::open(&folder)?;
    assert_eq!(source.layout, DatasetLayout::KittiSceneFlow2015);
    assert_eq!(Source::open(&folder.join("training"))?.sequences, source.sequences);
    let names: Vec<_> = source.sequences.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["000002", "000003"]);
    for sequence in &source.sequences {
        let frames: Vec<_> = sequence.frames.iter().map(|f| (f.index, f.time_s)).collect();
        assert_eq!(frames, [(10, 0.0), (11, 0.1)]);
        assert_eq!(sequence.clock, Clock::Assumed { interval_s: 0.1 });
        let rig = sequence.rig.unwrap();
        near(rig.focal_px, 721.54, 0.005);
        near(rig.baseline_m, 0.5327, 5e-5);
        let truth = sequence.truth_files.as_ref().unwrap();
        assert_eq!(truth.index, 10);
        let before = truth.disparity.as_ref().unwrap().read()?;
        let after = truth.next_disparity.as_ref().unwrap().read()?;
        let [vx, vy] = flow_png::read(truth.flow.as_ref().unwrap())?;
        for field in [&before, &after, &vx, &vy] {
            assert_eq!(field.size(), (rig.width_px, rig.height_px));
            // Laser truth covers a part of the image.
            assert!((0.05..0.6).contains(&field.density()), "{}", field.density());
        }
        assert_eq!(vx.count(), vy.count());
        let largest = before.grid().values().iter().copied().fold(0.0f32, f32::max);
        assert!((20.0..256.0).contains(&largest), "{largest}");
        // A colour image becomes grey of the usual range.
        let left = image::read(&sequence.frames[0].left)?;
        let mean = left.values().iter().map(|&g| f64::from(g)).sum::<f64>() / left.values().len() as f64;
        assert!((20.0..200.0).contains(&mean), "{mean}");
    }
    Ok(())
}

#[test]
fn kitti_stereo_flow_2012() -> Result<(), IoError> {
    let Some(folder) = data("kitti_stereo_flow_2012") else { return Ok(()) };
    let source = Source::open(&folder)?;
    assert_eq!(source.layout, DatasetLayout::KittiStereoFlow2012);
    let [first, second] = &source.sequences[..] else { panic!("{:?}", source.sequences) };
    assert_eq!((first.name.as_str(), second.name.as_str()), ("000027", "000138"));
    let indices =
        |frames: &[egomotion_io::source::FrameFiles]| frames.iter().map(|f| f.index).collect::<Vec<_>>();
    assert_eq!((indices(&first.frames), indices(&second.frames)), (vec![7, 8, 9, 10, 11], vec![10, 11]));
    near(first.rig.unwrap().focal_px, 718.856, 1e-9);
    // From the entries of calib/: 386.1448/718.856 and 387.5744/721.5377.
    near(first.rig.unwrap().baseline_m, 0.537166, 1e-6);
    near(second.rig.unwrap().baseline_m, 0.537151, 1e-6);
    assert_eq!((first.rig.unwrap().width_px, first.rig.unwrap().height_px), (1241, 376));
    let truth = first.truth_files.as_ref().unwrap();
    assert!(truth.next_disparity.is_none());
    assert!(truth.disparity.as_ref().unwrap().read()?.count() > 10_000);
    assert!(flow_png::read(truth.flow.as_ref().unwrap())?[0].count() > 10_000);
    Ok(())
}

#[test]
fn middlebury_flow() -> Result<(), IoError> {
    let Some(folder) = data("middlebury_flow_rubberwhale") else { return Ok(()) };
    let entries = folder.read_dir().map(|e| e.filter_map(Result::ok).map(|e| e.path()).collect::<Vec<_>>());
    let files = entries.unwrap_or_default();
    let file = files.iter().find(|path| path.extension().is_some_and(|e| e == "flo"));
    let [vx, vy] = flo::read(file.expect("the set has a .flo"))?;
    assert_eq!(vx.size(), (584, 388));
    assert!(vx.density() > 0.9 && vy.density() < 1.0);
    assert!(vx.grid().values().iter().all(|v| v.is_nan() || v.abs() < 10.0));
    Ok(())
}
