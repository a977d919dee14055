//! The four methods' variances, and their coefficients (53) while the sphere moves away: Figure 6.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::pixel::{ExactPixel, PixelNoise};
use crate::sequences::PAPER_STEPS;
use crate::synthetic::SyntheticWorld;
use crate::{Axis, Cell, Content, Figure, Line, Panel, Series, Table};
use egomotion::motion::depth_velocity as vz;
use egomotion::pipeline::Approach;
use egomotion::sim::{Part, Scene, Sequence, Shape};

/// Depth of the centre of the paper's sphere (7.1) at its nearest, in metres.
const NEAREST_M: f64 = 2.5;
/// Distance from one depth of the sphere's centre to the next, in metres.
const DEPTH_STEP_M: f64 = 0.25;
/// Steps of depth: up to 5 m.
const DEPTH_STEPS: i32 = 10;
/// Largest multiple of the motion; beyond, the sphere leaves the image.
const LARGEST_STEP: f64 = 16.0;
/// Place of the sphere's centre to the side and down, in metres, and its radius.
const SPHERE_X_Y_RADIUS_M: [f64; 3] = [-0.35, 0.30, 0.40];
/// Grey level of the sphere; nothing is rendered of it, so that any value serves.
const SPHERE_GREY: f64 = 185.0;

/// The four methods, numbered as in (53).
pub(super) const METHODS: [&str; 4] =
    ["DCCE differential", "DV differential", "DCCE discrete", "DV discrete"];

/// Variance of VZ by the four methods at one point, in m².
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Variances {
    /// (39), (44), (47) and (50), with σ²_di = ½ σ²_d for all derivatives as section 5.6 takes it.
    pub printed: [f64; 4],
    /// (39c), (44), (47c) and (50).
    pub corrected: [f64; 4],
}

impl Variances {
    /// At one point; `bf` is b f.
    pub(super) fn of(at: &ExactPixel, noise: &PixelNoise, bf: f64) -> Self {
        let (flow, track) = (at.depth_flow(noise), at.depth_track(noise));
        let halved = at.depth_track_as_in_5_6(noise);
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

/// The quantity that changes along a series of coefficients.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Swept {
    /// The sphere's depth, at the sequence's own motion.
    Depth,
    /// The multiple of the motion, with the sphere at its nearest.
    Step,
}

/// Coefficients of (53), means over the sphere; in mm² per px².
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coefficients {
    /// The series to which it belongs.
    pub swept: Swept,
    /// Multiple of the motion.
    pub step: f64,
    /// Depth of the sphere's centre, in metres.
    pub depth_m: f64,
    /// Mean depth of the usable pixels on it, in metres.
    pub mean_depth_m: f64,
    /// Usable pixels on the sphere.
    pub pixels: usize,
    /// As printed: (Coef_disp, Coef_vel) of the four methods.
    pub printed: [(f64, f64); 4],
    /// The same of the corrected formulas.
    pub corrected: [(f64, f64); 4],
}

/// The paper's sphere, moved from 2.5 to 5 m under the sequence's motion.
pub(super) fn over_depth(sequence: &Sequence) -> Vec<Coefficients> {
    let at = |i: i32| of_sphere(sequence, Swept::Depth, NEAREST_M + DEPTH_STEP_M * f64::from(i), 1.0);
    (0..=DEPTH_STEPS).filter_map(at).collect()
}

/// The sphere at 2.5 m under 1 to 16 times the sequence's motion; beyond, it leaves the image.
pub(super) fn over_speed(sequence: &Sequence) -> Vec<Coefficients> {
    let steps = PAPER_STEPS.iter().filter(|&&step| step <= LARGEST_STEP);
    steps.filter_map(|&step| of_sphere(sequence, Swept::Step, NEAREST_M, step)).collect()
}

/// `None` where no pixel of the sphere is usable.
fn of_sphere(sequence: &Sequence, swept: Swept, depth_m: f64, step: f64) -> Option<Coefficients> {
    let [x_m, y_m, radius_m] = SPHERE_X_Y_RADIUS_M;
    let sphere = Shape::sphere([x_m, y_m, depth_m], radius_m);
    let part = Part { shape: sphere, grey: SPHERE_GREY, tile_m: 0.0 };
    let scene = Scene::new(vec![part], Vector3::new(-0.6, -2.0, 0.8), 0.3, 2003);
    let world = &SyntheticWorld::new(&scene, &sequence.rig, &sequence.phi_cyclopean(0)?, 0, step);
    let bf = world.rig.depth_disparity_product();
    let usable = world.usable_in(Approach::Differential);
    let points: Vec<ExactPixel> = usable.filter_map(|pixel| ExactPixel::at(world, pixel.index)).collect();
    let mut sums = [[(0.0, 0.0); 4]; 2];
    for point in &points {
        let unit = |disparity_px, flow_px| Variances::of(point, &PixelNoise { disparity_px, flow_px }, bf);
        let (by_disparity, by_flow) = (unit(1.0, 0.0), unit(0.0, 1.0));
        let pairs = [(by_disparity.printed, by_flow.printed), (by_disparity.corrected, by_flow.corrected)];
        for (sum, (disparity, flow)) in sums.iter_mut().zip(pairs) {
            for (sum, (d, v)) in sum.iter_mut().zip(disparity.into_iter().zip(flow)) {
                *sum = (sum.0 + d, sum.1 + v);
            }
        }
    }
    let n = points.len() as f64;
    let [printed, corrected] = sums.map(|of| of.map(|(d, v)| (1e6 * d / n, 1e6 * v / n)));
    let mean_depth_m = points.iter().map(|point| point.depth_m).sum::<f64>() / n;
    (!points.is_empty()).then_some(Coefficients {
        swept,
        step,
        depth_m,
        mean_depth_m,
        pixels: points.len(),
        printed,
        corrected,
    })
}

/// A coefficient's name, `Coef1_disp`, and how to read it from (Coef_disp, Coef_vel) of the methods.
type NamedCoefficient = (&'static str, usize, fn((f64, f64)) -> f64);

/// The coefficients of all four methods, printed or corrected.
type OfMethods = fn(&Coefficients) -> &[(f64, f64); 4];

/// Those of the paper's Figure 6(a), which grow strongly with depth.
const STRONG: [NamedCoefficient; 4] = [
    ("Coef1_disp", 0, |c| c.0),
    ("Coef2_vel", 1, |c| c.1),
    ("Coef3_disp", 2, |c| c.0),
    ("Coef4_disp", 3, |c| c.0),
];
/// Those of its Figure 6(b); Coef4_vel is zero.
const WEAK: [NamedCoefficient; 3] =
    [("Coef1_vel", 0, |c| c.1), ("Coef2_disp", 1, |c| c.0), ("Coef3_vel", 2, |c| c.1)];

fn of<'a>(found: &[&'a Coefficients], swept: Swept) -> Vec<&'a Coefficients> {
    found.iter().copied().filter(|c| c.swept == swept).collect()
}

/// Figure 6.
pub(super) fn figure(found: &[&Coefficients]) -> Figure {
    let found = &of(found, Swept::Depth);
    let panel = |title: &str, named: &[NamedCoefficient], all: OfMethods| Panel {
        title: title.to_owned(),
        content: Content::Plot {
            x: Axis::linear("depth of the sphere (m)"),
            y: Axis::linear("coefficient (mm²/px²)"),
            series: named
                .iter()
                .map(|&(name, method, read)| series(name, found, |c| read(all(c)[method])))
                .collect(),
        },
    };
    Figure {
        id: "figure-06".to_owned(),
        title: "Figure 6. Uncertainty coefficients of (53): effect of depth".to_owned(),
        caption:
            "Variance of VZ = Coef_disp σ²_d + Coef_vel σ²_v, mean over the sphere's usable pixels while \
                  its centre moves from 2.5 to 5 m under the motion of sequence C. 1 DCCE DIFF, 2 DV DIFF, \
                  3 DCCE DISC, 4 DV DISC; the formulas on exact measurements. For the discrete DCCE, Coef_vel weighs the \
                  variance of one component of the displacement, σ²_x + σ²_x′; for the discrete DV it is \
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
    Series::through(name, Line::Solid, found.iter().map(|c| (c.depth_m, value(c))))
}

/// Every coefficient at every depth.
pub(super) fn data(found: &[&Coefficients]) -> Table {
    let mut table = Table::new(
        "coefficients",
        "Coefficients of (53) against depth and speed",
        "Means over the sphere's usable pixels; mm² per px².",
        &[
            ("depth_m", "depth of the centre (m)"),
            ("mean_depth_m", "mean depth (m)"),
            ("step", "STEP"),
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
                let place = [c.depth_m, c.mean_depth_m, c.step].map(Cell::from);
                let head = [c.pixels.into(), kind.into(), method.into()];
                table.rows.push(place.into_iter().chain(head).chain(numbers).collect());
            }
        }
    }
    table
}

/// How fast each coefficient grows with depth, and with speed.
pub(super) fn table(found: &[&Coefficients]) -> Table {
    let mut table = Table::new(
        "coefficients-growth",
        "Growth of the coefficients of (53) with depth and with speed",
        "From the nearest to the farthest place of the sphere, and the power p of the depth of its surface in \
         coefficient ∝ Zᵖ (the paper says between 2 and 4); then from the motion of sequence C to sixteen times it, the \
         sphere at 2.5 m.",
        &[
            ("coefficient", "coefficient"),
            ("kind", "kind"),
            ("near", "near (mm²/px²)"),
            ("far", "far (mm²/px²)"),
            ("power", "power of depth"),
            ("slow", "STEP 1 (mm²/px²)"),
            ("fast", "STEP 16 (mm²/px²)"),
        ],
    );
    let kinds: [(&str, OfMethods); 2] = [("printed", |c| &c.printed), ("corrected", |c| &c.corrected)];
    let (depths, steps) = (of(found, Swept::Depth), of(found, Swept::Step));
    for (kind, all) in kinds {
        for (name, method, read) in STRONG.iter().chain(&WEAK) {
            let value = |c: Option<&&Coefficients>| c.map(|c| read(all(c)[*method]));
            let depth = |c: Option<&&Coefficients>| c.map(|c| c.mean_depth_m);
            let ends = [depths.first(), depths.last()];
            let [Some(near), Some(far)] = ends.map(value) else { continue };
            let [Some(near_m), Some(far_m)] = ends.map(depth) else { continue };
            let power = (far / near).ln() / (far_m / near_m).ln();
            let speeds = [steps.first(), steps.last()].map(|c| Cell::from(value(c)));
            let numbers = [near, far, power].map(Cell::from);
            table.rows.push([(*name).into(), kind.into()].into_iter().chain(numbers).chain(speeds).collect());
        }
    }
    table
}
