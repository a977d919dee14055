//! Maximum likelihood of observations: where it starts, how it steps, and how it weighs residuals.

pub mod maximum_likelihood;
pub mod mixture;
pub mod robust_start;
pub(crate) mod step;
