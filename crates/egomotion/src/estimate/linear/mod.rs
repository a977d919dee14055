//! Fits of linear rows a · θ = b: least squares, least median of squares, Student's t, and the paper's two steps.

pub(super) mod best_subset;
pub(super) mod errors_in_variables;
pub(super) mod fit;
pub(super) mod least_squares;
pub(super) mod lmeds;
pub(super) mod m_estimator;
pub(super) mod row;
pub(super) mod two_step;
