//! The parts of the front end: disparity, flow and tracks, each with its uncertainty.

use egomotion::geometry::Twist;
use egomotion::observe::tracks::{Hints, stereo_tracks};
use egomotion::observe::{DisparityMap, DisparityMatcher, FlowField, Pyramid, StereoPyramid, dense_flow};
use egomotion::pipeline::Config;
use egomotion_io::precomputed;
use numpy::PyArray3;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::config::config;
use crate::error;
use crate::geometry::twist;
use crate::observations::StereoTracks;
use crate::rig::Rig;

/// A disparity map that the caller has computed.
pub fn precomputed_disparity(
    shift: Option<&Bound<'_, PyAny>>,
    sigma: Option<&Bound<'_, PyAny>>,
) -> PyResult<Option<DisparityMap>> {
    let Some(shift) = shift else {
        return match sigma {
            None => Ok(None),
            Some(_) => Err(error::value("disparity_sigma needs disparity")),
        };
    };
    let shift = arrays::field("disparity", shift)?;
    let Some(sigma) = sigma else {
        return Ok(Some(DisparityMap::given(shift, |_| precomputed::DEFAULT_SIGMA_PX)));
    };
    let sigma = arrays::field("disparity_sigma", sigma)?;
    if sigma.size() != shift.size() {
        return Err(error::value("disparity and disparity_sigma differ in size"));
    }
    Ok(Some(DisparityMap { shift, sigma }))
}

/// Flow that the caller has computed.
pub fn precomputed_flow(
    flow: Option<&Bound<'_, PyAny>>,
    covariance: Option<&Bound<'_, PyAny>>,
) -> PyResult<Option<FlowField>> {
    let Some(flow) = flow else {
        return match covariance {
            None => Ok(None),
            Some(_) => Err(error::value("flow_cov needs flow")),
        };
    };
    let [u, v] = arrays::fields("flow", flow)?;
    let found = FlowField::given(u, v, precomputed::DEFAULT_SIGMA_PX);
    let Some(covariance) = covariance else { return Ok(Some(found)) };
    let planes = arrays::fields::<3>("flow_cov", covariance)?;
    if planes[0].size() != found.size() {
        return Err(error::value("flow and flow_cov differ in size"));
    }
    let [cov_uu, cov_uv, cov_vv] = planes.map(|plane| plane.grid().clone());
    Ok(Some(FlowField { cov_uu, cov_uv, cov_vv, ..found }))
}

/// The settings of one part, by keywords.
fn part(py: Python<'_>, name: &str, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Config> {
    let all = PyDict::new(py);
    if let Some(settings) = settings {
        all.set_item(name, settings)?;
    }
    config(py, Some(&all))
}

/// Disparity u_left − u_right (H, W) of the left image's pixels, and its σ (H, W), in pixels; NaN where no match is to be
/// believed. Keywords are the settings `disparity` of `default_config()`.
#[pyfunction]
#[pyo3(signature = (left, right, **settings))]
pub fn disparity<'py>(
    py: Python<'py>,
    left: &Bound<'py, PyAny>,
    right: &Bound<'py, PyAny>,
    settings: Option<&Bound<'py, PyDict>>,
) -> PyResult<arrays::ArrayPair<'py, f32>> {
    let (left, right) = (arrays::image("left", left)?, arrays::image("right", right)?);
    let options = part(py, "disparity", settings)?.disparity;
    let map = py.detach(|| DisparityMatcher::new(options).compute(&left, &right)).map_err(error::value)?;
    Ok((arrays::field_plane(py, &map.shift)?, arrays::field_plane(py, &map.sigma)?))
}

/// Flow (H, W, 2) and its covariance (H, W, 3).
type FlowAndCovariance<'py> = (Bound<'py, PyArray3<f32>>, Bound<'py, PyArray3<f32>>);

/// Flow (H, W, 2) from one image to another in pixels, on the first one's pixels, and its covariance (H, W, 3) as uu, uv,
/// vv; NaN where nothing can be measured. Keywords are the settings `flow` of `default_config()`.
#[pyfunction]
#[pyo3(signature = (before, after, **settings))]
pub fn flow<'py>(
    py: Python<'py>,
    before: &Bound<'py, PyAny>,
    after: &Bound<'py, PyAny>,
    settings: Option<&Bound<'py, PyDict>>,
) -> PyResult<FlowAndCovariance<'py>> {
    let (before, after) = (arrays::image("before", before)?, arrays::image("after", after)?);
    let config = part(py, "flow", settings)?;
    let levels = config.tracks.pyramid_levels;
    let found = py.detach(|| {
        dense_flow(&Pyramid::new(before, levels), &Pyramid::new(after, levels), None, &config.flow)
    });
    let found = found.map_err(error::value)?;
    let flow = arrays::planes(py, &[found.u.grid(), found.v.grid()])?;
    Ok((flow, arrays::planes(py, &[&found.cov_uu, &found.cov_uv, &found.cov_vv])?))
}

/// Corners found in a stereo pair and followed to the next: (x, y, d) before and after with their covariances.
///
/// `expected_phi` is a motion φ (6,) of the scene near which they are looked for; keywords are the settings `tracks` of
/// `default_config()`.
#[pyfunction]
#[pyo3(signature = (before, after, rig, *, expected_phi = None, **settings))]
pub fn track(
    py: Python<'_>,
    before: (Bound<'_, PyAny>, Bound<'_, PyAny>),
    after: (Bound<'_, PyAny>, Bound<'_, PyAny>),
    rig: &Rig,
    expected_phi: Option<&Bound<'_, PyAny>>,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<StereoTracks> {
    let options = part(py, "tracks", settings)?.tracks;
    let expected_phi: Option<Twist> = expected_phi.map(|phi| twist("expected_phi", phi)).transpose()?;
    let size = (rig.0.width_px, rig.0.height_px);
    let pair = |(left, right): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let images = (arrays::image("left", &left)?, arrays::image("right", &right)?);
        if images.0.size() == size && images.1.size() == size {
            return Ok(images);
        }
        Err(error::value(format_args!(
            "images are {:?} and {:?} pixels, the rig {size:?}",
            images.0.size(),
            images.1.size()
        )))
    };
    let (before, after) = (pair(before)?, pair(after)?);
    Ok(StereoTracks(py.detach(|| {
        let pyramid = |(left, right)| {
            let mut images = StereoPyramid::default();
            images.renew(&left, Some(&right), options.pyramid_levels);
            images
        };
        let hints = Hints { motion: expected_phi.as_ref(), ..Hints::default() };
        stereo_tracks(&pyramid(before), &pyramid(after), &rig.0, hints, &options)
    })))
}
