//! From rows or observations to φ with its covariance.
//!
//! Linear methods fit rows a · θ = b: [`least_squares`], [`lmeds`], [`m_estimate`] (robust, with Student's t),
//! [`two_step`] for binocular flow, [`errors_in_variables`] for depth change. [`alignment`] lays points over points.
//! [`maximum_likelihood`] makes the misclosures of the observations themselves small, and [`cramer_rao_bound`] says what
//! no estimator surpasses. Every answer is an [`Estimate`], whose covariance comes from [`Blocks`] of neighbouring pixels.
//!
//! | symbol | what it is | unit |
//! |---|---|---|
//! | P = (X, Y, Z) | a point, in the left camera's frame | m |
//! | (x, y), d | its image coordinates and its disparity: the *structure* | px |
//! | φ = (t, Ω) | motion of the scene over one interval, V = t + Ω × P | m, rad |
//! | R, T | the finite motion exp(φ): P′ = R P + T | –, m |
//! | δ | a small motion: exp(φ + dφ) = exp(δ) exp(φ) | m, rad |
//! | n, c | direction and rate of a linear constraint n · V(P) = c | see [`LinearConstraint`](crate::constrain::LinearConstraint) |
//! | a, b, σ | a row a · θ = b ± σ: a = (n, P × n), b = c | that of c |
//! | θ | the unknowns of a linear fit: φ, or three of its components | m, rad |
//! | e, S | misclosure of an observation, and its covariance | px, px² |
//! | G | −∂e/∂φ, 3×6 | px per m or rad |
//! | q | eᵀ S⁻¹ e, χ² with three degrees of freedom where noise is as stated | – |
//! | w | robust weight of an observation, a function of q | – |
//! | A | information Σ w Gᵀ S⁻¹ G, or Σ w a aᵀ | 1/m², 1/rad² |
//! | s | score Σ w Gᵀ S⁻¹ e, or Σ w a (b − a · θ), of one block | 1/m, 1/rad |
//! | B | *bread*: the derivative of the total score, A less what the weights' own change takes away | as A |
//! | z = B⁻¹ s | influence of a block; Σ z zᵀ is the covariance (the sandwich) | m, rad |
//! | u | errors of a sensor, in units of their prior standard deviations | – |
//! | ν | degrees of freedom of Student's t | – |
//!
//! A matrix of derivatives is called `…_jacobian`; a single derivative ∂a/∂b is called `a_by_b`.

pub mod alignment;
mod certainty;
mod likelihood;
mod linear;
mod motion_estimate;
mod random_subsets;
mod sensor;
mod serde_array;
mod solved_motion;
mod student_t;
mod unsolvable;

pub use certainty::blocks::Blocks;
pub use certainty::observability::Observability;
pub use certainty::undetermined::{UndeterminedDirections, UndeterminedMotion};
pub use likelihood::cramer_rao::{cramer_rao_bound, efficient};
pub use likelihood::maximum_likelihood::{MaximumLikelihood, MaximumLikelihoodOptions, maximum_likelihood};
pub use likelihood::robust_start::robust_start;
pub use likelihood::score_sums::LikelihoodTerm;
pub use likelihood::systematic::{SystematicResponse, systematic_response};
pub use linear::best_subset::{BestSubset, best_subset, best_subset_plain};
pub use linear::errors_in_variables::errors_in_variables;
pub use linear::fit::LinearFit;
pub(crate) use linear::fit::noise_factor;
pub use linear::least_squares::{Weighting, least_squares};
pub use linear::lmeds::{LmedsOptions, lmeds, refit_best_subset, robust_scale};
pub use linear::m_estimator::m_estimate;
pub use linear::row::{NormalEquations, Row};
pub use linear::two_step::two_step;
pub use motion_estimate::{Estimate, MotionEstimate};
pub use random_subsets::{random_subsets, subsets_needed};
pub(crate) use sensor::augmented::augmented_step;
pub use sensor::errors::TrackSource;
pub(crate) use sensor::errors::{SensedTrack, SensorErrors};
pub use sensor::rig_prior::RigPrior;
pub(crate) use sensor::tolerance::SensorPrior;
pub use sensor::tolerance::{HAND_ACCELERATION_M_S2, HAND_ACCELERATION_RAD_S2, Tolerance};
pub(crate) use solved_motion::LastMotion;
pub use solved_motion::{CovarianceParts, MATCHING_ERRORS, SolvedMotion};
pub use student_t::StudentT;
pub use unsolvable::Unsolvable;
