//! `summary.json` of a set of scenes.

use egomotion::pipeline::Config;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::summary::{StatusCounts, Summary};
use super::verdict::MapVerdict;

/// The scenes of a set, and what came out of each.
#[derive(Serialize)]
pub struct SceneIndex {
    pub version: &'static str,
    pub source: String,
    /// As in [`Summary`].
    pub options: Value,
    pub config: Config,
    pub complete: bool,
    pub scenes: Vec<SceneEntry>,
}

/// One scene of a set.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SceneEntry {
    pub scene: String,
    pub frames: usize,
    pub counts: StatusCounts,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth_maps: Option<MapVerdict>,
    /// Why the scene could not be run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

impl SceneEntry {
    pub fn done(scene: &str, summary: Summary) -> Self {
        let Summary { frames, counts, truth_maps, .. } = summary;
        Self { scene: scene.to_owned(), frames, counts, truth_maps, error: None }
    }

    pub fn failed(scene: &str, error: &anyhow::Error) -> Self {
        let error = Some(format!("{error:#}"));
        Self { scene: scene.to_owned(), frames: 0, counts: StatusCounts::new(), truth_maps: None, error }
    }
}
