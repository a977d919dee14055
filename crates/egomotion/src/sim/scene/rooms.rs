//! The scenes of the named sequences.

use nalgebra::Vector3;

use super::{Part, Scene};
use crate::sim::shape::Shape;

impl Scene {
    /// The room of section 7.1: ground, front wall, two side walls, a sphere and a turned box.
    pub fn paper_room() -> Self {
        let parts = [
            (Shape::plane([0.0, -1.0, 0.0], -0.9), 135.0),
            (Shape::plane([0.0, 0.0, -1.0], -6.0), 178.0),
            (Shape::plane([1.0, 0.0, 0.0], -1.7), 160.0),
            (Shape::plane([-1.0, 0.0, 0.0], -1.7), 152.0),
            (Shape::sphere([-0.35, 0.30, 2.1], 0.40), 185.0),
            (Shape::turned_box([0.55, 0.55, 3.2], [0.35, 0.35, 0.30], 30.0), 105.0),
        ];
        Self::new(
            parts.map(|(shape, grey)| Part { shape, grey, tile_m: 0.0 }).to_vec(),
            Vector3::new(-0.6, -2.0, 0.8),
            0.3,
            2003,
        )
    }

    /// A furnished room, 5 m × 8.5 m, for the built-in demonstration: an obstacle ahead, others around it.
    pub fn demo_room() -> Self {
        let parts = [
            // Floor, ceiling, front, back, left and right wall.
            (Shape::plane([0.0, -1.0, 0.0], -0.7), 128.0, 0.4),
            (Shape::plane([0.0, 1.0, 0.0], -1.7), 175.0, 0.0),
            (Shape::plane([0.0, 0.0, -1.0], -6.5), 190.0, 0.0),
            (Shape::plane([0.0, 0.0, 1.0], -2.0), 150.0, 0.0),
            (Shape::plane([1.0, 0.0, 0.0], -2.4), 172.0, 0.0),
            (Shape::plane([-1.0, 0.0, 0.0], -2.6), 156.0, 0.0),
            // The obstacle, with a ball on it.
            (Shape::turned_box([0.10, 0.35, 3.05], [0.38, 0.35, 0.28], 14.0), 100.0, 0.0),
            (Shape::sphere([0.16, -0.17, 3.02], 0.17), 215.0, 0.0),
            // Left: a ball, a low crate, a pillar, a cupboard.
            (Shape::sphere([-1.15, 0.33, 3.9], 0.37), 150.0, 0.0),
            (Shape::turned_box([-1.02, 0.54, 2.95], [0.26, 0.16, 0.20], 38.0), 185.0, 0.0),
            (Shape::turned_box([-1.30, -0.50, 5.2], [0.20, 1.20, 0.20], 20.0), 115.0, 0.3),
            (Shape::turned_box([-2.15, -0.05, 3.6], [0.25, 0.75, 0.55], 0.0), 104.0, 0.0),
            // Right: two crates on each other, a shelf, a lamp's globe.
            (Shape::turned_box([1.35, 0.30, 4.1], [0.42, 0.40, 0.40], -25.0), 160.0, 0.0),
            (Shape::turned_box([1.30, -0.34, 4.15], [0.26, 0.24, 0.26], 18.0), 94.0, 0.0),
            (Shape::turned_box([2.30, -0.10, 3.1], [0.30, 0.80, 0.50], 0.0), 185.0, 0.0),
            (Shape::sphere([0.75, -1.05, 4.6], 0.22), 205.0, 0.0),
            // Behind: a table, and pictures on the wall.
            (Shape::turned_box([0.15, 0.10, 5.7], [0.75, 0.60, 0.35], -6.0), 104.0, 0.0),
            (Shape::quad([-0.35, -0.95, 6.48], [0.50, 0.0, 0.0], [0.0, 0.35, 0.0]), 80.0, 0.0),
            (Shape::quad([1.75, -0.75, 6.48], [0.35, 0.0, 0.0], [0.0, 0.48, 0.0]), 105.0, 0.12),
        ];
        Self::new(
            parts.map(|(shape, grey, tile_m)| Part { shape, grey, tile_m }).to_vec(),
            Vector3::new(0.3, -1.5, 1.6),
            0.26,
            42,
        )
    }

    /// A room like that of section 7.2, "two front walls and some objects": walls that meet in a corner 3.6 m
    /// ahead, a table, boxes and balls 1 to 3 m away, so that the paper's rig sees disparities of 15 to 55 px.
    ///
    /// Its walls and its table have no ends, so that a camera inside sees a surface wherever it turns to
    /// within 40°.
    pub fn lab_room() -> Self {
        let parts = [
            // Left and right front wall, each given by its horizontal normal, and the table.
            (Shape::plane([0.483_046, 0.0, -0.875_595], -3.007_228), 165.0, 0.0),
            (Shape::plane([-0.756_801, 0.0, -0.653_645], -2.580_163), 150.0, 0.0),
            (Shape::plane([0.0, -1.0, 0.0], -0.42), 128.0, 0.12),
            // On the table, from near to far.
            (Shape::turned_box([-0.28, 0.20, 1.25], [0.10, 0.22, 0.10], 25.0), 145.0, 0.0),
            (Shape::sphere([0.12, 0.24, 1.60], 0.18), 150.0, 0.0),
            (Shape::turned_box([0.55, 0.10, 2.10], [0.17, 0.32, 0.15], -20.0), 108.0, 0.0),
            (Shape::turned_box([-0.62, 0.05, 2.30], [0.22, 0.37, 0.18], 35.0), 120.0, 0.0),
            (Shape::sphere([0.02, 0.20, 2.75], 0.22), 140.0, 0.0),
            // A ball on the right box, and a lamp's globe above.
            (Shape::sphere([0.55, -0.36, 2.10], 0.14), 150.0, 0.0),
            (Shape::sphere([-0.12, -0.45, 2.00], 0.13), 155.0, 0.0),
        ];
        Self::new(
            parts.map(|(shape, grey, tile_m)| Part { shape, grey, tile_m }).to_vec(),
            Vector3::new(0.5, -1.6, 0.4),
            0.3,
            2003,
        )
    }

    /// A corridor, 4.4 m × 16 m, whose pillars and boxes stand now on the left and now on the right.
    pub fn corridor() -> Self {
        let walls = [
            // Floor, ceiling, far end, near end, left and right wall.
            (Shape::plane([0.0, -1.0, 0.0], -1.0), 128.0, 0.5),
            (Shape::plane([0.0, 1.0, 0.0], -1.6), 170.0, 0.0),
            (Shape::plane([0.0, 0.0, -1.0], -14.0), 175.0, 0.0),
            (Shape::plane([0.0, 0.0, 1.0], -2.0), 150.0, 0.0),
            (Shape::plane([1.0, 0.0, 0.0], -2.2), 165.0, 0.0),
            (Shape::plane([-1.0, 0.0, 0.0], -2.2), 150.0, 0.0),
        ];
        // What stands along the walls: every 1.5 m one thing on either side, of other sizes and turns.
        let beside = (0..9).flat_map(|i| {
            let (k, z) = (f64::from(i), 2.0 + 1.5 * f64::from(i));
            let half = 0.18 + 0.03 * f64::from(i % 3);
            let pillar = Shape::turned_box([-1.85, -0.3, z], [half, 1.3, half], 20.0 * k);
            let crate_ = Shape::turned_box([1.8, 0.65, z + 0.6], [0.3, 0.35, 0.25], -15.0 * k);
            let globe = Shape::sphere([1.75 - 0.1 * (k % 2.0), -0.1, z + 0.6], 0.22);
            [(pillar, 105.0, 0.0), (crate_, 140.0, 0.2), (globe, 120.0, 0.0)]
        });
        let parts = walls.into_iter().chain(beside);
        Self::new(
            parts.map(|(shape, grey, tile_m)| Part { shape, grey, tile_m }).collect(),
            Vector3::new(0.2, -1.4, 5.0),
            0.28,
            17,
        )
    }
}
