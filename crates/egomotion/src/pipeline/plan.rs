//! What is done with each pair of frames: decided once, from the choices and from what makes the tracks.

use super::config::{Approach, Config, Method, Observe};
use crate::estimate::TrackSource;
use crate::estimate::alignment::Form;
use crate::geometry::StereoRig;

/// The equations that determine φ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Equations {
    /// Maximum likelihood of tracks.
    TrackLikelihood,
    /// Maximum likelihood of tracks, and of the shape that a depth image shows where there are none.
    ShapeLikelihood,
    /// Maximum likelihood of velocities.
    FlowLikelihood,
    /// Depth change, (12).
    DepthChange,
    /// Binocular flow in two steps, (14) then (3).
    BinocularFlow,
    /// The same of finite displacements, exact in the mean point.
    BinocularDisplacement,
    /// Binocular flow and image flow solved together.
    JointFlow,
    /// The same of finite displacements, exact in the mean point.
    JointDisplacement,
    /// Point pairs, (22).
    Alignment(Form),
}

impl Equations {
    /// Whether they are linear regressions, whose noise in the coefficients leaves a bias; maximum likelihood has none.
    pub fn are_linear(self) -> bool {
        !matches!(self, Self::TrackLikelihood | Self::ShapeLikelihood | Self::FlowLikelihood)
    }
}

/// What gives VZ of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PixelVelocity {
    /// The rigid scene's motion, except where the measured change of disparity contradicts it.
    RigidScene,
    /// The change of depth over a finite displacement, discrete DCCE.
    DepthTrack,
    /// The rate of depth, differential DCCE.
    DepthFlow,
    /// The flows of both cameras, differential binocular flow.
    StereoFlow,
    /// Disparity before and after, discrete binocular flow.
    Disparities,
}

/// What is done with a pair of frames. The method is chosen here and nowhere else.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Plan {
    /// Dense fields, or tracks alone.
    pub observe: Observe,
    /// Finite displacements, or velocities.
    pub approach: Approach,
    /// What determines φ.
    pub equations: Equations,
    /// Whether the flow of the right camera is measured as well.
    pub right_flow: bool,
    /// What gives VZ of a pixel.
    pub pixel_velocity: PixelVelocity,
    /// What makes the tracks.
    pub source: TrackSource,
}

impl Plan {
    /// The plan of some choices, which [`Config::check`] allows, for tracks that `source` makes.
    pub fn new(config: &Config, source: TrackSource) -> Self {
        let by_shape = config.observe == Observe::Dense && source == TrackSource::Image;
        let (equations, pixel_velocity) = match (config.method, config.approach) {
            (Method::Ml, Approach::Discrete) if by_shape => {
                (Equations::ShapeLikelihood, PixelVelocity::RigidScene)
            }
            (Method::Ml, Approach::Discrete) => (Equations::TrackLikelihood, PixelVelocity::RigidScene),
            (Method::Ml, Approach::Differential) => (Equations::FlowLikelihood, PixelVelocity::RigidScene),
            (Method::Dcce, Approach::Discrete) => (Equations::DepthChange, PixelVelocity::DepthTrack),
            (Method::Dcce, Approach::Differential) => (Equations::DepthChange, PixelVelocity::DepthFlow),
            (Method::Dv, Approach::Discrete) => {
                (Equations::BinocularDisplacement, PixelVelocity::Disparities)
            }
            (Method::Dv, Approach::Differential) => (Equations::BinocularFlow, PixelVelocity::StereoFlow),
            (Method::Joint, Approach::Discrete) => (Equations::JointDisplacement, PixelVelocity::RigidScene),
            (Method::Joint, Approach::Differential) => (Equations::JointFlow, PixelVelocity::RigidScene),
            (Method::Rigid, _) => (Equations::Alignment(Form::Rigid), PixelVelocity::RigidScene),
            (Method::Linear22, _) => (Equations::Alignment(Form::Affine), PixelVelocity::RigidScene),
        };
        let of_velocities = matches!(config.method, Method::Dv | Method::Joint | Method::Ml);
        let right_flow =
            of_velocities && config.approach == Approach::Differential && source == TrackSource::Stereo;
        let Config { observe, approach, .. } = *config;
        Self { observe, approach, equations, right_flow, pixel_velocity, source }
    }
}

/// The interval between two frames: the rig that saw it, the choices, the plan that follows from them, and its length.
#[derive(Debug, Clone, Copy)]
pub struct Interval<'a> {
    /// The rig.
    pub rig: &'a StereoRig,
    /// The choices.
    pub config: &'a Config,
    /// What is done.
    pub plan: Plan,
    /// Length, in seconds.
    pub dt_s: f64,
}

impl<'a> Interval<'a> {
    /// An interval of `dt_s` seconds whose tracks `source` makes.
    pub fn new(rig: &'a StereoRig, config: &'a Config, source: TrackSource, dt_s: f64) -> Self {
        Self { rig, config, plan: Plan::new(config, source), dt_s }
    }
}
