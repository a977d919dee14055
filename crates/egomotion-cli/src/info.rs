//! `egomotion info`: what a source was recognised as.

use std::io::Write as _;

use anyhow::Result;
use egomotion::geometry::{Camera, Distortion, StereoRectification};
use egomotion_io::source::{Sequence, Source};

use crate::Ending;
use crate::args::InfoArgs;
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
    let lost = if missing > 0 { format!(", {missing} without a right image") } else { String::new() };
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
    let poses = frames.iter().filter(|frame| frame.truth.is_some()).count();
    let maps = sequence.truth_maps.as_ref().map_or("", |_| ", maps of disparity and flow");
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
