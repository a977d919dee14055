//! Rectification against OpenCV's, for every kind of lens; `fixtures/rectification.py` made the numbers.
use std::path::{Path, PathBuf};

use egomotion::geometry::StereoRectification;
use egomotion::observe::Rectifier;
use egomotion_io::calibration::{self, CameraPair};
use nalgebra::{Matrix3, Vector2, Vector3};

/// What OpenCV says about a case.
#[derive(Default)]
struct Reference {
    view: Vec<f64>,
    turns: Vec<Matrix3<f64>>,
    /// Is it the right image, pixel, place.
    maps: Vec<(bool, [usize; 2], [f64; 2])>,
    /// Z, disparity, left and right raw pixel.
    points: Vec<[f64; 6]>,
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

fn reference(case: &str) -> Reference {
    let mut found = Reference::default();
    for line in std::fs::read_to_string(fixture(&format!("{case}.csv"))).unwrap().lines() {
        let words: Vec<&str> = line.split(',').collect();
        let numbers = |from: usize| words[from..].iter().map(|w| w.parse().unwrap()).collect::<Vec<f64>>();
        match words[0] {
            "view" => found.view = numbers(1),
            "turn" => found.turns.push(Matrix3::from_row_slice(&numbers(2))),
            "map" => {
                let [u, v, x, y] = numbers(2)[..] else { panic!("{line}") };
                found.maps.push((words[1] == "right", [u as usize, v as usize], [x, y]));
            }
            "point" => found.points.push(numbers(1).try_into().unwrap()),
            other => panic!("{other}"),
        }
    }
    found
}

fn rectification(case: &str, size: (usize, usize)) -> StereoRectification {
    let path = fixture(&format!("{case}.toml"));
    let pair = calibration::read(&path).unwrap().pair(CameraPair::Grey, size, &path).unwrap();
    pair.rectification.unwrap()
}

fn agrees(case: &str, size: (usize, usize)) {
    let (ours, theirs) = (rectification(case, size), reference(case));
    let rig = *ours.rig();
    for (own, expected) in [rig.focal_px, rig.cx_px, rig.cy_px].into_iter().zip(&theirs.view) {
        assert!((own - expected).abs() < 1e-6, "f, cx, cy: {rig:?}");
    }
    let turns = [ours.rectified_left_from_left(), ours.rectified_right_from_right()];
    for (own, expected) in turns.into_iter().zip(&theirs.turns) {
        assert!((own - expected).amax() < 1e-9, "{own} {expected}");
    }
    let rectifier = Rectifier::new(&ours);
    assert_eq!(theirs.maps.len(), 160);
    let mut worst = 0.0_f64;
    for (is_right, [u, v], [x, y]) in theirs.maps {
        let map = if is_right { rectifier.right() } else { rectifier.left() };
        assert!(!map.unseen().at(u, v), "{u} {v}");
        let [own_x, own_y] = map.place(u, v).unwrap();
        worst = worst.max((f64::from(own_x) - x).abs()).max((f64::from(own_y) - y).abs());
    }
    assert!(worst < 0.001, "{worst} px");

    // What OpenCV projects into both raw images lies on one row of ours, at its disparity.
    assert_eq!(theirs.points.len(), 40);
    for [z, disparity, ul, vl, ur, vr] in theirs.points {
        let seen = |camera: &egomotion::geometry::Camera, turn: &Matrix3<f64>, u, v| {
            let ray: Vector3<f64> = turn * camera.direction(&Vector2::new(u, v)).unwrap();
            (ray.x / ray.z * rig.focal_px + rig.cx_px, ray.y / ray.z * rig.focal_y_px + rig.cy_px)
        };
        let left = seen(ours.left(), turns[0], ul, vl);
        let right = seen(ours.right(), turns[1], ur, vr);
        assert!((left.1 - right.1).abs() < 1e-4, "rows {} {}", left.1, right.1);
        assert!((left.0 - right.0 - disparity).abs() < 1e-4, "disparity {} {disparity}", left.0 - right.0);
        assert!((rig.depth(disparity).unwrap() - z).abs() < 1e-6 * z);
    }
}

#[test]
fn radial_tangential_lenses() {
    agrees("radial_tangential", (752, 480));
}

#[test]
fn rational_lenses() {
    agrees("rational", (1280, 720));
}

#[test]
fn fisheyes() {
    agrees("equidistant", (512, 512));
}
