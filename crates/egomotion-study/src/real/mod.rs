//! Section 7.2 again: the manipulator's sequences through the whole image pipeline, Tables 3 to 7 and Figures 11 to
//! 14, with what the paper prints beside what is measured here, and the best estimator beside both.
//!
//! Choices. The differential approach is the paper's own: derivatives at t, d_t = ½ (d(t+1) − d(t−1)), and the image
//! velocity at t as half the displacement from t−1 to t+1 in the left and in the right image, so that both are of
//! the same order in the motion. The discrete approach compares t with t+1. The paper's methods get disparity
//! rounded to 1/16 px, as its matcher gave it; maximum likelihood is the library's pipeline on the images of t and
//! t+1, with all its defaults. φ is estimated from all that is measured, wrong matches too; the truth only decides at
//! which pixels VZ is judged.

pub mod depth_velocity;
pub mod estimates;
pub mod lab;
pub mod measured;
pub mod printed;
mod publish;
pub mod record;
pub mod recording;
mod stage;
pub mod way;

pub use lab::{LabStudy, RealError};
pub use measured::{Measured, Unmeasured};
pub use record::{Draw, Record, Summary};
pub use way::{Estimator, Quantity, Way};
