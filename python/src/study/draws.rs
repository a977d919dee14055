//! What the study `table` draws, for methods of one's own.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use egomotion::geometry::{StereoRig, Twist};
use egomotion::pipeline::Approach;
use egomotion::sim;
use egomotion_study::OneSetting;
use egomotion_study::synthetic::{DifferentialDraw, DiscreteDraw, REFERENCE_POSES, SyntheticWorld};
use nalgebra::Vector3;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::checked;
use crate::error;
use crate::geometry::phi;
use crate::observations::{DepthFlows, DepthTracks, StereoFlows, StereoTracks};
use crate::rig::Rig;

/// Points of the synthetic world and what was measured at each, with the truth.
#[pyclass(module = "egomotion", frozen)]
pub struct StudyDraw {
    rig: StereoRig,
    phi: Twist,
    depth_velocity: Vec<f64>,
    /// What the depth change constraint takes: `DepthFlows` or `DepthTracks`.
    #[pyo3(get)]
    dcce: Py<PyAny>,
    /// What binocular flow takes: `StereoFlows` or `StereoTracks`.
    #[pyo3(get)]
    binocular_flow: Py<PyAny>,
    /// What maximum likelihood takes: the observations of binocular flow with both cameras' v_y.
    #[pyo3(get)]
    maximum_likelihood: Py<PyAny>,
    /// The `StereoTracks` without noise, where the Cramér–Rao bound is taken; None of an instant.
    #[pyo3(get)]
    exact_tracks: Option<Py<PyAny>>,
    /// Seed of the draw, for a method that needs chance of its own.
    #[pyo3(get)]
    seed: u64,
}

#[pymethods]
impl StudyDraw {
    /// What sees it.
    #[getter]
    fn rig(&self) -> Rig {
        Rig(self.rig)
    }

    /// True φ (6,), seen by the left camera.
    #[getter]
    fn phi<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        phi(py, &self.phi)
    }

    /// True VZ (n,) of every point: velocity, or the change of depth over the interval, in metres.
    #[getter]
    fn depth_velocity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.depth_velocity)
    }

    /// Where the left camera sees the middle of the rig (3,) in metres: the study's figures are of
    /// `seen_from(phi, cyclopean_centre)`.
    #[getter]
    fn cyclopean_centre<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let centre: Vector3<f64> = -self.rig.left_from_cyclopean();
        PyArray1::from_slice(py, centre.as_slice())
    }

    fn __len__(&self) -> usize {
        self.depth_velocity.len()
    }
}

/// The draws of `Study("table", …)`, one after another.
#[pyclass(module = "egomotion", frozen)]
pub struct StudyDraws {
    study: OneSetting,
    sequence: sim::Sequence,
    approach: Approach,
    /// The worlds of the reference poses, once they are needed.
    worlds: Mutex<[Option<Arc<SyntheticWorld>>; REFERENCE_POSES.len()]>,
    next: AtomicUsize,
}

/// The draws of `Study("table", **settings)` in one approach, "differential" or "discrete": an iterator of `StudyDraw`.
///
/// They are the same to the last bit, so that a method of one's own stands beside the study's.
#[pyfunction]
#[pyo3(signature = (approach, **settings))]
pub fn study_draws(
    py: Python<'_>,
    approach: &str,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<StudyDraws> {
    let approach = match approach {
        "differential" => Approach::Differential,
        "discrete" => Approach::Discrete,
        _ => {
            return Err(error::value(format!(
                "no approach {approach:?}; give \"differential\" or \"discrete\""
            )));
        }
    };
    let study: OneSetting = checked(py, settings)?;
    let sequence = study.sequence().map_err(error::value)?;
    Ok(StudyDraws { study, sequence, approach, worlds: Mutex::default(), next: AtomicUsize::new(0) })
}

impl StudyDraws {
    fn world(&self, i: usize) -> Option<Arc<SyntheticWorld>> {
        // A thread that panicked leaves worlds as they are: whole or none.
        let mut worlds = self.worlds.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let place = &mut worlds[i % REFERENCE_POSES.len()];
        if place.is_none() {
            *place = self.study.of(&self.sequence).world(i).map(Arc::new);
        }
        place.clone()
    }

    fn differential(&self, py: Python<'_>, world: &SyntheticWorld, seed: u64) -> PyResult<StudyDraw> {
        let found = py.detach(|| DifferentialDraw::new(world, &self.study.model, seed));
        Ok(StudyDraw {
            rig: world.rig,
            phi: world.phi,
            depth_velocity: found.pixels.iter().map(|p| p.vz_m).collect(),
            dcce: Py::new(py, DepthFlows(found.changes))?.into_any(),
            binocular_flow: Py::new(py, StereoFlows(found.motions))?.into_any(),
            maximum_likelihood: Py::new(py, StereoFlows(found.complete))?.into_any(),
            exact_tracks: None,
            seed,
        })
    }

    fn discrete(&self, py: Python<'_>, world: &SyntheticWorld, seed: u64) -> PyResult<StudyDraw> {
        let found = py.detach(|| DiscreteDraw::new(world, &self.study.model, seed));
        let exact = found.exact(&self.study.model);
        Ok(StudyDraw {
            rig: world.rig,
            phi: world.phi,
            depth_velocity: found.pixels.iter().map(|p| p.depth_change_m).collect(),
            dcce: Py::new(py, DepthTracks(found.changes))?.into_any(),
            binocular_flow: Py::new(py, StereoTracks(found.motions))?.into_any(),
            maximum_likelihood: Py::new(py, StereoTracks(found.complete))?.into_any(),
            exact_tracks: Some(Py::new(py, StereoTracks(exact))?.into_any()),
            seed,
        })
    }
}

#[pymethods]
impl StudyDraws {
    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<StudyDraw>> {
        py.check_signals()?;
        let i = self.next.fetch_add(1, Ordering::Relaxed);
        if i >= self.study.draws {
            return Ok(None);
        }
        let Some(world) = py.detach(|| self.world(i)) else { return Ok(None) };
        let seed = self.study.of(&self.sequence).seed_of(i);
        let draw = match self.approach {
            Approach::Differential => self.differential(py, &world, seed)?,
            Approach::Discrete => self.discrete(py, &world, seed)?,
        };
        Ok(Some(draw))
    }

    fn __len__(&self) -> usize {
        self.study.draws
    }
}
