//! Time to impact: the inverse of looming.

use serde::{Deserialize, Serialize};

use crate::geometry::Gaussian;
use crate::geometry::distribution::NORMAL_P975;

/// Time to impact, counted from the later frame, held as looming because that stays near-Gaussian through VZ = 0.
///
/// What looms at 0.5 ± 0.1 per second is met in 2 s, or between 1/(0.5 + 0.196) and 1/(0.5 − 0.196) s with 95 %:
///
/// ```
/// use egomotion::geometry::Gaussian;
/// use egomotion::motion::TimeToImpact;
///
/// let impact = TimeToImpact { looming: Gaussian::scalar(0.5, 0.1 * 0.1) };
/// assert_eq!(impact.seconds(), Some(2.0));
/// let (earliest, latest) = impact.interval95_s().ok_or("it recedes")?;
/// assert_eq!((format!("{earliest:.2}"), format!("{latest:.2}")), ("1.44".into(), "3.29".into()));
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TimeToImpact {
    /// Looming in 1/s; positive approaches.
    pub looming: Gaussian<1>,
}

impl TimeToImpact {
    /// 1/looming in seconds; `None` where the point does not approach.
    #[inline(always)]
    pub fn seconds(&self) -> Option<f64> {
        let looming = self.looming.value();
        (looming > 0.0).then(|| looming.recip())
    }

    /// The 95 % interval in seconds; its far end is infinite where looming may be zero. `None` where the
    /// whole interval recedes.
    #[inline(always)]
    pub fn interval95_s(&self) -> Option<(f64, f64)> {
        let (fast, slow) = self.rates95();
        (fast > 0.0).then(|| (fast.recip(), if slow > 0.0 { slow.recip() } else { f64::INFINITY }))
    }

    /// The ends of looming's 95 % interval, the faster one first, in 1/s.
    #[inline(always)]
    pub(crate) fn rates95(&self) -> (f64, f64) {
        let (mean, half) = (self.looming.value(), NORMAL_P975 * self.looming.sigma(0));
        (mean + half, mean - half)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn impact(looming: f64, sigma: f64) -> TimeToImpact {
        TimeToImpact { looming: Gaussian::scalar(looming, sigma * sigma) }
    }

    #[test]
    fn the_interval_is_open_where_looming_may_vanish() {
        let sure = impact(0.5, 0.01);
        assert_eq!(sure.seconds(), Some(2.0));
        let (lo, hi) = sure.interval95_s().unwrap();
        assert!(lo < 2.0 && 2.0 < hi && hi < 2.1);
        assert_eq!(impact(0.01, 0.02).interval95_s().unwrap().1, f64::INFINITY);
        assert_eq!(impact(-0.01, 0.02).seconds(), None);
        assert_eq!(impact(-0.1, 0.02).interval95_s(), None);
    }
}
