//! The contenders on images: approach, method and estimator of an answer.

use serde::{Deserialize, Serialize};

use crate::synthetic::{approach_label, approach_name, method_label, method_name};
use egomotion::pipeline::{Approach, Method};

/// How equations are solved; the method's own answer at each pixel needs no estimator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ImageEstimator {
    /// None: a value of each pixel.
    Pixel,
    /// Least squares, all rows alike.
    Ls,
    /// Least median of squares.
    Lmeds,
    /// Maximum likelihood, the library's default way from images to motion.
    Ml,
}

/// One estimator under comparison on images: an approach, a method, and how its equations are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ImageContender {
    /// Differential (velocities) or discrete (finite motion).
    pub approach: Approach,
    /// The method's equations.
    pub method: Method,
    /// How the equations are solved.
    pub estimator: ImageEstimator,
}

impl ImageContender {
    /// The library's own: maximum likelihood, discrete.
    pub const BEST: Self = Self::new(Approach::Discrete, Method::Ml, ImageEstimator::Ml);

    /// The contender of these three.
    pub const fn new(approach: Approach, method: Method, estimator: ImageEstimator) -> Self {
        Self { approach, method, estimator }
    }

    /// Names of approach, method and estimator in a file.
    pub(super) fn names(&self) -> [&'static str; 3] {
        let estimator = match self.estimator {
            // It stands with least squares.
            ImageEstimator::Pixel | ImageEstimator::Ls => "ls",
            ImageEstimator::Lmeds => "lmeds",
            ImageEstimator::Ml => "ml",
        };
        [approach_name(self.approach), method_name(self.method), estimator]
    }

    /// Name in a table, `DCCE, LS`; maximum likelihood has no other estimator.
    pub(super) fn label(&self) -> String {
        let method = method_label(self.method);
        match self.estimator {
            ImageEstimator::Ml => method.to_owned(),
            ImageEstimator::Lmeds => format!("{method}, LMedS"),
            ImageEstimator::Pixel | ImageEstimator::Ls => format!("{method}, LS"),
        }
    }

    /// Name in the legend of a figure that shows both approaches, `DCCE DIFF`; maximum likelihood is discrete alone.
    pub(super) fn legend(&self) -> String {
        let method = method_label(self.method);
        match self.method {
            Method::Ml => method.to_owned(),
            _ => format!("{method} {}", approach_label(self.approach)),
        }
    }
}
