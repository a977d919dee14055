//! φ from the change of depth and from the change of brightness, at the same pixels with the same depth.

use serde::{Deserialize, Serialize};

use crate::contender::Contender;
use crate::draw::{self, Measuring};
use crate::world::World;
use crate::{Axis, Cell, Content, Figure, Line, Panel, Point, Series, Table};
use egomotion::constrain::{LinearConstraint, image_flow};
use egomotion::estimate::{Row, Weighting, least_squares};
use egomotion::geometry::{Image, StereoRig, Twist};
use egomotion::observe::StereoFlow;
use egomotion::pipeline::{Approach, EstimatorKind, Method};
use egomotion::sim::{SensorNoise, Sequence, View, reference_pose};

/// Multiples of sequence C's motion; its images move by 1 to 6 px at 1.
pub(super) const STEPS: [f64; 6] = [0.03125, 0.0625, 0.125, 0.25, 0.5, 1.0];
/// Shares by which light grows from frame to frame, in percent.
const LIGHTS: [f64; 3] = [0.0, 1.0, 5.0];
/// Draws of each setting.
const DRAWS: u64 = 5;
/// Rays through a pixel at an edge, along each side.
const SAMPLES: usize = 3;

/// Root mean square error of φ's components, relative to the truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BrightnessError {
    /// Multiple of sequence C's motion.
    pub step: f64,
    /// What determines φ.
    pub source: String,
    /// Errors of (tX, tY, tZ, ΩX, ΩY), in percent of the truth; ΩZ is zero there.
    pub percent: [f64; 5],
}

/// Errors at one STEP, by depth exact and measured, and by brightness under steady and growing light.
pub(super) fn errors(step: f64, seed: u64) -> Vec<BrightnessError> {
    let Some(sequence) = Sequence::named("C", None, Some(2), 1.0) else { return Vec::new() };
    let Some(phi) = sequence.phi_cyclopean(0) else { return Vec::new() };
    let world = World::new(&sequence.scene, &sequence.rig, &phi, 0, step);
    let exact = Measuring::clean();
    let error = |source: &str, answers: Vec<Twist>| BrightnessError {
        step,
        source: source.to_owned(),
        percent: relative(&answers, &world.phi),
    };
    let depth = |measuring: &Measuring| -> Vec<Twist> {
        let of = |k| {
            let draw = draw::differential(&world, measuring, seed + k);
            let dcce = Contender {
                approach: Approach::Differential,
                method: Method::Dcce,
                estimator: EstimatorKind::Ls,
            };
            Some(dcce.differential(&draw, &world.rig, &Twist::zero(), &dcce.config(seed)).ok()?.phi())
        };
        (0..DRAWS).filter_map(of).collect()
    };
    let mut found = vec![
        error("depth, exact", depth(&exact)),
        error("depth, 1/16 px, noise 1/8 px", depth(&Measuring::real())),
    ];
    let moved = phi.scaled(step);
    let pose = reference_pose(&phi, 0);
    let clean = [moved.exp(), Twist::zero().exp(), moved.exp().inverse()]
        .map(|motion| View::new(&sequence.scene, &sequence.rig, pose.after(&motion)).render(SAMPLES));
    for light in LIGHTS {
        let of = |k: u64| {
            let frames = [0, 1, 2].map(|i| {
                let noise = SensorNoise::default().with_seed(seed + k);
                let mut lit = clean[i].clone();
                let gain = 1.0 + 0.01 * light * (i as f64 - 1.0);
                lit.left.values_mut().iter_mut().for_each(|grey| *grey *= gain as f32);
                noise.expose(&lit, i as u64).left
            });
            // Depth as above, measured.
            let draw = draw::differential(&world, &Measuring::real(), seed + k);
            by_brightness(&frames, &draw.motions, &world.rig)
        };
        let name =
            if light > 0.0 { format!("brightness, light + {light} %") } else { "brightness".to_owned() };
        found.push(error(&name, (0..DRAWS).filter_map(of).collect()));
    }
    found
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

fn relative(answers: &[Twist], truth: &Twist) -> [f64; 5] {
    let truth = truth.vector();
    std::array::from_fn(|i| {
        let squares: f64 = answers.iter().map(|a| (a.vector()[i] / truth[i] - 1.0).powi(2)).sum();
        100.0 * (squares / answers.len() as f64).sqrt()
    })
}

const COMPONENTS: [&str; 5] = ["tX", "tY", "tZ", "ΩX", "ΩY"];

pub(super) fn table(errors: &[&BrightnessError]) -> Table {
    let columns =
        [("step", "STEP"), ("source", "from"), ("tx", "tX (%)"), ("ty", "tY (%)"), ("tz", "tZ (%)")];
    let columns: Vec<_> = columns.into_iter().chain([("wx", "ΩX (%)"), ("wy", "ΩY (%)")]).collect();
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
    let panels = COMPONENTS.iter().enumerate().zip('a'..).map(|((i, name), letter)| {
        let series = sources.iter().map(|source| {
            let points = errors.iter().filter(|e| e.source == *source).map(|e| Point {
                x: e.step,
                y: e.percent[i],
                standard_error: None,
            });
            let line = if source.starts_with("depth") { Line::Solid } else { Line::Dashed };
            Series { name: (*source).to_owned(), line, points: points.collect() }
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
