//! Settings from keywords.

use egomotion::pipeline::Config;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::ThreadPool;
use serde::de::DeserializeOwned;

use crate::error;

/// Settings by keywords, the others as they are by default; nested ones are dictionaries.
pub fn from_keywords<T: DeserializeOwned + Default>(
    py: Python<'_>,
    keywords: Option<&Bound<'_, PyDict>>,
) -> PyResult<T> {
    let Some(keywords) = keywords else { return Ok(T::default()) };
    let text: String = py.import("json")?.call_method1("dumps", (keywords,))?.extract()?;
    serde_json::from_str(&text).map_err(|error| {
        // Lines and columns of the text in between mean nothing to the caller.
        let words = error.to_string();
        PyValueError::new_err(words.split(" at line ").next().unwrap_or(&words).to_owned())
    })
}

/// The settings of a pipeline, checked.
pub fn config(py: Python<'_>, keywords: Option<&Bound<'_, PyDict>>) -> PyResult<Config> {
    let config: Config = from_keywords(py, keywords)?;
    config.check().map_err(error::value)?;
    Ok(config)
}

/// Every setting with its default, nested as `StereoMotion` takes them.
#[pyfunction]
pub fn default_config(py: Python<'_>) -> PyResult<Py<PyAny>> {
    let text = serde_json::to_string(&Config::default()).map_err(error::value)?;
    Ok(py.import("json")?.call_method1("loads", (text,))?.unbind())
}

/// Threads of one's own, or those of the process.
pub struct Threads(Option<ThreadPool>);

impl Threads {
    pub fn new(count: Option<usize>) -> PyResult<Self> {
        let Some(count) = count else { return Ok(Self(None)) };
        if count == 0 {
            return Err(PyValueError::new_err("threads is 0; give at least 1, or None for all"));
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build();
        pool.map(|pool| Self(Some(pool))).map_err(error::value)
    }

    /// Work on these threads, without the interpreter.
    pub fn run<T: Send>(&self, py: Python<'_>, work: impl FnOnce() -> T + Send) -> T {
        py.detach(|| match &self.0 {
            Some(pool) => pool.install(work),
            None => work(),
        })
    }
}
