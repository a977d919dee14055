//! `summary.json`: what was run, how it went, and where the time was spent.

use std::collections::BTreeMap;

use egomotion::geometry::{RIG_ERRORS, RigCamera, RigErrors, StereoRectification, StereoRig};
use egomotion::pipeline::Config;
use egomotion::pipeline::solve::Contradiction;
use egomotion_io::source::{DepthSensor, Sequence};
use serde::Serialize;
use serde_json::Value;

use super::motion::{Viewpoint, status};
use super::verdict::{MapVerdict, MotionVerdict};
use crate::session::Outcome;

/// Median disagreement of rows in pixels above which the user is warned: it then shows in every depth.
const WARNED_ROW_DISAGREEMENT_PX: f64 = 0.25;

/// Share of the answered motions that corners contradict from which on the user is warned: chance alone contradicts
/// hardly any.
const WARNED_SHARE_CONTRADICTED: f64 = 0.1;

/// Number of rows by their `status`.
pub type StatusCounts = BTreeMap<String, usize>;

/// Whether any row gives a motion, or part of one.
pub fn has_answers(counts: &StatusCounts) -> bool {
    counts.contains_key("ok") || counts.contains_key("partial")
}

/// What `summary.json` holds.
#[derive(Serialize)]
pub struct Summary {
    pub version: &'static str,
    pub source: String,
    pub frames: usize,
    /// Whether every frame was done.
    pub complete: bool,
    pub rig: StereoRig,
    /// Camera whose φ `motion.csv` gives.
    pub frame: RigCamera,
    /// What the rig was made of.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cameras: Option<Cameras>,
    /// The options of the command that matter to the results and are not in `config`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub options: Option<Value>,
    pub config: Config,
    pub seed: u64,
    /// Rows by status.
    pub counts: StatusCounts,
    /// Answered intervals without an obstacle, by reason.
    pub no_obstacle: BTreeMap<&'static str, usize>,
    /// Mean milliseconds per frame.
    pub stages_ms: BTreeMap<&'static str, f64>,
    /// From the first decode to the last motion row, over frames; writing and report excluded.
    pub frame_ms: f64,
    pub wall_s: f64,
    /// Median over the frames of the vertical disparity of matches, in pixels: 0 if perfectly rectified.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub row_disagreement_px: Option<f64>,
    /// The errors of the rig that the uncertainty allows for.
    pub rig_errors: Vec<RigErrorState>,
    /// Why the method cannot hold on this recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub biased: Option<String>,
    /// What makes the answers less certain than they say.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// Against the source's own truth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<MotionVerdict>,
    /// Maps against the source's own truth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth_maps: Option<MapVerdict>,
}

/// An error of the rig: what is known of it, in the unit of its name.
#[derive(Debug, Clone, Serialize)]
pub struct RigErrorState {
    pub name: &'static str,
    pub value: f64,
    /// Standard deviation after the last frame.
    pub sigma: f64,
    /// Standard deviation that the configuration gives; `None` where the images' rows give it.
    pub prior_sigma: Option<f64>,
}

impl RigErrorState {
    /// As the last answer knows them; none without an answer.
    fn all(config: &Config, outcome: &Outcome) -> Vec<Self> {
        let Some(last) = outcome.frames.iter().rfind(|frame| frame.motion.motion.is_ok()) else {
            return Vec::new();
        };
        let (value, sigma) = (config.rig_errors.values().vector(), last.motion.rig_sigma.vector());
        let prior = config.rig_errors.stated();
        let state = |k: usize| {
            let unit = RigErrors::UNITS[k];
            let (value, sigma) = (value[k] / unit, sigma[k] / unit);
            Self { name: RigErrors::NAMES[k], value, sigma, prior_sigma: prior[k] }
        };
        (0..RIG_ERRORS).map(state).collect()
    }
}

/// Raw cameras, and a depth sensor.
#[derive(Debug, Clone, Serialize)]
pub struct Cameras {
    pub raw: Option<StereoRectification>,
    pub depth: Option<DepthSensor>,
}

impl Cameras {
    /// `None` where there is neither.
    pub fn of(sequence: &Sequence) -> Option<Self> {
        let cameras = Self { raw: sequence.rectification.clone(), depth: sequence.depth_sensor };
        (cameras.raw.is_some() || cameras.depth.is_some()).then_some(cameras)
    }
}

impl Summary {
    /// Number of rows that give a motion, or part of one.
    pub fn answered(&self) -> usize {
        ["ok", "partial"].iter().filter_map(|status| self.counts.get(*status)).sum()
    }

    /// That `motion.csv` is not of the camera that the report is of.
    pub fn camera_note(&self) -> Option<String> {
        let camera = match self.frame {
            RigCamera::Left => return None,
            RigCamera::Right => "right",
            RigCamera::Cyclopean => "cyclopean",
        };
        Some(format!("φ on this page is that of the left camera; motion.csv has the {camera} camera's."))
    }

    pub fn new(source: String, viewpoint: Viewpoint<'_>, config: &Config, outcome: &Outcome) -> Self {
        let (mut counts, mut no_obstacle) = (StatusCounts::new(), BTreeMap::new());
        for frame in outcome.frames.iter().skip(1) {
            *counts.entry(status(frame).to_owned()).or_insert(0) += 1;
            if let (Ok(_), Err(why)) = (&frame.motion.motion, &frame.motion.obstacle) {
                *no_obstacle.entry(why.code()).or_insert(0) += 1;
            }
        }
        let disagreements: Vec<f64> =
            outcome.frames.iter().filter_map(|frame| frame.motion.row_disagreement_px).collect();
        let row_disagreement_px = egomotion::metrics::quantile(&disagreements, 0.5);
        let biased = biased(outcome);
        Self {
            version: env!("CARGO_PKG_VERSION"),
            source,
            frames: outcome.frames.len(),
            complete: outcome.complete,
            rig: *viewpoint.rig,
            frame: viewpoint.camera,
            cameras: None,
            options: None,
            seed: config.seed,
            config: config.clone(),
            counts,
            no_obstacle,
            stages_ms: outcome.stages_ms.iter().copied().collect(),
            frame_ms: outcome.frame_ms,
            wall_s: outcome.wall_s,
            row_disagreement_px,
            rig_errors: RigErrorState::all(config, outcome),
            warnings: biased.iter().cloned().chain(row_disagreement_px.and_then(badly_rectified)).collect(),
            biased,
            truth: MotionVerdict::of(outcome),
            truth_maps: None,
        }
    }
}

/// What to say of a method that tracked corners contradict.
fn biased(outcome: &Outcome) -> Option<String> {
    let answered = outcome.frames.iter().filter(|frame| frame.motion.motion.is_ok()).count();
    let found: Vec<Contradiction> =
        outcome.frames.iter().filter_map(|frame| frame.motion.contradiction).collect();
    if found.is_empty() || (found.len() as f64) < WARNED_SHARE_CONTRADICTED * answered as f64 {
        return None;
    }
    let component = (0..6).max_by_key(|&i| found.iter().filter(|c| c.component == i).count())?;
    let of_it: Vec<Contradiction> = found.iter().filter(|c| c.component == component).copied().collect();
    let middle = |value: fn(&Contradiction) -> f64| {
        egomotion::metrics::quantile(&of_it.iter().map(value).collect::<Vec<f64>>(), 0.5)
    };
    let (factor, unit) = if component < 3 { (1.0, "m") } else { (1f64.to_degrees(), "°") };
    let typical = of_it.get(of_it.len() / 2)?;
    Some(format!(
        "The method does not hold on this recording. In {} of {answered} motions tracked corners contradict it, most \
         often in {}: {:.3} {unit} an interval in place of {:.3}. The cause: {}. Use --method ml.",
        found.len(),
        typical.symbol(),
        middle(|c| c.found)? * factor,
        middle(|c| c.expected)? * factor,
        typical.cause,
    ))
}

/// What to say of a pair whose rows disagree.
fn badly_rectified(rows_px: f64) -> Option<String> {
    (rows_px > WARNED_ROW_DISAGREEMENT_PX).then(|| {
        format!(
            "Matches of left and right lie on different rows, by {rows_px:.2} px: the pair is not well rectified, \
             and depths are less certain than their noise tells. Check the calibration."
        )
    })
}
