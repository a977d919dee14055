//! `egomotion info`: what a source was recognised as.

use std::io::Write as _;

use anyhow::Result;
use egomotion::pipeline::DepthNoise;
use egomotion_io::source::{Sequence, Source};

use crate::Ending;
use crate::args::InfoArgs;
use crate::terminal;

/// Print layout, frames, rig, time stamps and truth.
pub fn info(args: &InfoArgs) -> Result<Ending> {
    let source = Source::open(&args.source)?;
    let mut out = terminal::stdout();
    writeln!(out, "{}", source.path.display())?;
    writeln!(out, "layout      {} ({})", source.layout, source.reason)?;
    if source.layout.is_scene_set() {
        writeln!(out, "scenes      {}, independent of each other", source.sequences.len())?;
    }
    for sequence in &source.sequences {
        print_sequence(&mut out, sequence)?;
    }
    Ok(Ending::Done)
}

fn print_sequence(out: &mut impl std::io::Write, sequence: &Sequence) -> Result<()> {
    let frames = &sequence.frames;
    writeln!(out, "sequence    {}", sequence.name)?;
    let missing = frames.iter().filter(|frame| frame.right.is_none()).count();
    // A depth camera and tracks have no right images to miss.
    let lost = if missing > 0 && (missing < frames.len() || is_stereo(sequence)) {
        format!(", {missing} without a right image")
    } else {
        String::new()
    };
    let (first, last) = (frames.first().map_or(0, |f| f.index), frames.last().map_or(0, |f| f.index));
    writeln!(out, "  frames    {} ({first} to {last}){lost}", frames.len())?;
    let span = frames.last().map_or(0.0, |f| f.time_s) - frames.first().map_or(0.0, |f| f.time_s);
    let rate = (frames.len().saturating_sub(1)) as f64 / span;
    let rate = if rate.is_finite() { format!(", {rate:.2} Hz over {span:.2} s") } else { String::new() };
    writeln!(out, "  time      {}{rate}", sequence.clock)?;
    match &sequence.rig {
        Some(rig) => writeln!(
            out,
            "  rig       {}x{} px, f {:.3} px, baseline {:.4} m, centre ({:.2}, {:.2}), doffs {:.3} px",
            rig.width_px, rig.height_px, rig.focal_px, rig.baseline_m, rig.cx_px, rig.cy_px, rig.doffs_px
        )?,
        None => writeln!(out, "  rig       not known; give one with --calibration FILE")?,
    }
    if let Some(sensor) = &sequence.depth_sensor {
        let lost = frames.iter().filter(|frame| frame.depth.is_none()).count();
        let lost = if lost > 0 { format!(", {lost} frames without depth") } else { String::new() };
        writeln!(
            out,
            "  depth     {}, {} levels a metre in 16-bit files{lost}",
            noise(&sensor.noise),
            sensor.levels_per_m
        )?;
        let use_of = match missing < frames.len() {
            true => "right images are used; depth with --sensor depth",
            false => "used, for there is no right image: the baseline is virtual",
        };
        writeln!(out, "  sensor    {use_of}")?;
        if let Some(lens) = &sensor.lens {
            writeln!(
                out,
                "  lens      radial {:?}, tangential {:?}: warped when read",
                lens.radial, lens.tangential
            )?;
        }
    }
    let poses = frames.iter().filter(|frame| frame.truth.is_some()).count();
    let maps = sequence.truth_maps.as_ref().map_or("", |_| ", maps of disparity and flow");
    if poses > 0 || !maps.is_empty() {
        writeln!(out, "  truth     poses of {poses} frames{maps}")?;
    }
    Ok(())
}

fn is_stereo(sequence: &Sequence) -> bool {
    sequence.depth_sensor.is_none() && sequence.tracks.is_none()
}

/// The kind of sensor, and σ of depth at 1 m and at 3 m.
fn noise(noise: &DepthNoise) -> String {
    let kind = match noise {
        DepthNoise::StructuredLight { .. } => "structured light",
        DepthNoise::TimeOfFlight { .. } => "time of flight",
        DepthNoise::Stereo { .. } => "stereo by the sensor",
        DepthNoise::Exact { .. } => "rendered, exact",
    };
    let mm = |z_m: f64| 1e3 * noise.sigma_m(z_m);
    format!("{kind}, σ {:.1} mm at 1 m, {:.1} mm at 3 m", mm(1.0), mm(3.0))
}
