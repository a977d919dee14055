//! Names of what is compared: approach, method and estimator of an answer, and its quantities.

use serde::{Deserialize, Serialize};

use crate::contender::{Contender, approach_name};
use egomotion::pipeline::{Approach, EstimatorKind, Method};

/// How equations are solved; the method's own answer at each pixel needs no estimator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Estimator {
    /// None: a value of each pixel.
    Pixel,
    /// Least squares, all rows alike.
    Ls,
    /// Least median of squares.
    Lmeds,
    /// Maximum likelihood, the library's default way from images to motion.
    Ml,
}

/// How an answer was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Way {
    /// Velocities or finite motion.
    pub approach: Approach,
    /// Which equations.
    pub method: Method,
    /// How they are solved.
    pub estimator: Estimator,
}

/// What is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// VZ in mm per frame, at pixels whose neighbours lie on the same surface and which both cameras see.
    Vz,
    /// VZ in mm per frame wherever something was measured, depth edges and wrong matches too.
    VzAnywhere,
    /// VZ in mm per frame against what the true φ does to the measured depth of a still scene.
    VzStill,
    /// tX in mm per frame.
    Tx,
    /// tY in mm per frame.
    Ty,
    /// tZ in mm per frame.
    Tz,
    /// ΩX in degrees per frame.
    Wx,
    /// ΩY in degrees per frame.
    Wy,
    /// ΩZ in degrees per frame.
    Wz,
    /// Median error of disparity, in pixels.
    Disparity,
    /// Median error of flow, in pixels.
    Flow,
}

impl Quantity {
    /// The components of φ, in its order.
    pub const PHI: [Self; 6] = [Self::Tx, Self::Ty, Self::Tz, Self::Wx, Self::Wy, Self::Wz];

    /// Name in a file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vz => "vz",
            Self::VzAnywhere => "vz_anywhere",
            Self::VzStill => "vz_still",
            Self::Tx => "tx",
            Self::Ty => "ty",
            Self::Tz => "tz",
            Self::Wx => "wx",
            Self::Wy => "wy",
            Self::Wz => "wz",
            Self::Disparity => "disparity",
            Self::Flow => "flow",
        }
    }

    /// Symbol and unit.
    pub fn heading(self) -> &'static str {
        match self {
            Self::Vz | Self::VzAnywhere | Self::VzStill => "VZ (mm)",
            Self::Tx => "tX (mm)",
            Self::Ty => "tY (mm)",
            Self::Tz => "tZ (mm)",
            Self::Wx => "ΩX (°)",
            Self::Wy => "ΩY (°)",
            Self::Wz => "ΩZ (°)",
            Self::Disparity => "disparity (px)",
            Self::Flow => "flow (px)",
        }
    }
}

impl Way {
    /// The library's own way: maximum likelihood, discrete.
    pub const BEST: Self = Self::new(Approach::Discrete, Method::Ml, Estimator::Ml);

    /// A way.
    pub const fn new(approach: Approach, method: Method, estimator: Estimator) -> Self {
        Self { approach, method, estimator }
    }

    /// Names of approach, method and estimator in a file.
    pub fn names(&self) -> [&'static str; 3] {
        let contender =
            Contender { approach: self.approach, method: self.method, estimator: EstimatorKind::Ls };
        let estimator = match self.estimator {
            // It stands with least squares.
            Estimator::Pixel | Estimator::Ls => "ls",
            Estimator::Lmeds => "lmeds",
            Estimator::Ml => "ml",
        };
        [approach_name(self.approach), contender.method_name(), estimator]
    }

    /// Name on a page: `DCCE, LS`.
    pub fn label(&self) -> &'static str {
        match (self.method, self.estimator) {
            (Method::Dcce, Estimator::Lmeds) => "DCCE, LMedS",
            (Method::Dcce, _) => "DCCE, LS",
            (Method::Dv, Estimator::Lmeds) => "DV, LMedS",
            (Method::Dv, _) => "DV, LS",
            (Method::Linear22, Estimator::Lmeds) => "(22), LMedS",
            (Method::Linear22, _) => "(22), LS",
            (Method::Rigid, Estimator::Lmeds) => "(22) with a rotation, LMedS",
            (Method::Rigid, _) => "(22) with a rotation, LS",
            (Method::Joint, _) => "DV and flow jointly",
            (Method::Ml, _) => "maximum likelihood",
        }
    }
}
