//! The same drive in other forms gives the same motion: plain folders, images side by side, a stream, KITTI's raw
//! layout; and pairs of one time give disparity.

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use egomotion::geometry::{Grid, Image};
use egomotion_io::motion_table::{self, MotionRow};
use egomotion_io::{image, npy};
use serde_json::Value;
use tempfile::TempDir;

use crate::process::{Ended, assert_refused, egomotion, run, try_run};
use crate::recording::{FRAMES, drive, recording};

/// Images of the recording: left and right of each frame.
fn images() -> Vec<(Image, Image)> {
    let read = |camera: usize, k: usize| {
        image::read(&recording().join(format!("image_{camera}/{k:06}.png"))).unwrap()
    };
    (0..FRAMES).map(|k| (read(0, k), read(1, k))).collect()
}

/// The drive's `rig.toml`, and more.
fn rig_toml(more: &str) -> String {
    let rig = &drive().rig;
    let rate = drive().interval_s.recip();
    format!(
        "focal_px = {:?}\ncx_px = {:?}\ncy_px = {:?}\nbaseline_m = {:?}\nrate_hz = {rate:?}\n{more}",
        rig.focal_px, rig.cx_px, rig.cy_px, rig.baseline_m
    )
}

fn rows(out: &Path) -> Vec<MotionRow> {
    motion_table::read(&out.join("motion.csv")).unwrap()
}

/// φ of a run of the recording as it is.
fn usual(options: &str) -> Vec<MotionRow> {
    let out = TempDir::new().unwrap();
    run(recording(), out.path(), options);
    rows(out.path())
}

/// Two tables say the same of the motion; times may begin elsewhere.
fn assert_same(found: &[MotionRow], expected: &[MotionRow]) {
    assert_eq!((found.len(), expected.len()), (FRAMES - 1, FRAMES - 1));
    for (found, expected) in found.iter().zip(expected) {
        let (a, b) = (found.motion.as_ref().unwrap(), expected.motion.as_ref().unwrap());
        // Other time stamps are rounded otherwise.
        assert!(
            (a.phi.mean - b.phi.mean).amax() < 1e-9 && (a.phi.cov - b.phi.cov).amax() < 1e-12,
            "{a:?} {b:?}"
        );
        assert_eq!((a.observed, a.rows, a.inliers), (b.observed, b.rows, b.inliers));
        assert!((found.dt_s.unwrap() - expected.dt_s.unwrap()).abs() < 1e-9);
    }
}

#[test]
fn plain_folders_with_any_kind_of_images() {
    let expected = usual("--observe sparse");
    for ending in ["png", "pgm", "tif"] {
        let folder = TempDir::new().unwrap();
        for (k, (left, right)) in images().iter().enumerate() {
            for (side, picture) in [("left", left), ("right", right)] {
                let place = folder.path().join(side);
                fs::create_dir_all(&place).unwrap();
                // Names need not be alike: their numbers say what belongs together.
                write_as(&place.join(format!("{side}-{k}.{ending}")), picture);
            }
        }
        fs::write(folder.path().join("rig.toml"), rig_toml("")).unwrap();
        let out = TempDir::new().unwrap();
        run(folder.path(), out.path(), "--observe sparse");
        assert_same(&rows(out.path()), &expected);
        let info = egomotion(["info".as_ref(), folder.path().as_os_str()]).stdout;
        assert!(info.contains("plain folder (it holds the folders left and right)"), "{info}");
    }
}

#[test]
fn sixteen_bits_are_finer_levels_of_the_same_grey() {
    let motions = |ending: &str, options: &str, write: fn(&Path, &Image)| {
        let folder = TempDir::new().unwrap();
        for (k, (left, right)) in images().iter().enumerate() {
            for (side, picture) in [("left", left), ("right", right)] {
                let place = folder.path().join(side);
                fs::create_dir_all(&place).unwrap();
                write(&place.join(format!("{k}.{ending}")), picture);
            }
        }
        fs::write(folder.path().join("rig.toml"), rig_toml("")).unwrap();
        let out = TempDir::new().unwrap();
        run(folder.path(), out.path(), options);
        rows(out.path())
    };
    for (ending, options) in [("png", ""), ("tif", "--observe sparse")] {
        assert_same(&motions(ending, options, write_wide), &motions(ending, options, write_as));
    }
}

/// A picture with 65535 in place of 255.
fn write_wide(path: &Path, picture: &Image) {
    let (width, height) = (picture.width() as u32, picture.height() as u32);
    let levels: Vec<u16> = picture.values().iter().map(|&level| 257 * level as u16).collect();
    if path.extension().is_some_and(|ending| ending == "tif") {
        let wide = ::image::ImageBuffer::<::image::Luma<u16>, _>::from_raw(width, height, levels);
        return wide.unwrap().save(path).unwrap();
    }
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let bytes: Vec<u8> = levels.into_iter().flat_map(u16::to_be_bytes).collect();
    encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
}

fn write_as(path: &Path, picture: &Image) {
    if path.extension().is_some_and(|ending| ending == "png") {
        return image::write_grey(path, picture).unwrap();
    }
    let (width, height) = picture.size();
    let levels = picture.values().iter().map(|&level| level as u8).collect();
    ::image::GrayImage::from_raw(width as u32, height as u32, levels).unwrap().save(path).unwrap();
}

#[test]
fn images_side_by_side() {
    let folder = TempDir::new().unwrap();
    for (k, (left, right)) in images().iter().enumerate() {
        image::write_grey(&folder.path().join(format!("{k}.png")), &beside(left, right)).unwrap();
    }
    fs::write(folder.path().join("rig.toml"), rig_toml("side_by_side = true\n")).unwrap();
    let out = TempDir::new().unwrap();
    run(folder.path(), out.path(), "--observe sparse");
    assert_same(&rows(out.path()), &usual("--observe sparse"));
    // Without that word they are images of one camera.
    fs::write(folder.path().join("rig.toml"), rig_toml("")).unwrap();
    let ended = try_run(folder.path(), out.path(), "");
    assert_refused(&ended, 1, &["holds images of one camera"]);
    fs::write(folder.path().join("rig.toml"), "side_by_side = 3\n").unwrap();
    assert_refused(&try_run(folder.path(), out.path(), ""), 1, &["rig.toml:1: "]);
}

fn beside(left: &Image, right: &Image) -> Image {
    let (width, height) = left.size();
    Grid::from_fn(2 * width, height, |u, v| if u < width { left.at(u, v) } else { right.at(u - width, v) })
}

#[test]
fn images_beside_depth() {
    let folder = TempDir::new().unwrap();
    for name in ["rgb", "depth"] {
        fs::create_dir(folder.path().join(name)).unwrap();
    }
    for (k, (left, _)) in images().iter().enumerate() {
        image::write_grey(&folder.path().join(format!("rgb/{k}.png")), left).unwrap();
        let truth = drive().view(k).unwrap().truth_maps(None);
        npy::write(&folder.path().join(format!("depth/{k}.npy")), truth.depth.grid()).unwrap();
    }
    fs::write(folder.path().join("rig.toml"), rig_toml("depth_sensor = \"exact\"\n")).unwrap();
    let out = TempDir::new().unwrap();
    let ended = run(folder.path(), out.path(), "");
    assert!(ended.stdout.contains("4 of 4 motions answered"), "{}", ended.stdout);
    let refused = try_run(folder.path(), out.path(), "--frame right");
    assert_refused(&refused, 2, &["a depth camera has no other beside it", "--frame"]);
    // Exact depth beside noisy images: as good as stereo, whose motion is within .03 mm.
    for (found, stereo) in rows(out.path()).iter().zip(usual("")) {
        let (found, stereo) = (found.motion.as_ref().unwrap().phi.mean, stereo.motion.unwrap().phi.mean);
        assert!((found - stereo).fixed_rows::<3>(0).norm() < 2e-4, "{found} {stereo}");
        assert!((found - stereo).fixed_rows::<3>(3).norm() < 1e-4, "{found} {stereo}");
    }
}

/// Run with something on standard input, and what came out.
fn piped(content: &[u8], out: &Path, options: &[&str]) -> Ended {
    let calibration = recording().join("calib.txt");
    let mut child = Command::new(env!("CARGO_BIN_EXE_egomotion"))
        .args(["run", "-", "--calibration", calibration.to_str().unwrap(), "--out", out.to_str().unwrap()])
        .args(options)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let content = content.to_vec();
    let writer = std::thread::spawn(move || {
        let _ = stdin.write_all(&content);
    });
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    Ended::of(output)
}

#[test]
fn a_stream_answers_frame_by_frame() {
    let rate = format!("{:?}", drive().interval_s.recip());
    let png: Vec<u8> = (0..FRAMES)
        .flat_map(|k| {
            [0, 1].map(|camera| fs::read(recording().join(format!("image_{camera}/{k:06}.png"))).unwrap())
        })
        .flatten()
        .collect();
    let raw = |side_by_side: bool| -> Vec<u8> {
        let levels = |image: &Image| image.values().iter().map(|&level| level as u8).collect::<Vec<_>>();
        let of = |(left, right): &(Image, Image)| {
            if side_by_side { levels(&beside(left, right)) } else { [levels(left), levels(right)].concat() }
        };
        images().iter().flat_map(of).collect()
    };
    let expected = usual("--observe sparse");
    for (content, options) in [
        (png.clone(), vec![]),
        (raw(false), vec!["--raw", "320x240"]),
        (raw(true), vec!["--raw", "640x240", "--side-by-side"]),
    ] {
        let out = TempDir::new().unwrap();
        let ended =
            piped(&content, out.path(), &[&["--observe", "sparse", "--rate", &rate], &options[..]].concat());
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        let lines: Vec<Value> =
            ended.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        let statuses: Vec<&str> = lines.iter().map(|line| line["status"].as_str().unwrap()).collect();
        assert_eq!(statuses, ["first", "ok", "ok", "ok", "ok"]);
        assert_same(&rows(out.path()), &expected);
        for (line, row) in lines[1..].iter().zip(&expected) {
            let phi = &row.motion.as_ref().unwrap().phi;
            assert!((line["phi"][2].as_f64().unwrap() - phi.mean[2]).abs() < 1e-9);
            assert!((line["cov"][2][2].as_f64().unwrap() - phi.cov[(2, 2)]).abs() < 1e-12);
        }
    }
    // Lines hold what motion.csv holds, of the camera that was asked for.
    let out = TempDir::new().unwrap();
    let ended = piped(&png, out.path(), &["--observe", "sparse", "--rate", &rate, "--frame", "right"]);
    let lines = ended.stdout.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    for ((line, row), left) in lines.skip(1).zip(rows(out.path())).zip(&expected) {
        let [phi, left] = [row.motion.as_ref(), left.motion.as_ref()].map(|motion| motion.unwrap().phi);
        assert!((line["phi"][2].as_f64().unwrap() - phi.mean[2]).abs() < 1e-12);
        assert!((line["cov"][0][0].as_f64().unwrap() - phi.cov[(0, 0)]).abs() < 1e-15);
        assert!((phi.mean[2] - left.mean[2]).abs() > 1e-5, "{} {}", phi.mean[2], left.mean[2]);
    }
    // Cut in the last image: what was whole is answered, and the cut frame is named.
    let out = TempDir::new().unwrap();
    let ended = piped(&png[..png.len() - 9], out.path(), &["--observe", "sparse"]);
    assert!(ended.stderr.contains("frame 4: standard input: ends inside image 9"), "{}", ended.stderr);
    assert_eq!(rows(out.path()).last().unwrap().status, "bad_image");
    assert_refused(&piped(b"", out.path(), &[]), 1, &["standard input: holds no frame"]);
    assert_refused(&piped(b"GIF89a, and so on", out.path(), &[]), 1, &["standard input: image 0 is no PNG"]);
    assert_eq!(egomotion(["run", "-"]).code, 2);
}

#[test]
fn pairs_of_one_time_give_disparity() {
    let folder = TempDir::new().unwrap();
    let (left, right) = &images()[0];
    for name in ["one", "two"] {
        fs::create_dir(folder.path().join(name)).unwrap();
        image::write_grey(&folder.path().join(name).join("im2.png"), left).unwrap();
        image::write_grey(&folder.path().join(name).join("im6.png"), right).unwrap();
        let truth = drive().view(0).unwrap().truth_maps(None);
        let levels = Grid::from_fn(320, 240, |u, v| 2.0 * truth.shift.get(u, v).unwrap_or(0.0));
        image::write_grey(&folder.path().join(name).join("disp2.png"), &levels).unwrap();
    }
    fs::write(folder.path().join("datasets.xml"), "<datasets>\n one \"2\" \"0\"\n</datasets>\n").unwrap();
    let out = TempDir::new().unwrap();
    let ended = run(folder.path(), out.path(), "--maps-as npy,kitti,colour");
    assert_eq!(ended.stdout.matches("disparity in pixels, for want of a calibration, no motion").count(), 2);
    let summary: Value =
        serde_json::from_slice(&fs::read(out.path().join("one/summary.json")).unwrap()).unwrap();
    assert_eq!((&summary["status"], &summary["counts"]["no_motion"]), (&"no_motion".into(), &1.into()));
    assert_eq!(summary["rig"], Value::Null);
    let found = &summary["disparity"];
    // Levels of half a pixel: the truth itself is good to a quarter.
    assert!(
        found["bad_1px"].as_f64().unwrap() < 0.05 && found["pixels"].as_u64().unwrap() > 70_000,
        "{found}"
    );
    assert_eq!(
        rows(&out.path().join("two")).iter().map(|row| row.status.as_str()).collect::<Vec<_>>(),
        ["no_motion"]
    );
    let two: Value = serde_json::from_slice(&fs::read(out.path().join("two/summary.json")).unwrap()).unwrap();
    assert!(two.get("disparity").is_none(), "no scale is known for two");
    for file in [
        "disparity/000000.npy",
        "disparity/000000.png",
        "disparity/000000.colour.png",
        "disparity_sigma/000000.npy",
    ] {
        assert!(out.path().join("one").join(file).is_file(), "{file}");
    }
    // One broken pair does not end the others.
    fs::write(folder.path().join("one/im6.png"), "no image").unwrap();
    let ended = run(folder.path(), out.path(), "");
    assert!(
        ended.stderr.contains("one: ") && ended.stdout.contains("two: a pair of one time"),
        "{}",
        ended.stderr
    );
}
