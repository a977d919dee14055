//! `moving.csv`: one row for each thing that moves by itself between two frames.

use anyhow::Result;
use egomotion::pipeline::MovingGroup;

use crate::session::FrameResult;

/// The columns: where the group is, its φ (metres, radians) with σ, VZ in metres a frame, and time to impact.
const COLUMNS: [&str; 25] = [
    "frame",
    "group",
    "u",
    "v",
    "width",
    "height",
    "pixels",
    "depth_m", //
    "tx",
    "ty",
    "tz",
    "wx",
    "wy",
    "wz", //
    "sigma_tx",
    "sigma_ty",
    "sigma_tz",
    "sigma_wx",
    "sigma_wy",
    "sigma_wz", //
    "vz",
    "vz_sigma",
    "impact_s",
    "impact_lo_s",
    "impact_hi_s",
];

/// The table; what is not known is empty.
pub fn table(frames: &[FrameResult]) -> Result<String> {
    let mut table = csv::Writer::from_writer(Vec::new());
    table.write_record(COLUMNS)?;
    for frame in frames {
        for (number, group) in frame.motion.moving.iter().enumerate() {
            table.write_record(record(frame.index, number, group))?;
        }
    }
    let bytes = table.into_inner().map_err(|e| e.into_error())?;
    Ok(String::from_utf8(bytes)?)
}

fn record(frame: usize, number: usize, group: &MovingGroup) -> Vec<String> {
    let shown = |v: Option<f64>| v.map_or(String::new(), |v| format!("{v:?}"));
    let bounds = &group.bounds;
    let counts = [frame, number, bounds.u, bounds.v, bounds.width, bounds.height, group.pixels];
    let mut record: Vec<String> = counts.iter().map(usize::to_string).collect();
    record.push(shown(Some(group.depth_m)));
    let known = |i: usize| group.motion.as_ref().filter(|motion| motion.observed[i]);
    record.extend((0..6).map(|i| shown(known(i).map(|motion| motion.theta.mean[i]))));
    record.extend((0..6).map(|i| shown(known(i).map(|motion| motion.theta.sigma(i)))));
    let vz = &group.depth_velocity;
    record.extend([vz.value(), vz.sigma(0)].map(|v| shown(Some(v))));
    let interval = group.impact.and_then(|impact| Some((impact.seconds()?, impact.interval95_s()?)));
    record.extend([
        shown(interval.map(|i| i.0)),
        shown(interval.map(|i| i.1.0)),
        shown(interval.map(|i| i.1.1)),
    ]);
    record
}

/// One sentence for the report; `None` if nothing moved.
pub fn note(frames: &[FrameResult]) -> Option<String> {
    let moving = frames.iter().filter(|frame| !frame.motion.moving.is_empty()).count();
    let groups: usize = frames.iter().map(|frame| frame.motion.moving.len()).sum();
    (groups > 0).then(|| {
        format!("Things moved by themselves in {moving} of {} frames, {groups} in all: moving.csv lists them, each with its own motion.", frames.len())
    })
}
