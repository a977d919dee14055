//! The files of a run: from an [`Outcome`](crate::session::Outcome) to what lies in its folder.

mod cloud;
mod colours;
mod folder;
pub mod maps;
mod motion;
mod moving;
mod pair_summary;
mod report;
mod scene_index;
mod summary;
pub mod verdict;

pub use folder::ResultFolder;
pub use motion::{Viewpoint, motion_row, status, write_motion, write_rows};
pub use pair_summary::{NO_MOTION, PairIndex, PairSummary};
pub use report::{RunDescription, write_index, write_report};
pub use scene_index::{SceneEntry, SceneIndex};
pub use summary::{Cameras, Summary, has_answers};
