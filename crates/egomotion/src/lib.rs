//! 3D motion, depth velocity and time to impact from stereo, each with an uncertainty that can be trusted.
//!
//! The modules follow the way of the data; each imports only from those before it:
//! [`geometry`], [`observe`].
#![deny(missing_docs)]

pub mod geometry;
pub mod observe;
