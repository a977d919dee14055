//! The tables of the study of poses.

use super::{ComparedPose, FRAMES_APART, PoseRecord};
use crate::{Cell, Table};

/// Degrees of freedom of a pose.
const DEGREES: f64 = 6.0;

/// NEES/6 of each sequence and of all, over each number of frames.
pub(super) fn nees(sequences: &[String], records: &[PoseRecord]) -> Table {
    let columns = [
        ("sequence", "sequence"),
        ("frames_apart", "frames apart"),
        ("runs", "runs"),
        ("poses", "poses"),
        ("nees_over_6", "NEES/6"),
        ("scatter", "its scatter √(1/(3 poses))"),
        ("scatter_of_runs", "its scatter by runs"),
        ("unknown", "without covariance"),
        ("t_rmse_mm", "translation (mm)"),
        ("t_sigma_mm", "stated σ (mm)"),
    ];
    let caption = "Poses relative to earlier ones against exact truth, each run with a rig, a texture and a noise of its \
                   own. NEES/6 is 1 where covariances are true. Poses of one run share its rig: the scatter by runs is \
                   that of the mean of runs.";
    let mut table = Table::new("poses", "Covariance of relative poses", caption, &columns);
    let named = sequences.iter().map(|name| (name.as_str(), Some(name)));
    for (label, of) in named.chain([("all", None)]) {
        for apart in FRAMES_APART {
            let chosen: Vec<&PoseRecord> = records
                .iter()
                .filter(|r| r.frames_apart == apart && of.is_none_or(|name| *name == r.sequence))
                .collect();
            table.rows.push(row(label, apart, &chosen));
        }
    }
    table
}

fn row(label: &str, apart: usize, records: &[&PoseRecord]) -> Vec<Cell> {
    let poses: Vec<&ComparedPose> = records.iter().flat_map(|r| &r.poses).collect();
    let n = poses.len() as f64;
    let mean = |of: &dyn Fn(&ComparedPose) -> f64| poses.iter().map(|pose| of(pose)).sum::<f64>() / n;
    let nees = mean(&|pose| pose.1 / DEGREES);
    let runs: Vec<f64> = records
        .iter()
        .filter(|r| !r.poses.is_empty())
        .map(|r| r.poses.iter().map(|pose| pose.1 / DEGREES).sum::<f64>() / r.poses.len() as f64)
        .collect();
    let count = runs.len() as f64;
    let middle = runs.iter().sum::<f64>() / count;
    let scatter = (runs.iter().map(|r| (r - middle).powi(2)).sum::<f64>() / (count * (count - 1.0))).sqrt();
    let translation = |of: fn(&(f64, f64)) -> f64| {
        1e3 * mean(&|pose| pose.0[..3].iter().map(|c| of(c).powi(2)).sum::<f64>()).sqrt()
    };
    vec![
        label.into(),
        apart.into(),
        runs.len().into(),
        poses.len().into(),
        nees.into(),
        (1.0 / (3.0 * n)).sqrt().into(),
        scatter.into(),
        records.iter().map(|r| r.unknown).sum::<usize>().into(),
        translation(|c| c.0).into(),
        translation(|c| c.1).into(),
    ]
}

/// Normalised variance of each component over each number of frames.
pub(super) fn components(records: &[PoseRecord]) -> Table {
    let columns = [
        ("frames_apart", "frames apart"),
        ("x", "X"),
        ("y", "Y"),
        ("z", "Z"),
        ("rot_x", "about X"),
        ("rot_y", "about Y"),
        ("rot_z", "about Z"),
    ];
    let caption = "Mean squared error over the stated variance, of each component of the relative poses.";
    let mut table = Table::new("normalised-variance", "Normalised variance of poses", caption, &columns);
    for apart in FRAMES_APART {
        let chosen: Vec<&PoseRecord> = records.iter().filter(|r| r.frames_apart == apart).collect();
        let poses: Vec<&ComparedPose> = chosen.iter().flat_map(|r| &r.poses).collect();
        let of = |c: usize| {
            poses.iter().map(|pose| (pose.0[c].0 / pose.0[c].1).powi(2)).sum::<f64>() / poses.len() as f64
        };
        let mut cells: Vec<Cell> = vec![apart.into()];
        cells.extend((0..6).map(|c| Cell::from(of(c))));
        table.rows.push(cells);
    }
    table
}
