//! The paper's studies and ours: parts that can be run anywhere, and what their records show.

mod draws;

use std::sync::Arc;

use egomotion_study::{
    Assumptions, Cell, Consistency, Efficiency, LabStudy, OneSetting, Publication, Sensitivity,
    Study as Parts, Table, Uncertainty,
};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use serde::de::DeserializeOwned;

use crate::config::from_keywords;
use crate::error;
use crate::signals::interruptible;
pub use draws::{StudyDraw, StudyDraws, study_draws};

/// Names of the studies, in the order in which `names()` gives them.
const NAMES: [&str; 7] =
    ["table", "sensitivity", "uncertainty", "real", "assumptions", "consistency", "efficiency"];

/// A study of any kind; records are JSON texts.
trait AnyStudy: Send + Sync {
    fn settings(&self) -> Result<String, String>;
    fn parts(&self) -> Vec<String>;
    fn run(&self, part: usize) -> Result<Vec<String>, String>;
    fn publish(&self, records: &[String]) -> Result<Publication, String>;
}

impl<S: Parts + Send> AnyStudy for S {
    fn settings(&self) -> Result<String, String> {
        words(serde_json::to_string(self))
    }

    fn parts(&self) -> Vec<String> {
        Parts::parts(self)
    }

    fn run(&self, part: usize) -> Result<Vec<String>, String> {
        words(Parts::run(self, part))?.iter().map(|record| words(serde_json::to_string(record))).collect()
    }

    fn publish(&self, records: &[String]) -> Result<Publication, String> {
        let records = records.iter().map(|text| words(serde_json::from_str(text)));
        Ok(Parts::publish(self, &records.collect::<Result<Vec<_>, _>>()?))
    }
}

fn words<T>(result: Result<T, impl std::fmt::Display>) -> Result<T, String> {
    result.map_err(|error| error.to_string())
}

/// The settings of a study by keywords, the others as they are by default.
fn made<S: Parts + Send + Default + DeserializeOwned + 'static>(
    py: Python<'_>,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<Arc<dyn AnyStudy>> {
    Ok(Arc::new(checked::<S>(py, settings)?))
}

/// A study by keywords that can be run.
pub fn checked<S: Parts + Default + DeserializeOwned>(
    py: Python<'_>,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<S> {
    let study: S = from_keywords(py, settings)?;
    study.check().map_err(error::value)?;
    Ok(study)
}

/// A study: independent parts, each of which gives records, and what the records of all of them show.
///
/// Parts may run in any order and on any machine: the numbers are the same.
#[pyclass(module = "egomotion", frozen)]
pub struct Study {
    study: Arc<dyn AnyStudy>,
    name: String,
}

#[pymethods]
impl Study {
    /// The study of that name, of `names()`, with settings by keywords, as `settings` shows them.
    #[new]
    #[pyo3(signature = (name, **settings))]
    fn new(py: Python<'_>, name: &str, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let study = match name {
            "table" => made::<OneSetting>(py, settings)?,
            "sensitivity" => made::<Sensitivity>(py, settings)?,
            "uncertainty" => made::<Uncertainty>(py, settings)?,
            "real" => made::<LabStudy>(py, settings)?,
            "assumptions" => made::<Assumptions>(py, settings)?,
            "consistency" => made::<Consistency>(py, settings)?,
            "efficiency" => made::<Efficiency>(py, settings)?,
            _ => {
                let words = format!("no study {name:?}; there are {}", NAMES.join(", "));
                return Err(PyValueError::new_err(words));
            }
        };
        Ok(Self { study, name: name.to_owned() })
    }

    /// Every name.
    #[staticmethod]
    fn names() -> [&'static str; NAMES.len()] {
        NAMES
    }

    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// Its settings.
    #[getter]
    fn settings(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let text = self.study.settings().map_err(error::value)?;
        Ok(py.import("json")?.call_method1("loads", (text,))?.unbind())
    }

    /// Names of the parts.
    #[getter]
    fn parts(&self) -> Vec<String> {
        self.study.parts()
    }

    /// The records of one part, each a JSON text. Ctrl-C ends the wait at once; what was begun runs out unheard.
    fn run(&self, py: Python<'_>, part: usize) -> PyResult<Vec<String>> {
        let parts = self.study.parts().len();
        if part >= parts {
            return Err(PyIndexError::new_err(format!("part {part} of {parts}")));
        }
        let study = self.study.clone();
        interruptible(py, move || study.run(part))?.map_err(error::value)
    }

    /// Tables of the records, in the order of the parts: name → {column → list}; None where a cell is empty.
    fn publish<'py>(&self, py: Python<'py>, records: Vec<String>) -> PyResult<Bound<'py, PyDict>> {
        let shown = py.detach(|| self.study.publish(&records)).map_err(error::value)?;
        let tables = PyDict::new(py);
        for table in shown.data.iter().chain(&shown.tables) {
            tables.set_item(&table.id, columns(py, table)?)?;
        }
        Ok(tables)
    }

    /// Run all parts in this process, and publish.
    fn tables<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let mut records = Vec::new();
        for part in 0..self.study.parts().len() {
            records.extend(self.run(py, part)?);
        }
        self.publish(py, records)
    }

    fn __repr__(&self) -> String {
        format!("Study({:?}, {} parts)", self.name, self.study.parts().len())
    }
}

fn columns<'py>(py: Python<'py>, table: &Table) -> PyResult<Bound<'py, PyDict>> {
    let columns = PyDict::new(py);
    for (i, column) in table.columns.iter().enumerate() {
        let list = PyList::empty(py);
        for row in &table.rows {
            match row.get(i) {
                Some(Cell::Text(text)) => list.append(text)?,
                Some(Cell::Number(number)) => list.append(number)?,
                Some(Cell::Count(count)) => list.append(count)?,
                Some(Cell::Empty) | None => list.append(py.None())?,
            }
        }
        columns.set_item(&column.name, list)?;
    }
    Ok(columns)
}
