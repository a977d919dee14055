//! A scene of plain parts: what a ray sees, and how bright it looks.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

mod file;
mod rooms;

use super::shape::Shape;
use super::texture::Texture;
pub use file::SceneError;
use file::SceneFile;

/// The most parts of a scene: a surface id has 16 bits.
const MAX_PARTS: usize = 10_000;
/// Number of surface ids that a part takes: a box has six faces.
const FACES: u16 = 6;
/// Where the texture saturates, in its standard deviations: it keeps every grey level above zero.
const SATURATION: f64 = 2.4;
/// Light that reaches every surface, whatever its direction, as a share of full light.
const AMBIENT: f64 = 0.5;
/// Difference between neighbouring tiles, as a share of their mean.
const TILE_CONTRAST: f64 = 0.3;
/// A part's shade reaches this many of its radii: further it would hardly be seen, and cost as much.
const SHADE_REACH: f64 = 5.0;

/// One part of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Mean grey level in full light; up to 150 keeps nearly every spot within 8 bits.
    pub grey: f64,
    /// Side of the dark and bright tiles laid in it along the world's axes, in metres; 0 for none.
    #[serde(default)]
    pub tile_m: f64,
    /// Its shape, in the world's frame.
    pub shape: Shape,
}

/// A ball around a part, or one that shades like it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ball {
    part: u16,
    centre: Vector3<f64>,
    radius_m: f64,
}

/// What a ray sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Ray parameter: the depth Z in metres where the direction has Z = 1 in the camera's frame.
    pub s: f64,
    /// The point, in metres, world frame.
    pub point: Vector3<f64>,
    /// Unit normal of the surface, towards the ray's origin.
    pub normal: Vector3<f64>,
    /// Surface id: unique to a part, and to a face where the part is a box.
    pub surface: u16,
}

/// Textured parts under one lamp. Everything that decides a point's brightness is fixed to the world,
/// so that brightness is constant between cameras and between frames.
///
/// Written and read by serde as its parts; what is read is checked ([`super::SceneError`]) and equals what was
/// written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "SceneFile", into = "SceneFile")]
pub struct Scene {
    parts: Vec<Part>,
    texture: Texture,
    contrast: f64,
    lamp_m: Vector3<f64>,
    shades: Vec<Ball>,
}

impl Scene {
    /// A scene of at most 10 000 parts (further ones are dropped), lit by a lamp at `lamp_m`.
    ///
    /// Every surface carries the texture of `seed`; `contrast` is the standard deviation of its grey level
    /// as a share of the mean, below 0.4 so that it never reaches black.
    pub fn new(mut parts: Vec<Part>, lamp_m: Vector3<f64>, contrast: f64, seed: u64) -> Self {
        parts.truncate(MAX_PARTS);
        let shade = |(part, id): (&Part, u16)| {
            part.shape.shade_ball().map(|(centre, radius_m)| Ball { part: id, centre, radius_m })
        };
        let shades = parts.iter().zip(0..).filter_map(shade).collect();
        Self { parts, texture: Texture::new(seed), contrast, lamp_m, shades }
    }

    /// The same parts under the texture of another seed.
    #[must_use]
    pub fn with_texture(self, seed: u64) -> Self {
        Self { texture: Texture::new(seed), ..self }
    }

    /// What every surface carries.
    pub fn texture(&self) -> &Texture {
        &self.texture
    }

    /// Standard deviation of the texture, as a share of the mean grey level.
    pub fn contrast(&self) -> f64 {
        self.contrast
    }

    /// Where the lamp hangs, in metres, world frame.
    pub fn lamp_m(&self) -> Vector3<f64> {
        self.lamp_m
    }

    /// The parts, in the order of their surface ids.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// First surface on the ray origin + s · direction, s > 0; `None` if it meets nothing.
    pub fn cast(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Hit> {
        let mut nearest: Option<(u16, super::shape::Meeting)> = None;
        for (part, id) in self.parts.iter().zip(0_u16..) {
            if let Some(m) = part.shape.meet(origin, direction)
                && nearest.is_none_or(|(_, best)| m.s < best.s)
            {
                nearest = Some((id, m));
            }
        }
        nearest.map(|(id, m)| Hit {
            s: m.s,
            point: origin + m.s * direction,
            normal: m.normal,
            surface: id * FACES + m.face,
        })
    }

    /// Whether nothing stands between `origin` and a point on a surface.
    pub fn sees(&self, origin: &Vector3<f64>, point: &Vector3<f64>) -> bool {
        let direction = point - origin;
        let blocks = |part: &Part| part.shape.meet(origin, &direction).is_some_and(|m| m.s < 1.0 - 1e-6);
        !self.parts.iter().any(blocks)
    }

    /// Distance from a point to the nearest surface, in metres; negative inside a solid or behind a wall, NaN
    /// where the point is.
    pub fn clearance_m(&self, p: &Vector3<f64>) -> f64 {
        self.parts.iter().map(|part| part.shape.clearance_m(p)).fold(f64::INFINITY, least)
    }

    /// Grey level, 0 … 255, of a hit seen by a pixel whose steps move the point by `du`, `dv` (metres).
    pub fn grey(&self, hit: &Hit, du: &Vector3<f64>, dv: &Vector3<f64>) -> f64 {
        let id = hit.surface / FACES;
        let Some(part) = self.parts.get(usize::from(id)) else { return 0.0 };
        // Each part is cut from another place of the same material.
        let place = f64::from(id);
        let cut =
            Vector3::new((place * 0.618).fract(), (place * 0.755).fract(), (place * 0.570).fract()) * 4.0;
        let n = self.texture.value(&(hit.point + cut), du, dv);
        let n = n / (1.0 + n * n / (SATURATION * SATURATION)).sqrt();
        let tile = 1.0 + tiles(part.tile_m, hit, du, dv);
        (part.grey * tile * self.light(id, hit) * (1.0 + self.contrast * n)).clamp(0.0, 255.0)
    }

    /// Share of full light at a hit: ambient light, the lamp, and the soft shade of the parts nearby.
    fn light(&self, id: u16, hit: &Hit) -> f64 {
        let to_lamp = self.lamp_m - hit.point;
        let range_squared = to_lamp.norm_squared();
        let slant = (hit.normal.dot(&to_lamp) / range_squared.sqrt()).max(0.0);
        let lamp = (1.0 - AMBIENT) * (0.3 + 0.7 * slant) / (1.0 + 0.01 * range_squared);
        let open = |ball: &Ball| {
            // Share of the half space that the ball leaves open, with a tail that ends.
            let (to, r2) = (ball.centre - hit.point, ball.radius_m * ball.radius_m);
            let d2 = to.norm_squared().max(r2);
            if ball.part == id || d2 > SHADE_REACH * SHADE_REACH * r2 {
                return 1.0;
            }
            let hidden = r2 / d2 - 1.0 / (SHADE_REACH * SHADE_REACH);
            1.0 - 0.75 * (hit.normal.dot(&to) / d2.sqrt()).clamp(0.0, 1.0) * hidden
        };
        (AMBIENT + lamp) * self.shades.iter().map(open).product::<f64>()
    }
}

/// The lesser of two numbers; NaN if either is, which [`f64::min`] hides.
pub(super) fn least(a: f64, b: f64) -> f64 {
    if a < b || a.is_nan() { a } else { b }
}

/// Brightness of a solid chequer at a hit, in ±½ [`TILE_CONTRAST`], averaged over the pixel's extent along
/// each axis; the axis nearest to the normal does not count, so that no face lies on a border.
fn tiles(side_m: f64, hit: &Hit, du: &Vector3<f64>, dv: &Vector3<f64>) -> f64 {
    if side_m <= 0.0 {
        return 0.0;
    }
    // Integral of the square wave of period 2.
    let wave = |x: f64| 2.0 * (0.5 * x - (0.5 * x).floor() - 0.5).abs();
    let mut sign = 0.5 * TILE_CONTRAST;
    for axis in (0..3).filter(|&axis| axis != hit.normal.iamax()) {
        let (x, width) = (hit.point[axis] / side_m, (du[axis].abs() + dv[axis].abs()) / side_m);
        sign *= (wave(x - 0.5 * width) - wave(x + 0.5 * width)) / width.max(1e-9);
    }
    sign
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paper_room_against_closed_forms() {
        let scene = Scene::paper_room();
        let cast = |x: f64, y: f64| scene.cast(&Vector3::zeros(), &Vector3::new(x, y, 1.0)).unwrap();
        assert!((cast(0.0, -0.2).s - 6.0).abs() < 1e-12);
        assert!((cast(0.0, 0.45).s - 2.0).abs() < 1e-12);
        assert!((cast(-0.5, -0.1).s - 3.4).abs() < 1e-12);
        assert!((cast(0.5, -0.1).s - 3.4).abs() < 1e-12);
        // Through the sphere's centre: its front lies one radius nearer.
        let centre = Vector3::new(-0.35, 0.30, 2.1);
        let hit = scene.cast(&Vector3::zeros(), &centre).unwrap();
        assert!((hit.s - (1.0 - 0.4 / centre.norm())).abs() < 1e-12);
        // Every ray of the image meets something, and boxes have faces of their own.
        let mut seen = std::collections::BTreeSet::new();
        for i in -38..=38 {
            for j in -28..=28 {
                seen.insert(cast(f64::from(i) / 100.0, f64::from(j) / 100.0).surface);
            }
        }
        let box_faces = seen.iter().filter(|&&id| id / FACES == 5).count();
        assert_eq!(box_faces, 3, "{seen:?}");
        assert_eq!(seen.len(), 5 + box_faces, "{seen:?}");
    }

    #[test]
    fn walls_of_the_lab_meet_at_its_corner_and_close_the_view() {
        let scene = Scene::lab_room();
        let corner = Vector3::new(0.3, 0.0, 3.6);
        for wall in &scene.parts()[..2] {
            assert!(wall.shape.clearance_m(&corner).abs() < 1e-5);
        }
        for degrees in -40..=40 {
            let (x, z) = f64::from(degrees).to_radians().sin_cos();
            let ahead = scene.cast(&Vector3::zeros(), &Vector3::new(x, -0.2, z)).unwrap();
            assert!((1.0..4.0).contains(&ahead.s), "{degrees} {}", ahead.s);
        }
    }

    #[test]
    fn a_scene_with_another_texture_has_the_same_shapes() {
        let (one, two) = (Scene::lab_room(), Scene::lab_room().with_texture(7));
        let ray = Vector3::new(0.1, -0.1, 1.0);
        let (a, b) = (one.cast(&Vector3::zeros(), &ray).unwrap(), two.cast(&Vector3::zeros(), &ray).unwrap());
        assert_eq!(a, b);
        let still = Vector3::zeros();
        assert_ne!(one.grey(&a, &still, &still), two.grey(&b, &still, &still));
        assert_eq!(one, two.with_texture(2003));
    }

    #[test]
    fn sight_is_blocked_by_the_sphere_only() {
        let scene = Scene::paper_room();
        let behind = Vector3::new(-0.35, 0.30, 2.1) * (6.0 / 2.1);
        assert!(!scene.sees(&Vector3::zeros(), &behind));
        assert!(scene.sees(&Vector3::new(-1.5, 0.0, 0.0), &behind));
        assert!((scene.clearance_m(&Vector3::zeros()) - 0.9).abs() < 1e-12);
    }

    #[test]
    fn the_texture_has_no_seam_at_the_edges_of_a_box() {
        let scene = Scene::paper_room();
        let texture_at = |x: f64, y: f64| {
            let hit = scene.cast(&Vector3::zeros(), &Vector3::new(x, y, 1.0)).unwrap();
            let full = scene.parts[5].grey * scene.light(5, &hit);
            (hit.surface, scene.grey(&hit, &Vector3::zeros(), &Vector3::zeros()) / full - 1.0)
        };
        // Along a row across the box: where the face changes the texture goes on, within what 1/40 mm changes.
        let mut changes = 0;
        for i in 0..60_000 {
            let [(face, a), (next, b)] = [i, i + 1].map(|i| texture_at(1e-5 * f64::from(i), 0.17));
            if face != next && face / FACES == 5 && next / FACES == 5 {
                assert!((a - b).abs() < 0.01, "{a} {b}");
                changes += 1;
            }
        }
        assert_eq!(changes, 1);
    }

    #[test]
    fn tiles_alternate_and_fade_where_pixels_are_coarse() {
        let at = |x: f64, z: f64, width: f64| {
            let (point, normal) = (Vector3::new(x, 0.7, z), Vector3::new(0.0, -1.0, 0.0));
            let steps = [Vector3::new(width, 0.0, 0.0), Vector3::new(0.0, 0.0, width)];
            tiles(0.4, &Hit { s: 1.0, point, normal, surface: 0 }, &steps[0], &steps[1])
        };
        let bright = 0.5 * TILE_CONTRAST;
        assert!((at(0.2, 0.2, 0.01) - bright).abs() < 1e-12 && (at(0.6, 0.2, 0.01) + bright).abs() < 1e-12);
        assert!((at(-0.2, 0.2, 0.01) + bright).abs() < 1e-12 && (at(0.6, -0.2, 0.01) - bright).abs() < 1e-12);
        // On a border, half of each; over whole periods, nothing.
        assert!(at(0.4, 0.2, 0.1).abs() < 1e-12 && at(0.2, 0.2, 1.6).abs() < 1e-12);
    }
}
