//! The files of a rendered sequence; each appears whole or not at all.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use egomotion::geometry::{Grid, RigidMotion, Twist};
use serde::Serialize;

use super::{SceneSetup, Simulation};
use crate::calibration::kitti;
use crate::maps::{flo, pfm};
use crate::tables::trajectory::{Pose, write_kitti, write_tum};
use crate::{IoError, image, write};

/// A folder that a rendered sequence goes to: KITTI odometry's layout, and the truth beside it.
#[derive(Debug)]
pub struct SequenceFolder {
    path: PathBuf,
}

/// Folders with one file for each frame, and the extension of the files. Depth velocity and flow have none for the last
/// frame.
const FRAME_FOLDERS: [(&str, &str); 7] = [
    ("image_0", "png"),
    ("image_1", "png"),
    ("truth/disparity", "pfm"),
    ("truth/depth", "pfm"),
    ("truth/visible", "png"),
    ("truth/depth_velocity", "pfm"),
    ("truth/flow", "flo"),
];

/// Files about all frames together.
const SEQUENCE_FILES: [&str; 4] = ["times.txt", "poses.txt", "truth/trajectory_tum.txt", "truth/motion.toml"];

/// `truth/motion.toml`.
#[derive(Serialize)]
struct MotionFile<'a> {
    sequence: &'a str,
    step: f64,
    frames: usize,
    interval_s: f64,
    motion: Vec<TrueMotion>,
}

/// The motion that ends at a frame.
#[derive(Serialize)]
struct TrueMotion {
    frame: usize,
    phi_left: [f64; 6],
    phi_cyclopean: [f64; 6],
}

/// Comment at the head of `truth/motion.toml`.
const MOTION_HEAD: &str = "\
# Motion of the scene from the frame before to `frame`: tX, tY, tZ (metres) and ΩX, ΩY, ΩZ (radians) of φ, with
# P' = R P + T and (R, T) = exp(φ). The camera moves by the inverse. X right, Y down, Z forward.
";

/// Comment at the head of `scene.toml`.
const SCENE_HEAD: &str = "\
# Where the sequence takes place, and what sees it: egomotion simulate --sequence NAME --scene THIS_FILE.
# The world's frame is that of the cyclopean camera, in the middle between left and right, at frame 0.
";

impl SequenceFolder {
    /// Make the folders, and take away what will be written anew, so that an interrupted run leaves no mixture.
    ///
    /// # Errors
    /// The folder cannot be made, or holds frames of a longer sequence.
    pub fn create(path: &Path, frames: usize) -> Result<Self, IoError> {
        for (name, _) in FRAME_FOLDERS {
            write::folder(&path.join(name))?;
        }
        let folder = Self { path: path.to_owned() };
        folder.refuse_longer(frames)?;
        let each = FRAME_FOLDERS
            .iter()
            .flat_map(|(name, extension)| (0..frames).map(|k| folder.file(name, k, extension)));
        for file in each.chain(SEQUENCE_FILES.map(|name| path.join(name))) {
            match std::fs::remove_file(&file) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                    return Err(IoError::system(&file, "replace", &error));
                }
                _ => {}
            }
        }
        Ok(folder)
    }

    /// Frames of a longer sequence would be read as if they belonged to this one.
    fn refuse_longer(&self, frames: usize) -> Result<(), IoError> {
        for (name, _) in FRAME_FOLDERS {
            let folder = self.path.join(name);
            let failed = |error| IoError::system(&folder, "list", &error);
            for entry in folder.read_dir().map_err(failed)? {
                let file = entry.map_err(failed)?.path();
                let number = file.file_stem().and_then(|stem| stem.to_str()?.parse::<usize>().ok());
                if number.is_some_and(|number| number >= frames) {
                    let reason = format!("is not of this sequence of {frames} frames");
                    return Err(IoError::new(&file, reason, "remove the folder or choose another one"));
                }
            }
        }
        Ok(())
    }

    fn file(&self, folder: &str, k: usize, extension: &str) -> PathBuf {
        self.path.join(folder).join(format!("{k:06}.{extension}"))
    }

    /// `calib.txt` and `scene.toml`.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write_scene(&self, simulation: &Simulation) -> Result<(), IoError> {
        kitti::write_grey_pair(&self.path.join("calib.txt"), &simulation.sequence.rig)?;
        let scene = SceneSetup {
            rig: Some(simulation.sequence.rig),
            sensor: Some(simulation.sensor),
            scene: simulation.sequence.scene.clone(),
        };
        self.write_toml("scene.toml", SCENE_HEAD, &scene)
    }

    /// The images and the maps of frame `k`.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write_frame(&self, simulation: &Simulation, k: usize) -> Result<(), IoError> {
        let missing =
            || IoError::new(&self.path, format_args!("there is no frame {k}"), "take a smaller number");
        let (view, images) = simulation.sequence.view(k).zip(simulation.photograph(k)).ok_or_else(missing)?;
        // The last frame has no motion to a later one, even where the sequence would go on.
        let phi = simulation.sequence.phi(k).filter(|_| k + 1 < simulation.frames);
        let truth = view.truth_maps(phi.as_ref());
        image::write_grey(&self.file("image_0", k, "png"), &images.left)?;
        image::write_grey(&self.file("image_1", k, "png"), &images.right)?;
        pfm::write(&self.file("truth/disparity", k, "pfm"), truth.shift.grid())?;
        pfm::write(&self.file("truth/depth", k, "pfm"), truth.depth.grid())?;
        let (width, height) = truth.visible.size();
        let bits = Grid::from_fn(width, height, |u, v| f32::from(truth.visible.at(u, v)));
        image::write_grey(&self.file("truth/visible", k, "png"), &bits)?;
        if phi.is_some() {
            pfm::write(&self.file("truth/depth_velocity", k, "pfm"), truth.depth_velocity.grid())?;
            flo::write(&self.file("truth/flow", k, "flo"), &truth.flow)?;
        }
        Ok(())
    }

    /// Time stamps, poses and motions of the first `frames` frames.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write_course(&self, simulation: &Simulation, frames: usize) -> Result<(), IoError> {
        let sequence = &simulation.sequence;
        // Every sequence has a frame.
        let first = sequence.world_from_left(0).unwrap_or(RigidMotion::identity()).inverse();
        let pose = |k: usize| {
            let world_from_camera = first.after(&sequence.world_from_left(k)?);
            Some(Pose { time_s: Some(k as f64 * sequence.interval_s), world_from_camera })
        };
        let poses: Vec<Pose> = (0..frames).map_while(pose).collect();
        let mut times = String::new();
        for time_s in poses.iter().filter_map(|pose| pose.time_s) {
            let _ = writeln!(times, "{time_s}");
        }
        write::bytes(&self.path.join("times.txt"), times.as_bytes())?;
        write_kitti(&self.path.join("poses.txt"), &poses)?;
        write_tum(&self.path.join("truth/trajectory_tum.txt"), &poses)?;
        let row = |k: usize| {
            let numbers = |phi: Twist| phi.vector().into();
            let (left, cyclopean) = (sequence.phi(k)?, sequence.phi_cyclopean(k)?);
            Some(TrueMotion { frame: k + 1, phi_left: numbers(left), phi_cyclopean: numbers(cyclopean) })
        };
        let motion = MotionFile {
            sequence: &sequence.name,
            step: simulation.step,
            frames,
            interval_s: sequence.interval_s,
            motion: (0..frames.saturating_sub(1)).map_while(row).collect(),
        };
        self.write_toml("truth/motion.toml", MOTION_HEAD, &motion)
    }

    fn write_toml(&self, name: &str, head: &str, value: &impl Serialize) -> Result<(), IoError> {
        let path = self.path.join(name);
        let failed =
            |error| IoError::new(&path, format_args!("cannot be put into TOML: {error}"), "report this");
        let text = toml::to_string(value).map_err(failed)?;
        write::bytes(&path, format!("{head}\n{text}").as_bytes())
    }
}
