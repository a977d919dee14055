//! How well an estimate is known: its covariance, and what the data do not determine.

pub(super) mod blocks;
pub(super) mod covariance;
pub(super) mod neighbours;
pub(super) mod observability;
pub(super) mod undetermined;
