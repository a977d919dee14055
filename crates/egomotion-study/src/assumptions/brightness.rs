//! φ from the change of depth and from the change of brightness, at the same pixels with the same depth.

use serde::{Deserialize, Serialize};

use crate::components::{NAMES, SYMBOLS};
use crate::sequences::two_frames;
use crate::synthetic::{Contender, DifferentialDraw, EDGE_RAYS, MeasurementModel, SyntheticWorld};
use crate::{Axis, Cell, Content, Figure, Line, Panel, Series, Table};
use egomotion::constrain::{LinearConstraint, image_flow};
use egomotion::estimate::{Row, Weighting, least_squares};
use egomotion::geometry::{Image, StereoRig, Twist};
use egomotion::observe::StereoFlow;
use egomotion::pipeline::{Approach, EstimatorKind, Method};
use egomotion::sim::{SensorNoise, Sequence, StereoImages, View, reference_pose};

/// Multiples of sequence C's motion, whose images move by 1 to 6 px. Brightness is linear over smaller motions alone.
pub(super) const MOTION_FACTORS: [f64; 6] = [0.03125, 0.0625, 0.125, 0.25, 0.5, 1.0];
/// Growth of the light from frame to frame, in percent: steady light, and two rates.
const LIGHT_GROWTH_PERCENT: [f64; 3] = [0.0, 1.0, 5.0];
/// Draws of each setting; more of them make the root mean square more certain and take longer.
const DRAWS: u64 = 5;
/// Components of φ that are compared: all but ΩZ, which is zero in sequence C.
const COMPARED: usize = 5;

/// Root mean square error of φ's components, relative to the truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BrightnessError {
    /// Multiple of sequence C's motion.
    pub step: f64,
    /// The measurements that determine φ.
    pub source: String,
    /// Errors of (tX, tY, tZ, ΩX, ΩY), in percent of the truth; ΩZ is zero there.
    pub percent: [f64; COMPARED],
}

/// Errors at one STEP, by depth exact and measured, and by brightness under steady and growing light.
pub(super) fn errors(step: f64, seed: u64) -> Vec<BrightnessError> {
    let Some(sequence) = two_frames("C") else { return Vec::new() };
    let Some(phi) = sequence.phi_cyclopean(0) else { return Vec::new() };
    let world = SyntheticWorld::new(&sequence.scene, &sequence.rig, &phi, 0, step);
    let error = |source: &str, estimates: Vec<Twist>| BrightnessError {
        step,
        source: source.to_owned(),
        percent: rms_percent(&estimates, &world.phi),
    };
    let mut errors = vec![
        error("depth, exact", by_depth(&world, &MeasurementModel::clean(), seed)),
        error("depth, 1/16 px, noise 1/8 px", by_depth(&world, &MeasurementModel::real(), seed)),
    ];
    let clean = rendered(&sequence, &phi, step);
    for growth in LIGHT_GROWTH_PERCENT {
        let of_draw = |k: u64| {
            let frames = lit(&clean, growth, seed + k);
            // The same measured depth as above.
            let draw = DifferentialDraw::new(&world, &MeasurementModel::real(), seed + k);
            by_brightness(&frames, &draw.motions, &world.rig)
        };
        let name =
            if growth > 0.0 { format!("brightness, light + {growth} %") } else { "brightness".to_owned() };
        errors.push(error(&name, (0..DRAWS).filter_map(of_draw).collect()));
    }
    errors
}

/// φ by least squares of the differential DCCE, draw by draw.
fn by_depth(world: &SyntheticWorld, model: &MeasurementModel, seed: u64) -> Vec<Twist> {
    let dcce =
        Contender { approach: Approach::Differential, method: Method::Dcce, estimator: EstimatorKind::Ls };
    let of_draw = |k| {
        let draw = DifferentialDraw::new(world, model, seed + k);
        Some(dcce.differential(&draw, &world.rig, &Twist::zero(), &dcce.config(seed)).ok()?.phi())
    };
    (0..DRAWS).filter_map(of_draw).collect()
}

/// The images at t − 1, t and t + 1 without noise, under steady light.
fn rendered(sequence: &Sequence, phi: &Twist, step: f64) -> [StereoImages; 3] {
    let moved = phi.scaled(step);
    let pose = reference_pose(phi, 0);
    [moved.exp(), Twist::zero().exp(), moved.exp().inverse()]
        .map(|motion| View::new(&sequence.scene, &sequence.rig, pose.after(&motion)).render(EDGE_RAYS))
}

/// The left images under light that grows from frame to frame, with the sensor's noise.
fn lit(clean: &[StereoImages; 3], growth_percent: f64, seed: u64) -> [Image; 3] {
    [0, 1, 2].map(|i| {
        let noise = SensorNoise::default().with_seed(seed);
        let mut images = clean[i].clone();
        let gain = 1.0 + 0.01 * growth_percent * (i as f64 - 1.0);
        images.left.values_mut().iter_mut().for_each(|grey| *grey *= gain as f32);
        noise.expose(&images, i as u64).left
    })
}

/// Least squares of Ex v_x + Ey v_y = −Et with v of (3): image flow along the gradient of brightness.
fn by_brightness(frames: &[Image; 3], points: &[StereoFlow], rig: &StereoRig) -> Option<Twist> {
    let [before, now, after] = frames;
    let row = |flow: &StereoFlow| {
        let (u, v) = rig.pixel_from_image(flow.x_px, flow.y_px);
        let (u, v) = (u.round() as usize, v.round() as usize);
        let half = |a: f32, b: f32| 0.5 * f64::from(a - b);
        let ex = half(now.at(u + 1, v), now.at(u - 1, v));
        let ey = half(now.at(u, v + 1), now.at(u, v - 1));
        let et = half(after.at(u, v), before.at(u, v));
        let [along_x, along_y] = image_flow::constraints(flow, rig, &Twist::zero());
        let normal = along_x.normal * ex + along_y.normal * ey;
        Row::from_constraint(&LinearConstraint { normal, rate: -et, ..along_x }, 0)
    };
    let rows: Vec<Row<6>> = points.iter().map(row).collect();
    Some(Twist::from_vector(&least_squares(&rows, Weighting::Unit).ok()?.theta))
}

/// Root mean square errors of the estimates, in percent of the truth.
fn rms_percent(estimates: &[Twist], truth: &Twist) -> [f64; COMPARED] {
    let truth = truth.vector();
    std::array::from_fn(|i| {
        let squares: f64 = estimates.iter().map(|a| (a.vector()[i] / truth[i] - 1.0).powi(2)).sum();
        100.0 * (squares / estimates.len() as f64).sqrt()
    })
}

pub(super) fn table(errors: &[&BrightnessError]) -> Table {
    let headings = SYMBOLS.map(|symbol| format!("{symbol} (%)"));
    let components = NAMES.into_iter().zip(headings.iter().map(String::as_str)).take(COMPARED);
    let columns: Vec<_> = [("step", "STEP"), ("source", "from")].into_iter().chain(components).collect();
    let mut table = Table::new(
        "brightness",
        "φ from depth and from brightness",
        "Root mean square error in percent of the truth, least squares over all usable pixels.",
        &columns,
    );
    let row = |e: &&BrightnessError| {
        let words = [Cell::from(e.step), Cell::from(e.source.as_str())];
        words.into_iter().chain(e.percent.map(Cell::from)).collect()
    };
    table.rows = errors.iter().map(row).collect();
    table
}

pub(super) fn figure(errors: &[&BrightnessError]) -> Figure {
    let mut sources: Vec<&str> = Vec::new();
    for error in errors {
        if !sources.contains(&error.source.as_str()) {
            sources.push(&error.source);
        }
    }
    let panels = SYMBOLS.iter().take(COMPARED).enumerate().zip('a'..).map(|((i, name), letter)| {
        let series = sources.iter().map(|source| {
            let points = errors.iter().filter(|e| e.source == *source).map(|e| (e.step, e.percent[i]));
            let line = if source.starts_with("depth") { Line::Solid } else { Line::Dashed };
            Series::through(source, line, points)
        });
        Panel {
            title: format!("({letter}) {name}"),
            content: Content::Plot {
                x: Axis::log("STEP"),
                y: Axis::log(format!("{name}: error (%)")),
                series: series.collect(),
            },
        }
    });
    Figure {
        id: "figure-brightness".to_owned(),
        title: "Sections 1 and 3.1. φ from the change of depth and from the change of brightness".to_owned(),
        caption: "Sequence C, dense, least squares, differential approach, the same pixels. Brightness uses measured \
                  depth (1/16 px, noise 1/8 px) and rendered images with the sensor's noise, under light that is \
                  steady or grows by a share from frame to frame."
            .to_owned(),
        columns: 3,
        panels: panels.collect(),
    }
}
