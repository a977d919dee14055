//! Maximum likelihood of observations: where it starts, how it steps, how it weighs residuals, and what moves all of them.

pub(super) mod cramer_rao;
pub(super) mod maximum_likelihood;
pub(super) mod mixture;
pub(super) mod robust_start;
pub(super) mod score_sums;
mod step;
pub(super) mod systematic;
