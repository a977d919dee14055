//! Rendered sequences on the disk.

use std::path::PathBuf;

use egomotion::geometry::RigErrors;
use egomotion_io::simulation::{SequenceFolder, Simulation, SimulationOptions};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;

use crate::error;

/// Render a sequence into a folder in KITTI odometry's layout, with its exact truth beside it, as `egomotion simulate`
/// does. It gives back the number of frames.
///
/// `sequence` is one of `Sequence.names()`; `step` a factor of every motion; `size_px` (width, height); `noise` False leaves out
/// the cameras' noise, `seed` is its seed, `texture_seed` that of the surfaces; `scene` a `scene.toml`.
#[pyfunction]
#[pyo3(signature = (
    sequence, out, *, step = 1.0, frames = None, size_px = None, noise = None, seed = None, texture_seed = None, scene = None
))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub fn simulate(
    py: Python<'_>,
    sequence: String,
    out: PathBuf,
    step: f64,
    frames: Option<usize>,
    size_px: Option<(usize, usize)>,
    noise: Option<bool>,
    seed: Option<u32>,
    texture_seed: Option<u32>,
    scene: Option<PathBuf>,
) -> PyResult<usize> {
    if frames.is_some_and(|frames| !(2..=1_000_000).contains(&frames)) {
        return Err(error::value("frames must be 2 to 1000000"));
    }
    let (seed, texture) = (seed.map(u64::from), texture_seed.map(u64::from));
    let options = SimulationOptions {
        sequence,
        step,
        frames,
        size_px,
        noise,
        seed,
        texture,
        scene,
        rig_errors: RigErrors::default(),
    };
    let simulation = py.detach(|| Simulation::new(&options)).map_err(error::options)?;
    for warning in &simulation.warnings {
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &std::ffi::CString::new(warning.as_str())?, 1)?;
    }
    let folder = SequenceFolder::create(&out, simulation.frames).map_err(error::file)?;
    folder.write_scene(&simulation).map_err(error::file)?;
    for k in 0..simulation.frames {
        py.detach(|| folder.write_frame(&simulation, k)).map_err(error::file)?;
        py.check_signals()?;
    }
    folder.write_course(&simulation, simulation.frames).map_err(error::file)?;
    Ok(simulation.frames)
}
