//! A rectified pair of cameras.

use egomotion::geometry::StereoRig;
use numpy::{PyArray2, PyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays;

/// The row of a point that there is not, in metres or pixels.
const NO_POINT: nalgebra::Vector3<f64> = nalgebra::Vector3::new(f64::NAN, f64::NAN, f64::NAN);

/// A rectified stereo rig: pinhole cameras with parallel axes.
///
/// Lengths are metres, image coordinates pixels. x and y count from the principal point, x right, y down, and are
/// scaled to the horizontal focal length; d = x_left − x_right = baseline · focal / Z.
#[pyclass(name = "StereoRig", module = "egomotion", frozen, from_py_object)]
#[derive(Clone, Copy)]
pub struct Rig(pub StereoRig);

#[pymethods]
impl Rig {
    /// A rig of focal length (px), principal point (px), baseline (m) and image size (width, height).
    ///
    /// `doffs_px` is cx_right − cx_left; `focal_y_px` the vertical focal length where pixels are not square.
    #[new]
    #[pyo3(signature = (focal_px, centre_px, baseline_m, size_px, *, doffs_px = 0.0, focal_y_px = None))]
    fn new(
        focal_px: f64,
        centre_px: (f64, f64),
        baseline_m: f64,
        size_px: (usize, usize),
        doffs_px: f64,
        focal_y_px: Option<f64>,
    ) -> PyResult<Self> {
        let rig = StereoRig {
            focal_px,
            focal_y_px: focal_y_px.unwrap_or(focal_px),
            cx_px: centre_px.0,
            cy_px: centre_px.1,
            doffs_px,
            baseline_m,
            width_px: size_px.0,
            height_px: size_px.1,
        };
        rig.check().map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok(Self(rig))
    }

    /// Horizontal focal length in pixels.
    #[getter]
    fn focal_px(&self) -> f64 {
        self.0.focal_px
    }

    /// Vertical focal length in pixels.
    #[getter]
    fn focal_y_px(&self) -> f64 {
        self.0.focal_y_px
    }

    /// Principal point of the left camera (u, v) in pixels.
    #[getter]
    fn centre_px(&self) -> (f64, f64) {
        (self.0.cx_px, self.0.cy_px)
    }

    /// Distance between the optical centres in metres.
    #[getter]
    fn baseline_m(&self) -> f64 {
        self.0.baseline_m
    }

    /// Difference of the principal points, cx_right − cx_left, in pixels.
    #[getter]
    fn doffs_px(&self) -> f64 {
        self.0.doffs_px
    }

    /// Image size (width, height) in pixels.
    #[getter]
    fn size_px(&self) -> (usize, usize) {
        (self.0.width_px, self.0.height_px)
    }

    /// Depth Z in metres of disparities d in pixels, both of any one shape; NaN where d is not positive.
    fn depth<'py>(&self, disparity: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        arrays::each("disparity", disparity, |d| self.0.depth(d).unwrap_or(f64::NAN))
    }

    /// Disparity d in pixels of depths in metres, both of any one shape; NaN where Z is not positive.
    fn disparity<'py>(&self, depth: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        arrays::each("depth", depth, |z| self.0.disparity(z).unwrap_or(f64::NAN))
    }

    /// Points P (n, 3) in metres, left camera, of (x, y, d) (n, 3) in pixels; NaN where d is not positive.
    fn point<'py>(&self, py: Python<'py>, xyd: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let xyd = arrays::rows::<3>("xyd", xyd)?;
        arrays::table(py, xyd.iter().map(|xyd| self.0.point(xyd).unwrap_or(NO_POINT)))
    }

    /// (x, y, d) (n, 3) in pixels of points P (n, 3) in metres; NaN where Z is not positive.
    fn project<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = arrays::rows::<3>("points", points)?;
        arrays::table(py, points.iter().map(|p| self.0.project(p).unwrap_or(NO_POINT)))
    }

    /// (x, y) (n, 2) of pixels (u, v) (n, 2).
    fn image_from_pixel<'py>(
        &self,
        py: Python<'py>,
        uv: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let uv = arrays::rows::<2>("uv", uv)?;
        arrays::table(py, uv.iter().map(|uv| <[f64; 2]>::from(self.0.image_from_pixel(uv.x, uv.y)).into()))
    }

    /// Pixels (u, v) (n, 2) of (x, y) (n, 2).
    fn pixel_from_image<'py>(
        &self,
        py: Python<'py>,
        xy: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let xy = arrays::rows::<2>("xy", xy)?;
        arrays::table(py, xy.iter().map(|xy| <[f64; 2]>::from(self.0.pixel_from_image(xy.x, xy.y)).into()))
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.0 == other.0
    }

    fn __repr__(&self) -> String {
        let rig = &self.0;
        format!(
            "StereoRig(focal_px={:?}, centre_px=({:?}, {:?}), baseline_m={:?}, size_px=({}, {}), doffs_px={:?}, focal_y_px={:?})",
            rig.focal_px,
            rig.cx_px,
            rig.cy_px,
            rig.baseline_m,
            rig.width_px,
            rig.height_px,
            rig.doffs_px,
            rig.focal_y_px
        )
    }
}
