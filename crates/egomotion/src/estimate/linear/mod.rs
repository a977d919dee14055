//! Fits of linear rows: least squares, least median of squares, and what weighs or corrects them.

pub mod errors_in_variables;
pub mod least_squares;
pub mod lmeds;
pub mod m_estimator;
pub mod median_search;
pub mod row;
pub mod two_step;
