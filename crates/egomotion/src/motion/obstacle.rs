//! The nearest obstacle: of all that will pass through the vehicle's window, the connected region met first.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::impact::TimeToImpact;
use crate::geometry::{Cells, PixelBounds, upper_median};

/// What will be met first if nothing changes its motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Obstacle {
    /// When the first tenth of the region has been met.
    pub impact: TimeToImpact,
    /// Number of its points that will cross the vehicle's window.
    pub points: usize,
    /// Where it is in the earlier left image.
    pub bounds: PixelBounds,
}

/// Why there is no obstacle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error, Serialize, Deserialize)]
pub enum NoObstacle {
    /// No point has a distance and a motion.
    #[error("nothing was measured")]
    NothingMeasured,
    /// Points recede or keep their distance.
    #[error("nothing approaches")]
    NothingApproaches,
    /// What approaches will pass beside the vehicle.
    #[error("nothing that approaches crosses the vehicle's window")]
    NothingCrosses,
    /// Too few points that agree, and so probably wrong ones.
    #[error("only scattered points cross the vehicle's window")]
    OnlyScattered,
}

impl NoObstacle {
    /// One word for tables.
    pub fn code(&self) -> &'static str {
        match self {
            Self::NothingMeasured => "nothing_measured",
            Self::NothingApproaches => "nothing_approaches",
            Self::NothingCrosses => "nothing_crosses",
            Self::OnlyScattered => "only_scattered",
        }
    }
}

/// What makes points an obstacle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObstacleCriteria {
    /// Side of the cells that points are gathered in, in pixels.
    pub cell_px: usize,
    /// Least share of a cell's points that must cross: a mismatched patch does not fill a cell.
    pub cell_share: f64,
    /// Fewest crossing points of a region.
    pub region_points: usize,
}

impl ObstacleCriteria {
    /// Every pixel is a point.
    pub const DENSE: Self = Self { cell_px: 16, cell_share: 0.25, region_points: 100 };
    /// Points are tracks, about thirty pixels apart.
    pub const SPARSE: Self = Self { cell_px: 96, cell_share: 0.1, region_points: 3 };
}

/// Fewest crossing points of a cell that takes part: one or two may be mismatches.
const LEAST_CROSSING_POINTS: usize = 3;
/// Neighbouring cells show one surface when their loomings differ by at most this share of the larger one, or by no
/// more than their noise: less would cut slanted surfaces apart, more would join what is met at different times.
const SAME_SURFACE_SHARE: f64 = 0.2;
/// This share of a region's cells is met before the one that answers for it: a single wrong cell must not.
const SHARE_MET_BEFORE: f64 = 0.1;

/// The points seen in one cell.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sightings {
    /// Time to impact of the points that will cross the vehicle's window.
    crossing: Vec<TimeToImpact>,
    seen: usize,
    approaching: usize,
}

impl Sightings {
    /// Count one point, and whether it will pass through the vehicle's window.
    pub(crate) fn add(&mut self, impact: TimeToImpact, crosses: bool) {
        self.seen += 1;
        self.approaching += usize::from(impact.looming.value() > 0.0);
        self.crossing.extend(crosses.then_some(impact));
    }

    /// The median of the crossing points, if there are enough of them. Its σ is a point's own, not divided by
    /// their number: neighbours share their noise.
    fn median(&mut self, share: f64) -> Option<TimeToImpact> {
        let count = self.crossing.len();
        let enough = count >= LEAST_CROSSING_POINTS && count as f64 >= share * self.seen as f64;
        upper_median(&mut self.crossing, by_looming).filter(|_| enough)
    }
}

fn by_looming(a: &TimeToImpact, b: &TimeToImpact) -> std::cmp::Ordering {
    a.looming.value().total_cmp(&b.looming.value())
}

/// Whether two neighbouring cells may show one surface.
fn agree(a: &TimeToImpact, b: &TimeToImpact) -> bool {
    let (x, y) = (a.looming.value(), b.looming.value());
    let apart = (x - y).abs();
    apart <= SAME_SURFACE_SHARE * x.max(y) || apart * apart <= a.looming.variance() + b.looming.variance()
}

/// The nearest obstacle among what was seen, one entry a cell of `criteria` over an image of `image`
/// (width, height). The order of the points of a cell is lost.
///
/// # Errors
/// [`NoObstacle`] says why there is none.
pub(crate) fn nearest_obstacle(
    seen: &mut [Sightings],
    image: (usize, usize),
    criteria: &ObstacleCriteria,
) -> Result<Obstacle, NoObstacle> {
    let total = |count: fn(&Sightings) -> usize| seen.iter().map(count).sum::<usize>();
    if total(|cell| cell.seen) == 0 {
        return Err(NoObstacle::NothingMeasured);
    }
    if total(|cell| cell.approaching) == 0 {
        return Err(NoObstacle::NothingApproaches);
    }
    if total(|cell| cell.crossing.len()) == 0 {
        return Err(NoObstacle::NothingCrosses);
    }
    let cells = Cells::tiling(image, criteria.cell_px);
    let medians: Vec<Option<TimeToImpact>> =
        seen.iter_mut().map(|cell| cell.median(criteria.cell_share)).collect();
    let of = |cell: usize| medians.get(cell).copied().flatten();
    let joined = |a, b| of(a).zip(of(b)).is_some_and(|(a, b)| agree(&a, &b));
    let regions = cells.regions(|cell| of(cell).is_some(), joined);
    let obstacles = regions.iter().filter_map(|region| {
        let points = region.iter().map(|&cell| seen[cell].crossing.len()).sum();
        let bounds = cells.bounds(region).filter(|_| points >= criteria.region_points)?;
        let impact = first(region.iter().filter_map(|&cell| of(cell)).collect())?;
        Some(Obstacle { impact, points, bounds })
    });
    obstacles.max_by(|a, b| by_looming(&a.impact, &b.impact)).ok_or(NoObstacle::OnlyScattered)
}

/// The one before which a tenth comes, to the nearest rank: of few the very first.
///
/// Which one that is is known to about a rank: half the step between its neighbours counts as an error.
fn first(mut impacts: Vec<TimeToImpact>) -> Option<TimeToImpact> {
    impacts.sort_by(|a, b| by_looming(b, a));
    let rank = (SHARE_MET_BEFORE * impacts.len() as f64).round() as usize;
    let looming = |rank: usize| impacts.get(rank).map(|impact| impact.looming.value());
    let mut found = *impacts.get(rank)?;
    let (before, after) = (looming(rank.saturating_sub(1))?, looming(rank + 1).or(looming(rank))?);
    found.looming.cov[(0, 0)] += (0.5 * (before - after)).powi(2);
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Gaussian;

    const CRITERIA: ObstacleCriteria = ObstacleCriteria { cell_px: 10, cell_share: 0.25, region_points: 20 };
    /// 4 × 3 cells.
    const IMAGE: (usize, usize) = (40, 30);

    fn impact(looming: f64, sigma: f64) -> TimeToImpact {
        TimeToImpact { looming: Gaussian::scalar(looming, sigma * sigma) }
    }

    /// Twelve cells that each see 40 points, of which those given by (cell, crossing points, looming) cross.
    fn seen(crossing: &[(usize, usize, f64)]) -> Vec<Sightings> {
        let mut cells = vec![Sightings::default(); 12];
        for (i, cell) in cells.iter_mut().enumerate() {
            let of_cell = crossing.iter().filter(|c| c.0 == i);
            let points = of_cell.flat_map(|&(_, count, looming)| (0..count).map(move |_| looming));
            points.for_each(|looming| cell.add(impact(looming, 1e-3), true));
            (cell.seen..40).for_each(|_| cell.add(impact(0.05, 1e-3), false));
        }
        cells
    }

    fn found(crossing: &[(usize, usize, f64)]) -> Result<Obstacle, NoObstacle> {
        nearest_obstacle(&mut seen(crossing), IMAGE, &CRITERIA)
    }

    #[test]
    fn the_region_met_first_answers_not_the_largest_nor_scattered_cells() {
        let far = [(4, 40, 0.2), (5, 40, 0.21), (8, 40, 0.2), (9, 40, 0.19)];
        let near = [(2, 15, 0.5), (6, 15, 0.55)];
        // One cell alone of a mismatched patch, sooner than all.
        let alone = [(11, 15, 3.0)];
        let all: Vec<_> = far.into_iter().chain(near).chain(alone).collect();
        let obstacle = found(&all).unwrap();
        // Of two cells the first, known to half of their difference.
        assert_eq!((obstacle.impact.looming.value(), obstacle.points), (0.55, 30));
        assert!((obstacle.impact.looming.variance() - (1e-6 + 0.025_f64.powi(2))).abs() < 1e-12);
        assert_eq!(obstacle.bounds, PixelBounds { u: 20, v: 0, width: 10, height: 20 });
    }

    #[test]
    fn neighbours_at_other_times_are_other_obstacles() {
        // Two surfaces side by side: 20 points are needed of one of them.
        assert_eq!(found(&[(0, 15, 0.5), (1, 15, 0.9)]), Err(NoObstacle::OnlyScattered));
        assert!(found(&[(0, 15, 0.5), (1, 15, 0.45)]).is_ok());
        // They are the same where the noise of either explains the difference.
        let mut noisy = seen(&[(0, 15, 0.5)]);
        (0..15).for_each(|_| noisy[1].add(impact(0.9, 0.5), true));
        assert_eq!(nearest_obstacle(&mut noisy, IMAGE, &CRITERIA).unwrap().points, 30);
    }

    #[test]
    fn cells_of_which_few_points_cross_do_not_take_part() {
        // 9 of 40 are less than a quarter, whatever the number of such cells.
        let thin: Vec<_> = (0..12).map(|cell| (cell, 9, 0.5)).collect();
        assert_eq!(found(&thin), Err(NoObstacle::OnlyScattered));
        let two_points = ObstacleCriteria { cell_share: 0.0, region_points: 0, ..CRITERIA };
        assert_eq!(
            nearest_obstacle(&mut seen(&[(0, 2, 0.5)]), IMAGE, &two_points),
            Err(NoObstacle::OnlyScattered)
        );
    }

    #[test]
    fn a_tenth_comes_before_the_time_to_impact() {
        let impacts = |count: usize| (0..count).map(|i| impact(i as f64, 0.1)).collect::<Vec<_>>();
        let first = |count| first(impacts(count)).map(|found| found.looming.value());
        assert_eq!([first(0), first(1), first(4)], [None, Some(0.0), Some(3.0)]);
        assert_eq!([first(10), first(40)], [Some(8.0), Some(35.0)]);
        // Its neighbours in rank are 1 away on either side.
        assert!((super::first(impacts(40)).unwrap().looming.variance() - 1.01).abs() < 1e-12);
        assert!((super::first(impacts(1)).unwrap().looming.variance() - 0.01).abs() < 1e-12);
    }

    #[test]
    fn it_says_why_there_is_none() {
        let mut cells = vec![Sightings::default(); 12];
        assert_eq!(nearest_obstacle(&mut cells, IMAGE, &CRITERIA), Err(NoObstacle::NothingMeasured));
        cells[3].add(impact(-0.1, 0.01), false);
        assert_eq!(nearest_obstacle(&mut cells, IMAGE, &CRITERIA), Err(NoObstacle::NothingApproaches));
        cells[3].add(impact(0.1, 0.01), false);
        assert_eq!(nearest_obstacle(&mut cells, IMAGE, &CRITERIA), Err(NoObstacle::NothingCrosses));
        cells[3].add(impact(0.1, 0.01), true);
        assert_eq!(nearest_obstacle(&mut cells, IMAGE, &CRITERIA), Err(NoObstacle::OnlyScattered));
    }
}
