//! NumPy arrays in, planes and points out, and back.

use egomotion::geometry::{Field, Grid, Image};
use egomotion_io::image::{LEVELS_16_PER_8_BIT, luma};
use nalgebra::{SMatrix, SVector};
use numpy::{Element, PyArray1, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Two arrays (H, W).
pub type ArrayPair<'py, T> = (Bound<'py, PyArray2<T>>, Bound<'py, PyArray2<T>>);

/// What NumPy makes of an argument, without a copy where that is possible; what gives only DLPack goes in too.
fn array<'py>(argument: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let only_dlpack = argument.hasattr("__dlpack__")? && !argument.hasattr("__array__")?;
    let how = if only_dlpack { "from_dlpack" } else { "asarray" };
    argument.py().import("numpy")?.call_method1(how, (argument,))
}

/// In C order and aligned: without a copy where it is so already.
fn contiguous<'py>(array: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let py = array.py();
    py.import("numpy")?.call_method1("require", (array, py.None(), ["C_CONTIGUOUS", "ALIGNED"]))
}

/// What is made of the shape and values of an array of one type, which are not copied; `None` if it is of another.
fn values<T: Element, R>(
    array: &Bound<'_, PyAny>,
    take: impl FnOnce(&[usize], &[T]) -> PyResult<R>,
) -> PyResult<Option<R>> {
    let Ok(array) = array.cast::<PyArrayDyn<T>>() else { return Ok(None) };
    let values = array.try_readonly()?;
    take(array.shape(), values.as_slice()?).map(Some)
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
    let array = contiguous(&array(argument)?)?;
    if let Some(image) = values(&array, |shape, levels: &[u8]| grey(name, shape, levels, 1.0))? {
        return Ok(image);
    }
    if let Some(image) =
        values(&array, |shape, levels: &[u16]| grey(name, shape, levels, LEVELS_16_PER_8_BIT))?
    {
        return Ok(image);
    }
    let image = values(&array, |shape, levels: &[f32]| grey(name, shape, levels, 1.0))?;
    image.ok_or_else(|| wrong_type(name, &array, "uint8, uint16 or float32"))
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
        [r, g, b, ..] => luma([r.into(), g.into(), b.into()]) / unit,
        _ => 0.0,
    };
    let levels = levels.chunks_exact(channels).map(level).collect();
    let grid = Grid::from_values(width, height, levels).filter(|_| width > 0 && height > 0);
    grid.ok_or_else(|| wrong_shape(name, shape, wanted))
}

/// A plane (H, W) of float32 or float64 whose missing pixels are NaN.
pub fn field(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<Field> {
    let array = contiguous(&array(argument)?)?;
    let single = |shape: &[usize], levels: &[f32]| grid(name, shape, levels.to_vec());
    if let Some(plane) = values(&array, single)? {
        return Ok(Field::from_grid(plane));
    }
    let double =
        |shape: &[usize], levels: &[f64]| grid(name, shape, levels.iter().map(|&v| v as f32).collect());
    let plane = values(&array, double)?;
    let plane = plane.ok_or_else(|| wrong_type(name, &array, "float32 with NaN where it is unknown"))?;
    Ok(Field::from_grid(plane))
}

/// Planes side by side (H, W, N) of float32 or float64 whose missing pixels are NaN.
pub fn fields<const N: usize>(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<[Field; N]> {
    let wanted = format!("(height, width, {N}), not empty");
    let split = |shape: &[usize], level: &dyn Fn(usize) -> f32| match *shape {
        [height, width, n] if n == N && height > 0 && width > 0 => Ok(std::array::from_fn(|k| {
            Field::from_grid(Grid::from_fn(width, height, |u, v| level((v * width + u) * N + k)))
        })),
        _ => Err(wrong_shape(name, shape, &wanted)),
    };
    let array = contiguous(&array(argument)?)?;
    if let Some(planes) = values(&array, |shape, levels: &[f32]| split(shape, &|i| levels[i]))? {
        return Ok(planes);
    }
    let planes = values(&array, |shape, levels: &[f64]| split(shape, &|i| levels[i] as f32))?;
    planes.ok_or_else(|| wrong_type(name, &array, "float32 with NaN where it is unknown"))
}

/// A plane (H, W) of booleans.
pub fn mask(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<Grid<bool>> {
    let array = contiguous(&array(argument)?)?;
    let found = values(&array, |shape, values: &[bool]| grid(name, shape, values.to_vec()))?;
    found.ok_or_else(|| wrong_type(name, &array, "bool"))
}

fn grid<T: Copy>(name: &str, shape: &[usize], values: Vec<T>) -> PyResult<Grid<T>> {
    let found = match *shape {
        [height, width] if height > 0 && width > 0 => Grid::from_values(width, height, values),
        _ => None,
    };
    found.ok_or_else(|| wrong_shape(name, shape, "(height, width), not empty"))
}

/// Numbers of any shape, not copied if they are float64: these, or what converts to them safely.
pub fn numbers<R>(
    name: &str,
    argument: &Bound<'_, PyAny>,
    take: impl FnOnce(&[usize], &[f64]) -> PyResult<R>,
) -> PyResult<R> {
    let array = array(argument)?;
    let wrong = || wrong_type(name, &array, "float64 or other real numbers");
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if !["f", "i", "u"].contains(&kind.as_str()) {
        return Err(wrong());
    }
    let as_they_are = PyDict::new(array.py());
    as_they_are.set_item("copy", false)?;
    let doubles = array.call_method("astype", ("float64",), Some(&as_they_are))?;
    values(&contiguous(&doubles)?, take)?.ok_or_else(wrong)
}

/// A function of each number, in an array of the same shape.
pub fn each<'py>(
    name: &str,
    argument: &Bound<'py, PyAny>,
    of: impl Fn(f64) -> f64,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let py = argument.py();
    numbers(name, argument, |shape, values| {
        PyArray1::from_iter(py, values.iter().map(|&value| of(value))).reshape(shape)
    })
}

/// n numbers: (n,).
pub fn vector(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    numbers(name, argument, |shape, values| match shape {
        [_] => Ok(values.to_vec()),
        _ => Err(wrong_shape(name, shape, "(n,)")),
    })
}

/// One vector of N numbers: (N,).
pub fn one<const N: usize>(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<SVector<f64, N>> {
    numbers(name, argument, |shape, values| match shape {
        [n] if *n == N => Ok(SVector::from_column_slice(values)),
        _ => Err(wrong_shape(name, shape, &format!("({N},)"))),
    })
}

/// n vectors of N numbers each: (n, N).
pub fn rows<const N: usize>(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<Vec<SVector<f64, N>>> {
    numbers(name, argument, |shape, values| match shape {
        [_, columns] if *columns == N => {
            Ok(values.as_chunks::<N>().0.iter().map(|row| SVector::from_column_slice(row)).collect())
        }
        _ => Err(wrong_shape(name, shape, &format!("(n, {N})"))),
    })
}

/// One N × N matrix.
pub fn matrix<const N: usize>(name: &str, argument: &Bound<'_, PyAny>) -> PyResult<SMatrix<f64, N, N>> {
    numbers(name, argument, |shape, values| match shape {
        [a, b] if *a == N && *b == N => Ok(SMatrix::from_row_slice(values)),
        _ => Err(wrong_shape(name, shape, &format!("({N}, {N})"))),
    })
}

/// Covariances of n vectors of N numbers: whole (n, N, N), or variances (n, N) or (N,).
pub fn covariances<const N: usize>(
    name: &str,
    argument: &Bound<'_, PyAny>,
    n: usize,
) -> PyResult<Vec<SMatrix<f64, N, N>>> {
    let diagonal = |row: &[f64]| SMatrix::from_diagonal(&SVector::<f64, N>::from_column_slice(row));
    numbers(name, argument, |shape, values| match *shape {
        [rows] if rows == N => Ok(vec![diagonal(values); n]),
        [rows, columns] if rows == n && columns == N => Ok(values.chunks_exact(N).map(diagonal).collect()),
        [rows, a, b] if rows == n && a == N && b == N => {
            Ok(values.chunks_exact(N * N).map(SMatrix::from_row_slice).collect())
        }
        _ => {
            let wanted = format!("variances ({N},) or ({n}, {N}), or covariances ({n}, {N}, {N})");
            Err(wrong_shape(name, shape, &wanted))
        }
    })
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
