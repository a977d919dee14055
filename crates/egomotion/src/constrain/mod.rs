//! From observations to equations: rows n · V(P) = c, or misclosures that maximum likelihood makes small.

pub mod binocular_flow;
pub mod dcce;
pub mod displacement;
pub mod image_flow;
mod linear;
mod misclosure;

pub use linear::LinearConstraint;
#[cfg(test)]
pub(crate) use misclosure::phase_wave;
pub(crate) use misclosure::predict;
pub use misclosure::{LinearisationPoint, Measurement, Misclosure, SharedJacobian};
