//! A good file of every kind, beside the reader and the fuzz target that take it.

use std::fs;
use std::io::Write as _;
use std::path::Path;

use ::image as image_crate;
use egomotion::geometry::{Distortion, Field, Gaussian, Grid, RigidMotion};
use egomotion_io::calibration::{
    self, CameraModel, CameraPair, KittiCalibration, RawPair, StereoCalibration, euroc, kalibr, opencv, rig,
    ros,
};
use egomotion_io::motion_table::{self, EstimatedMotion, MotionRow};
use egomotion_io::trajectory::{self, Pose};
use egomotion_io::{IoError, depth, disparity_png, flo, flow_png, image, npy, pfm, stream, tracks};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// What a reader makes of some content; an answer is as good as an error.
pub type Reader = fn(&[u8], &Path) -> Result<(), IoError>;

/// A `.npy` of f64 as NumPy writes it.
fn npy_file(shape: &[usize]) -> Vec<u8> {
    let sides: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let head = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({sides}), }}\n");
    let count: usize = shape.iter().product();
    let values: Vec<u8> = (0..count).flat_map(|i| (i as f64 + 1.0).to_le_bytes()).collect();
    [b"\x93NUMPY\x01\x00", (head.len() as u16).to_le_bytes().as_slice(), head.as_bytes(), &values].concat()
}

/// An `.npz` with tracks.
fn npz_file() -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, shape) in
        [("features", vec![4, 5, 3]), ("K", vec![3, 3]), ("b", vec![1]), ("time_stamps", vec![3])]
    {
        let options = zip::write::SimpleFileOptions::default();
        archive.start_file(format!("{name}.npy"), options).unwrap();
        archive.write_all(&npy_file(&shape)).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

/// A good file of every kind, its reader, and whether the reader must refuse every cut of it.
pub fn kinds() -> Vec<(&'static str, Vec<u8>, Reader, bool)> {
    let folder = tempfile::tempdir().unwrap();
    let written = |write: &dyn Fn(&Path)| {
        let path = folder.path().join("file");
        write(&path);
        fs::read(path).unwrap()
    };
    let field = || Field::from_grid(Grid::from_fn(23, 17, |u, v| ((u * v) % 7) as f32 + 0.25 * u as f32));
    let poses = [Pose { time_s: Some(1.25), world_from_camera: RigidMotion::identity() }; 5];
    let pair = raw_pair();
    let whole: Reader = |c, p| {
        let calibration = calibration::parse(&String::from_utf8_lossy(c), p)?;
        calibration.pair(CameraPair::Grey, (8, 6), p).map(|pair| assert!(pair.rig.check().is_ok()))
    };
    let calibration = b"P0: 700 0 600 0 0 700 180 0 0 0 1 0\nP1: 700 0 600 -350 0 700 180 0 0 0 1 0\n";
    vec![
        (
            "grey.png",
            written(&|p| image::write_grey(p, field().grid()).unwrap()),
            |c, p| image::decode(c, p).map(drop),
            true,
        ),
        (
            "rgb.png",
            written(&|p| image::write_rgb(p, &Grid::from_fn(19, 11, |u, v| [u as u8, v as u8, 7])).unwrap()),
            |c, p| image::decode(c, p).map(drop),
            true,
        ),
        (
            "d.png",
            written(&|p| disparity_png::write(p, &field()).unwrap()),
            |c, p| disparity_png::decode(c, p).map(drop),
            true,
        ),
        (
            "f.png",
            written(&|p| flow_png::write(p, &[field(), field()]).unwrap()),
            |c, p| flow_png::decode(c, p).map(drop),
            true,
        ),
        (
            "depth.png",
            written(&|p| disparity_png::write(p, &field()).unwrap()),
            |c, p| depth::decode_png(c, 5000.0, p).map(drop),
            true,
        ),
        ("a.npy", npy_file(&[3, 4, 2]), |c, p| npy::decode(c, p).map(drop), true),
        ("t.npz", npz_file(), |c, p| tracks::decode_npz(c, p).map(drop), true),
        (
            "t.csv",
            b"frame,track,u_left,v_left,u_right,v_right,time_s\n0,1,2.5,3,1,3,0.1\n1,1,2.6,3,1.2,3,0.2\n"
                .to_vec(),
            |c, p| tracks::parse_csv(&String::from_utf8_lossy(c), p).map(drop),
            false,
        ),
        (
            "m.pfm",
            written(&|p| pfm::write(p, field().grid()).unwrap()),
            |c, p| pfm::decode(c, p).map(drop),
            true,
        ),
        (
            "f.flo",
            written(&|p| flo::write(p, &[field(), field()]).unwrap()),
            |c, p| flo::decode(c, p).map(drop),
            true,
        ),
        (
            "grey.jpg",
            encoded(image_crate::ImageFormat::Jpeg),
            |c, p| image::decode(c, p).map(drop),
            // A JPEG's decoder fills up what is lost at the end.
            false,
        ),
        ("grey.tif", encoded(image_crate::ImageFormat::Tiff), |c, p| image::decode(c, p).map(drop), true),
        ("grey.pgm", encoded(image_crate::ImageFormat::Pnm), |c, p| image::decode(c, p).map(drop), true),
        (
            "stream.png",
            [0, 1].map(|_| written(&|p| image::write_grey(p, field().grid()).unwrap())).concat(),
            |c, p| {
                let mut images = stream::ImageStream::new(c, stream::StreamFormat::Png, p);
                // Something must come of it, and a stream may end after any image.
                let first = images.next_image()?.ok_or_else(|| IoError::new(p, "is empty", "give images"))?;
                assert!(first.width() > 0);
                while images.next_image()?.is_some() {}
                Ok(())
            },
            false,
        ),
        (
            "motion.txt",
            motion_table::text(&[motion_row(), motion_row()]).into_bytes(),
            |c, p| motion_table::parse(&String::from_utf8_lossy(c), p).map(drop),
            false,
        ),
        (
            "euroc_poses.txt",
            written(&|p| trajectory::write_euroc(p, &poses).unwrap()),
            |c, p| trajectory::parse(&String::from_utf8_lossy(c), None, p).map(drop),
            false,
        ),
        (
            "tum.txt",
            written(&|p| trajectory::write_tum(p, &poses).unwrap()),
            |c, p| trajectory::parse(&String::from_utf8_lossy(c), None, p).map(drop),
            false,
        ),
        (
            "kitti.txt",
            written(&|p| trajectory::write_kitti(p, &poses).unwrap()),
            |c, p| trajectory::parse(&String::from_utf8_lossy(c), None, p).map(drop),
            false,
        ),
        (
            "calib.txt",
            calibration.to_vec(),
            |c, p| {
                let calibration = KittiCalibration::parse(&String::from_utf8_lossy(c), p)?;
                calibration.left_centre(CameraPair::Grey)?;
                calibration.rig(CameraPair::Grey, (1242, 375)).map(|rig| assert!(rig.check().is_ok()))
            },
            false,
        ),
        ("kalibr.txt", written(&|p| kalibr::write(p, &pair).unwrap()), whole, false),
        ("opencv_yaml.txt", written(&|p| opencv::write_yaml(p, &pair).unwrap()), whole, false),
        ("opencv_xml.txt", written(&|p| opencv::write_xml(p, &pair).unwrap()), whole, false),
        ("rig.txt", written(&|p| rig::write(p, &StereoCalibration::Raw(pair)).unwrap()), whole, false),
        (
            "euroc.txt",
            written(&|p| euroc::write(p, &pair.left, &pair.right_from_left).unwrap()),
            |c, p| euroc::parse(&String::from_utf8_lossy(c), p).map(drop),
            false,
        ),
        (
            "ros.txt",
            written(&|p| {
                let camera = CameraModel { size: Some((8, 6)), ..pair.left };
                let info =
                    ros::CameraInfo { camera, rectification: Matrix3::identity(), projection: [0.5; 12] };
                ros::write(p, &info).unwrap();
            }),
            |c, p| ros::parse(&String::from_utf8_lossy(c), p).map(drop),
            false,
        ),
    ]
}

/// A small picture in another format.
fn encoded(format: image_crate::ImageFormat) -> Vec<u8> {
    let picture = image_crate::GrayImage::from_fn(23, 17, |u, v| image_crate::Luma([(5 * u + 3 * v) as u8]));
    let mut content = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut content, format).unwrap();
    content.into_inner()
}

fn motion_row() -> MotionRow {
    let phi = Gaussian { mean: Vector6::new(0.1, 0.2, -1.0, 1e-3, 2e-3, 0.0), cov: Matrix6::identity() };
    let motion = EstimatedMotion { phi, own: Some(phi.cov), observed: [true; 6], rows: 900, inliers: 800 };
    MotionRow {
        frame: 7,
        time_s: 0.7,
        dt_s: Some(0.1),
        motion: Some(motion),
        impact_s: Some([2.0, 1.5, 3.0]),
        status: "ok".into(),
    }
}

/// Two cameras for images of any size.
fn raw_pair() -> RawPair {
    let distortion = Distortion::RadialTangential { k: [-0.28, 0.07, 0.0], p: [1e-4, 2e-5] };
    let camera = CameraModel { focal_px: (40.0, 41.0), centre_px: (3.5, 2.5), distortion, size: None };
    let right_from_left =
        RigidMotion { rotation: Matrix3::identity(), translation: Vector3::new(-0.1, 0.0, 0.0) };
    RawPair { left: camera, right: camera, right_from_left, body_from_left: None }
}

/// The fuzz target that a kind of file is a seed of.
pub fn target(name: &str) -> &str {
    match name {
        "d.png" => "disparity_png",
        "f.png" => "flow_png",
        "depth.png" => "depth",
        "stream.png" => "stream",
        "a.npy" => "npy",
        "t.npz" => "npz",
        "t.csv" => "tracks",
        "m.pfm" => "pfm",
        "f.flo" => "flo",
        "motion.txt" => "motion_table",
        "tum.txt" | "kitti.txt" | "euroc_poses.txt" => "trajectory",
        _ if name.ends_with("txt") => "calibration",
        _ => "image",
    }
}
