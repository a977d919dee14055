//! The resolution in depth of a step of disparity: the table under (51), and Figure 3.

use crate::{Axis, Content, Figure, Line, Panel, Point, Series, Table};
use egomotion::motion::depth_velocity::smallest_change;

/// b f of section 5.5: 130 mm × 5 mm/0.012 mm, in millimetre pixels.
const BF_MM: f64 = 130.0 * 5.0 / 0.012;
/// Half of the baseline of section 5.5, in millimetres.
const HALF_BASELINE_MM: f64 = 65.0;
/// Side of the pixels of Figure 3(a), in real pixels, whose cells could not be seen; larger cells are fewer.
const COARSE_PX: f64 = 8.0;
/// Depth at which the rays of Figure 3(a) begin, in millimetres.
const NEAREST_MM: f64 = 900.0;
/// Depth at which the rays of Figure 3(a) end, in millimetres.
const FARTHEST_MM: f64 = 7000.0;

/// The list under (51): (d in px, δ in px, Z in mm, ΔZ in mm) as the paper prints it.
pub(super) const PRINTED: [(f64, f64, f64, f64); 10] = [
    (1.0, 0.0625, 54_167.0, -3186.0),
    (5.0, 0.0625, 10_833.0, -133.7),
    (10.0, 0.0625, 5417.0, -33.7),
    (20.0, 0.0625, 2708.0, -8.4),
    (50.0, 0.0625, 1083.0, -1.4),
    (1.0, 0.25, 54_167.0, -10_833.0),
    (5.0, 0.25, 10_833.0, -515.9),
    (10.0, 0.25, 5417.0, -132.1),
    (20.0, 0.25, 2708.0, -33.4),
    (50.0, 0.25, 1083.0, -5.4),
];

/// The table under (51), ours beside the printed one.
pub(super) fn table() -> Table {
    let mut table = Table::new(
        "table-51",
        "Smallest change of depth that a step of disparity shows, (51)",
        "b = 130 mm, f = 416.667 px. Nine of the ten printed values agree; at d = 10 px and 1/16 px the \
         formula gives 33.64 mm, printed 33.7.",
        &[
            ("disparity_px", "d (px)"),
            ("step_px", "δ (px)"),
            ("z_mm", "Z (mm)"),
            ("z_printed_mm", "Z printed (mm)"),
            ("change_mm", "ΔZ (mm)"),
            ("change_printed_mm", "ΔZ printed (mm)"),
        ],
    );
    let row = |&(d, step, z, printed): &(f64, f64, f64, f64)| {
        [d, step, BF_MM / d, z, smallest_change(d, step, BF_MM), printed].map(Into::into).to_vec()
    };
    table.rows = PRINTED.iter().map(row).collect();
    table
}

/// Figure 3.
pub(super) fn figure() -> Figure {
    let plan = Content::Plot {
        x: Axis::linear("X (mm)"),
        y: Axis::linear("Z (mm)"),
        series: [
            ("rays of the left camera", -HALF_BASELINE_MM),
            ("rays of the right camera", HALF_BASELINE_MM),
        ]
        .into_iter()
        .flat_map(|(name, centre_mm)| (-3..=3).map(move |k| ray(name, centre_mm, k)))
        .chain([5.0, 4.0, 3.0, 2.0].map(cell))
        .collect(),
    };
    let lines = [(1.0, "δ = 1 px"), (0.25, "δ = 1/4 px"), (0.0625, "δ = 1/16 px")].map(|(step, name)| {
        let depth = |i: i32| 1000.0 * 50.0_f64.powf(f64::from(i) / 16.0);
        let point = |i: i32| Point::at(depth(i), -smallest_change(BF_MM / depth(i), step, BF_MM));
        Series { name: name.to_owned(), line: Line::Solid, points: (0..=16).map(point).collect() }
    });
    let printed = Series {
        name: "printed under (51)".to_owned(),
        line: Line::Marks,
        points: PRINTED.iter().map(|&(_, _, z, change)| Point::at(z, -change)).collect(),
    };
    let change = Content::Plot {
        x: Axis::log("Z (mm)"),
        y: Axis::log("smallest change of depth (mm)"),
        series: lines.into_iter().chain([printed]).collect(),
    };
    Figure {
        id: "figure-03".to_owned(),
        title: "Figure 3. Effect of finite resolution of disparity maps in depth".to_owned(),
        caption: "(a) Seen from above: rays through the borders of pixels (drawn 8 px wide) of both cameras; \
                  a point anywhere in a cell has the same pair of pixels. Cells are long in depth, and \
                  grow with its square. (b) The smallest change of depth that a step of disparity shows, (51)."
            .to_owned(),
        columns: 2,
        panels: vec![
            Panel { title: "(a) cells of equal disparity".to_owned(), content: plan },
            Panel { title: "(b) resolution in depth".to_owned(), content: change },
        ],
    }
}

/// Ray of the camera at `centre_mm` through the `k`-th border of coarse pixels.
fn ray(name: &str, centre_mm: f64, k: i32) -> Series {
    let slope = f64::from(k) * COARSE_PX * 0.012 / 5.0;
    let points = [NEAREST_MM, FARTHEST_MM].map(|z| Point::at(centre_mm + z * slope, z)).to_vec();
    Series { name: name.to_owned(), line: Line::Reference, points }
}

/// The cell of a coarse pixel of each camera, `disparity` coarse pixels apart, near the middle.
fn cell(disparity: f64) -> Series {
    let left = (0.5 * disparity).floor();
    let corner = |l: f64, r: f64| {
        // Where the rays of two borders meet: x = X/Z f + shift, so d = l − r.
        let d = COARSE_PX * (l - r);
        Point::at(-HALF_BASELINE_MM + 2.0 * HALF_BASELINE_MM * COARSE_PX * l / d, BF_MM / d)
    };
    let right = left - disparity;
    let corners =
        [(left, right), (left + 1.0, right), (left + 1.0, right + 1.0), (left, right + 1.0), (left, right)];
    Series {
        name: format!("cell at d = {} px", disparity * COARSE_PX),
        line: Line::Solid,
        points: corners.map(|(l, r)| corner(l, r)).to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printed_list_but_for_one() {
        let off: Vec<f64> = PRINTED
            .iter()
            .filter(|(d, step, _, printed)| {
                let digit = if *printed < -1000.0 { 1.0 } else { 0.1 };
                (smallest_change(*d, *step, BF_MM) - printed).abs() > 0.5 * digit
            })
            .map(|case| case.3)
            .collect();
        assert_eq!(off, [-33.7]);
        assert!(PRINTED.iter().all(|(d, _, z, _)| (BF_MM / d - z).abs() <= 0.5));
    }

    #[test]
    fn cells_end_on_rays_and_grow_with_the_square_of_depth() {
        let Content::Plot { series, .. } = &figure().panels[0].content else { panic!("a plot") };
        let cells: Vec<&Series> = series.iter().filter(|s| s.name.starts_with("cell")).collect();
        let length = |s: &Series| {
            let z: Vec<f64> = s.points.iter().map(|p| p.y).collect();
            let (lo, hi) = z.iter().fold((f64::MAX, 0.0_f64), |(lo, hi), &z| (lo.min(z), hi.max(z)));
            assert_eq!(z.len(), 5);
            hi - lo
        };
        // Between d − 1 and d + 1 coarse pixels: 2 b f/(d² − 1).
        for (s, d) in cells.iter().zip([5.0, 4.0, 3.0, 2.0_f64]) {
            assert!((length(s) / (2.0 * BF_MM / COARSE_PX / (d * d - 1.0)) - 1.0).abs() < 1e-12);
            for corner in &s.points {
                let border = |centre: f64| (corner.x - centre) / corner.y * 5.0 / 0.012 / COARSE_PX;
                assert!(
                    [-HALF_BASELINE_MM, HALF_BASELINE_MM]
                        .iter()
                        .all(|&c| (border(c) - border(c).round()).abs() < 1e-9)
                );
            }
        }
    }
}
