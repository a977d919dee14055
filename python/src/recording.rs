//! Recordings from their files.

use std::path::PathBuf;
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex};

use egomotion::pipeline::Trajectory;
use egomotion_io::Source;
use egomotion_io::recording::{Pipeline, Recording, RecordingOptions, Sensor, SourceFrame, read_ahead};
use egomotion_io::source::Sequence;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::config::{Threads, config};
use crate::doubt::Doubt;
use crate::error;
use crate::frame_motion::FrameMotion;
use crate::rig::Rig;

/// Names of the sequences that a recording holds: one, or the scenes of a set.
#[pyfunction]
#[pyo3(signature = (path, *, calibration = None))]
pub fn sequences(py: Python<'_>, path: PathBuf, calibration: Option<PathBuf>) -> PyResult<Vec<String>> {
    let source = py.detach(|| Source::open_with(&path, calibration.as_deref())).map_err(error::file)?;
    Ok(source.sequences.into_iter().map(|sequence| sequence.name).collect())
}

/// The motion of a recording, frame by frame: an iterator of `FrameMotion`, read ahead on a thread of its own.
///
/// `path` is what `egomotion run` takes; of a set of scenes `sequence` names one of `sequences(path)`. `sensor` is "stereo"
/// or "depth"; `disparity` and `flow` are folders of maps, `tracks` a file, `mask` an image. Other keywords are the settings
/// of `default_config()`, and so are these three where they are dictionaries.
#[pyfunction]
#[pyo3(signature = (
    path, *, sequence = None, calibration = None, start = 0, frames = None, stride = 1, reverse = false, sensor = None,
    disparity = None, flow = None, tracks = None, mask = None, threads = None, **settings
))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub fn run(
    py: Python<'_>,
    path: PathBuf,
    sequence: Option<&str>,
    calibration: Option<PathBuf>,
    start: usize,
    frames: Option<usize>,
    stride: usize,
    reverse: bool,
    sensor: Option<&str>,
    disparity: Option<&Bound<'_, PyAny>>,
    flow: Option<&Bound<'_, PyAny>>,
    tracks: Option<&Bound<'_, PyAny>>,
    mask: Option<PathBuf>,
    threads: Option<usize>,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<Run> {
    let sensor = sensor.map(named_sensor).transpose()?;
    if stride == 0 {
        return Err(PyValueError::new_err("stride is 0; give at least 1"));
    }
    let settings = settings.map_or_else(|| Ok(PyDict::new(py)), |given| given.copy())?;
    let [disparity, flow, tracks] = [("disparity", disparity), ("flow", flow), ("tracks", tracks)]
        .map(|(name, given)| file_or_settings(name, given, &settings));
    let (disparity, flow, tracks) = (disparity?, flow?, tracks?);
    let choice = RecordingOptions {
        start,
        frames,
        stride: Some(stride),
        reverse,
        sensor,
        disparity,
        flow,
        tracks,
        mask,
    };
    let (config, threads) = (config(py, Some(&settings))?, Threads::new(threads)?);
    let (name, recording) = py.detach(|| -> PyResult<_> {
        let source = Source::open_with(&path, calibration.as_deref()).map_err(error::file)?;
        let found = named(source, sequence)?;
        Ok((found.name.clone(), Recording::open(&path, &found, &choice).map_err(error::options)?))
    })?;
    let pipeline = recording.pipeline(&config).map_err(error::value)?;
    let recording = Arc::new(recording);
    Ok(Run {
        name,
        fetched: Mutex::new(read_ahead(Arc::clone(&recording))),
        recording,
        pipeline,
        trajectory: Trajectory::new(),
        threads,
        doubt: Doubt::default(),
    })
}

/// The sensor of that name.
fn named_sensor(name: &str) -> PyResult<Sensor> {
    match name {
        "stereo" => Ok(Sensor::Stereo),
        "depth" => Ok(Sensor::Depth),
        other => {
            Err(PyValueError::new_err(format!("sensor {other:?} is not known; give 'stereo' or 'depth'")))
        }
    }
}

/// A path; a dictionary goes to the settings of that name.
fn file_or_settings(
    name: &str,
    given: Option<&Bound<'_, PyAny>>,
    settings: &Bound<'_, PyDict>,
) -> PyResult<Option<PathBuf>> {
    match given {
        Some(part) if part.is_instance_of::<PyDict>() => settings.set_item(name, part).map(|()| None),
        given => given.map(|path| path.extract()).transpose(),
    }
}

/// The sequence of that name, or the only one.
fn named(source: Source, name: Option<&str>) -> PyResult<Sequence> {
    let names =
        || source.sequences.iter().map(|sequence| sequence.name.as_str()).collect::<Vec<_>>().join(", ");
    let place = match name {
        Some(name) => {
            source.sequences.iter().position(|sequence| sequence.name == name).ok_or_else(|| {
                PyValueError::new_err(format!(
                    "{}: no sequence {name:?}; there are {}",
                    source.path.display(),
                    names()
                ))
            })?
        }
        None if source.sequences.len() == 1 => 0,
        None => {
            let words =
                format!("{}: holds several sequences; name one of {}", source.path.display(), names());
            return Err(PyValueError::new_err(words));
        }
    };
    source.sequences.into_iter().nth(place).ok_or_else(|| PyValueError::new_err("no sequence"))
}

/// A recording on its way through the pipeline: an iterator of `FrameMotion`.
#[pyclass(module = "egomotion")]
pub struct Run {
    name: String,
    recording: Arc<Recording>,
    fetched: Mutex<Receiver<SourceFrame>>,
    pipeline: Pipeline,
    trajectory: Trajectory,
    threads: Threads,
    doubt: Doubt,
}

#[pymethods]
impl Run {
    /// Name of the sequence.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// The rig on whose pixels the maps lie.
    #[getter]
    fn rig(&self) -> Rig {
        Rig(self.recording.rig)
    }

    fn __len__(&self) -> usize {
        self.recording.len()
    }

    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__(&mut self, py: Python<'_>) -> PyResult<Option<FrameMotion>> {
        let Self { fetched, pipeline, threads, .. } = self;
        let pushed = threads.run(py, || {
            let SourceFrame { index, time_s, input, truth, .. } = fetched.get_mut().ok()?.recv().ok()?;
            Some((index, truth, pipeline.push(time_s, input)))
        });
        let Some((index, truth, answer)) = pushed else { return Ok(None) };
        self.doubt.of(py, &answer)?;
        self.trajectory.push(&answer);
        // Where there is no answer the pose follows from the next one.
        let pose =
            self.trajectory.poses().last().copied().filter(|_| answer.motion.is_ok() || answer.frame == 0);
        Ok(Some(FrameMotion::of(answer).placed(index, pose, truth)))
    }

    /// Poses world_from_camera of the frames so far as (n, 4, 4), the first the identity; where frames gave no answer
    /// they are interpolated.
    #[getter]
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, numpy::PyArray3<f64>>> {
        crate::arrays::stack(
            py,
            self.trajectory.poses().iter().map(|pose| {
                let mut matrix = nalgebra::Matrix4::identity();
                matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&pose.rotation);
                matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&pose.translation);
                matrix
            }),
        )
    }

    /// Their times (n,) in seconds.
    #[getter]
    fn times_s<'py>(&self, py: Python<'py>) -> Bound<'py, numpy::PyArray1<f64>> {
        numpy::PyArray1::from_slice(py, self.trajectory.times_s())
    }

    fn __repr__(&self) -> String {
        format!("Run({:?}, {} frames)", self.name, self.recording.len())
    }
}
