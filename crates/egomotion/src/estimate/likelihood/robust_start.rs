//! Where maximum likelihood starts: the motion that most of the tracks agree on.
//!
//! Three tracks give a motion by their alignment; the one with the least median of q = eᵀ S⁻¹ e over all tracks wins
//! (Rousseeuw 1984), its candidates improved on what they fit best (Rousseeuw and Van Driessen 1999).

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::estimate::alignment::{Form, Moments, PointPair};
use crate::estimate::likelihood::maximum_likelihood::MaximumLikelihoodOptions;
use crate::estimate::likelihood::mixture::{MEDIAN, Mixture};
use crate::estimate::likelihood::step::{Sums, Weighing};
use crate::estimate::linear::lmeds::{random_subsets, trials};
use crate::estimate::linear::m_estimator::LEAST_SCALE2;
use crate::estimate::measurement::{At, Measurement, median_square, squares};
use crate::estimate::{Observability, Unsolvable, median};
use crate::geometry::{StereoRig, Twist};
use crate::observe::StereoTrack;

/// Subsets are drawn anew, so many times at most,
const ROUNDS: u64 = 4;
/// while the least median of q is above so many times that of noise: half of all tracks are then outliers, or the
/// search has failed, as three noisy points do now and then beside a large moving body.
const PLAUSIBLE: f64 = 4.0;

/// Candidates are first judged on about so many observations,
const FIRST_LOOK: usize = 100;
/// so many of them are improved on these,
const FINALISTS: usize = 16;
/// and so many of those on all.
const IMPROVED: usize = 4;
/// Steps by which a candidate is improved,
const CONCENTRATIONS: usize = 4;
/// by observations whose q, were the median that of χ²₃, is below this: its 95th percentile.
const NEAR: f64 = 7.8;

/// A motion is no longer improved whose median of q is below so many times that of noise: most of the tracks fit,
/// as is the rule when it was predicted.
const FITS: f64 = 1.5;

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
        if found.0 < PLAUSIBLE * MEDIAN {
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
        if let Some(fits) = first.filter(|(middle, _)| *middle < FITS * MEDIAN) {
            return Ok(fits);
        }
        let finalists = improve(finalists, &glance);
        let improved = improve(best(&finalists, IMPROVED, sample, rig), sample);
        best(&improved, 1, sample, rig).first().copied().ok_or(Unsolvable::Unobservable)
    }

    /// Alignments of three points each.
    fn candidates(&self, round: u64, prior: Option<&Twist>) -> Vec<Twist> {
        let count = trials(self.options.confidence, self.options.outliers, 3);
        let subsets = random_subsets::<3>(self.pairs.len(), count, self.options.seed.wrapping_add(round));
        let alignment = |subset: [usize; 3]| {
            let moments = Moments::over(subset.iter().map(|&i| (&self.pairs[i], 1.0)));
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
        let at = At::new(phi, rig);
        let middle = median(&mut squares(sample, &at));
        let mut structures: Vec<Vector3<f64>> = sample.iter().map(Measurement::structure).collect();
        let weighing = Weighing {
            blocks: None,
            mixture: Mixture::within(NEAR),
            scale2: (middle / MEDIAN).max(LEAST_SCALE2),
        };
        let step = Sums::over(sample, &mut structures, &at, &weighing).whole;
        let next = Observability::of(&step.score.information)
            .and_then(|observability| observability.solve(&step.score.information, &step.score.score));
        let Ok(delta) = next else { break };
        phi = Twist::from_vector(&(phi.vector() + delta));
    }
    phi
}
