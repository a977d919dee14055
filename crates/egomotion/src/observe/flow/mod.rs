//! Dense optical flow with its covariance.
//!
//! Freely (`free`): coarse to fine by dense inverse search (`search`: small patches, inverse-compositional,
//! after Kroeger et al., ECCV 2016, made dense by photometric weights), then a windowed
//! Lucas–Kanade step per pixel (`refine`, `solve`) which gives the sub-pixel accuracy and the covariance: at
//! the level where the search ends, and at full resolution; where the latter has not enough texture the
//! former's wider window answers. What backward flow contradicts stays missing. `step_planes` holds what a step
//! gives, by name.
//!
//! With a prediction (`guided`, `rigid`) the Lucas–Kanade steps begin with it, and only what contradicts
//! it is searched for freely.

mod compare;
mod corrections;
mod displacement;
mod free;
mod guided;
mod options;
mod refine;
mod rigid;
mod search;
mod solve;
mod step_planes;

pub use options::FlowOptions;
pub use rigid::{Side, rigid_flow};

use crate::geometry::{Field, Gaussian, Grid, Image};
use crate::observe::pyramid::Pyramid;
use crate::observe::spline;
use nalgebra::{Matrix2, Vector2};

/// Standard deviation from which on a displacement is a guess and no measurement, in pixels: what was
/// predicted and could not be measured.
///
/// Such values tell where pixels go; motion is not to be estimated from them.
pub const GUESS_SIGMA_PX: f32 = 1.0;

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

    /// Flow handed in by somebody else, with one standard deviation for all; missing where either component is.
    pub fn given(u: Field, v: Field, sigma_px: f32) -> Self {
        let (width, height) = u.size();
        let known = |x: usize, y: usize| u.get(x, y).and(v.get(x, y)).is_some();
        let all =
            |value: f32| Grid::from_fn(width, height, |x, y| if known(x, y) { value } else { f32::NAN });
        let (variance, none) = (all(sigma_px * sigma_px), all(0.0));
        let [u, v] = [&u, &v].map(|plane| {
            let both = |x, y| if known(x, y) { plane.get(x, y).unwrap_or(f32::NAN) } else { f32::NAN };
            Field::from_grid(Grid::from_fn(width, height, both))
        });
        Self { cov_uu: variance.clone(), cov_uv: none, cov_vv: variance, u, v }
    }

    /// (width, height), in pixels.
    pub fn size(&self) -> (usize, usize) {
        self.u.size()
    }

    /// Displacement measured at pixel (u, v), which must lie inside, with its covariance, in pixels; guesses
    /// (see [`GUESS_SIGMA_PX`]) are none.
    pub fn get(&self, u: usize, v: usize) -> Option<Gaussian<2>> {
        let (uu, vv) = (self.cov_uu.at(u, v), self.cov_vv.at(u, v));
        if uu.max(vv) >= GUESS_SIGMA_PX * GUESS_SIGMA_PX {
            return None;
        }
        let mean = Vector2::new(self.u.get(u, v)?.into(), self.v.get(u, v)?.into());
        let uv = f64::from(self.cov_uv.at(u, v));
        let cov = Matrix2::new(uu.into(), uv, uv, vv.into());
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

/// Flow of `from` to `to`, on the pixel grid of `from`, displacement (to − from) in pixels.
///
/// `initial` predicts the flow at some or all pixels, as [`rigid_flow`] does from disparity and motion. The
/// search begins there, and what moves by itself is searched for freely; where nothing can be measured the
/// prediction stands in as a guess ([`GUESS_SIGMA_PX`]) if [`FlowOptions::fill`] says so.
///
/// Pixels without texture in two directions, with a residual too large, that leave the image, or of
/// which the backward flow disagrees are not measured. The errors of neighbours are correlated, see
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
    FlowPair { from, to, to_spline: None }.flow(initial, options, &mut FlowSpace::default())
}

/// Work space that flow keeps from one pair to the next; its content does not change the answer.
#[derive(Debug, Clone, Default)]
pub struct FlowSpace {
    /// The step from the prediction, the step from what the search found, and the step from both.
    from_prediction: step_planes::StepPlanes,
    from_search: step_planes::StepPlanes,
    from_both: step_planes::StepPlanes,
}

/// Two images between which there is flow.
#[derive(Debug, Clone, Copy)]
pub struct FlowPair<'a> {
    /// The first image.
    pub from: &'a Pyramid,
    /// The second image.
    pub to: &'a Pyramid,
    /// Spline coefficients of the second image, if they are there already.
    pub to_spline: Option<&'a Image>,
}

impl FlowPair<'_> {
    /// [`dense_flow`], in a work space at hand.
    ///
    /// # Errors
    /// As those of [`dense_flow`].
    pub fn flow(
        &self,
        initial: Option<&FlowField>,
        options: &FlowOptions,
        space: &mut FlowSpace,
    ) -> Result<FlowField, FlowError> {
        options.check()?;
        let size = self.from.size();
        let others = [self.to.size()].into_iter().chain(initial.map(FlowField::size));
        for other in others.chain(self.to_spline.map(Image::size)) {
            if other != size {
                return Err(FlowError::SizeMismatch { from: size, to: other });
            }
        }
        let (Some(from), Some(to)) = (self.from.levels().first(), self.to.levels().first()) else {
            return Ok(FlowField::missing(0, 0));
        };
        if size.0.min(size.1) < search::PATCH {
            return Ok(FlowField::missing(size.0, size.1));
        }
        let coefficients;
        let to = match self.to_spline {
            Some(there) => there,
            None => {
                coefficients = spline::coefficients(to);
                &coefficients
            }
        };
        let images = compare::LevelImages { from, to };
        Ok(match initial {
            Some(prediction) => guided::flow(self, images, prediction, options, space),
            None => free::flow(self, images, options),
        })
    }

    /// Levels that both images have.
    fn levels(&self) -> Vec<(&Image, &Image)> {
        self.from.levels().iter().zip(self.to.levels()).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::Ordering;

    use super::*;
    use crate::simd::PLAIN;

    #[test]
    fn the_answer_depends_not_on_the_vectors() {
        let grey = |u: f32, v: f32| {
            100.0 + 30.0 * (0.31 * u + 0.12 * v).sin() * (0.2 * v).cos() + 40.0 * (0.07 * u - 0.09 * v).sin()
        };
        let image =
            |shift: f32| Grid::from_fn(171, 93, |u, v| grey(u as f32 + shift, v as f32 - 0.3 * shift));
        let [from, to] = [0.0, 1.7].map(|shift| Pyramid::new(image(shift), 4));
        let plane = |value| Field::from_grid(Grid::filled(171, 93, value));
        // Wrong on purpose: the search takes part.
        let prediction = FlowField::prediction(plane(4.0), plane(0.0));
        let bits = || {
            [None, Some(&prediction)].map(|initial| {
                let flow = dense_flow(&from, &to, initial, &FlowOptions::default()).unwrap();
                [flow.u.grid(), flow.v.grid(), &flow.cov_uu, &flow.cov_uv, &flow.cov_vv]
                    .map(|plane| plane.values().iter().map(|x| x.to_bits()).collect::<Vec<_>>())
            })
        };
        let wide = bits();
        PLAIN.store(true, Ordering::Relaxed);
        let plain = bits();
        PLAIN.store(false, Ordering::Relaxed);
        assert!(wide == plain);
    }
}
