//! The files of a run; each appears whole or not at all.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use egomotion::geometry::StereoRig;
use egomotion::pipeline::{Config, Observe};
use egomotion_io::motion_table::{self, Motion, MotionRow};
use egomotion_io::trajectory::{Pose, write_euroc, write_kitti, write_tum};
use egomotion_io::write;
use serde::Serialize;

use crate::moving;
use crate::session::{Outcome, Row};
use crate::summary::{Index, SceneEntry};
use egomotion_report::run::{Eyes, FrameRow, Report, Scene};

/// A folder that results go to.
pub struct ResultFolder {
    path: PathBuf,
}

impl ResultFolder {
    /// Make the folder.
    pub fn create(path: &Path) -> Result<Self> {
        write::folder(path)?;
        // Find out now, not after an hour, that nothing can be written here.
        let probe = path.join(".egomotion-writable");
        write::bytes(&probe, b"")?;
        let _ = std::fs::remove_file(&probe);
        Ok(Self { path: path.to_owned() })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Remove what a killed run left half written.
    pub fn sweep(&self) -> Result<()> {
        Ok(write::sweep(&self.path)?)
    }

    /// Write one file.
    pub fn write(&self, name: &str, content: &[u8]) -> Result<()> {
        Ok(write::bytes(&self.path.join(name), content)?)
    }

    /// Write a value as JSON.
    pub fn write_json(&self, name: &str, value: &impl Serialize) -> Result<()> {
        let mut text = serde_json::to_string_pretty(value).context("cannot put the summary into JSON")?;
        text.push('\n');
        self.write(name, text.as_bytes())
    }

    /// Write the trajectory in all formats, `motion.csv`, and where every pixel was seen `moving.csv`.
    /// With `parquet` that too.
    pub fn write_motion(&self, config: &Config, outcome: &Outcome, parquet: bool) -> Result<()> {
        let times = outcome.trajectory.times_s();
        let poses: Vec<Pose> = outcome
            .trajectory
            .poses()
            .iter()
            .zip(times)
            .map(|(pose, &time_s)| Pose { time_s: Some(time_s), world_from_camera: *pose })
            .collect();
        write_tum(&self.path.join("trajectory_tum.txt"), &poses)?;
        write_kitti(&self.path.join("trajectory_kitti.txt"), &poses)?;
        write_euroc(&self.path.join("trajectory_euroc.csv"), &poses)?;
        if config.observe == Observe::Dense {
            self.write("moving.csv", moving::table(&outcome.rows)?.as_bytes())?;
        }
        // The first frame has no motion.
        let rows: Vec<MotionRow> = outcome.rows.iter().skip(1).map(motion_row).collect();
        self.write_rows(&rows, parquet)
    }

    /// Write `motion.csv`, and with `parquet` the same as `motion.parquet`.
    pub fn write_rows(&self, rows: &[MotionRow], parquet: bool) -> Result<()> {
        motion_table::write(&self.path.join("motion.csv"), rows)?;
        #[cfg(feature = "parquet")]
        if parquet {
            egomotion_io::motion_parquet::write(&self.path.join("motion.parquet"), rows)?;
        }
        // Without the feature the option is refused before anything is done.
        #[cfg(not(feature = "parquet"))]
        let _ = parquet;
        Ok(())
    }
}

/// What the report says of a run beside its results.
pub struct About<'a> {
    pub title: &'a str,
    pub source: &'a str,
    /// The command that repeats the run.
    pub command: String,
    pub config: &'a Config,
    pub rig: &'a StereoRig,
    pub eyes: Eyes,
    /// What the reader should know besides.
    pub notes: Vec<String>,
}

impl ResultFolder {
    /// Write `report.html`.
    pub fn write_report(&self, about: &About<'_>, outcome: &Outcome) -> Result<()> {
        let frames: Vec<FrameRow> = outcome
            .rows
            .iter()
            .map(|row| FrameRow {
                frame: row.index,
                time_s: row.motion.time_s,
                dt_s: row.motion.dt_s,
                motion: row.motion.motion.as_ref().ok().copied(),
                truth: row.truth,
                obstacle: row.motion.obstacle,
                moving: row.motion.moving.clone(),
                status: status(row).to_owned(),
            })
            .collect();
        let page = egomotion_report::run::render(&Report {
            title: about.title.to_owned(),
            source: about.source.to_owned(),
            command: about.command.clone(),
            settings_toml: toml::to_string(about.config).context("cannot put the settings into TOML")?,
            rig: about.rig,
            eyes: about.eyes,
            sparse: about.config.observe == Observe::Sparse,
            complete: outcome.complete,
            frames: &frames,
            poses: outcome.trajectory.poses(),
            truth: outcome.truth.as_deref(),
            album: &outcome.album,
            stages_ms: outcome.stages_ms.clone(),
            frame_ms: outcome.frame_ms,
            notes: about.notes.iter().cloned().chain(moving::note(&outcome.rows)).collect(),
        });
        self.write("report.html", page.as_bytes())
    }

    /// Write `report.html` of a set of scenes, which links to theirs.
    pub fn write_index(&self, command: &str, index: &Index) -> Result<()> {
        let scenes: Vec<Scene> = index.scenes.iter().map(|scene| listed(scene, &self.path)).collect();
        let page = egomotion_report::run::render_index(&index.source, command, index.complete, &scenes);
        self.write("report.html", page.as_bytes())
    }
}

/// A scene as the index of its set shows it.
fn listed(scene: &SceneEntry, folder: &Path) -> Scene {
    let counts: Vec<String> = scene.counts.iter().map(|(status, n)| format!("{status} {n}")).collect();
    let verdict = scene.truth_maps.as_ref().map(|maps| {
        format!(
            "VZ: middle error {:.3} m a frame, {:.1} % within 2σ; disparity: {:.1} % off by more than 3 px or missing",
            maps.vz_median_abs_error_m,
            100.0 * maps.vz_within_2_sigma,
            100.0 * maps.disparity_bad_3px
        )
    });
    Scene {
        name: scene.scene.clone(),
        frames: scene.frames,
        outcome: scene.error.clone().unwrap_or_else(|| counts.join(", ")),
        verdict: verdict.unwrap_or_default(),
        has_page: folder.join(&scene.scene).join("report.html").exists(),
    }
}

/// A row of `motion.csv`.
pub fn motion_row(row: &Row) -> MotionRow {
    let motion = &row.motion;
    let impact = motion.impact();
    MotionRow {
        frame: row.index,
        time_s: motion.time_s,
        dt_s: motion.dt_s,
        motion: motion.motion.as_ref().ok().map(|estimate| Motion {
            phi: estimate.theta,
            observed: estimate.observed,
            rows: estimate.rows,
            inliers: estimate.inliers,
        }),
        impact_s: impact.and_then(|impact| {
            let (low, high) = impact.interval95_s()?;
            Some([impact.seconds()?, low, high])
        }),
        status: status(row).to_owned(),
    }
}

/// `ok`, `partial`, or why there is no answer.
pub fn status(row: &Row) -> &'static str {
    match &row.motion.motion {
        Ok(estimate) if estimate.is_complete() => "ok",
        Ok(_) => "partial",
        Err(why) => why.code(),
    }
}
