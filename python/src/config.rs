//! Settings from keywords.

use egomotion::pipeline::{Config, former_key_advice};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::ThreadPool;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::error;

/// Settings by keywords, the others as they are by default; nested ones are dictionaries.
pub fn from_keywords<T: DeserializeOwned + Default>(
    py: Python<'_>,
    keywords: Option<&Bound<'_, PyDict>>,
) -> PyResult<T> {
    match keywords {
        Some(keywords) => parse(&json(py, keywords)?),
        None => Ok(T::default()),
    }
}

/// The settings of a pipeline, checked; a key of an earlier version is refused with what to do about it.
pub fn config(py: Python<'_>, keywords: Option<&Bound<'_, PyDict>>) -> PyResult<Config> {
    let Some(keywords) = keywords else { return Ok(Config::default()) };
    let text = json(py, keywords)?;
    if let Ok(value) = serde_json::from_str::<Value>(&text)
        && let Some((key, advice)) = former_key(&value, &mut Vec::new())
    {
        return Err(PyValueError::new_err(format!("there is no setting `{key}` any more: {advice}")));
    }
    let config: Config = parse(&text)?;
    config.check().map_err(error::value)?;
    Ok(config)
}

/// Keywords as the text that settings are read from.
fn json(py: Python<'_>, keywords: &Bound<'_, PyDict>) -> PyResult<String> {
    py.import("json")?.call_method1("dumps", (keywords,))?.extract()
}

fn parse<T: DeserializeOwned>(text: &str) -> PyResult<T> {
    serde_json::from_str(text).map_err(|error| {
        // Lines and columns of the text in between mean nothing to the caller.
        let words = error.to_string();
        PyValueError::new_err(words.split(" at line ").next().unwrap_or(&words).to_owned())
    })
}

/// The first key below `path` that settings no longer have, as `part.key`, and what to do about it.
fn former_key<'a>(settings: &'a Value, path: &mut Vec<&'a str>) -> Option<(String, &'static str)> {
    for (key, value) in settings.as_object()? {
        path.push(key);
        let found = former_key_advice(path)
            .map(|advice| (path.join("."), advice))
            .or_else(|| former_key(value, path));
        if found.is_some() {
            return found;
        }
        path.pop();
    }
    None
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
