//! The Python package `egomotion`: arguments are converted, nothing is computed here.
#![deny(missing_docs)]
#![deny(clippy::disallowed_methods)]
#![warn(clippy::too_many_lines)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod arrays;
mod config;
mod doubt;
mod error;
mod estimators;
mod evaluate;
mod frame_motion;
mod front_end;
mod geometry;
mod metrics;
mod motion;
mod observations;
mod pipeline;
mod recording;
mod rig;
mod rows;
mod signals;
mod simulation;
mod study;

use pyo3::prelude::*;

/// The compiled part of the package.
#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::config::default_config;
    #[pymodule_export]
    use crate::error::{FileError, Unsolvable};
    #[pymodule_export]
    use crate::estimators::{
        Estimate, align, align_phi, cramer_rao_bound, errors_in_variables, irls, joint, least_squares, lmeds,
        lmeds_search, lmeds_trials, maximum_likelihood, robust_scale, two_step,
    };
    #[pymodule_export]
    use crate::evaluate::evaluate;
    #[pymodule_export]
    use crate::frame_motion::{FrameMotion, Impact, MovingGroup};
    #[pymodule_export]
    use crate::front_end::{disparity, flow, track};
    #[pymodule_export]
    use crate::geometry::{
        exp, image_flow, image_velocity, instantaneous, log, propagate_covariance, rotation_and_u,
        rounding_variance, seen_from, velocity,
    };
    #[pymodule_export]
    use crate::metrics::section_seven;
    #[pymodule_export]
    use crate::motion::{rotation_left_out, scaled_depth};
    #[pymodule_export]
    use crate::observations::{
        DepthChanges, DepthFlows, DepthTracks, StereoFlows, StereoTracks, exact_depth_change,
        smallest_depth_change,
    };
    #[pymodule_export]
    use crate::pipeline::{RgbdMotion, StereoMotion};
    #[pymodule_export]
    use crate::recording::{Run, run, sequences};
    #[pymodule_export]
    use crate::rig::Rig;
    #[pymodule_export]
    use crate::rows::Rows;
    #[pymodule_export]
    use crate::simulation::{Sequence, simulate};
    #[pymodule_export]
    use crate::study::{Study, StudyDraw, StudyDraws, study_draws};
}
