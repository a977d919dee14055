//! `egomotion info`: what a source was recognised as.

use std::io::Write as _;

use anyhow::Result;
use egomotion::geometry::{Camera, Distortion, StereoRectification};
use egomotion::pipeline::DepthNoise;
use egomotion_io::source::{Sequence, Source};

use crate::args::InfoArgs;
use crate::exit::Ending;
use crate::terminal;

/// Print layout, frames, rig, time stamps and truth.
pub fn info(args: &InfoArgs) -> Result<Ending> {
    let source = Source::open_with(&args.source, args.calibration.as_deref())?;
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
    if let Some(pair) = &sequence.rectification {
        print_cameras(out, pair)?;
    }
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
            writeln!(out, "  lens      {}: warped when read", described(lens))?;
        }
    }
    let poses = frames.iter().filter(|frame| frame.truth.is_some()).count();
    let maps = sequence.truth_files.as_ref().map_or("", |_| ", maps of disparity and flow");
    if poses > 0 || !maps.is_empty() {
        writeln!(out, "  truth     poses of {poses} frames{maps}")?;
    }
    Ok(())
}

/// The raw cameras, the pose between them, and how they become the rig.
fn print_cameras(out: &mut impl std::io::Write, pair: &StereoRectification) -> Result<()> {
    for (side, camera) in [("left      ", pair.left()), ("right     ", pair.right())] {
        writeln!(out, "  {side}{}", described(camera))?;
    }
    let pose = pair.right_from_left();
    // Rounded first, so that no zero has a sign.
    let place = pose.inverse().translation.map(|c| (1e4 * c).round() / 1e4 + 0.0);
    let turn = pose.log().omega.norm().to_degrees();
    writeln!(
        out,
        "  pose      right camera at ({:.4}, {:.4}, {:.4}) m from the left one, turned by {turn:.2}°",
        place.x, place.y, place.z
    )?;
    let turned = |rotation: &nalgebra::Matrix3<f64>| {
        let rotation =
            egomotion::geometry::RigidMotion { rotation: *rotation, translation: nalgebra::Vector3::zeros() };
        rotation.log().omega.norm().to_degrees()
    };
    writeln!(
        out,
        "  rectified as read: left turned by {:.2}°, right by {:.2}°, to the widest view that both images fill \
         (f not below 0.8 of the lenses' own)",
        turned(pair.rectified_left_from_left()),
        turned(pair.rectified_right_from_right())
    )?;
    Ok(())
}

/// A raw camera in one line.
fn described(camera: &Camera) -> String {
    let ((w, h), (fx, fy), (cx, cy)) = (camera.size(), camera.focal_px(), camera.centre_px());
    let list = |k: &[f64]| k.iter().map(|k| format!("{k:.4}")).collect::<Vec<_>>().join(" ");
    let lens = match camera.distortion() {
        Distortion::None => "no distortion".to_owned(),
        Distortion::RadialTangential { k, p } => format!("radial-tangential k {}, p {}", list(k), list(p)),
        Distortion::Rational { k, p } => format!("rational k {}, p {}", list(k), list(p)),
        Distortion::Equidistant { k } => format!("equidistant k {}", list(k)),
    };
    format!("raw {w}x{h} px, f ({fx:.3}, {fy:.3}), centre ({cx:.2}, {cy:.2}), {lens}")
}

fn is_stereo(sequence: &Sequence) -> bool {
    sequence.depth_sensor.is_none() && sequence.tracks.is_none() && !sequence.side_by_side
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
