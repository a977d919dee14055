//! A small recording: a rendered robot's drive as a folder of PNG files, calibration, time stamps and poses.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use egomotion::sim::{SensorNoise, Sequence};
use egomotion_io::image;
use egomotion_io::trajectory::kitti_row;
use tempfile::TempDir;

/// Number of frames.
pub const FRAMES: usize = 5;
/// Image size.
pub const SIZE: (usize, usize) = (320, 240);

/// The drive that was recorded.
pub fn drive() -> &'static Sequence {
    static DRIVE: OnceLock<Sequence> = OnceLock::new();
    DRIVE.get_or_init(|| Sequence::named("demo", Some(SIZE), Some(FRAMES), 1.0).unwrap())
}

/// The recording, rendered once; nobody may change it.
pub fn recording() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        // One place, written anew by each test run: a static is never dropped, and would leave its folder.
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("recording").join("drive");
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        write_recording(&folder);
        folder
    })
}

fn write_recording(folder: &Path) {
    let drive = drive();
    let noise = SensorNoise::default().with_seed(7);
    let [left, right] = ["image_0", "image_1"].map(|name| folder.join(name));
    for camera in [&left, &right] {
        fs::create_dir(camera).unwrap();
    }
    let (mut times, mut poses) = (String::new(), String::new());
    for k in 0..FRAMES {
        let images = noise.expose(&drive.view(k).unwrap().render(2), k as u64);
        let name = format!("{k:06}.png");
        image::write_grey(&left.join(&name), &images.left).unwrap();
        image::write_grey(&right.join(&name), &images.right).unwrap();
        times += &format!("{}\n", 100.0 + drive.interval_s * k as f64);
        poses += &format!("{}\n", kitti_row(&drive.world_from_left(k).unwrap()));
    }
    fs::write(folder.join("times.txt"), times).unwrap();
    fs::write(folder.join("poses.txt"), poses).unwrap();
    let (f, b) = (drive.rig.focal_px, drive.rig.baseline_m);
    fs::write(folder.join("calib.txt"), calibration(f, f, b)).unwrap();
}

/// A calibration file with these focal lengths and this baseline.
pub fn calibration(left_px: f64, right_px: f64, baseline_m: f64) -> String {
    let (cx, cy) = (drive().rig.cx_px, drive().rig.cy_px);
    let row = |f: f64, last: f64| format!("{f:?} 0 {cx} {last:?} 0 {f:?} {cy} 0 0 0 1 0");
    format!("P0: {}\nP1: {}\n", row(left_px, 0.0), row(right_px, -right_px * baseline_m))
}

/// A copy of the recording that a test may spoil, and a place for results beside it.
pub struct Copy {
    folder: TempDir,
}

impl Copy {
    /// All frames.
    pub fn new() -> Self {
        let folder = TempDir::new().unwrap();
        let source = folder.path().join("drive");
        for camera in ["image_0", "image_1"] {
            fs::create_dir_all(source.join(camera)).unwrap();
            for k in 0..FRAMES {
                let name = format!("{camera}/{k:06}.png");
                fs::copy(recording().join(&name), source.join(&name)).unwrap();
            }
        }
        for name in ["calib.txt", "times.txt", "poses.txt"] {
            fs::copy(recording().join(name), source.join(name)).unwrap();
        }
        Self { folder }
    }

    /// The folder of the sequence.
    pub fn source(&self) -> PathBuf {
        self.folder.path().join("drive")
    }

    /// A file of the sequence.
    pub fn file(&self, name: &str) -> PathBuf {
        self.source().join(name)
    }

    /// Where results go; it does not exist yet.
    pub fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }
}
