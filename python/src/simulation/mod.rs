//! Rendered sequences with exact truth, in memory and as folders.

mod folder;
mod sequence;

pub use folder::simulate;
pub use sequence::Sequence;
