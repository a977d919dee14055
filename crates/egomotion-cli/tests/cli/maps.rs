//! `--maps`: one file a frame pair in each folder, on the earlier frame's pixel grid.

use egomotion::geometry::Field;
use egomotion_io::{flo, flow_png, image, npy, pfm};
use tempfile::TempDir;

use crate::outputs::dense_results;
use crate::process::{names, run, try_run};
use crate::recording::{FRAMES, SIZE, drive, recording};

const PFM: [&str; 7] = [
    "disparity",
    "disparity_sigma",
    "depth_velocity",
    "depth_velocity_sigma",
    "impact",
    "impact_lo",
    "impact_hi",
];

#[test]
fn every_pair_has_all_maps_of_the_image_s_size() {
    for k in 0..FRAMES - 1 {
        for folder in PFM {
            let map = pfm::read_grid(&dense_results().join(folder).join(format!("{k:06}.pfm"))).unwrap();
            assert_eq!(map.size(), SIZE, "{folder}");
            assert!(map.values().iter().any(|v| v.is_finite()), "{folder} {k} is empty");
        }
        let flow = flo::read(&dense_results().join("flow").join(format!("{k:06}.flo"))).unwrap();
        assert!(flow.iter().all(|part| part.size() == SIZE && part.density() > 0.5));
    }
    for folder in PFM.iter().chain(&["flow"]) {
        assert_eq!(names(&dense_results().join(folder)).len(), FRAMES - 1, "{folder}");
    }
}

/// Median of |map − truth| over every fourth pixel that has both.
fn median_error(map: &Field, truth: impl Fn(usize, usize) -> Option<f64>) -> f64 {
    let pixels = (0..SIZE.1).step_by(4).flat_map(|v| (0..SIZE.0).step_by(4).map(move |u| (u, v)));
    let error = |(u, v)| Some((f64::from(map.get(u, v)?) - truth(u, v)?).abs());
    let errors: Vec<f64> = pixels.filter_map(error).collect();
    assert!(errors.len() > 1000, "{}", errors.len());
    egomotion::metrics::quantile(&errors, 0.5).unwrap()
}

#[test]
fn maps_hold_what_their_names_say() {
    let read = |folder: &str| pfm::read(&dense_results().join(folder).join("000001.pfm")).unwrap();
    let (view, phi) = (drive().view(1).unwrap(), drive().phi(1).unwrap());
    let at = |u: usize, v: usize| view.truth_at(u as f64, v as f64).filter(|truth| truth.in_right);
    let moved = |u: usize, v: usize| at(u, v).map(|truth| (truth, view.motion_at(&truth, &phi)));
    // Disparity is some 10 px, its change with the frame's index and the flow are of the order of a pixel.
    assert!(median_error(&read("disparity"), |u, v| at(u, v).map(|truth| truth.disparity_px())) < 0.2);
    // Points come about 50 mm nearer per frame; a map per second, or of the wrong sign, is far off.
    let vz = |u, v| moved(u, v).map(|(truth, moved)| moved.depth_change_m(&truth));
    assert!(median_error(&read("depth_velocity"), vz) < 5e-3);
    let impact = |u, v| {
        moved(u, v).map(|(truth, moved)| -moved.later.z * drive().interval_s / moved.depth_change_m(&truth))
    };
    assert!(median_error(&read("impact"), impact) < 1.0);
    let (lo, hi) =
        (read("impact_lo"), pfm::read_grid(&dense_results().join("impact_hi/000001.pfm")).unwrap());
    let impact = read("impact");
    for (u, v) in (0..SIZE.1).flat_map(|v| (0..SIZE.0).map(move |u| (u, v))) {
        let Some(t) = impact.get(u, v) else {
            assert!(lo.get(u, v).is_none() && hi.at(u, v).is_nan());
            continue;
        };
        assert!(lo.get(u, v).is_some_and(|lo| 0.0 < lo && lo <= t) && t <= hi.at(u, v));
    }
}

#[test]
fn maps_are_named_by_the_earlier_frame_s_index() {
    let out = TempDir::new().unwrap();
    run(recording(), out.path(), "--maps --start 1 --stride 2");
    assert_eq!(names(&out.path().join("depth_velocity")), ["000001.pfm"]);
    // Backwards the earlier frame is the one with the larger number.
    let out = TempDir::new().unwrap();
    run(recording(), out.path(), "--maps --frames 3 --reverse");
    assert_eq!(names(&out.path().join("flow")), ["000001.flo", "000002.flo"]);
}

#[test]
fn maps_in_every_format_and_clouds() {
    let out = TempDir::new().unwrap();
    run(recording(), out.path(), "--frames 2 --maps-as pfm,npy,kitti,colour --cloud vz");
    for folder in PFM {
        let at = |ending: &str| out.path().join(folder).join(format!("000000.{ending}"));
        let (pfm, npy) = (pfm::read(&at("pfm")).unwrap(), npy::read_map(&at("npy")).unwrap());
        let mut pixels = (0..240).flat_map(|v| (0..320).map(move |u| (u, v)));
        assert!(pixels.all(|(u, v)| pfm.get(u, v) == npy.get(u, v)) && pfm.count() > 1000, "{folder}");
        assert!(image::read(&at("colour.png")).unwrap().size() == SIZE, "{folder}");
        assert_eq!(at("png").is_file(), folder == "disparity", "{folder}");
    }
    let at = |ending: &str| out.path().join("flow").join(format!("000000.{ending}"));
    let [u, _] = npy::read_flow(&at("npy")).unwrap();
    let kitti = flow_png::read(&at("png")).unwrap();
    let both = (0..240)
        .flat_map(|v| (0..320).map(move |u| (u, v)))
        .filter_map(|(x, y)| u.get(x, y).zip(kitti[0].get(x, y)));
    assert!(
        both.clone().count() > 1000 && both.into_iter().all(|(a, b)| (a - b).abs() <= 1.0 / 128.0 + 1e-4)
    );
    let cloud = std::fs::read(out.path().join("cloud/000000.ply")).unwrap();
    let head = String::from_utf8_lossy(&cloud[..400]).into_owned();
    assert!(head.contains("property float depth_velocity_sigma"), "{head}");
    let points: usize =
        head.lines().find_map(|l| l.strip_prefix("element vertex ")).unwrap().parse().unwrap();
    assert!(points > 70_000, "{points}");
    assert_eq!(try_run(recording(), out.path(), "--observe sparse --cloud vz").code, 2);
}
