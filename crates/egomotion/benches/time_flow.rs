//! Times dense flow on one pair and writes it: used by `bench/flow.py` beside OpenCV's.
//!
//! `time_flow REPEATS OUT FROM TO` searches freely; `time_flow REPEATS OUT LEFT RIGHT LEFT_LATER
//! RIGHT_LATER F CX CY B` runs the pipeline, whose disparity and tracks predict the rigid flow.
//! Prints the milliseconds of each repeat; OUT gets six planes of f32: u, v, their covariance
//! (uu, uv, vv), NaN where missing, and 1 where measured.

use std::path::Path;
use std::time::Instant;

use egomotion::geometry::{Image, StereoRig};
use egomotion::observe::{FlowField, FlowOptions, Pyramid, dense_flow};
use egomotion::pipeline::{Config, StereoFrame, StereoMotion};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let read = |path: &String| egomotion_io::image::read(Path::new(path)).unwrap();
    let (flow, times) = match &arguments[..] {
        [repeats, _, from, to] => free([read(from), read(to)], repeats.parse().unwrap()),
        [repeats, _, a, b, c, d, numbers @ ..] if numbers.len() == 4 => {
            let numbers: Vec<f64> = numbers.iter().map(|n| n.parse().unwrap()).collect();
            let [f, cx, cy, b_m] = numbers[..] else { unreachable!() };
            let images = [read(a), read(b), read(c), read(d)];
            let rig = StereoRig::new(f, (cx, cy), b_m, images[0].size()).unwrap();
            predicted(&images, &rig, repeats.parse().unwrap())
        }
        _ => {
            println!("usage: time_flow REPEATS OUT FROM TO | LEFT RIGHT LEFT_LATER RIGHT_LATER F CX CY B");
            return;
        }
    };
    println!("{}", times.iter().map(|t| format!("{t:.2}")).collect::<Vec<_>>().join(" "));
    write(Path::new(&arguments[1]), &flow);
}

fn free(images: [Image; 2], repeats: usize) -> (FlowField, Vec<f64>) {
    let [from, to] = images.map(|image| {
        let mut pyramid = Pyramid::new(image.clone(), 1);
        pyramid.renew(&image, 6);
        pyramid
    });
    let (mut flow, mut times) = (FlowField::missing(1, 1), Vec::new());
    for _ in 0..repeats {
        let start = Instant::now();
        flow = dense_flow(&from, &to, None, &FlowOptions::default()).unwrap();
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    (flow, times)
}

fn predicted(images: &[Image; 4], rig: &StereoRig, repeats: usize) -> (FlowField, Vec<f64>) {
    let (mut flow, mut times) = (FlowField::missing(1, 1), Vec::new());
    let [a, b, c, d] = images;
    for _ in 0..repeats {
        let mut pipeline = StereoMotion::new(*rig, Config::default()).unwrap();
        pipeline.push(StereoFrame { time_s: 0.0, left: a.clone(), right: b.clone() });
        let answer = pipeline.push(StereoFrame { time_s: 0.1, left: c.clone(), right: d.clone() });
        times.push(answer.stages.flow_ms);
        flow = answer.dense.unwrap().flow;
    }
    (flow, times)
}

fn write(path: &Path, flow: &FlowField) {
    let (width, height) = flow.size();
    let planes = [flow.u.grid(), flow.v.grid(), &flow.cov_uu, &flow.cov_uv, &flow.cov_vv];
    let mut bytes: Vec<u8> =
        planes.iter().flat_map(|plane| plane.values()).flat_map(|value| value.to_le_bytes()).collect();
    for v in 0..height {
        for u in 0..width {
            let measured = if flow.get(u, v).is_some() { 1.0_f32 } else { 0.0 };
            bytes.extend(measured.to_le_bytes());
        }
    }
    std::fs::write(path, bytes).unwrap();
}
