//! Where maximum likelihood starts: the motion that most of the tracks agree on.
//!
//! Three tracks give a motion by their alignment; the one with the least median of q = eᵀ S⁻¹ e over all tracks wins
//! (Rousseeuw 1984), its candidates improved on what they fit best (Rousseeuw and Van Driessen 1999).

use nalgebra::Vector3;
use rayon::prelude::*;

use super::maximum_likelihood::MaximumLikelihoodOptions;
use super::mixture::{Mixture, ResidualModel};
use super::score_sums::{FrameSums, Weighing, median_square};
use crate::constrain::{LinearisationPoint, Measurement};
use crate::estimate::alignment::{Form, Moments, PointPair};
use crate::estimate::certainty::observability::Observability;
use crate::estimate::random_subsets::{random_subsets, subsets_needed};
use crate::estimate::student_t::LEAST_SCALE2;
use crate::estimate::unsolvable::Unsolvable;
use crate::geometry::distribution::{CHI2_3_P50, CHI2_3_P95};
use crate::geometry::{StereoRig, Twist};
use crate::observe::StereoTrack;

/// Subsets are drawn anew at most this often, while [`IMPLAUSIBLE_MEDIAN`] is exceeded.
const ROUNDS: u64 = 4;
/// A search has failed when the least median of q is this many times that of noise: half of all tracks are then
/// outliers, or three noisy points were taken beside a large moving body, as happens now and then.
const IMPLAUSIBLE_MEDIAN: f64 = 4.0;
/// Candidates are first judged on about this many observations: enough to drop the bad ones cheaply.
const FIRST_LOOK: usize = 100;
/// This many of the candidates that looked best first are improved on those observations.
const FINALISTS: usize = 16;
/// This many of the improved finalists are improved again, on all observations.
const IMPROVED_ON_ALL: usize = 4;
/// Steps by which a candidate is improved each time: fewer leave it noisier, more take longer.
const CONCENTRATIONS: usize = 4;
/// Observations improve a candidate whose q is below this, were the median of q that of noise.
const CONCENTRATION_Q: f64 = CHI2_3_P95;
/// A motion is no longer improved whose median of q is below this many times that of noise: most of the tracks fit,
/// as is the rule when it was predicted.
const FITTING_MEDIAN: f64 = 1.5;

/// A robust start for tracks: the three-point alignment, or the prior, with the least median of q.
///
/// # Errors
/// [`Unsolvable`] with fewer than four tracks or when no subset determines a motion.
pub fn robust_start(
    tracks: &[StereoTrack],
    rig: &StereoRig,
    prior: Option<&Twist>,
    options: &MaximumLikelihoodOptions,
) -> Result<Twist, Unsolvable> {
    let stride = tracks.len().div_ceil(options.start_observations.max(4)).max(1);
    let sample: Vec<StereoTrack> = tracks.iter().step_by(stride).copied().collect();
    let pairs: Vec<PointPair> =
        sample.iter().filter_map(|track| PointPair::from_track(track, rig, 0)).collect();
    if pairs.len() < 4 {
        return Err(Unsolvable::FewRows { rows: pairs.len(), needed: 4 });
    }
    let search = StartSearch { pairs: &pairs, sample: &sample, rig, options };
    let mut found = search.round(0, prior)?;
    for round in 1..ROUNDS {
        if found.0 < IMPLAUSIBLE_MEDIAN * CHI2_3_P50 {
            break;
        }
        let again = search.round(round, None)?;
        found = if again.0 < found.0 { again } else { found };
    }
    Ok(found.1)
}

/// The search for the motion with the least median of q.
struct StartSearch<'a> {
    pairs: &'a [PointPair],
    sample: &'a [StereoTrack],
    rig: &'a StereoRig,
    options: &'a MaximumLikelihoodOptions,
}

impl StartSearch<'_> {
    /// The best of fresh subsets and the prior, with its median of q.
    fn round(&self, round: u64, prior: Option<&Twist>) -> Result<(f64, Twist), Unsolvable> {
        let (sample, rig) = (self.sample, self.rig);
        let candidates = self.candidates(round, prior);
        let stride = (sample.len() / FIRST_LOOK).max(1);
        let glance: Vec<StereoTrack> = sample.iter().step_by(stride).copied().collect();
        let improve = |candidates: Vec<(f64, Twist)>, sample: &[StereoTrack]| -> Vec<Twist> {
            candidates.par_iter().map(|(_, phi)| concentrated(phi, sample, rig)).collect()
        };
        let finalists = best(&candidates, FINALISTS, &glance, rig);
        let first = finalists.first().map(|(_, phi)| (median_square(phi, sample, rig), *phi));
        if let Some(fits) = first.filter(|(middle, _)| *middle < FITTING_MEDIAN * CHI2_3_P50) {
            return Ok(fits);
        }
        let finalists = improve(finalists, &glance);
        let improved = improve(best(&finalists, IMPROVED_ON_ALL, sample, rig), sample);
        best(&improved, 1, sample, rig).first().copied().ok_or(Unsolvable::Unobservable)
    }

    /// Alignments of three points each.
    fn candidates(&self, round: u64, prior: Option<&Twist>) -> Vec<Twist> {
        let count = subsets_needed(self.options.confidence, self.options.outliers, 3);
        let subsets = random_subsets::<3>(self.pairs.len(), count, self.options.seed.wrapping_add(round));
        let alignment = |subset: [usize; 3]| {
            let moments = Moments::of_weighted_pairs(subset.iter().map(|&i| (&self.pairs[i], 1.0)));
            Some(moments.align(Form::Rigid)?.motion()?.log())
        };
        subsets.filter_map(alignment).chain(prior.copied()).collect()
    }
}

/// The `count` candidates with the least median of q, the best first.
fn best(candidates: &[Twist], count: usize, sample: &[StereoTrack], rig: &StereoRig) -> Vec<(f64, Twist)> {
    let mut judged: Vec<(f64, Twist)> =
        candidates.par_iter().map(|phi| (median_square(phi, sample, rig), *phi)).collect();
    judged.sort_by(|a, b| a.0.total_cmp(&b.0));
    judged.truncate(count);
    judged
}

/// A candidate improved by steps on that part of the sample which it fits best: what it is made
/// of, three points, is noisy, and then a moving body does not stand out.
fn concentrated(phi: &Twist, sample: &[StereoTrack], rig: &StereoRig) -> Twist {
    let mut phi = *phi;
    for _ in 0..CONCENTRATIONS {
        let at = LinearisationPoint::new(phi, rig);
        let middle = median_square(&phi, sample, rig);
        if middle.is_infinite() {
            break;
        }
        let mut structures: Vec<Vector3<f64>> = sample.iter().map(Measurement::structure).collect();
        let residuals = ResidualModel {
            mixture: Mixture::within(CONCENTRATION_Q),
            scale2: (middle / CHI2_3_P50).max(LEAST_SCALE2),
        };
        let weighing = Weighing { blocks: None, in_later: false, residuals };
        let whole = FrameSums::linearised(sample, &mut structures, &at, &weighing).whole;
        let next = Observability::of(&whole.score.information)
            .and_then(|observability| observability.solve(&whole.score.information, &whole.score.score));
        let Ok(delta) = next else { break };
        phi = Twist::from_vector(&(phi.vector() + delta));
    }
    phi
}
