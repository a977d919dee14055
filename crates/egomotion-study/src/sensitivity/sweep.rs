//! The six sweeps of section 7.1, and the two baselines at which the other parameters stand meanwhile.

use crate::sequences::PAPER_STEPS;
use crate::synthetic::{APPROACHES, MeasurementModel};
use egomotion::pipeline::Approach;

/// The values of all parameters but the swept one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Baseline {
    /// No noise, no rounding.
    Clean,
    /// 1/16 px of disparity, 1/8 px of noise.
    Real,
}

impl Baseline {
    /// Both, in the paper's order.
    pub(super) const ALL: [Self; 2] = [Self::Clean, Self::Real];

    /// Its name in files.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Clean => "clean",
            Self::Real => "real",
        }
    }

    /// Its noise and rounding.
    pub(super) fn model(self) -> MeasurementModel {
        match self {
            Self::Clean => MeasurementModel::clean(),
            Self::Real => MeasurementModel::real(),
        }
    }
}

/// A swept parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sweep {
    /// STEP: factor of the velocity.
    Step,
    /// ROUND: levels of disparity for each pixel.
    Round,
    /// STD_DISP: noise of disparity.
    StdDisp,
    /// STD_VEL: noise of differential flow.
    StdVel,
    /// STD_TRACK: noise of discrete displacement.
    StdTrack,
    /// FEATURES: number of tracked features.
    Features,
}

impl Sweep {
    /// All six, in the paper's order.
    pub(super) const ALL: [Self; 6] =
        [Self::Step, Self::Round, Self::StdDisp, Self::StdVel, Self::StdTrack, Self::Features];

    /// Its name in files.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Step => "step",
            Self::Round => "round",
            Self::StdDisp => "std_disp",
            Self::StdVel => "std_vel",
            Self::StdTrack => "std_track",
            Self::Features => "features",
        }
    }

    /// Its values; infinite for ROUND is no rounding.
    pub(super) fn values(self) -> &'static [f64] {
        match self {
            Self::Step => &PAPER_STEPS,
            Self::Round => &[f64::INFINITY, 32.0, 16.0, 8.0, 4.0],
            Self::StdDisp | Self::StdVel | Self::StdTrack => &[0.0, 0.0625, 0.125, 0.25, 0.5],
            Self::Features => &[128.0, 512.0, 2048.0, 8192.0],
        }
    }

    /// The approaches whose measurements it changes.
    pub(super) fn approaches(self) -> &'static [Approach] {
        match self {
            Self::Step | Self::Round | Self::StdDisp => &APPROACHES,
            Self::StdVel => &[Approach::Differential],
            Self::StdTrack | Self::Features => &[Approach::Discrete],
        }
    }

    /// STEP and the measurement model where the swept parameter has this value, and all others the baseline's.
    pub(super) fn at(self, value: f64, baseline: Baseline) -> (f64, MeasurementModel) {
        let (mut step, mut model) = (1.0, baseline.model());
        match self {
            Self::Step => step = value,
            Self::Round => model.round = value.is_finite().then_some(value as u32),
            Self::StdDisp => model.std_disp_px = value,
            Self::StdVel => model.std_vel_px = value,
            Self::StdTrack => model.std_track_px = value,
            Self::Features => model.features = value as usize,
        }
        (step, model)
    }
}
