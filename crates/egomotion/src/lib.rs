//! 3D motion, depth velocity and time to impact from stereo, each with an uncertainty that can be trusted.
//!
//! The modules follow the way of the data; each imports only from those before it:
//! [`geometry`], [`observe`], [`constrain`], [`estimate`], [`motion`], [`pipeline`]. Beside them stand [`sim`],
//! which needs geometry alone, and [`metrics`].
#![deny(missing_docs)]

pub mod constrain;
pub mod estimate;
pub mod geometry;
pub mod metrics;
pub mod motion;
pub mod observe;
pub mod pipeline;
pub mod sim;
