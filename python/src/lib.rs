//! The Python package `egomotion`: arguments are converted, nothing is computed here.
#![deny(missing_docs)]

mod alignment;
mod arrays;
mod config;
mod draws;
mod error;
mod estimate;
mod estimators;
mod evaluate;
mod frame_motion;
mod geometry;
mod measured;
mod observations;
mod observe;
mod pipeline;
mod recording;
mod rig;
mod rows;
mod signals;
mod simulate;
mod study;
mod world;

use pyo3::prelude::*;

/// The compiled part of the package.
#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::alignment::{align, align_phi};
    #[pymodule_export]
    use crate::config::default_config;
    #[pymodule_export]
    use crate::draws::{Draw, Draws, draws};
    #[pymodule_export]
    use crate::error::{ReadError, Unsolvable};
    #[pymodule_export]
    use crate::estimate::Estimate;
    #[pymodule_export]
    use crate::estimators::{irls, least_squares, lmeds, lmeds_search, lmeds_trials, robust_scale, two_step};
    #[pymodule_export]
    use crate::evaluate::evaluate;
    #[pymodule_export]
    use crate::frame_motion::{FrameMotion, Impact, MovingGroup};
    #[pymodule_export]
    use crate::geometry::{exp, image_flow, instantaneous, log, rotation_and_u, seen_from, velocity};
    #[pymodule_export]
    use crate::measured::{cramer_rao_bound, errors_in_variables, maximum_likelihood};
    #[pymodule_export]
    use crate::observations::{
        DepthChanges, DepthFlows, DepthTracks, StereoFlows, StereoTracks, exact_change, smallest_change,
    };
    #[pymodule_export]
    use crate::observe::{disparity, flow, track};
    #[pymodule_export]
    use crate::pipeline::{RgbdMotion, StereoMotion};
    #[pymodule_export]
    use crate::recording::{Run, run, sequences};
    #[pymodule_export]
    use crate::rig::Rig;
    #[pymodule_export]
    use crate::rows::Rows;
    #[pymodule_export]
    use crate::simulate::simulate;
    #[pymodule_export]
    use crate::study::Study;
    #[pymodule_export]
    use crate::world::Sequence;
}
