//! Linear equations in up to six unknowns.

use egomotion::estimate::Row;
use nalgebra::{SVector, Vector6};
use numpy::{PyArray1, PyArray2, PyArrayMethods as _};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays;

/// Linear equations a · θ = b, each with the standard deviation of its residual and the block whose noise it shares.
#[pyclass(module = "egomotion", frozen)]
pub struct Rows {
    /// Unknowns.
    pub unknowns: usize,
    /// Coefficients row by row.
    a: Vec<f64>,
    b: Vec<f64>,
    sigma: Vec<f64>,
    block: Vec<usize>,
}

/// The most unknowns of an equation: the six components of φ.
pub const MAX_UNKNOWNS: usize = 6;

/// Call `$body` with N the number of unknowns.
macro_rules! with_unknowns {
    ($rows:expr, $n:ident => $body:expr) => {
        match $rows.unknowns {
            1 => {
                const $n: usize = 1;
                $body
            }
            2 => {
                const $n: usize = 2;
                $body
            }
            3 => {
                const $n: usize = 3;
                $body
            }
            4 => {
                const $n: usize = 4;
                $body
            }
            5 => {
                const $n: usize = 5;
                $body
            }
            _ => {
                const $n: usize = 6;
                $body
            }
        }
    };
}

impl Rows {
    /// Equations in φ.
    pub fn of_six(rows: Vec<(Vector6<f64>, f64, f64, usize)>) -> Self {
        Self {
            unknowns: MAX_UNKNOWNS,
            a: rows.iter().flat_map(|row| <[f64; 6]>::from(row.0)).collect(),
            b: rows.iter().map(|row| row.1).collect(),
            sigma: rows.iter().map(|row| row.2).collect(),
            block: rows.iter().map(|row| row.3).collect(),
        }
    }

    /// Number of equations.
    pub fn len(&self) -> usize {
        self.b.len()
    }

    pub fn to<const N: usize>(&self) -> Vec<Row<N>> {
        let rest = self.b.iter().zip(&self.sigma).zip(&self.block);
        let row = |(a, ((&b, &sigma), &block)): (&[f64; N], _)| Row { a: SVector::from(*a), b, sigma, block };
        self.a.as_chunks::<N>().0.iter().zip(rest).map(row).collect()
    }
}

#[pymethods]
impl Rows {
    /// a (n, k) with k ≤ 6 unknowns, b (n,), sigma (n,), and blocks (n,), by default each row its own.
    #[new]
    #[pyo3(signature = (a, b, sigma = None, block = None))]
    fn new(
        a: &Bound<'_, PyAny>,
        b: &Bound<'_, PyAny>,
        sigma: Option<&Bound<'_, PyAny>>,
        block: Option<Vec<usize>>,
    ) -> PyResult<Self> {
        let (n, unknowns, a) = arrays::numbers("a", a, |shape, values| match *shape {
            [n, unknowns @ 1..=MAX_UNKNOWNS] => Ok((n, unknowns, values.to_vec())),
            _ => {
                let words = format!("a has shape {shape:?}; give (n, k) with k from 1 to {MAX_UNKNOWNS}");
                Err(PyValueError::new_err(words))
            }
        })?;
        let b = arrays::vector("b", b)?;
        let sigma = sigma.map_or_else(|| Ok(vec![1.0; n]), |sigma| arrays::vector("sigma", sigma))?;
        let block = block.unwrap_or_else(|| (0..n).collect());
        arrays::same_length("b", b.len(), n)?;
        arrays::same_length("sigma", sigma.len(), n)?;
        arrays::same_length("block", block.len(), n)?;
        if block.iter().any(|&block| block > n) {
            return Err(PyValueError::new_err(format!(
                "block has numbers beyond the {n} rows; number them from 0"
            )));
        }
        if sigma.iter().any(|sigma| sigma.is_nan() || *sigma <= 0.0) {
            return Err(PyValueError::new_err("sigma must be positive"));
        }
        Ok(Self { unknowns, a, b, sigma, block })
    }

    /// Coefficients (n, k).
    #[getter]
    fn a<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        PyArray1::from_slice(py, &self.a).reshape([self.b.len(), self.unknowns])
    }

    /// Right-hand sides (n,).
    #[getter]
    fn b<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.b)
    }

    /// Standard deviations of the residuals (n,).
    #[getter]
    fn sigma<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.sigma)
    }

    /// Blocks (n,).
    #[getter]
    fn block<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<usize>> {
        PyArray1::from_slice(py, &self.block)
    }

    fn __len__(&self) -> usize {
        self.len()
    }
}

pub(crate) use with_unknowns;
