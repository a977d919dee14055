//! From observations to motion constraints n · V(P) = c.

pub mod binocular_flow;
pub mod dcce;
pub mod image_flow;
pub mod linear;

pub use linear::LinearConstraint;
