//! A rendered sequence in memory: poses, exact motions, images, true maps.

use egomotion::geometry::RigidMotion;
use egomotion::sim;
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::geometry::{Motion, phi, pose};
use crate::rig::Rig;

/// A rendered sequence: poses, exact motions, images, true maps.
#[pyclass(module = "egomotion", frozen)]
pub struct Sequence(sim::Sequence);

#[pymethods]
impl Sequence {
    /// The sequence of that name, of `names()`; `size_px` (width, height), `frames`, and a factor `step` of every motion.
    #[new]
    #[pyo3(signature = (name, *, size_px = None, frames = None, step = 1.0))]
    fn new(name: &str, size_px: Option<(usize, usize)>, frames: Option<usize>, step: f64) -> PyResult<Self> {
        if !step.is_finite() {
            return Err(PyValueError::new_err("step is not a number"));
        }
        if size_px
            .is_some_and(|(width, height)| !(16..=8192).contains(&width) || !(16..=8192).contains(&height))
        {
            return Err(PyValueError::new_err("size_px must be 16 to 8192 pixels in both directions"));
        }
        if frames.is_some_and(|frames| !(1..=1_000_000).contains(&frames)) {
            return Err(PyValueError::new_err("frames must be 1 to 1000000"));
        }
        let found = sim::Sequence::named(name, size_px, frames, step);
        let known = || sim::Sequence::names().collect::<Vec<_>>().join(", ");
        found
            .map(Self)
            .ok_or_else(|| PyValueError::new_err(format!("no sequence {name:?}; there are {}", known())))
    }

    /// Every name.
    #[staticmethod]
    fn names() -> Vec<&'static str> {
        sim::Sequence::names().collect()
    }

    /// What sees it.
    #[getter]
    fn rig(&self) -> Rig {
        Rig(self.0.rig)
    }

    /// Seconds from frame to frame; 1 where the motion is defined per frame only.
    #[getter]
    fn interval_s(&self) -> f64 {
        self.0.interval_s
    }

    /// Pose world_from_left of frame k: rotation (3, 3) and translation (3,).
    fn pose<'py>(&self, py: Python<'py>, k: usize) -> PyResult<Motion<'py>> {
        let motion: RigidMotion = self.0.world_from_left(k).ok_or_else(past_the_end)?;
        pose(py, &motion)
    }

    /// Exact φ (6,) of the scene, seen by the left camera, from frame k to k + 1.
    fn phi<'py>(&self, py: Python<'py>, k: usize) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(phi(py, &self.0.phi(k).ok_or_else(past_the_end)?))
    }

    /// Distance in metres from the nearer camera to the nearest surface at frame k; negative outside the room.
    fn clearance_m(&self, k: usize) -> PyResult<f64> {
        self.0.clearance_m(k).ok_or_else(past_the_end)
    }

    /// Left and right image (H, W), float32 grey levels 0 … 255, of frame k; `samples`² rays a pixel.
    ///
    /// The sensor's `noise` is of `seed`.
    #[pyo3(signature = (k, *, noise = true, seed = 1, samples = 4))]
    fn render<'py>(
        &self,
        py: Python<'py>,
        k: usize,
        noise: bool,
        seed: u64,
        samples: usize,
    ) -> PyResult<arrays::ArrayPair<'py, f32>> {
        if !(1..=16).contains(&samples) {
            return Err(PyValueError::new_err("samples must be 1 to 16"));
        }
        let sensor =
            if noise { sim::SensorNoise::default().with_seed(seed) } else { sim::SensorNoise::none() };
        let view = self.0.view(k).ok_or_else(past_the_end)?;
        let images = py.detach(|| sensor.photograph(&view, samples, k as u64));
        Ok((arrays::plane(py, &images.left)?, arrays::plane(py, &images.right)?))
    }

    /// True maps of frame k on the left image's pixels, NaN where nothing is seen: `disparity`, `depth`, and towards frame
    /// k + 1 `depth_velocity`, `flow` (H, W, 2), `in_right` and `in_later` (H, W) bool.
    fn truth<'py>(&self, py: Python<'py>, k: usize) -> PyResult<Bound<'py, PyDict>> {
        let view = self.0.view(k).ok_or_else(past_the_end)?;
        let motion = self.0.phi(k);
        let maps = py.detach(|| view.truth_maps(motion.as_ref()));
        let seen = |bit: u8| -> PyResult<Bound<'py, PyArray2<bool>>> {
            let (width, height) = maps.visible.size();
            let grid =
                egomotion::geometry::Grid::from_fn(width, height, |u, v| maps.visible.at(u, v) & bit != 0);
            arrays::plane(py, &grid)
        };
        let dict = PyDict::new(py);
        dict.set_item("disparity", arrays::field_plane(py, &maps.shift)?)?;
        dict.set_item("depth", arrays::field_plane(py, &maps.depth)?)?;
        dict.set_item("in_right", seen(sim::IN_RIGHT)?)?;
        if motion.is_some() {
            let flow: Bound<'py, PyArray3<f32>> =
                arrays::planes(py, &[maps.flow[0].grid(), maps.flow[1].grid()])?;
            dict.set_item("depth_velocity", arrays::field_plane(py, &maps.depth_velocity)?)?;
            dict.set_item("flow", flow)?;
            dict.set_item("in_later", seen(sim::IN_LATER)?)?;
        }
        Ok(dict)
    }

    fn __len__(&self) -> usize {
        self.0.frames()
    }

    fn __repr__(&self) -> String {
        format!("Sequence({:?}, {} frames)", self.0.name, self.0.frames())
    }
}

fn past_the_end() -> PyErr {
    PyIndexError::new_err("there are not so many frames")
}
