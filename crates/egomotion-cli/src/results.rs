//! The files of a run; each appears whole or not at all.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use egomotion::geometry::StereoRig;
use egomotion::motion::TimeToImpact;
use egomotion::pipeline::stereo::DenseResults;
use egomotion::pipeline::{Config, Observe};
use egomotion_io::trajectory::{Pose, write_kitti, write_tum};
use egomotion_io::{flo, pfm, write};
use serde::Serialize;

use crate::moving;
use crate::report::{self, FrameRow, Report, Scene};
use crate::session::{Outcome, Row};
use crate::summary::{Index, SceneEntry};

/// A folder that results go to.
pub struct ResultFolder {
    path: PathBuf,
}

/// The folders of maps.
const MAPS: [&str; 8] = [
    "disparity",
    "disparity_sigma",
    "flow",
    "depth_velocity",
    "depth_velocity_sigma",
    "impact",
    "impact_lo",
    "impact_hi",
];

impl ResultFolder {
    /// Make the folder, and those of the maps if they will be written.
    pub fn create(path: &Path, maps: bool) -> Result<Self> {
        write::folder(path)?;
        // Find out now, not after an hour, that nothing can be written here.
        let probe = path.join(".egomotion-writable");
        write::bytes(&probe, b"")?;
        let _ = std::fs::remove_file(&probe);
        if maps {
            for name in MAPS {
                write::folder(&path.join(name))?;
            }
        }
        Ok(Self { path: path.to_owned() })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
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

    /// Write the maps of the frame pair whose earlier frame has `index` in the source.
    pub fn write_maps(&self, index: usize, dense: &DenseResults) -> Result<()> {
        let file =
            |folder: &str, extension: &str| self.path.join(folder).join(format!("{index:06}.{extension}"));
        let motion = &dense.motion;
        let interval = |impact: &TimeToImpact| impact.interval95_s();
        for (folder, map) in [
            ("disparity", dense.disparity.shift.grid()),
            ("disparity_sigma", dense.disparity.sigma.grid()),
            ("depth_velocity", motion.depth_velocity.grid()),
            ("depth_velocity_sigma", motion.depth_velocity_sigma.grid()),
            ("impact", &motion.seconds(TimeToImpact::seconds)),
            ("impact_lo", &motion.seconds(|impact| Some(interval(impact)?.0))),
            ("impact_hi", &motion.seconds(|impact| Some(interval(impact)?.1))),
        ] {
            pfm::write(&file(folder, "pfm"), map)?;
        }
        flo::write(&file("flow", "flo"), &[dense.flow.u.clone(), dense.flow.v.clone()])?;
        Ok(())
    }

    /// Write the trajectory in both formats, `motion.csv`, and where every pixel was seen `moving.csv`.
    pub fn write_motion(&self, config: &Config, outcome: &Outcome) -> Result<()> {
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
        if config.observe == Observe::Dense {
            self.write("moving.csv", moving::table(&outcome.rows)?.as_bytes())?;
        }
        self.write("motion.csv", motion_table(&outcome.rows)?.as_bytes())
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
        let page = report::render(&Report {
            title: about.title.to_owned(),
            source: about.source.to_owned(),
            command: about.command.clone(),
            settings_toml: toml::to_string(about.config).context("cannot put the settings into TOML")?,
            rig: about.rig,
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
        let page = report::render_index(&index.source, command, index.complete, &scenes);
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

/// `motion.csv`: one row for each frame from the second on.
fn motion_table(rows: &[Row]) -> Result<String> {
    let mut table = csv::Writer::from_writer(Vec::new());
    let mut head: Vec<String> =
        ["frame", "time_s", "dt_s", "tx", "ty", "tz", "wx", "wy", "wz"].map(String::from).to_vec();
    head.extend(upper_triangle().map(|(i, j)| format!("cov_{i}{j}")));
    head.extend(
        ["rows", "inliers", "observed", "impact_s", "impact_lo_s", "impact_hi_s", "status"].map(String::from),
    );
    table.write_record(&head)?;
    for row in rows.iter().skip(1) {
        table.write_record(motion_record(row))?;
    }
    let bytes = table.into_inner().map_err(|e| e.into_error())?;
    Ok(String::from_utf8(bytes)?)
}

fn upper_triangle() -> impl Iterator<Item = (usize, usize)> {
    (0..6).flat_map(|i| (i..6).map(move |j| (i, j)))
}

fn motion_record(row: &Row) -> Vec<String> {
    let motion = &row.motion;
    let number = |v: f64| format!("{v:?}");
    let mut record = vec![row.index.to_string(), number(motion.time_s)];
    record.push(motion.dt_s.map_or(String::new(), number));
    match &motion.motion {
        Ok(estimate) => {
            let shown = |i: usize, v: f64| if estimate.observed[i] { number(v) } else { String::new() };
            record.extend((0..6).map(|i| shown(i, estimate.theta.mean[i])));
            record.extend(upper_triangle().map(|(i, j)| number(estimate.theta.cov[(i, j)])));
            record.extend([estimate.rows.to_string(), estimate.inliers.to_string()]);
            let mut observed = String::new();
            for o in estimate.observed {
                let _ = write!(observed, "{}", u8::from(o));
            }
            record.push(observed);
        }
        Err(_) => record.extend(std::iter::repeat_n(String::new(), 6 + 21 + 3)),
    }
    let interval = motion.impact().and_then(|impact| Some((impact.seconds()?, impact.interval95_s()?)));
    match interval {
        Some((seconds, (lo, hi))) => record.extend([seconds, lo, hi].map(number)),
        None => record.extend(std::iter::repeat_n(String::new(), 3)),
    }
    record.push(status(row).to_owned());
    record
}

/// `ok`, `partial`, or why there is no answer.
pub fn status(row: &Row) -> &'static str {
    match &row.motion.motion {
        Ok(estimate) if estimate.is_complete() => "ok",
        Ok(_) => "partial",
        Err(why) => why.code(),
    }
}
