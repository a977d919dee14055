//! The studies of Gonçalves and Araújo (2003), repeated and extended: how wrong each method is, and how certain.
//!
//! A [`Study`] is a list of independent parts. Running a part gives records; the records of all parts give a
//! [`Publication`]: tables and figures as plain values. This crate writes no files: the command `egomotion study` turns
//! publications into CSV, SVG and a page, and Python into columns.
//!
//! Two draws of sequence C, with every method and estimator on the same measurements:
//!
//! ```
//! use egomotion_study::{OneSetting, Study};
//!
//! let study = OneSetting { sequence: "C".to_owned(), draws: 2, ..OneSetting::default() };
//! study.check()?;
//! let mut records = Vec::new();
//! for part in 0..study.parts().len() {
//!     records.extend(study.run(part)?);
//! }
//!
//! let publication = study.publish(&records);
//! let overview = &publication.tables[0];
//! assert_eq!(overview.columns[5].heading, "tX");
//!
//! let maximum_likelihood = ["discrete", "ml", "ml"];
//! let tz = records.iter().map(|record| &record.errors);
//! let tz = tz.filter(|errors| errors.contender() == maximum_likelihood && errors.quantity == "tz");
//! for errors in tz {
//!     let statistics = errors.tally.statistics().ok_or("no draw has an answer")?;
//!     println!("tZ: mean error {:.2} % over {} draws", statistics.mean_error(), statistics.n);
//!     assert!(statistics.n == 2 && statistics.mean_error() < 5.0);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | study | `egomotion study` | section of the paper |
//! |---|---|---|
//! | [`Uncertainty`] | `uncertainty` | 5: variance formulas (32) to (53) against draws, Figures 3 to 6 |
//! | [`Sensitivity`] | `sensitivity` | 7.1: six sweeps of the synthetic world, Figures 7 to 9 |
//! | [`OneSetting`] | `table` | 7.1: one setting alone, with every contender |
//! | [`LabStudy`] | `real` | 7.2: the manipulator's sequences as images, Tables 3 to 7, Figures 11 to 14 |
//! | [`Assumptions`] | `assumptions` | 1, 3.1 and 4.3: depth against brightness, instantaneous motion |
//! | [`Efficiency`] | `efficiency` | none: variance, bias and coverage against the Cramér–Rao bound |
//! | [`Consistency`] | `consistency` | none: NEES and coverage of the whole image pipeline |
//! | [`PoseConsistency`] | `consistency --rig` | none: the covariance of every pose, of rigs with errors |
//! | [`Reliability`] | `reliability` | none: which answers of the linear methods can be believed |
//!
//! # Words
//!
//! - A *setting* is a choice of sequence, motion and noise. Its *draws* are random repetitions, each with a seed.
//! - A *contender* is an estimator of φ under comparison: an approach, a method, and how its equations are solved.
//! - A *trial* is one draw with the estimates of all contenders. A *tally* adds up errors over draws; *statistics* are
//!   what it says: ERM, EAM and STD of section 7, or bias, variance, NEES and coverage.
//!
//! Numbers depend on the settings alone: not on the number of threads, nor on the order or the machine of the parts.
#![deny(missing_docs)]
#![deny(clippy::disallowed_methods)]
#![warn(clippy::too_many_lines)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod components;
mod figure;
mod range;
mod sequences;
mod study;
mod table;

pub mod assumptions;
pub mod consistency;
pub mod efficiency;
pub mod poses;
pub mod real;
pub mod reliability;
pub mod sensitivity;
pub mod synthetic;
pub mod uncertainty;

pub use assumptions::Assumptions;
pub use consistency::Consistency;
pub use efficiency::Efficiency;
pub use figure::{Axis, Content, Figure, Layout, Line, Panel, Point, Series};
pub use poses::PoseConsistency;
pub use range::OutOfRange;
pub use real::LabStudy;
pub use reliability::Reliability;
pub use sensitivity::{OneSetting, Sensitivity};
pub use sequences::NoSequence;
pub use study::{Publication, Study};
pub use table::{Cell, Column, Table};
pub use uncertainty::Uncertainty;
