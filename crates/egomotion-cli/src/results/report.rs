//! `report.html`: the page of a run, and of a set of scenes.

use std::path::Path;

use anyhow::{Context, Result};
use egomotion::geometry::StereoRig;
use egomotion::pipeline::{Config, Observe};
use egomotion_report::run::{FrameRow, InputKind, Report, SceneSummary, render, render_index};

use super::folder::ResultFolder;
use super::motion::status;
use super::moving;
use super::scene_index::{SceneEntry, SceneIndex};
use crate::session::{FrameResult, Outcome};

/// Name of the page.
const PAGE: &str = "report.html";

/// What the page says of a run beside its results.
pub struct RunDescription<'a> {
    pub title: &'a str,
    pub source: &'a str,
    /// The command that repeats the run.
    pub command: String,
    pub config: &'a Config,
    pub rig: &'a StereoRig,
    pub input: InputKind,
    /// Whether the method does not hold; a note says why.
    pub biased: bool,
    /// What the reader should know besides.
    pub notes: Vec<String>,
}

/// Write the page of a run.
pub fn write_report(
    folder: &ResultFolder,
    description: &RunDescription<'_>,
    outcome: &Outcome,
) -> Result<()> {
    let frames: Vec<FrameRow> = outcome.frames.iter().map(frame_row).collect();
    let config = description.config;
    let page = render(&Report {
        title: description.title.to_owned(),
        source: description.source.to_owned(),
        command: description.command.clone(),
        settings_toml: toml::to_string(config).context("cannot put the settings into TOML")?,
        rig: description.rig,
        input: description.input,
        sparse: config.observe == Observe::Sparse,
        complete: outcome.complete,
        frames: &frames,
        poses: outcome.trajectory.poses(),
        pose_covariances: &outcome.trajectory.covariances_from(0).collect::<Vec<_>>(),
        truth: outcome.truth.as_deref(),
        album: &outcome.album,
        stages_ms: outcome.stages_ms.clone(),
        frame_ms: outcome.frame_ms,
        biased: description.biased,
        notes: description.notes.iter().cloned().chain(moving::note(&outcome.frames)).collect(),
    });
    folder.write(PAGE, page.as_bytes())
}

fn frame_row(frame: &FrameResult) -> FrameRow {
    let motion = &frame.motion;
    FrameRow {
        frame: frame.index,
        time_s: motion.time_s,
        dt_s: motion.dt_s,
        motion: motion.motion.as_ref().ok().copied(),
        truth: frame.truth,
        obstacle: motion.obstacle,
        moving: motion.moving.clone(),
        status: status(frame).to_owned(),
    }
}

/// Write the page of a set of scenes, which links to theirs.
pub fn write_index(folder: &ResultFolder, command: &str, index: &SceneIndex) -> Result<()> {
    let scenes: Vec<SceneSummary> =
        index.scenes.iter().map(|scene| scene_summary(scene, folder.path())).collect();
    let page = render_index(&index.source, command, index.complete, &scenes);
    folder.write(PAGE, page.as_bytes())
}

/// A scene as the page of its set shows it.
fn scene_summary(scene: &SceneEntry, folder: &Path) -> SceneSummary {
    let counts: Vec<String> = scene.counts.iter().map(|(status, n)| format!("{status} {n}")).collect();
    let verdict = scene.truth_maps.as_ref().map(|maps| {
        format!(
            "VZ: middle error {:.3} m a frame, {:.1} % within 2σ; disparity: {:.1} % off by more than 3 px or missing",
            maps.vz_median_abs_error_m,
            100.0 * maps.vz_within_2_sigma,
            100.0 * maps.disparity_bad_3px
        )
    });
    SceneSummary {
        name: scene.scene.clone(),
        frames: scene.frames,
        outcome: scene.error.clone().unwrap_or_else(|| counts.join(", ")),
        verdict: verdict.unwrap_or_default(),
        has_page: folder.join(&scene.scene).join(PAGE).exists(),
    }
}
