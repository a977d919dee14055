//! What cannot be observed, in words: the twists that no equation sees, as shifts, turns and screws.

use std::fmt;

use nalgebra::{DMatrix, Matrix6, SVector, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use crate::estimate::serde_array;
use crate::geometry::Twist;

/// How sharply directions are known where nobody says, as a share of their length.
const DEFAULT_TOLERANCE: f64 = 1e-3;
/// A direction lies in those already known when less than this share of it is left without them: rounding errors.
const LEAST_NEW_PART: f64 = 1e-9;
/// A direction is named after an axis where its cosine with it exceeds this: two decimals would be 1 and 0.
const AXIS_COSINE: f64 = 0.999_95;
/// An axis goes through the camera's centre where it passes nearer than this, in metres: two decimals would be 0.
const LEAST_OFFSET_M: f64 = 5e-3;

/// The directions of N unknowns that the data do not determine: a basis of what may be added to θ unseen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct UndeterminedDirections<const N: usize> {
    #[serde(with = "serde_array")]
    directions: [SVector<f64, N>; N],
    count: usize,
    /// How sharply the directions are known, as a share of their length.
    tolerance: f64,
}

impl<const N: usize> Default for UndeterminedDirections<N> {
    fn default() -> Self {
        Self { directions: [SVector::zeros(); N], count: 0, tolerance: DEFAULT_TOLERANCE }
    }
}

impl<const N: usize> UndeterminedDirections<N> {
    /// The span of some directions, known to a share `tolerance` of their length.
    pub fn spanned(directions: impl IntoIterator<Item = SVector<f64, N>>, tolerance: f64) -> Self {
        let mut found = Self { tolerance, ..Self::default() };
        directions.into_iter().for_each(|direction| found.include(&direction));
        found
    }

    /// Number of independent directions.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The directions: unit length each, at right angles to each other.
    pub fn directions(&self) -> &[SVector<f64, N>] {
        &self.directions[..self.count]
    }

    /// One direction more, unless it lies in those already there.
    pub(crate) fn include(&mut self, direction: &SVector<f64, N>) {
        let Some(direction) = direction.try_normalize(0.0) else { return };
        // Once more takes away what rounding left.
        let rest =
            |v: SVector<f64, N>| self.directions().iter().fold(v, |v, known| v - known * known.dot(&v));
        let rest = rest(rest(direction));
        if self.count < N && rest.norm() > LEAST_NEW_PART {
            self.directions[self.count] = rest.normalize();
            self.count += 1;
        }
    }

    /// The same with components of which nothing is known.
    #[must_use]
    pub(crate) fn with_components(mut self, components: impl IntoIterator<Item = usize>) -> Self {
        components
            .into_iter()
            .for_each(|i| self.include(&SVector::from_fn(|j, _| f64::from(u8::from(i == j)))));
        self
    }
}

/// A motion of the scene that the data do not see.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum UndeterminedMotion {
    /// A shift along a direction of length 1.
    Shift {
        /// The direction.
        along: Vector3<f64>,
    },
    /// A turn about an axis.
    Turn {
        /// The axis' direction, of length 1.
        about: Vector3<f64>,
        /// Its point nearest to the left camera, in metres.
        through: Vector3<f64>,
    },
    /// A turn about an axis with a shift along it.
    Screw {
        /// The axis' direction, of length 1.
        about: Vector3<f64>,
        /// Its point nearest to the left camera, in metres.
        through: Vector3<f64>,
        /// Shift per turn, in metres per radian.
        pitch: f64,
    },
}

impl UndeterminedDirections<6> {
    /// The same directions of another camera's φ; `matrix` is that of [`Twist::seen_from_matrix`].
    #[must_use]
    pub(crate) fn transformed(&self, matrix: &Matrix6<f64>) -> Self {
        Self::spanned(self.directions().iter().map(|direction| matrix * direction), self.tolerance)
    }

    /// A readable basis: pure shifts first, then turns, then screws.
    pub fn motions(&self) -> Vec<UndeterminedMotion> {
        if self.count == 0 {
            return Vec::new();
        }
        let basis = DMatrix::from_fn(6, self.count, |i, k| self.directions[k][i]);
        let turning = basis.rows(3, 3).into_owned();
        let eigen = (turning.transpose() * &turning).symmetric_eigen();
        let combined =
            |k: usize| Vector6::from_iterator((&basis * eigen.eigenvectors.column(k)).iter().copied());
        let (mut shifts, mut turns) = (Vec::new(), Vec::new());
        for k in 0..self.count {
            let motion = combined(k);
            if eigen.eigenvalues[k] <= self.tolerance * self.tolerance {
                shifts.push(motion);
            } else {
                turns.push(motion);
            }
        }
        let (shifts, turns) = (reduced(shifts, 0, self.tolerance), reduced(turns, 3, self.tolerance));
        let free = UndeterminedDirections::<3>::spanned(shifts.iter().map(part::<0>), self.tolerance);
        let turns = turns.iter().map(|motion| self.turn(motion, &free));
        let (pure, screws): (Vec<_>, Vec<_>) =
            turns.partition(|m| matches!(m, UndeterminedMotion::Turn { .. }));
        let shifts =
            shifts.iter().map(|motion| UndeterminedMotion::Shift { along: part::<0>(motion).normalize() });
        shifts.chain(pure).chain(screws).collect()
    }

    /// A motion that turns: with any of the free shifts added it is as free, so the one with none of them.
    fn turn(&self, motion: &Vector6<f64>, free: &UndeterminedDirections<3>) -> UndeterminedMotion {
        let rate = part::<3>(motion).norm();
        let (about, shift) = (part::<3>(motion) / rate, part::<0>(motion) / rate);
        let shift = free.directions().iter().fold(shift, |shift, known| shift - known * known.dot(&shift));
        let (pitch, through) = (shift.dot(&about), about.cross(&shift));
        if pitch.abs() <= self.tolerance * (1.0 + shift.norm()) {
            UndeterminedMotion::Turn { about, through }
        } else {
            UndeterminedMotion::Screw { about, through, pitch }
        }
    }
}

/// t or Ω of a twist's six numbers.
fn part<const FROM: usize>(motion: &Vector6<f64>) -> Vector3<f64> {
    motion.fixed_rows::<3>(FROM).into_owned()
}

/// The same span with as many zeros as can be in the three components from `first` on (Gauss and Jordan).
fn reduced(mut motions: Vec<Vector6<f64>>, first: usize, tolerance: f64) -> Vec<Vector6<f64>> {
    let mut done = 0;
    for column in first..first + 3 {
        let pivot = (done..motions.len())
            .max_by(|&a, &b| motions[a][column].abs().total_cmp(&motions[b][column].abs()));
        let Some(pivot) = pivot.filter(|&p| motions[p][column].abs() > tolerance) else { continue };
        motions.swap(done, pivot);
        let unit = motions[done] / motions[done][column];
        motions[done] = unit;
        for (k, motion) in motions.iter_mut().enumerate() {
            if k != done {
                *motion -= unit * motion[column];
            }
        }
        done += 1;
    }
    motions.truncate(done);
    motions
}

impl UndeterminedMotion {
    /// The motion as a twist of length 1: per metre of shift, or per radian.
    pub fn twist(&self) -> Twist {
        match *self {
            Self::Shift { along } => Twist { t: along, omega: Vector3::zeros() },
            Self::Turn { about, through } => Twist { t: through.cross(&about), omega: about },
            Self::Screw { about, through, pitch } => {
                Twist { t: through.cross(&about) + about * pitch, omega: about }
            }
        }
    }
}

/// A number to two decimals, without what says nothing.
fn short(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

fn triple(v: &Vector3<f64>) -> String {
    format!("({}, {}, {})", short(v.x), short(v.y), short(v.z))
}

/// `x`, `y`, `z`, or three numbers.
fn direction(v: &Vector3<f64>) -> String {
    let axis = ["x", "y", "z"].iter().enumerate().find(|(i, _)| v[*i].abs() > AXIS_COSINE);
    axis.map_or_else(|| triple(v), |(_, name)| (*name).to_owned())
}

impl fmt::Display for UndeterminedMotion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axis = |about: &Vector3<f64>, through: &Vector3<f64>| {
            let place = if through.amax() < LEAST_OFFSET_M {
                String::new()
            } else {
                format!(" through {} m", triple(through))
            };
            format!("turn about {}{place}", direction(about))
        };
        match self {
            Self::Shift { along } => write!(f, "shift along {}", direction(along)),
            Self::Turn { about, through } => f.write_str(&axis(about, through)),
            Self::Screw { about, through, pitch } => {
                write!(f, "{} with a shift of {} m/rad", axis(about, through), short(*pitch))
            }
        }
    }
}

/// Motions separated by semicolons; nothing where all is determined.
impl fmt::Display for UndeterminedDirections<6> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words: Vec<String> = self.motions().iter().map(UndeterminedMotion::to_string).collect();
        f.write_str(&words.join("; "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The twist of a turn about an axis through a point, with a shift along it.
    fn turn(about: [f64; 3], through: [f64; 3], pitch: f64) -> Vector6<f64> {
        let about = Vector3::from(about).normalize();
        UndeterminedMotion::Screw { about, through: through.into(), pitch }.twist().vector()
    }

    fn shift(along: [f64; 3]) -> Vector6<f64> {
        Twist { t: along.into(), omega: Vector3::zeros() }.vector()
    }

    fn words(directions: &[Vector6<f64>]) -> String {
        // Mixed with each other, as eigenvectors come.
        let mix = |k: usize| {
            directions
                .iter()
                .enumerate()
                .map(|(i, d)| d * (1.0 + ((i + 2) * (k + 1)) as f64).sin())
                .sum::<Vector6<f64>>()
        };
        UndeterminedDirections::spanned((0..directions.len()).map(mix), 1e-3).to_string()
    }

    #[test]
    fn motions_are_named() {
        assert_eq!(words(&[]), "");
        assert_eq!(words(&[shift([0.0, -2.0, 0.0])]), "shift along y");
        assert_eq!(words(&[shift([1.0, 0.0, 1.0])]), "shift along (0.71, 0, 0.71)");
        let wall =
            [shift([1.0, 0.0, 0.0]), shift([0.0, 1.0, 0.0]), turn([0.0, 0.0, 1.0], [0.3, 0.2, 3.0], 0.0)];
        assert_eq!(words(&wall), "shift along x; shift along y; turn about z");
        let ball =
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| turn(axis, [0.1, -0.2, 3.0], 0.0));
        assert_eq!(
            words(&ball),
            "turn about x through (0, -0.2, 3) m; turn about y through (0.1, 0, 3) m; turn about z through (0.1, -0.2, 0) m"
        );
        let pipe = [shift([0.0, 1.0, 0.0]), turn([0.0, 1.0, 0.0], [0.2, 0.0, 2.1], 0.0)];
        assert_eq!(words(&pipe), "shift along y; turn about y through (0.2, 0, 2.1) m");
        let screw = [turn([0.0, 0.0, 1.0], [0.5, 0.0, 0.0], 0.25)];
        assert_eq!(words(&screw), "turn about z through (0.5, 0, 0) m with a shift of 0.25 m/rad");
        let all: Vec<Vector6<f64>> = (0..6).map(|i| Vector6::ith(i, 1.0)).collect();
        let named = "shift along x; shift along y; shift along z; turn about x; turn about y; turn about z";
        assert_eq!(words(&all), named);
    }

    #[test]
    fn the_named_motions_span_what_is_undetermined() {
        let given = [
            turn([1.0, 2.0, -0.5], [0.3, -1.0, 2.0], 0.4),
            turn([0.0, 1.0, 1.0], [1.0, 0.0, 2.0], 0.0),
            shift([0.2, 0.1, 1.0]),
        ];
        let undetermined = UndeterminedDirections::spanned(given, 1e-3);
        let motions = undetermined.motions();
        assert_eq!(motions.len(), 3);
        let mut span = undetermined;
        motions.iter().for_each(|motion| span.include(&motion.twist().vector()));
        assert_eq!(span.count(), 3, "{motions:?}");
        let named = UndeterminedDirections::spanned(motions.iter().map(|m| m.twist().vector()), 1e-3);
        assert_eq!(named.count(), 3);
    }

    #[test]
    fn another_camera_sees_the_same_axis_elsewhere() {
        let centre = Vector3::new(-0.5, 0.0, 0.0);
        let here = UndeterminedDirections::spanned([turn([0.0, 1.0, 0.0], [0.2, 0.0, 2.0], 0.0)], 1e-3);
        let there = here.transformed(&Twist::seen_from_matrix(&centre));
        assert_eq!(there.to_string(), "turn about y through (0.7, 0, 2) m");
    }
}
