//! Cut, mutated and random input: every reader answers or gives a one-line error that names the file.
#![allow(missing_docs)]

use std::fs;
use std::io::Write as _;
use std::path::Path;

use ::image as image_crate;
use egomotion::geometry::{Distortion, Field, Gaussian, Grid, RigidMotion};
use egomotion_io::calibration::{
    self, Calibration, CameraModel, CameraPair, RawPair, StereoCalibration, euroc, kalibr, opencv, rig, ros,
};
use egomotion_io::motion_table::{self, Motion, MotionRow};
use egomotion_io::trajectory::{self, Pose};
use egomotion_io::{IoError, depth, disparity_png, flo, flow_png, image, npy, pfm, stream, tracks};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// What a reader makes of some content; an answer is as good as an error.
type Reader = fn(&[u8], &Path) -> Result<(), IoError>;

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
fn kinds() -> Vec<(&'static str, Vec<u8>, Reader, bool)> {
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
                let mut images = stream::ImageStream::new(c, stream::Kind::Png, p);
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
                let calibration = Calibration::parse(&String::from_utf8_lossy(c), p)?;
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
    let motion = Motion { phi, observed: [true; 6], rows: 900, inliers: 800 };
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

/// Run a reader; an error must be one line that starts with the file's name.
fn check(name: &str, content: &[u8], read: Reader) -> bool {
    match read(content, Path::new(name)) {
        Ok(()) => true,
        Err(error) => {
            let message = error.to_string();
            assert!(
                message.starts_with(name) && message.contains("; ") && !message.contains('\n'),
                "{message}"
            );
            false
        }
    }
}

#[test]
fn good_files_are_read() {
    for (name, content, read, _) in kinds() {
        assert!(check(name, &content, read), "{name}");
    }
}

#[test]
fn a_cut_file_is_an_error_at_every_sixteenth() {
    for (name, content, read, must_refuse) in kinds() {
        for sixteenth in 0..16 {
            let answered = check(name, &content[..content.len() * sixteenth / 16], read);
            assert!(!(answered && must_refuse), "{name} cut at {sixteenth}/16 was taken for whole");
        }
        // The last bytes too: a writer may be stopped anywhere.
        for cut in 1..24.min(content.len()) {
            let answered = check(name, &content[..content.len() - cut], read);
            assert!(!(answered && must_refuse), "{name} without its last {cut} bytes was taken for whole");
        }
    }
}

#[test]
fn mutated_files_do_not_panic() {
    let mut rng = Pcg64Mcg::seed_from_u64(2003);
    for (name, content, read, _) in kinds() {
        let mut answered = 0;
        for round in 0..1500 {
            let mut mutated = content.clone();
            // Half of the rounds hit the head, where sizes and keys stand.
            let reach = if round % 2 == 0 { mutated.len() } else { mutated.len().min(48) };
            for _ in 0..rng.random_range(1..4) {
                let at = rng.random_range(0..reach);
                mutated[at] = if name.ends_with("txt") {
                    b"0123456789.-+e \nPinfa:#"[rng.random_range(0..23)]
                } else {
                    rng.random()
                };
            }
            answered += usize::from(check(name, &mutated, read));
        }
        assert!(answered < 1500, "{name}: no mutation was noticed");
    }
}

#[test]
fn random_content_is_refused() {
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    for (name, _, read, _) in kinds() {
        for length in (0..400).step_by(3) {
            let noise: Vec<u8> = (0..length).map(|_| rng.random()).collect();
            assert!(!check(name, &noise, read), "{name}");
        }
    }
}

#[test]
fn damaged_sizes_in_intact_chunks_do_not_panic() {
    // Check sums hide the head of a PNG from plain mutations, so they are mended here.
    let mut rng = Pcg64Mcg::seed_from_u64(11);
    for (name, content, read, _) in kinds().into_iter().filter(|kind| kind.0.ends_with("png")) {
        for _ in 0..400 {
            let mut mutated = content.clone();
            let at = rng.random_range(16..29);
            mutated[at] = if rng.random() { rng.random_range(0..20) } else { rng.random() };
            let sum = crc32(&mutated[12..29]).to_be_bytes();
            mutated[29..33].copy_from_slice(&sum);
            check(name, &mutated, read);
        }
    }
}

/// The check sum of a PNG chunk, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
    let over = |crc, byte: &u8| (0..8).fold(crc ^ u32::from(*byte), |c, _| step(c));
    !bytes.iter().fold(!0, over)
}

#[test]
fn files_that_cannot_be_read_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("none.png");
    assert!(image::read(&missing).unwrap_err().to_string().contains("none.png: cannot read"));
    assert!(image::size(&missing).unwrap_err().to_string().contains("check the path"));
    assert!(image::read(folder.path()).is_err());
    let binary = folder.path().join("calib.txt");
    fs::write(&binary, [0xff, 0xfe, 0x00]).unwrap();
    assert!(Calibration::read(&binary).unwrap_err().to_string().contains("calib.txt: is not a text file"));
}
