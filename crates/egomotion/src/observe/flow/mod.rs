//! Dense optical flow with its covariance.
//!
//! Coarse to fine by dense inverse search (`search`: small patches, inverse-compositional, after
//! Kroeger et al., ECCV 2016, made dense by photometric weights in `densify`), then a windowed
//! Lucas–Kanade step per pixel (`refine`) which gives the sub-pixel accuracy and the covariance: at the
//! level where the search ends, and at full resolution; where the latter has not enough texture the
//! former's wider window answers (`widen`). What backward flow contradicts (`consistency`) stays missing.

mod consistency;
mod correlation;
mod densify;
mod options;
mod refine;
mod sampling;
mod search;
mod select;
mod smooth;
mod widen;
mod window;

pub use options::FlowOptions;

use crate::geometry::{Field, Gaussian, Grid, Image};
use crate::observe::pyramid::Pyramid;
use nalgebra::{Matrix2, Vector2};

/// Displacement of each pixel from one image to another, with its covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct FlowField {
    /// Horizontal displacement (to − from), in pixels; missing exactly where `v` is.
    pub u: Field,
    /// Vertical displacement (to − from), in pixels.
    pub v: Field,
    /// Variance of `u`, in px²; NaN where missing.
    pub cov_uu: Grid<f32>,
    /// Covariance of `u` and `v`, in px²; NaN where missing.
    pub cov_uv: Grid<f32>,
    /// Variance of `v`, in px²; NaN where missing.
    pub cov_vv: Grid<f32>,
}

impl FlowField {
    /// Flow without any value.
    pub fn missing(width: usize, height: usize) -> Self {
        let none = Grid::filled(width, height, f32::NAN);
        Self {
            u: Field::missing(width, height),
            v: Field::missing(width, height),
            cov_uu: none.clone(),
            cov_uv: none.clone(),
            cov_vv: none,
        }
    }

    /// Flow predicted without a covariance of its own (all zero), for the `initial` of [`dense_flow`].
    pub fn prediction(u: Field, v: Field) -> Self {
        let zero = Grid::filled(u.width(), u.height(), 0.0);
        Self { u, v, cov_uu: zero.clone(), cov_uv: zero.clone(), cov_vv: zero }
    }

    /// (width, height), in pixels.
    pub fn size(&self) -> (usize, usize) {
        self.u.size()
    }

    /// Displacement at pixel (u, v), which must lie inside, with its covariance, in pixels.
    pub fn get(&self, u: usize, v: usize) -> Option<Gaussian<2>> {
        let mean = Vector2::new(self.u.get(u, v)?.into(), self.v.get(u, v)?.into());
        let uv = f64::from(self.cov_uv.at(u, v));
        let cov = Matrix2::new(self.cov_uu.at(u, v).into(), uv, uv, self.cov_vv.at(u, v).into());
        Some(Gaussian { mean, cov })
    }
}

/// Why there is no flow at all.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FlowError {
    /// The two images, or the prediction, differ in size.
    #[error("images of {from:?} and {to:?} pixels cannot be compared")]
    SizeMismatch {
        /// (width, height) of the first image.
        from: (usize, usize),
        /// (width, height) of the second image or of the prediction.
        to: (usize, usize),
    },
    /// An option lies outside its range.
    #[error("flow option {0}")]
    Option(&'static str),
}

/// Dense displacement of every pixel without holes; what the steps hand on to each other.
#[derive(Debug, Clone)]
struct Displacement {
    u: Grid<f32>,
    v: Grid<f32>,
}

/// A pixel's displacement with its covariance (uu, uv, vv); without an answer all of it is NaN, or the
/// covariance infinite.
#[derive(Debug, Clone, Copy)]
struct Answer {
    u: f32,
    v: f32,
    cov: [f32; 3],
}

impl Answer {
    /// Nothing is known, for want of texture: a wider window may know more.
    const UNKNOWN: Self = Self { u: f32::NAN, v: f32::NAN, cov: [f32::INFINITY; 3] };
    /// What was found has been refuted.
    const REFUTED: Self = Self { u: f32::NAN, v: f32::NAN, cov: [f32::NAN; 3] };
}

impl FlowField {
    fn from_answers(answers: &Grid<Answer>) -> Self {
        let (width, height) = answers.size();
        let plane = |f: fn(&Answer) -> f32| {
            let mut plane = Grid::filled(width, height, f32::NAN);
            let known = plane.values_mut().iter_mut().zip(answers.values()).filter(|(_, a)| !a.u.is_nan());
            known.for_each(|(p, a)| *p = f(a));
            plane
        };
        Self {
            u: Field::from_grid(plane(|a| a.u)),
            v: Field::from_grid(plane(|a| a.v)),
            cov_uu: plane(|a| a.cov[0]),
            cov_uv: plane(|a| a.cov[1]),
            cov_vv: plane(|a| a.cov[2]),
        }
    }
}

/// Flow of `from` to `to`, on the pixel grid of `from`, displacement (to − from) in pixels.
///
/// `initial` predicts the flow at some or all pixels (for example from rigid motion and disparity). It
/// competes with what is found coarse to fine; at each pixel the smaller photometric residual wins, so
/// that what moves by itself is found all the same.
///
/// Pixels without texture in two directions, with a residual too large, that leave the image, or of
/// which the backward flow disagrees are missing. The errors of neighbours are correlated, see
/// [`FlowOptions::correlation_area_px`]. The answer does not depend on the number of threads.
///
/// # Errors
/// [`FlowError`] if sizes differ or an option lies outside its range. Images too small for a patch of
/// 8×8 pixels are no error: every pixel is missing.
pub fn dense_flow(
    from: &Pyramid,
    to: &Pyramid,
    initial: Option<&FlowField>,
    options: &FlowOptions,
) -> Result<FlowField, FlowError> {
    options.check()?;
    let size = from.size();
    for other in std::iter::once(to.size()).chain(initial.map(FlowField::size)) {
        if other != size {
            return Err(FlowError::SizeMismatch { from: size, to: other });
        }
    }
    let (Some(first), Some(second)) = (from.levels().first(), to.levels().first()) else {
        return Ok(FlowField::missing(0, 0));
    };
    if size.0.min(size.1) < search::PATCH {
        return Ok(FlowField::missing(size.0, size.1));
    }

    let coarsest = from.levels().len().min(to.levels().len()) - 1;
    let finest = options.finest_search_level.min(coarsest);
    let found = coarse_to_fine(from, to, initial, finest, options);
    let wide = (finest > 0).then(|| {
        let (a, b) = (&from.levels()[finest], &to.levels()[finest]);
        refine::refine(a, b, found.clone(), options)
    });
    let found = densify::enlarge(found, finest, size);
    let start = match initial {
        Some(prediction) => select::better(first, second, found, prediction, options),
        None => found,
    };
    let mut flow = refine::refine(first, second, start, options);
    if let Some(wide) = &wide {
        widen::widen(&mut flow, wide, finest);
    }

    if options.consistency_px.is_finite() {
        let coarse = options.consistency_level.min(coarsest);
        let reverse = initial.map(consistency::reverse);
        let backward = coarse_to_fine(to, from, reverse.as_ref(), coarse, options);
        consistency::reject(&mut flow, &backward, coarse, options.consistency_px);
    }
    Ok(FlowField::from_answers(&flow))
}

/// Dense inverse search from the coarsest level both pyramids have down to level `finest`; the
/// displacement is in pixels of that level.
fn coarse_to_fine(
    from: &Pyramid,
    to: &Pyramid,
    initial: Option<&FlowField>,
    finest: usize,
    options: &FlowOptions,
) -> Displacement {
    let levels: Vec<(&Image, &Image)> = from.levels().iter().zip(to.levels()).collect();
    let coarsest = levels.len() - 1;
    let mut flow: Option<Displacement> = None;
    for (level, (a, b)) in levels.iter().enumerate().skip(finest).rev() {
        let prediction = initial.filter(|_| level <= options.initial_level.max(finest)).map(|f| (f, level));
        let pair = search::Pair::new(a, b);
        let patches = search::search(&pair, flow.as_ref(), prediction, level == coarsest, options);
        flow = Some(densify::densify(&pair, &patches));
    }
    flow.unwrap_or_else(|| {
        let zero = Grid::filled(from.size().0, from.size().1, 0.0);
        Displacement { u: zero.clone(), v: zero }
    })
}
