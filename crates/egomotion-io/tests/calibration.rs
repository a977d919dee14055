//! Calibration files: each format comes back as written, is recognised by its content, and names what is wrong.
use std::fs;
use std::path::{Path, PathBuf};

use egomotion::geometry::{Distortion, RigidMotion, StereoRig, Twist};
use egomotion_io::calibration::{
    self, CameraModel, CameraPair, RawPair, StereoCalibration, euroc, kalibr, opencv, rig, ros,
};
use nalgebra::{Matrix3, Vector3};
use tempfile::TempDir;

const SIZE: (usize, usize) = (752, 480);
const BROWN: Distortion =
    Distortion::RadialTangential { k: [-0.28340811, 0.07395907, 0.0], p: [0.00019359, 1.76187114e-05] };
const BROWN5: Distortion = Distortion::RadialTangential { k: [-0.25, 0.1, -0.03], p: [1e-3, -2e-3] };
const RATIONAL: Distortion = Distortion::Rational { k: [0.9, 0.2, 0.01, 1.3, 0.4, 0.03], p: [1e-3, -7e-4] };
const FISHEYE: Distortion = Distortion::Equidistant { k: [0.0034823894, 0.00071503, -0.00205, 0.0002] };

fn pair(distortion: Distortion) -> RawPair {
    let turn =
        |z: f64| Twist { t: Vector3::new(0.1 + z, 0.02, -0.3), omega: Vector3::new(0.1, 1.2, z) }.exp();
    let camera = |f: f64| CameraModel {
        focal_px: (f, f - 4.0 / 3.0),
        centre_px: (367.215, 248.375 + 1.0 / 7.0),
        distortion,
        size: Some(SIZE),
    };
    let right_from_left =
        Twist { t: Vector3::new(-0.11, 0.001, 0.002), omega: Vector3::new(0.01, -0.02, 0.003) };
    RawPair {
        left: camera(458.654),
        right: camera(457.587),
        right_from_left: right_from_left.exp(),
        body_from_left: Some(turn(0.2)),
    }
}

fn assert_same_motion(a: &RigidMotion, b: &RigidMotion) {
    assert!(
        (a.rotation - b.rotation).amax() < 1e-14 && (a.translation - b.translation).amax() < 1e-14,
        "{a:?} {b:?}"
    );
}

fn assert_same(a: &RawPair, b: &RawPair) {
    assert_eq!((a.left, a.right), (b.left, b.right));
    assert_same_motion(&a.right_from_left, &b.right_from_left);
}

fn read_raw(path: &Path) -> RawPair {
    match calibration::read(path) {
        Ok(StereoCalibration::Raw(pair)) => pair,
        other => panic!("{other:?}"),
    }
}

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn file(&self, name: &str) -> PathBuf {
        let path = self.0.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    }

    fn with(&self, name: &str, text: &str) -> PathBuf {
        let path = self.file(name);
        fs::write(&path, text).unwrap();
        path
    }
}

#[test]
fn euroc_comes_back() {
    for lens in [BROWN, BROWN5, FISHEYE] {
        let (folder, given) = (Folder::new(), pair(lens));
        let left = given.body_from_left.unwrap();
        let right = left.after(&given.right_from_left.inverse());
        let files = ["mav0/cam0/sensor.yaml", "mav0/cam1/sensor.yaml"].map(|name| folder.file(name));
        euroc::write(&files[0], &given.left, &left).unwrap();
        euroc::write(&files[1], &given.right, &right).unwrap();
        // Either file, or a folder above.
        for path in [files[0].clone(), files[1].clone(), folder.file("x").parent().unwrap().to_owned()] {
            let back = read_raw(&path);
            assert_same(&given, &back);
            assert_same_motion(&back.body_from_left.unwrap(), &left);
        }
        fs::remove_file(&files[1]).unwrap();
        assert!(calibration::read(&files[0]).unwrap_err().to_string().contains("cam1/sensor.yaml"));
    }
    assert!(euroc::write(Path::new("x"), &pair(RATIONAL).left, &RigidMotion::identity()).is_err());
}

#[test]
fn kalibr_comes_back() {
    for lens in [BROWN, FISHEYE, Distortion::None] {
        let (folder, given) = (Folder::new(), pair(lens));
        let file = folder.file("chain.yaml");
        kalibr::write(&file, &given).unwrap();
        let back = read_raw(&file);
        assert_same(&given, &back);
        assert_same_motion(&back.body_from_left.unwrap(), &given.body_from_left.unwrap());
    }
    // As the tool writes it, with the poses in the body alone.
    let text = "cam0:\n  T_cam_imu:\n  - [1.0, 0.0, 0.0, 0.05]\n  - [0.0, 1.0, 0.0, 0.0]\n  - [0.0, 0.0, 1.0, 0.0]\n  - [0.0, 0.0, 0.0, 1.0]\n  cam_overlaps: [1]\n  camera_model: pinhole\n  distortion_coeffs: [0.1, 0.2, 0.0, 0.0]\n  distortion_model: radtan\n  intrinsics: [400.0, 401.0, 320.0, 240.0]\n  resolution: [640, 480]\n  rostopic: /cam0/image_raw\ncam1:\n  T_cam_imu:\n  - [1.0, 0.0, 0.0, -0.05]\n  - [0.0, 1.0, 0.0, 0.0]\n  - [0.0, 0.0, 1.0, 0.0]\n  - [0.0, 0.0, 0.0, 1.0]\n  camera_model: pinhole\n  distortion_coeffs: [0.1, 0.2, 0.0, 0.0]\n  distortion_model: radtan\n  intrinsics: [400.0, 401.0, 320.0, 240.0]\n  resolution: [640, 480]\n";
    let pair = kalibr::parse(text, Path::new("c")).unwrap();
    assert!((pair.right_from_left.translation - Vector3::new(-0.1, 0.0, 0.0)).norm() < 1e-15);
    let omni =
        kalibr::parse(&text.replacen("pinhole", "omni", 1), Path::new("c.yaml")).unwrap_err().to_string();
    assert!(
        omni.starts_with("c.yaml:8: cam0.camera_model: \"omni\" is not supported, only pinhole; "),
        "{omni}"
    );
}

#[test]
fn opencv_comes_back_as_yaml_and_xml() {
    for lens in [Distortion::None, BROWN5, RATIONAL, FISHEYE] {
        let (folder, given) = (Folder::new(), pair(lens));
        let (yaml, xml) = (folder.file("stereo.yml"), folder.file("stereo.xml"));
        opencv::write_yaml(&yaml, &given).unwrap();
        opencv::write_xml(&xml, &given).unwrap();
        assert_same(&given, &read_raw(&yaml));
        assert_same(&given, &read_raw(&xml));
    }
}

#[test]
fn opencv_in_the_two_files_of_its_sample() {
    let folder = Folder::new();
    let matrix = |name: &str, rows: usize, cols: usize, data: &str| {
        format!("{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: [ {data} ]\n")
    };
    let camera = |f: &str| format!("{f}, 0.,\n       3.4205e+02, 0., {f}, 2.3516e+02, 0., 0., 1.");
    let lens = "-2.8e-01, 9.5e-02, 0., 0., 0., 0., 0., 2.6e-02, 0., 0., 0., 0., 0., 0.";
    let intrinsics = [
        "%YAML:1.0\n---\n".to_owned(),
        matrix("M1", 3, 3, &camera("5.3391e+02")),
        matrix("D1", 1, 14, lens),
        matrix("M2", 3, 3, &camera("5.3391e+02")),
        matrix("D2", 1, 14, lens),
    ]
    .concat();
    let extrinsics = [
        "%YAML:1.0\n---\n".to_owned(),
        matrix("R", 3, 3, "1., 0., 0., 0., 1., 0., 0., 0., 1."),
        matrix("T", 3, 1, "-3.34, 4.7e-02, -7.1e-04"),
    ]
    .concat();
    let one = folder.with("intrinsics.yml", &intrinsics);
    let other = folder.with("extrinsics.yml", &extrinsics);
    let pair = read_raw(&one);
    assert_eq!(pair, read_raw(&other));
    assert_eq!((pair.left.focal_px, pair.left.centre_px), ((533.91, 533.91), (342.05, 235.16)));
    assert_eq!(
        pair.left.distortion,
        Distortion::Rational { k: [-0.28, 0.095, 0.0, 0.0, 0.0, 0.026], p: [0.0, 0.0] }
    );
    assert_eq!(pair.right_from_left.translation, Vector3::new(-3.34, 0.047, -0.00071));
    fs::remove_file(&other).unwrap();
    assert!(
        calibration::read(&one).unwrap_err().to_string().contains("the key R or rotation_matrix is missing")
    );
}

#[test]
fn ros_comes_back_and_gives_the_pose() {
    for lens in [BROWN5, RATIONAL, FISHEYE] {
        let (folder, given) = (Folder::new(), pair(lens));
        let rectified = StereoCalibration::Raw(given).pair(CameraPair::Grey, SIZE, Path::new("c")).unwrap();
        let (rig, how) = (rectified.rig, rectified.rectification.unwrap());
        let info = |camera, rectification: &Matrix3<f64>, last: f64| ros::CameraInfo {
            camera,
            rectification: *rectification,
            projection: [
                rig.focal_px,
                0.0,
                rig.cx_px,
                last,
                0.0,
                rig.focal_y_px,
                rig.cy_px,
                0.0,
                0.0,
                0.0,
                1.0,
                0.0,
            ],
        };
        let left = info(given.left, how.rectified_left_from_left(), 0.0);
        let right = info(given.right, how.rectified_right_from_right(), -rig.depth_disparity_product());
        let files = [folder.file("left.yaml"), folder.file("right.yaml")];
        ros::write(&files[0], &left).unwrap();
        ros::write(&files[1], &right).unwrap();
        let back = ros::read(&files[1]).unwrap();
        assert!((back.rectification - right.rectification).amax() < 1e-15);
        assert_eq!((back.camera, back.projection), (right.camera, right.projection));
        for path in [files[0].clone(), files[1].clone(), folder.0.path().to_owned()] {
            let pair = read_raw(&path);
            assert_eq!((pair.left, pair.right), (given.left, given.right));
            let (a, b) = (pair.right_from_left, given.right_from_left);
            assert!(
                (a.rotation - b.rotation).amax() < 1e-12 && (a.translation - b.translation).amax() < 1e-12
            );
        }
    }
}

#[test]
fn ros_without_distortion_is_rectified() {
    let folder = Folder::new();
    let camera = CameraModel {
        focal_px: (400.0, 400.0),
        centre_px: (320.0, 240.0),
        distortion: Distortion::None,
        size: Some((640, 480)),
    };
    for (name, last) in [("left.yaml", 0.0), ("right.yaml", -40.0)] {
        let projection = [400.0, 0.0, 320.0, last, 0.0, 400.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let info = ros::CameraInfo { camera, rectification: Matrix3::identity(), projection };
        ros::write(&folder.file(name), &info).unwrap();
    }
    let read = calibration::read(folder.0.path()).unwrap();
    let expected = StereoRig::new(400.0, (320.0, 240.0), 0.1, (640, 480)).unwrap();
    assert_eq!(read, StereoCalibration::Rectified(expected));
    let path = folder.file("left.yaml");
    assert!(
        read.pair(CameraPair::Grey, (320, 240), &path)
            .unwrap_err()
            .to_string()
            .contains("is for 640x480 pixels, the images have 320x240")
    );
    fs::remove_file(folder.file("right.yaml")).unwrap();
    assert!(calibration::read(&path).unwrap_err().to_string().contains("name them left.yaml and right.yaml"));
}

#[test]
fn our_own_comes_back() {
    let folder = Folder::new();
    let file = folder.file("rig.toml");
    for lens in [Distortion::None, BROWN5, RATIONAL, FISHEYE] {
        let given = pair(lens);
        rig::write(&file, &StereoCalibration::Raw(given)).unwrap();
        assert_same(&given, &read_raw(&file));
    }
    let given = StereoRig {
        doffs_px: 1.0 / 3.0,
        focal_y_px: 401.5,
        ..StereoRig::new(400.0, (320.0, 240.0), 0.1, (640, 480)).unwrap()
    };
    rig::write(&file, &StereoCalibration::Rectified(given)).unwrap();
    assert_eq!(calibration::read(&file).unwrap(), StereoCalibration::Rectified(given));
    // The least that it can say, for images of any size.
    let short =
        folder.with("rig.toml", "# ours\nfocal_px = 400\ncx_px = 320\ncy_px = 240\nbaseline_m = 0.1\n");
    let read = calibration::read(&short).unwrap().pair(CameraPair::Grey, (640, 480), &short).unwrap();
    assert_eq!(
        (read.rig, read.rectification),
        (StereoRig::new(400.0, (320.0, 240.0), 0.1, (640, 480)).unwrap(), None)
    );
}

#[test]
fn kitti_raw_is_recognised_by_its_content() {
    let folder = Folder::new();
    let text = "calib_time: 09-Jan-2012 13:57:47\ncorner_dist: 9.950000e-02\nS_00: 1392 512\nP_rect_00: 721.5 0 609.6 0 0 721.5 172.9 0 0 0 1 0\nP_rect_01: 721.5 0 609.6 -387.6 0 721.5 172.9 0 0 0 1 0\n";
    let path = folder.with("anything", text);
    let pair = calibration::read(&path).unwrap().pair(CameraPair::Grey, (1242, 375), &path).unwrap();
    assert!((pair.rig.baseline_m - 387.6 / 721.5).abs() < 1e-12 && pair.rectification.is_none());
}

#[test]
fn what_is_wrong_is_named() {
    let toml = "right_from_left = [1, 0, 0, -0.1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n[left]\nfocal_px = [400, 400]\ncentre_px = [320, 240]\ndistortion = [-0.1, 0.01, 0, 0]\n[right]\nfocal_px = [400, 400]\ncentre_px = [320, 240]\n";
    let path = Path::new("rig.toml");
    let refused = |from: &str, to: &str| {
        assert!(toml.contains(from), "{from}");
        let text = toml.replacen(from, to, 1);
        let read = calibration::parse(&text, path).and_then(|c| c.pair(CameraPair::Grey, (640, 480), path));
        read.map(drop).unwrap_err().to_string()
    };
    for (from, to, expected) in [
        (
            "0.01, 0, 0]",
            "0.01, 0]",
            "rig.toml:5: left.distortion: 3 distortion coefficients; give k1 k2 p1 p2",
        ),
        ("-0.1, 0, 1", "-0.1, 0, 2", "rig.toml:1: right_from_left: is no rotation"),
        (", 1]\n[left]", "]\n[left]", "rig.toml:1: right_from_left: 15 numbers, not 16"),
        ("[right]", "[wrong]", "the key right is missing"),
        (
            "focal_px = [400, 400]",
            "focal_px = [0, 400]",
            "the left camera: focal length 0 px is not positive",
        ),
        ("focal_px = [400, 400]", "focal_px = 400", "rig.toml:3: left.focal_px: 1 numbers, not 2"),
        ("[320, 240]", "[320, nan]", "rig.toml:4: left.centre_px: NaN is not a finite number"),
        ("-0.1, 0, 1", "0.1, 0, 1", "left and right may be swapped"),
        ("-0.1, 0, 1", "-110, 0, 1", "110 m apart; is that in millimetres?"),
        ("[-0.1, 0.01", "[1e300, inf", "rig.toml:5: left.distortion: inf is not a finite number"),
        (
            "distortion = [",
            "size_px = [1920, 1080]\ndistortion = [",
            "is calibrated for 1920x1080 pixels, the images have 640x480",
        ),
        (
            "distortion = [",
            "distortion_model = \"tilted\"\ndistortion = [",
            "rig.toml:5: left.distortion_model: the distortion model \"tilted\" is not known",
        ),
        ("[left]", "[left", "rig.toml:2: is no TOML"),
    ] {
        let message = refused(from, to);
        assert!(message.contains(expected), "{from} -> {to}: {message}");
        assert!(message.starts_with("rig.toml"), "{message}");
    }
    for text in ["", "hello", "a: 1\n", "{", "<a/>", "<", "%YAML:1.0\n---\n", "- 1\n- 2\n", "\u{0}\u{1}"] {
        let error = calibration::parse(text, Path::new("c")).unwrap_err().to_string();
        assert!(error.starts_with('c') && error.contains("Kalibr"), "{text:?}: {error}");
    }
}
