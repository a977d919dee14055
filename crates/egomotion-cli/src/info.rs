//! `egomotion info`: what a source was recognised as.

use std::io::Write as _;

use anyhow::Result;
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
    let lost = if missing > 0 { format!(", {missing} without a right image") } else { String::new() };
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
    let poses = frames.iter().filter(|frame| frame.truth.is_some()).count();
    let maps = sequence.truth_maps.as_ref().map_or("", |_| ", maps of disparity and flow");
    if poses > 0 || !maps.is_empty() {
        writeln!(out, "  truth     poses of {poses} frames{maps}")?;
    }
    Ok(())
}
