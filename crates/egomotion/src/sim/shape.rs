//! The plain shapes a scene is made of, and where a ray meets them.

use nalgebra::{Matrix3, Rotation3, Vector3};
use serde::{Deserialize, Serialize};

/// One shape; lengths in metres, world frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// The infinite plane n · P = `offset_m`; the unit normal points into the room.
    Plane {
        /// Unit normal n.
        normal: Vector3<f64>,
        /// n · P of every point of the plane.
        offset_m: f64,
    },
    /// A rectangle, seen from both sides.
    Quad {
        /// Centre.
        centre: Vector3<f64>,
        /// From the centre to the middle of an edge, and of the next edge; perpendicular.
        half_m: [Vector3<f64>; 2],
    },
    /// A ball.
    Sphere {
        /// Centre.
        centre: Vector3<f64>,
        /// Radius.
        radius_m: f64,
    },
    /// A box turned about the vertical.
    Box {
        /// Centre.
        centre: Vector3<f64>,
        /// Half sizes along the box's own axes.
        half_m: Vector3<f64>,
        /// Its turn, from the box's axes to the world's.
        #[serde(rename = "turn_deg", default)]
        turn: Turn,
    },
}

/// A turn about the vertical axis Y (right-handed); in a file its angle in degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "f64", into = "f64")]
pub struct Turn {
    deg: f64,
    world_from_turned: Matrix3<f64>,
}

impl From<f64> for Turn {
    fn from(deg: f64) -> Self {
        let rotation = Rotation3::from_axis_angle(&Vector3::y_axis(), deg.to_radians());
        Self { deg, world_from_turned: rotation.into_inner() }
    }
}

impl From<Turn> for f64 {
    fn from(turn: Turn) -> Self {
        turn.deg
    }
}

impl Default for Turn {
    fn default() -> Self {
        Self::from(0.0)
    }
}

/// Where a ray meets a shape first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Meeting {
    /// Ray parameter s > 0 of origin + s · direction.
    pub s: f64,
    /// Unit normal of the surface, against the ray.
    pub normal: Vector3<f64>,
    /// Face: 0 … 5 for a box (−X, +X, −Y, +Y, −Z, +Z of its own axes), else 0.
    pub face: u16,
}

impl Shape {
    /// A box turned by `turn_deg` about the Y axis (right-handed).
    pub fn turned_box(centre: [f64; 3], half_m: [f64; 3], turn_deg: f64) -> Self {
        Self::Box { centre: centre.into(), half_m: half_m.into(), turn: turn_deg.into() }
    }

    /// A ball.
    pub fn sphere(centre: [f64; 3], radius_m: f64) -> Self {
        Self::Sphere { centre: centre.into(), radius_m }
    }

    /// The plane with inward unit normal `normal` through n · P = `offset_m`.
    pub fn plane(normal: [f64; 3], offset_m: f64) -> Self {
        Self::Plane { normal: normal.into(), offset_m }
    }

    /// A rectangle from its centre and two perpendicular half edges.
    pub fn quad(centre: [f64; 3], half_u: [f64; 3], half_v: [f64; 3]) -> Self {
        Self::Quad { centre: centre.into(), half_m: [half_u.into(), half_v.into()] }
    }

    /// Whether it is a shape that rays can meet; else what is wrong with it.
    ///
    /// # Errors
    /// A number that is not finite, a size that is not positive, a normal or edges that are not what they must be.
    pub fn check(&self) -> Result<(), &'static str> {
        let all = |vectors: &[&Vector3<f64>], scalars: &[f64]| {
            vectors.iter().flat_map(|v| v.iter()).chain(scalars).all(|c| c.is_finite())
        };
        let (finite, sound, reason) = match self {
            Self::Plane { normal, offset_m } => {
                let unit = (normal.norm() - 1.0).abs() < 1e-6;
                (all(&[normal], &[*offset_m]), unit, "the plane's normal is not of length 1")
            }
            Self::Quad { centre, half_m: [a, b] } => {
                let area = a.norm() * b.norm();
                let square = area > 0.0 && a.dot(b).abs() <= 1e-6 * area;
                (all(&[centre, a, b], &[]), square, "the quad's half edges are not perpendicular, or zero")
            }
            Self::Sphere { centre, radius_m } => {
                (all(&[centre], &[*radius_m]), *radius_m > 0.0, "the sphere's radius is not positive")
            }
            Self::Box { centre, half_m, turn } => (
                all(&[centre, half_m], &[turn.deg]),
                half_m.min() > 0.0,
                "a half size of the box is not positive",
            ),
        };
        match (finite, sound) {
            (false, _) => Err("a number of the shape is not finite"),
            (_, false) => Err(reason),
            _ => Ok(()),
        }
    }

    /// First meeting of the ray origin + s · direction, s > 0, with the surface; `None` if it misses.
    pub(super) fn meet(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Meeting> {
        match self {
            Self::Plane { normal, offset_m } => meet_plane(normal, *offset_m, origin, direction),
            Self::Quad { centre, half_m: [a, b] } => {
                let normal = a.cross(b);
                let m = meet_plane(&normal, normal.dot(centre), origin, direction)?;
                let p = origin + m.s * direction - centre;
                let inside = |e: &Vector3<f64>| p.dot(e).abs() <= e.norm_squared();
                (inside(a) && inside(b)).then(|| Meeting { normal: m.normal.normalize(), ..m })
            }
            Self::Sphere { centre, radius_m } => meet_sphere(centre, *radius_m, origin, direction),
            Self::Box { centre, half_m, turn: Turn { world_from_turned: world_from_box, .. } } => {
                // Most rays miss the ball around the box, which is quickly seen.
                let from = origin - centre;
                let (outside, along) = (from.norm_squared() - half_m.norm_squared(), from.dot(direction));
                if outside > 0.0 && (along > 0.0 || along * along < outside * direction.norm_squared()) {
                    return None;
                }
                let m = meet_slabs(half_m, &world_from_box.tr_mul(&from), &world_from_box.tr_mul(direction))?;
                Some(Meeting { normal: world_from_box * m.normal, ..m })
            }
        }
    }

    /// Distance from a point to the surface, in metres; negative behind a plane or inside a solid.
    pub fn clearance_m(&self, p: &Vector3<f64>) -> f64 {
        match self {
            Self::Plane { normal, offset_m } => normal.dot(p) - offset_m,
            Self::Quad { centre, half_m } => {
                let mut away = p - centre;
                for e in half_m {
                    away -= e * (away.dot(e) / e.norm_squared()).clamp(-1.0, 1.0);
                }
                away.norm()
            }
            Self::Sphere { centre, radius_m } => (p - centre).norm() - radius_m,
            Self::Box { centre, half_m, turn } => {
                let out = turn.world_from_turned.tr_mul(&(p - centre)).abs() - half_m;
                out.sup(&Vector3::zeros()).norm() + out.max().min(0.0)
            }
        }
    }

    /// A ball that throws about the same shade: centre and radius; `None` for flat shapes.
    pub(super) fn shade_ball(&self) -> Option<(Vector3<f64>, f64)> {
        match self {
            Self::Sphere { centre, radius_m } => Some((*centre, *radius_m)),
            Self::Box { centre, half_m, .. } => Some((*centre, 1.15 * half_m.product().cbrt())),
            Self::Plane { .. } | Self::Quad { .. } => None,
        }
    }
}

fn meet_plane(
    n: &Vector3<f64>,
    offset: f64,
    origin: &Vector3<f64>,
    direction: &Vector3<f64>,
) -> Option<Meeting> {
    let along = n.dot(direction);
    let s = (offset - n.dot(origin)) / along;
    (s > 0.0 && s.is_finite()).then(|| Meeting { s, normal: -along.signum() * n, face: 0 })
}

fn meet_sphere(
    centre: &Vector3<f64>,
    radius: f64,
    origin: &Vector3<f64>,
    direction: &Vector3<f64>,
) -> Option<Meeting> {
    let from = origin - centre;
    let (a, b, c) = (direction.norm_squared(), from.dot(direction), from.norm_squared() - radius * radius);
    let disc = b * b - a * c;
    if disc < 0.0 {
        return None;
    }
    let root = disc.sqrt();
    let near = (-b - root) / a;
    let (s, side) = if near > 0.0 { (near, 1.0) } else { ((-b + root) / a, -1.0) };
    (s > 0.0).then(|| Meeting { s, normal: (from + s * direction) * (side / radius), face: 0 })
}

/// The box in its own frame: the ray's interval inside all three pairs of planes.
fn meet_slabs(half: &Vector3<f64>, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Meeting> {
    let (mut enter, mut leave) = ((f64::NEG_INFINITY, 0), (f64::INFINITY, 0));
    for axis in 0..3 {
        let inverse = 1.0 / direction[axis];
        let reach = half[axis] * inverse.abs();
        let middle = -origin[axis] * inverse;
        if middle.is_finite() {
            if middle - reach > enter.0 {
                enter = (middle - reach, axis);
            }
            if middle + reach < leave.0 {
                leave = (middle + reach, axis);
            }
        } else if origin[axis].abs() > half[axis] {
            return None;
        }
    }
    if enter.0 > leave.0 || leave.0 <= 0.0 || leave.0.is_infinite() {
        return None;
    }
    let outside = enter.0 > 0.0;
    let (s, axis) = if outside { enter } else { leave };
    let forward = direction[axis] > 0.0;
    let mut normal = Vector3::zeros();
    normal[axis] = if forward { -1.0 } else { 1.0 };
    let upper = forward != outside;
    Some(Meeting { s, normal, face: 2 * axis as u16 + u16::from(upper) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn v(x: f64, y: f64, z: f64) -> Vector3<f64> {
        Vector3::new(x, y, z)
    }

    #[test]
    fn plane_and_quad_against_closed_forms() {
        let ground = Shape::plane([0.0, -1.0, 0.0], -0.9);
        let m = ground.meet(&v(0.0, 0.0, 0.0), &v(0.1, 0.3, 1.0)).unwrap();
        assert!((m.s - 3.0).abs() < 1e-12 && m.normal == v(0.0, -1.0, 0.0));
        assert!(ground.meet(&v(0.0, 0.0, 0.0), &v(0.1, -0.3, 1.0)).is_none());
        assert!(ground.meet(&v(0.0, 0.0, 0.0), &v(0.1, 0.0, 1.0)).is_none());
        let quad = Shape::quad([0.0, 0.0, 2.0], [0.5, 0.0, 0.0], [0.0, 0.2, 0.0]);
        assert!(quad.meet(&v(0.0, 0.0, 0.0), &v(0.24, 0.09, 1.0)).is_some());
        assert!(quad.meet(&v(0.0, 0.0, 0.0), &v(0.26, 0.09, 1.0)).is_none());
        assert!(quad.meet(&v(0.0, 0.0, 0.0), &v(0.24, 0.11, 1.0)).is_none());
        assert!((quad.clearance_m(&v(0.8, 0.6, 2.0)) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn sphere_against_its_closed_form() {
        let ball = Shape::sphere([0.0, 0.0, 5.0], 1.0);
        let m = ball.meet(&v(0.6, 0.0, 0.0), &v(0.0, 0.0, 2.0)).unwrap();
        assert!((m.s - 2.1).abs() < 1e-12 && (m.normal - v(0.6, 0.0, -0.8)).norm() < 1e-12);
        assert!(ball.meet(&v(1.01, 0.0, 0.0), &v(0.0, 0.0, 1.0)).is_none());
        assert!(ball.meet(&v(0.0, 0.0, 7.0), &v(0.0, 0.0, 1.0)).is_none());
        assert!(ball.clearance_m(&v(0.0, 0.0, 4.5)) < 0.0);
    }

    #[test]
    fn turned_box_against_its_corner() {
        // A cube turned by 45° shows its edge at half the diagonal.
        let cube = Shape::turned_box([0.0, 0.0, 5.0], [1.0, 1.0, 1.0], 45.0);
        let edge = 5.0 - 2f64.sqrt();
        let left = cube.meet(&v(-1e-9, 0.0, 0.0), &v(0.0, 0.0, 1.0)).unwrap();
        let right = cube.meet(&v(1e-9, 0.0, 0.0), &v(0.0, 0.0, 1.0)).unwrap();
        assert!((left.s - edge).abs() < 1e-8 && (right.s - edge).abs() < 1e-8);
        assert_ne!(left.face, right.face);
        let slope = 0.5f64.sqrt();
        assert!((right.normal - v(slope, 0.0, -slope)).norm() < 1e-12);
        assert!((cube.clearance_m(&v(0.0, 0.0, 0.0)) - edge).abs() < 1e-12);
        assert!((cube.clearance_m(&v(0.0, 0.0, 5.0)) + 1.0).abs() < 1e-12);
        let inside = cube.meet(&v(0.0, 0.0, 5.0), &v(0.0, 1.0, 0.0)).unwrap();
        assert!((inside.s - 1.0).abs() < 1e-12 && inside.face == 3);
    }
}
