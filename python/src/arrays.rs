//! NumPy arrays in, planes and points out, and back.

use egomotion::geometry::{Field, Grid, Image};
use egomotion_io::image::{LUMA, WIDE};
use nalgebra::{SMatrix, SVector};
use numpy::{Element, PyArray1, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// Two arrays (H, W).
pub type Two<'py, T> = (Bound<'py, PyArray2<T>>, Bound<'py, PyArray2<T>>);

/// What NumPy makes of an argument, in C order and aligned: without a copy where it is so already.
fn contiguous<'py>(argument: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let numpy = argument.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (argument,))?;
    numpy.call_method1("require", (array, argument.py().None(), ["C_CONTIGUOUS", "ALIGNED"]))
}

/// The shape and values of an array of one type; `None` if it is of another.
fn values<T: Element + Copy>(array: &Bound<'_, PyAny>) -> PyResult<Option<(Vec<usize>, Vec<T>)>> {
    let Ok(array) = array.cast::<PyArrayDyn<T>>() else { return Ok(None) };
    let values = array.try_readonly()?;
    Ok(Some((array.shape().to_vec(), values.as_slice()?.to_vec())))
}

fn wrong_type(name: &str, array: &Bound<'_, PyAny>, wanted: &str) -> PyErr {
    let found = array.getattr("dtype").map_or_else(|_| "?".to_owned(), |dtype| dtype.to_string());
    PyTypeError::new_err(format!("{name} has dtype {found}; give {wanted}"))
}

fn wrong_shape(name: &str, found: &[usize], wanted: &str) -> PyErr {
    PyValueError::new_err(format!("{name} has shape {found:?}; give {wanted}"))
}

/// Grey levels 0 … 255 of an image, as those of files: (H, W), or colours (H, W, 3) or (H, W, 4) as red, green, blue; uint8, uint16 (0 … 65535) or
/// float32.
pub fn image(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<Image> {
    let array = contiguous(argument)?;
    if let Some((shape, levels)) = values::<u8>(&array)? {
        return grey(name, &shape, &levels, 1.0);
    }
    if let Some((shape, levels)) = values::<u16>(&array)? {
        return grey(name, &shape, &levels, WIDE);
    }
    if let Some((shape, levels)) = values::<f32>(&array)? {
        return grey(name, &shape, &levels, 1.0);
    }
    Err(wrong_type(name, &array, "uint8, uint16 or float32"))
}

fn grey<T: Copy + Into<f32>>(name: &str, shape: &[usize], levels: &[T], unit: f32) -> PyResult<Image> {
    let wanted = "(height, width) or (height, width, 3), not empty";
    let (height, width, channels) = match *shape {
        [height, width] => (height, width, 1),
        [height, width, channels @ (3 | 4)] => (height, width, channels),
        _ => return Err(wrong_shape(name, shape, wanted)),
    };
    let level = |pixel: &[T]| match *pixel {
        [grey] => grey.into() / unit,
        [r, g, b, ..] => (LUMA[0] * r.into() + LUMA[1] * g.into() + LUMA[2] * b.into()) / unit,
        _ => 0.0,
    };
    let levels = levels.chunks_exact(channels).map(level).collect();
    let grid = Grid::from_values(width, height, levels).filter(|_| width > 0 && height > 0);
    grid.ok_or_else(|| wrong_shape(name, shape, wanted))
}

/// A plane (H, W) of float32 or float64 whose missing pixels are NaN.
pub fn field(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<Field> {
    let array = contiguous(argument)?;
    let (shape, levels) = match values::<f32>(&array)? {
        Some(found) => found,
        None => match values::<f64>(&array)? {
            Some((shape, levels)) => (shape, levels.iter().map(|&level| level as f32).collect()),
            None => return Err(wrong_type(name, &array, "float32 with NaN where it is unknown")),
        },
    };
    let wanted = "(height, width), not empty";
    let [height, width] = shape[..] else { return Err(wrong_shape(name, &shape, wanted)) };
    let grid = Grid::from_values(width, height, levels).filter(|_| width > 0 && height > 0);
    grid.map(Field::from_grid).ok_or_else(|| wrong_shape(name, &shape, wanted))
}

/// A plane (H, W) of booleans.
pub fn mask(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<Grid<bool>> {
    let array = contiguous(argument)?;
    let (shape, values) = values::<bool>(&array)?.ok_or_else(|| wrong_type(name, &array, "bool"))?;
    let [height, width] = shape[..] else { return Err(wrong_shape(name, &shape, "(height, width)")) };
    Grid::from_values(width, height, values).ok_or_else(|| wrong_shape(name, &shape, "(height, width)"))
}

/// Numbers of any shape: float64, or what converts to it safely.
pub fn numbers(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<(Vec<usize>, Vec<f64>)> {
    let numpy = argument.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (argument,))?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if !["f", "i", "u"].contains(&kind.as_str()) {
        return Err(wrong_type(name, &array, "float64 or other real numbers"));
    }
    let array = contiguous(&array.call_method1("astype", ("float64",))?)?;
    values::<f64>(&array)?.ok_or_else(|| wrong_type(name, &array, "float64"))
}

/// n numbers: (n,).
pub fn vector(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let (shape, values) = numbers(name, argument)?;
    if shape.len() == 1 { Ok(values) } else { Err(wrong_shape(name, &shape, "(n,)")) }
}

/// One vector of N numbers: (N,).
pub fn one<const N: usize>(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<SVector<f64, N>> {
    let (shape, values) = numbers(name, argument)?;
    if shape == [N] {
        Ok(SVector::from_column_slice(&values))
    } else {
        Err(wrong_shape(name, &shape, &format!("({N},)")))
    }
}

/// n vectors of N numbers each: (n, N).
pub fn rows<const N: usize>(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<Vec<SVector<f64, N>>> {
    let (shape, values) = numbers(name, argument)?;
    match shape[..] {
        [_, columns] if columns == N => {
            Ok(values.as_chunks::<N>().0.iter().map(|row| SVector::from_column_slice(row)).collect())
        }
        _ => Err(wrong_shape(name, &shape, &format!("(n, {N})"))),
    }
}

/// One N × N matrix.
pub fn matrix<const N: usize>(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<SMatrix<f64, N, N>> {
    let (shape, values) = numbers(name, argument)?;
    if shape == [N, N] {
        Ok(SMatrix::from_row_slice(&values))
    } else {
        Err(wrong_shape(name, &shape, &format!("({N}, {N})")))
    }
}

/// Covariances of n vectors of N numbers: whole (n, N, N), or variances (n, N) or (N,).
pub fn covariances<const N: usize>(
    name: &str,
    argument: &Bound<'_, PyAny>,
    n: usize,
) -> PyResult<Vec<SMatrix<f64, N, N>>> {
    let (shape, values) = numbers(name, argument)?;
    let diagonal = |row: &[f64]| SMatrix::from_diagonal(&SVector::<f64, N>::from_column_slice(row));
    match shape[..] {
        [rows] if rows == N => Ok(vec![diagonal(&values); n]),
        [rows, columns] if rows == n && columns == N => Ok(values.chunks_exact(N).map(diagonal).collect()),
        [rows, a, b] if rows == n && a == N && b == N => {
            Ok(values.chunks_exact(N * N).map(SMatrix::from_row_slice).collect())
        }
        _ => {
            let wanted = format!("variances ({N},) or ({n}, {N}), or covariances ({n}, {N}, {N})");
            Err(wrong_shape(name, &shape, &wanted))
        }
    }
}

/// As many of one thing as of another.
pub fn same_length(name: &str, found: usize, wanted: usize) -> PyResult<()> {
    if found == wanted {
        return Ok(());
    }
    Err(PyValueError::new_err(format!("{name} has {found} rows; give {wanted}, one for each point")))
}

/// A plane as an array (H, W).
pub fn plane<'py, T: Element + Copy>(py: Python<'py>, grid: &Grid<T>) -> PyResult<Bound<'py, PyArray2<T>>> {
    PyArray1::from_slice(py, grid.values()).reshape([grid.height(), grid.width()])
}

/// Planes of one size side by side, (H, W, n).
pub fn planes<'py>(py: Python<'py>, planes: &[&Grid<f32>]) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let (width, height) = planes.first().map_or((0, 0), |plane| plane.size());
    let pixel = |i: usize| planes.iter().map(move |plane| plane.values()[i]);
    let values: Vec<f32> = (0..width * height).flat_map(pixel).collect();
    PyArray1::from_vec(py, values).reshape([height, width, planes.len()])
}

/// A field as an array (H, W) with NaN where it is missing.
pub fn field_plane<'py>(py: Python<'py>, field: &Field) -> PyResult<Bound<'py, PyArray2<f32>>> {
    plane(py, field.grid())
}

/// Vectors as an array (n, N).
pub fn table<'py, const N: usize>(
    py: Python<'py>,
    rows: impl IntoIterator<Item = SVector<f64, N>>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let values: Vec<f64> = rows.into_iter().flat_map(<[f64; N]>::from).collect();
    let n = values.len() / N.max(1);
    PyArray1::from_vec(py, values).reshape([n, N])
}

/// A matrix as an array (R, C).
pub fn square<'py, const R: usize, const C: usize>(
    py: Python<'py>,
    matrix: &SMatrix<f64, R, C>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_slice(py, matrix.transpose().as_slice()).reshape([R, C])
}

/// Matrices as an array (n, R, C).
pub fn stack<'py, const R: usize, const C: usize>(
    py: Python<'py>,
    matrices: impl IntoIterator<Item = SMatrix<f64, R, C>>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let values: Vec<f64> = matrices.into_iter().flat_map(|m| m.transpose().as_slice().to_vec()).collect();
    let n = values.len() / (R * C).max(1);
    PyArray1::from_vec(py, values).reshape([n, R, C])
}
