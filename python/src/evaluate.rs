//! A trajectory against the truth.

use std::path::PathBuf;

use egomotion::metrics::TrajectoryAlignment;
use egomotion_io::evaluation::{Evaluation, EvaluationOptions};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::error;

/// Compare a trajectory with the truth, as `egomotion evaluate` does: a dictionary with the keys of its JSON, and
/// `warnings`.
///
/// Each is a file of TUM, KITTI or EuRoC rows, the folder of a run, or a recording with true poses. `align` is "none",
/// "se3" or "sim3"; `associate` "time" or "row"; `truth_sigma` the truth's own σ from frame to frame in metres and degrees.
#[pyfunction]
#[pyo3(signature = (
    estimate, truth, *, align = "se3", associate = "time", max_diff_s = 0.01, lengths_m = None, deltas = None,
    truth_sigma = None
))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub fn evaluate(
    py: Python<'_>,
    estimate: PathBuf,
    truth: PathBuf,
    align: &str,
    associate: &str,
    max_diff_s: f64,
    lengths_m: Option<Vec<f64>>,
    deltas: Option<Vec<String>>,
    truth_sigma: Option<(f64, f64)>,
) -> PyResult<Py<PyAny>> {
    let own = EvaluationOptions::default();
    let known = [TrajectoryAlignment::None, TrajectoryAlignment::Se3, TrajectoryAlignment::Sim3];
    let alignment = known.into_iter().find(|known| known.name() == align);
    let by_time = match associate {
        "time" => true,
        "row" => false,
        other => {
            return Err(PyValueError::new_err(format!(
                "associate {other:?} is not known; give 'time' or 'row'"
            )));
        }
    };
    let deltas = match deltas {
        None => own.deltas,
        Some(names) => {
            let parsed = names.into_iter().map(|name| {
                let delta =
                    name.parse().map_err(|why| PyValueError::new_err(format!("delta {name:?}: {why}")))?;
                Ok((name, delta))
            });
            parsed.collect::<PyResult<_>>()?
        }
    };
    let lengths_m = lengths_m.unwrap_or(own.lengths_m);
    if lengths_m.iter().any(|length| !length.is_finite() || *length <= 0.0) {
        return Err(PyValueError::new_err("lengths_m must be positive"));
    }
    let (t, degrees) = truth_sigma.unwrap_or_default();
    let r = degrees.to_radians();
    let options = EvaluationOptions {
        format: None,
        by_time,
        largest_gap_s: max_diff_s,
        alignment: alignment.ok_or_else(|| {
            PyValueError::new_err(format!("align {align:?} is not known; give 'none', 'se3' or 'sim3'"))
        })?,
        lengths_m,
        deltas,
        truth_sigma: [t, t, t, r, r, r],
    };
    let found = py.detach(|| Evaluation::of(&estimate, &truth, &options)).map_err(error::file)?;
    let mut json = found.json();
    json["warnings"] = found.warnings.into();
    Ok(py.import("json")?.call_method1("loads", (json.to_string(),))?.unbind())
}
