//! The exact truth of a frame as maps on the left camera's pixel grid.

use rayon::prelude::*;

use super::render::View;
use crate::geometry::{Field, Grid, Twist};

/// Bit of [`TruthMaps::visible`]: the right camera sees the point too.
pub const IN_RIGHT: u8 = 1;
/// Bit of [`TruthMaps::visible`]: the later left image shows the point.
pub const IN_LATER: u8 = 2;

/// What every pixel of the left image sees, and where a motion takes it.
///
/// A map has a value wherever the pixel sees a surface; those of the motion only where the point also stays in
/// front of the camera. Occlusion takes no value away: `visible` tells it.
#[derive(Debug, Clone, PartialEq)]
pub struct TruthMaps {
    /// u_left − u_right, in pixels.
    pub shift: Field,
    /// Depth Z, in metres.
    pub depth: Field,
    /// Z′ − Z, in metres per interval.
    pub depth_velocity: Field,
    /// Displacement (x′ − x, y′ − y) of the point in the left image, in pixels as [`Field`]s of u and v.
    pub flow: [Field; 2],
    /// Bits [`IN_RIGHT`] and [`IN_LATER`]: inside that image, and not hidden.
    pub visible: Grid<u8>,
}

/// One pixel of all maps; NaN is missing.
#[derive(Clone, Copy)]
struct Pixel {
    shift: f32,
    depth: f32,
    depth_velocity: f32,
    flow: [f32; 2],
    visible: u8,
}

/// A pixel that sees nothing.
const NOTHING: Pixel =
    Pixel { shift: f32::NAN, depth: f32::NAN, depth_velocity: f32::NAN, flow: [f32::NAN; 2], visible: 0 };

impl View<'_> {
    /// The truth of every pixel; `phi` is the scene motion of the *left* camera to the later frame.
    ///
    /// Without a later frame the maps of the motion are empty.
    pub fn truth_maps(&self, phi: Option<&Twist>) -> TruthMaps {
        let (width, height) = (self.rig.width_px, self.rig.height_px);
        let at = |i: usize| self.pixel_truth((i % width) as f64, (i / width) as f64, phi).unwrap_or(NOTHING);
        let pixels: Vec<Pixel> = (0..width * height).into_par_iter().with_min_len(width).map(at).collect();
        let field = |value: fn(&Pixel) -> f32| {
            Field::from_grid(Grid::from_fn(width, height, |u, v| value(&pixels[v * width + u])))
        };
        TruthMaps {
            shift: field(|p| p.shift),
            depth: field(|p| p.depth),
            depth_velocity: field(|p| p.depth_velocity),
            flow: [field(|p| p.flow[0]), field(|p| p.flow[1])],
            visible: Grid::from_fn(width, height, |u, v| pixels[v * width + u].visible),
        }
    }

    fn pixel_truth(&self, u: f64, v: f64, phi: Option<&Twist>) -> Option<Pixel> {
        let point = self.truth_at(u, v)?;
        let seen = Pixel {
            shift: self.rig.shift_from_disparity(point.disparity_px()) as f32,
            depth: point.depth_m() as f32,
            visible: if point.in_right { IN_RIGHT } else { 0 },
            ..NOTHING
        };
        let Some(motion) = phi.map(|phi| self.motion_at(&point, phi)) else { return Some(seen) };
        let Some(later) = motion.later_xyd else { return Some(seen) };
        let (later_u, later_v) = self.rig.pixel_from_image(later.x, later.y);
        Some(Pixel {
            depth_velocity: motion.depth_change_m(&point) as f32,
            flow: [(later_u - u) as f32, (later_v - v) as f32],
            visible: seen.visible | if motion.in_later { IN_LATER } else { 0 },
            ..seen
        })
    }
}
