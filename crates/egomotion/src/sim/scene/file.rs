//! A scene as a file holds it (TOML, JSON …): its parts, and what lights and covers them.
//!
//! ```toml
//! texture_seed = 2003
//! contrast = 0.3
//! lamp_m = [-0.6, -2.0, 0.8]
//!
//! [[parts]]
//! grey = 135.0
//! shape.plane = { normal = [0.0, -1.0, 0.0], offset_m = -0.9 }
//!
//! [[parts]]
//! grey = 105.0
//! tile_m = 0.1
//! shape.box = { centre = [0.55, 0.55, 3.2], half_m = [0.35, 0.35, 0.30], turn_deg = 30.0 }
//! ```

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{MAX_PARTS, Part, Scene};

/// The numbers that make a [`Scene`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// Seed of the texture; TOML holds those below 2⁶³.
    pub texture_seed: u64,
    /// Standard deviation of the texture, as a share of the mean grey level.
    pub contrast: f64,
    /// Where the lamp hangs, in metres, world frame.
    pub lamp_m: Vector3<f64>,
    /// The parts.
    pub parts: Vec<Part>,
}

/// Why numbers make no scene.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum SceneError {
    /// A part that cannot be.
    #[error("part {number}: {reason}")]
    Part {
        /// Its number, from 1.
        number: usize,
        /// What is wrong.
        reason: &'static str,
    },
    /// No part at all, or more than have surface ids.
    #[error("{0} parts; give 1 to {MAX_PARTS}")]
    Parts(usize),
    /// The texture would reach black, or is no texture.
    #[error("contrast {0} is not within 0 … 0.4")]
    Contrast(f64),
    /// The lamp is nowhere.
    #[error("the lamp's place is not finite")]
    Lamp,
}

/// Largest contrast: the texture saturates at 2.4 of its standard deviations.
const MAX_CONTRAST: f64 = 0.4;

impl TryFrom<SceneFile> for Scene {
    type Error = SceneError;

    fn try_from(file: SceneFile) -> Result<Self, SceneError> {
        if !(1..=MAX_PARTS).contains(&file.parts.len()) {
            return Err(SceneError::Parts(file.parts.len()));
        }
        if !(0.0..=MAX_CONTRAST).contains(&file.contrast) {
            return Err(SceneError::Contrast(file.contrast));
        }
        if !file.lamp_m.iter().all(|c| c.is_finite()) {
            return Err(SceneError::Lamp);
        }
        for (part, number) in file.parts.iter().zip(1..) {
            check(part).map_err(|reason| SceneError::Part { number, reason })?;
        }
        Ok(Self::new(file.parts, file.lamp_m, file.contrast, file.texture_seed))
    }
}

impl From<Scene> for SceneFile {
    fn from(scene: Scene) -> Self {
        Self {
            texture_seed: scene.texture().seed(),
            contrast: scene.contrast(),
            lamp_m: scene.lamp_m(),
            parts: scene.parts().to_vec(),
        }
    }
}

fn check(part: &Part) -> Result<(), &'static str> {
    if !(0.0..=255.0).contains(&part.grey) {
        return Err("grey is not within 0 … 255");
    }
    if !(part.tile_m >= 0.0 && part.tile_m.is_finite()) {
        return Err("tile_m is not a length");
    }
    part.shape.check()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_come_back_equal() {
        for scene in [Scene::paper_room(), Scene::demo_room().with_texture(7)] {
            let text = toml::to_string(&scene).unwrap();
            assert_eq!(toml::from_str::<Scene>(&text).unwrap(), scene, "{text}");
        }
    }

    const ROOM: &str = "texture_seed = 2\ncontrast = 0.3\nlamp_m = [0, -1, 0]\n[[parts]]\ngrey = 135\n\
                        shape.plane = { normal = [0, -1, 0], offset_m = -0.9 }\n[[parts]]\ngrey = 90\n\
                        shape.box = { centre = [0, 0, 3], half_m = [1, 1, 1] }\n";

    #[test]
    fn a_scene_written_by_hand_is_read() {
        let scene: Scene = toml::from_str(ROOM).unwrap();
        assert_eq!(scene.parts().len(), 2);
        let hit = scene.cast(&Vector3::zeros(), &Vector3::z()).unwrap();
        assert!((hit.s - 2.0).abs() < 1e-12);
        assert!((scene.clearance_m(&Vector3::zeros()) - 0.9).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_scene_is_refused_in_words() {
        for (from, to, why) in [
            ("contrast = 0.3", "contrast = 0.5", "contrast 0.5 is not within"),
            ("lamp_m = [0, -1, 0]", "lamp_m = [0, nan, 0]", "lamp"),
            ("normal = [0, -1, 0]", "normal = [0, -2, 0]", "part 1: the plane's normal"),
            ("normal = [0, -1, 0]", "normal = [0, inf, 0]", "part 1: a number of the shape is not finite"),
            ("half_m = [1, 1, 1]", "half_m = [1, 0, 1]", "part 2: a half size"),
            ("grey = 90", "grey = 256", "part 2: grey"),
            ("grey = 90", "grey = 90\ntile_m = -1", "part 2: tile_m"),
            ("grey = 90", "grey = 90\ncolour = 1", "unknown field `colour`"),
            ("shape.box", "shape.cone", "unknown variant `cone`"),
        ] {
            let text = ROOM.replace(from, to);
            assert_ne!(text, ROOM);
            let error = toml::from_str::<Scene>(&text).unwrap_err().to_string();
            assert!(error.contains(why), "{why}: {error}");
        }
        let none = SceneFile { texture_seed: 1, contrast: 0.1, lamp_m: Vector3::zeros(), parts: Vec::new() };
        assert_eq!(Scene::try_from(none), Err(SceneError::Parts(0)));
    }
}
