//! The synthetic experiment of section 7.1: a world with exact truth, one draw of measurements, and every estimator.
//!
//! [`SyntheticWorld`] holds the exact disparity around one reference pose. [`DifferentialDraw`] and [`DiscreteDraw`]
//! are measurements of it with the noise and rounding of a [`MeasurementModel`]. A [`Contender`] turns a draw into φ.

mod contender;
mod draw;
mod measurement;
mod world;

pub use contender::Contender;
pub(crate) use contender::{APPROACHES, approach_label, approach_name, method_label, method_name};
pub use draw::{DifferentialDraw, DiscreteDraw, Draw};
pub use measurement::{LEAST_FEATURES, MeasurementModel};
pub(crate) use world::FrameTime;
pub use world::{SyntheticWorld, UsablePixel};

/// Reference poses exp(k φ) that the draws of a study go through in turn (7.1).
pub const REFERENCE_POSES: [i32; 5] = [-2, -1, 0, 1, 2];

/// Rays in each direction through a pixel of a rendered image that an edge between surfaces crosses.
///
/// More rays make edges smoother and rendering slower; the studies' numbers belong to three.
pub(crate) const EDGE_RAYS: usize = 3;

/// Seed of draw `i` of a study with this seed.
///
/// Seeds of neighbouring studies lie about a million apart, so that their draws are not the same.
pub(crate) fn draw_seed(seed: u64, i: usize) -> u64 {
    seed.wrapping_mul(1_000_003).wrapping_add(i as u64)
}
