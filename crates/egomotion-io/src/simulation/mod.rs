//! A rendered sequence on the disk: a named motion, in its own scene or that of a file, seen by a sensor, with its exact
//! truth.

mod folder;

use std::path::{Path, PathBuf};

use egomotion::geometry::{RigErrors, StereoRig};
use egomotion::sim::{Scene, SensorNoise, Sequence};
use serde::{Deserialize, Serialize};

use crate::{IoError, OptionsError, read};
pub use folder::SequenceFolder;

/// Rays along each side of a pixel that shows an edge, 9 for each of them: more make edges smoother and rendering slower.
const RAYS_ACROSS_PIXEL: usize = 3;

/// Pixels along each side of the grid that is looked at for surfaces: 64 pixels, enough to tell a quarter of an image.
const SAMPLES_ACROSS: usize = 8;

/// The most pixels of an image that is rendered, 2²⁵, 8K: a bound on memory and time.
const MAX_PIXELS: usize = 1 << 25;

/// Which sequence is rendered, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulationOptions {
    /// Name of the motion and its scene, one of [`Sequence::names`].
    pub sequence: String,
    /// Factor of every motion.
    pub step: f64,
    /// Number of frames; `None` is the sequence's own.
    pub frames: Option<usize>,
    /// Width and height of the images, in pixels; `None` is the sequence's own.
    pub size_px: Option<(usize, usize)>,
    /// Whether the cameras add noise; `None` is as the scene's file says, or yes.
    pub noise: Option<bool>,
    /// Seed of that noise; `None` is the scene's file's, or 0.
    pub seed: Option<u64>,
    /// Seed of the texture on every surface; `None` is the scene's own.
    pub texture: Option<u64>,
    /// A file with a scene, and perhaps rig and sensor, in place of the sequence's own: a `scene.toml`.
    pub scene: Option<PathBuf>,
    /// By how much the rig that takes the images differs from the one that the files state.
    pub rig_errors: RigErrors,
}

impl SimulationOptions {
    /// A sequence as it is by itself.
    pub fn named(sequence: &str) -> Self {
        let sequence = sequence.to_owned();
        Self {
            sequence,
            step: 1.0,
            frames: None,
            size_px: None,
            noise: None,
            seed: None,
            texture: None,
            scene: None,
            rig_errors: RigErrors::default(),
        }
    }
}

/// A sequence to be rendered.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// The motion in its scene.
    pub sequence: Sequence,
    /// What the cameras add.
    pub sensor: SensorNoise,
    /// Number of frames: those in which the cameras stay clear of everything.
    pub frames: usize,
    /// Factor of every motion of the named sequence.
    pub step: f64,
    /// What a user should know about it, each in one line.
    pub warnings: Vec<String>,
}

/// `scene.toml`: where the sequence takes place, and what sees it.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneSetup {
    /// Without one, the sequence's own.
    rig: Option<StereoRig>,
    /// Without one, what the options say.
    sensor: Option<SensorNoise>,
    scene: Scene,
}

impl Simulation {
    /// The sequence that the options ask for, ready to be rendered.
    ///
    /// # Errors
    /// There is no such sequence, or no such image; the scene's file is wrong; the cameras would leave the room at once.
    pub fn new(options: &SimulationOptions) -> Result<Self, OptionsError> {
        let known = || Sequence::names().collect::<Vec<_>>().join(", ");
        if !Sequence::names().any(|name| name.eq_ignore_ascii_case(&options.sequence)) {
            let words =
                format!("sequence {:?}: there is no such sequence; known: {}", options.sequence, known());
            return Err(OptionsError::Invalid(words));
        }
        if let Some(size) = options.size_px {
            check_size(size).map_err(|e| OptionsError::Invalid(format!("size: {e}")))?;
        }
        let mut sequence = Sequence::named(&options.sequence, options.size_px, options.frames, options.step)
            .ok_or_else(|| OptionsError::Invalid("size: an image has at least one pixel".into()))?;
        let own =
            options.scene.as_deref().map(|path| in_file(path, &mut sequence, options)).transpose()?.flatten();
        if let Some(seed) = options.texture {
            sequence = sequence.with_texture(seed);
        }
        sequence = sequence.with_rig_errors(options.rig_errors);
        let sensor = match options.noise {
            Some(true) => SensorNoise::default(),
            // The files hold 8 bits.
            Some(false) => SensorNoise { eight_bit: true, ..SensorNoise::none() },
            None => own.unwrap_or_default(),
        };
        let sensor = options.seed.map_or(sensor, |seed| sensor.with_seed(seed));
        let mut warnings = Vec::new();
        let frames = clear_frames(&sequence, options, &mut warnings)?;
        if let Some(k) = (0..frames).find(|&k| looks_away(&sequence, k)) {
            let name = &sequence.name;
            warnings.push(format!(
                "frame {k} of {name}: more than a quarter of the image sees no surface, and is black"
            ));
        }
        Ok(Self { sequence, sensor, frames, step: options.step, warnings })
    }

    /// Both images of frame `k` as the sensor delivers them; `None` past the end.
    pub fn photograph(&self, k: usize) -> Option<egomotion::sim::StereoImages> {
        Some(self.sensor.photograph(&self.sequence.view(k)?, RAYS_ACROSS_PIXEL, k as u64))
    }

    /// The sensor for people.
    pub fn noise_in_words(&self) -> String {
        let none = SensorNoise { eight_bit: true, ..SensorNoise::none() };
        if self.sensor == none.with_seed(self.sensor.seed) {
            "no noise".into()
        } else {
            format!("sensor noise of seed {}", self.sensor.seed)
        }
    }
}

/// Take scene and rig from a file, and give back its sensor.
fn in_file(
    path: &Path,
    sequence: &mut Sequence,
    options: &SimulationOptions,
) -> Result<Option<SensorNoise>, OptionsError> {
    let file: SceneSetup = read::toml(path)?;
    let wrong = |what: String| IoError::new(path, what, "correct the file");
    sequence.scene = file.scene;
    if let Some(rig) = file.rig {
        rig.check().map_err(|e| wrong(format!("rig: {e}")))?;
        check_size((rig.width_px, rig.height_px)).map_err(|e| wrong(format!("rig: the size {e}")))?;
        if options.size_px.is_some() {
            let words = format!("size: {} has a rig of its own; leave out one of them", path.display());
            return Err(OptionsError::Invalid(words));
        }
        sequence.rig = rig;
    }
    if let Some(read) = &file.sensor {
        read.check().map_err(|e| wrong(format!("sensor: {e}")))?;
    }
    Ok(file.sensor)
}

/// Number of frames until a camera would touch something; says so if that is before the end.
fn clear_frames(
    sequence: &Sequence,
    options: &SimulationOptions,
    warnings: &mut Vec<String>,
) -> Result<usize, OptionsError> {
    let (name, frames) = (&sequence.name, sequence.frames());
    if let Some(asked) = options.frames.filter(|&asked| asked > frames) {
        warnings.push(format!("{name} has {frames} frames, not {asked}"));
    }
    let blocked = |k: &usize| !sequence.clearance_m(*k).is_some_and(|clearance| clearance > 0.0);
    match (0..frames).find(blocked) {
        None => Ok(frames),
        // Every sequence starts at the world's origin.
        Some(0) => {
            let reason = format!("frame 0 of {name}: a camera is outside the room or inside a part");
            let scene = options.scene.as_deref().unwrap_or(Path::new("scene"));
            Err(IoError::new(scene, reason, "leave the scene's origin clear").into())
        }
        Some(1) => Err(OptionsError::Invalid(format!(
            "frame 1 of {name}: a camera would leave the room or enter a part of the scene; take a smaller step"
        ))),
        Some(k) => {
            warnings.push(format!(
                "frame {k} of {name}: a camera would leave the room or enter a part of the scene; \
                 the sequence ends with frame {}",
                k - 1
            ));
            Ok(k)
        }
    }
}

/// Whether more than a quarter of an even grid of pixels sees no surface at frame `k`.
fn looks_away(sequence: &Sequence, k: usize) -> bool {
    let Some(view) = sequence.view(k) else { return false };
    let place = |i: usize, size: usize| (i as f64 + 0.5) / SAMPLES_ACROSS as f64 * (size as f64 - 1.0);
    let sees = |i: &usize| {
        let (u, v) =
            (place(i % SAMPLES_ACROSS, view.rig.width_px), place(i / SAMPLES_ACROSS, view.rig.height_px));
        view.truth_at(u, v).is_some()
    };
    4 * (0..SAMPLES_ACROSS * SAMPLES_ACROSS).filter(sees).count() < 3 * SAMPLES_ACROSS * SAMPLES_ACROSS
}

/// Whether images of this size can be rendered and kept.
///
/// # Errors
/// What is wrong with it, in words.
pub fn check_size((width, height): (usize, usize)) -> Result<(), String> {
    let pixels = width.saturating_mul(height);
    match pixels {
        0 => Err("has no pixels".into()),
        _ if pixels > MAX_PIXELS => Err(format!("{width}x{height} is more than {MAX_PIXELS} pixels")),
        _ => Ok(()),
    }
}
