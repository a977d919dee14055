//! The four methods' variances, and their coefficients (53) while the sphere moves away: Figure 6.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::exact::{Exact, Noise};
use crate::motion::depth_velocity as vz;
use crate::sim::{Part, Scene, Sequence, Shape};
use crate::study::world::World;
use crate::study::{Axis, Cell, Content, Figure, Line, Panel, Point, Series, Table};

/// The four methods, numbered as in (53).
pub const METHODS: [&str; 4] = ["DCCE differential", "DV differential", "DCCE discrete", "DV discrete"];

/// Variance of VZ by the four methods at one point, in m².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variances {
    /// (39), (44), (47) and (50), with σ²_di = ½ σ²_d for all derivatives as section 5.6 takes it.
    pub printed: [f64; 4],
    /// (39c), (44), (47c) and (50).
    pub corrected: [f64; 4],
}

impl Variances {
    /// At one point; `bf` is b f.
    pub fn of(at: &Exact, noise: &Noise, bf: f64) -> Self {
        let (flow, track) = (at.depth_flow(noise), at.depth_track(noise));
        let mut halved = track.as_printed();
        halved.disparity.cov[(3, 3)] = 0.5 * track.disparity.cov[(0, 0)];
        let dv = vz::dv(&at.stereo_flow(noise), bf).vz().variance();
        let dv_discrete = vz::dv_discrete(&at.stereo_track(noise), bf).vz().variance();
        Self {
            printed: [
                vz::dcce_variance_as_printed(&flow, bf),
                dv,
                vz::dcce_variance_as_printed(&halved, bf),
                dv_discrete,
            ],
            corrected: [
                vz::dcce(&flow.depth_change(bf)).vz().variance(),
                dv,
                vz::dcce(&track.depth_change(bf)).vz().variance(),
                dv_discrete,
            ],
        }
    }
}

/// Coefficients of (53), means over the sphere, with its centre at one depth; in mm² per px².
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coefficients {
    /// Depth of the sphere's centre, in metres.
    pub depth_m: f64,
    /// Usable pixels on the sphere.
    pub pixels: usize,
    /// As printed: (Coef_disp, Coef_vel) of the four methods.
    pub printed: [(f64, f64); 4],
    /// Of the corrected formulas.
    pub corrected: [(f64, f64); 4],
}

/// The paper's sphere, moved from 2.5 to 5 m under the sequence's motion.
pub fn over_depth(sequence: &Sequence) -> Vec<Coefficients> {
    let Some(phi) = sequence.phi_cyclopean(0) else { return Vec::new() };
    let at = |depth_m: f64| {
        let part = Part { shape: Shape::sphere([-0.35, 0.30, depth_m], 0.40), grey: 185.0, tile_m: 0.0 };
        let scene = Scene::new(vec![part], Vector3::new(-0.6, -2.0, 0.8), 0.3, 2003);
        mean_over(&World::new(&scene, &sequence.rig, &phi, 0, 1.0), depth_m)
    };
    (0..=10).map(|i| at(2.5 + 0.25 * f64::from(i))).collect()
}

fn mean_over(world: &World, depth_m: f64) -> Coefficients {
    let bf = world.rig.depth_disparity_product();
    let usable = world.pixels().iter().filter(|pixel| pixel.differential);
    let points: Vec<Exact> = usable.filter_map(|pixel| Exact::at(world, pixel.index)).collect();
    let mut sums = [[(0.0, 0.0); 4]; 2];
    for point in &points {
        let unit = |disparity_px, flow_px| Variances::of(point, &Noise { disparity_px, flow_px }, bf);
        let (by_disparity, by_flow) = (unit(1.0, 0.0), unit(0.0, 1.0));
        let pairs = [(by_disparity.printed, by_flow.printed), (by_disparity.corrected, by_flow.corrected)];
        for (sum, (disparity, flow)) in sums.iter_mut().zip(pairs) {
            for (sum, (d, v)) in sum.iter_mut().zip(disparity.into_iter().zip(flow)) {
                *sum = (sum.0 + d, sum.1 + v);
            }
        }
    }
    let scale = 1e6 / points.len().max(1) as f64;
    let [printed, corrected] = sums.map(|of| of.map(|(d, v)| (scale * d, scale * v)));
    Coefficients { depth_m, pixels: points.len(), printed, corrected }
}

/// A coefficient's name, `Coef1_disp`, and how to read it from (Coef_disp, Coef_vel) of the methods.
type Named = (&'static str, usize, fn((f64, f64)) -> f64);

/// Those of the paper's Figure 6(a), which grow strongly with depth.
const STRONG: [Named; 4] = [
    ("Coef1_disp", 0, |c| c.0),
    ("Coef2_vel", 1, |c| c.1),
    ("Coef3_disp", 2, |c| c.0),
    ("Coef4_disp", 3, |c| c.0),
];
/// Those of its Figure 6(b); Coef4_vel is zero.
const WEAK: [Named; 3] = [("Coef1_vel", 0, |c| c.1), ("Coef2_disp", 1, |c| c.0), ("Coef3_vel", 2, |c| c.1)];

/// Figure 6.
pub fn figure(found: &[&Coefficients]) -> Figure {
    let panel = |title: &str, named: &[Named], of: fn(&Coefficients) -> &[(f64, f64); 4]| Panel {
        title: title.to_owned(),
        content: Content::Plot {
            x: Axis::linear("depth of the sphere (m)"),
            y: Axis::linear("coefficient (mm²/px²)"),
            series: named
                .iter()
                .map(|&(name, method, read)| series(name, found, |c| read(of(c)[method])))
                .collect(),
        },
    };
    Figure {
        id: "figure-06".to_owned(),
        title: "Figure 6. Uncertainty coefficients of (53): effect of depth".to_owned(),
        caption:
            "Variance of VZ = Coef_disp σ²_d + Coef_vel σ²_v, mean over the sphere's usable pixels while \
                  its centre moves from 2.5 to 5 m under the motion of sequence C. 1 DCCE differential, 2 DV \
                  differential, 3 DCCE discrete, 4 DV discrete. Of the discrete DCCE, Coef_vel weighs the \
                  variance of one component of the displacement, σ²_x + σ²_x′; of the discrete DV it is \
                  zero. The printed coefficients take σ²_di = ½ σ²_d for d_t of the discrete form too; the \
                  corrected ones, of (39c) and (47c), have its 2 σ²_d and the shared disparity."
                .to_owned(),
        columns: 2,
        panels: vec![
            panel("(a) as printed: those that grow strongly", &STRONG, |c| &c.printed),
            panel("(b) as printed: those that grow slowly", &WEAK, |c| &c.printed),
            panel("(c) corrected: those that grow strongly", &STRONG, |c| &c.corrected),
            panel("(d) corrected: those that grow slowly", &WEAK, |c| &c.corrected),
        ],
    }
}

fn series(name: &str, found: &[&Coefficients], value: impl Fn(&Coefficients) -> f64) -> Series {
    let point = |c: &&Coefficients| Point { x: c.depth_m, y: value(c), standard_error: None };
    Series { name: name.to_owned(), line: Line::Solid, points: found.iter().map(point).collect() }
}

/// Every coefficient at every depth.
pub fn data(found: &[&Coefficients]) -> Table {
    let mut table = Table::new(
        "coefficients",
        "Coefficients of (53) against depth",
        "Means over the sphere's usable pixels; mm² per px².",
        &[
            ("depth_m", "depth (m)"),
            ("pixels", "pixels"),
            ("kind", "kind"),
            ("method", "method"),
            ("coef_disp", "Coef_disp (mm²/px²)"),
            ("coef_vel", "Coef_vel (mm²/px²)"),
        ],
    );
    for c in found {
        for (kind, of) in [("printed", &c.printed), ("corrected", &c.corrected)] {
            for (method, (disparity, velocity)) in METHODS.into_iter().zip(of) {
                let numbers = [(*disparity).into(), (*velocity).into()];
                let head = [c.depth_m.into(), c.pixels.into(), kind.into(), method.into()];
                table.rows.push(head.into_iter().chain(numbers).collect());
            }
        }
    }
    table
}

/// How fast each coefficient grows: its values at the ends and the power of depth between them.
pub fn table(found: &[&Coefficients]) -> Table {
    let mut table = Table::new(
        "coefficients-growth",
        "Growth of the coefficients of (53) with depth",
        "From the nearest to the farthest place of the sphere; the power p of depth in coefficient ∝ Zᵖ. \
         The paper says between 2 and 4.",
        &[
            ("coefficient", "coefficient"),
            ("printed_near", "printed, near (mm²/px²)"),
            ("printed_far", "printed, far (mm²/px²)"),
            ("printed_power", "power"),
            ("corrected_near", "corrected, near (mm²/px²)"),
            ("corrected_far", "corrected, far (mm²/px²)"),
            ("corrected_power", "power"),
        ],
    );
    let (Some(near), Some(far)) = (found.first(), found.last()) else { return table };
    for (name, method, read) in STRONG.iter().chain(&WEAK) {
        let growth = |of: fn(&Coefficients) -> &[(f64, f64); 4]| {
            let [a, b] = [near, far].map(|c| read(of(c)[*method]));
            [a, b, (b / a).ln() / (far.depth_m / near.depth_m).ln()].map(Cell::from)
        };
        let numbers = growth(|c| &c.printed).into_iter().chain(growth(|c| &c.corrected));
        table.rows.push([Cell::from(*name)].into_iter().chain(numbers).collect());
    }
    table
}
