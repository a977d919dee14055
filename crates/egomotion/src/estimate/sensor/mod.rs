//! Errors of a sensor that is known only so well: their prior, what they do, and their estimate together with φ.

pub(super) mod augmented;
pub(super) mod errors;
pub(super) mod rig_prior;
pub(super) mod tolerance;
