//! The paper's laboratory
#![deny(missing_docs)]
#![deny(clippy::disallowed_methods)]
#![warn(clippy::too_many_lines)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod assumptions;
pub mod consistency;
pub mod efficiency;
pub mod real;
pub mod sensitivity;
pub mod synthetic;
pub mod uncertainty;

mod components;
mod figure;
mod range;
mod sequences;
mod study;
mod table;

pub use assumptions::Assumptions;
pub use consistency::Consistency;
pub use efficiency::Efficiency;
pub use figure::{Axis, Content, Figure, Layout, Line, Panel, Point, Series};
pub use range::OutOfRange;
pub use real::LabStudy;
pub use sensitivity::{OneSetting, Sensitivity};
pub use sequences::NoSequence;
pub use study::{Publication, Study};
pub use table::{Cell, Column, Table};
pub use uncertainty::Uncertainty;
