//! `egomotion simulate`: a rendered sequence on disk, in KITTI layout, with its exact truth beside it.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use anyhow::Result;
use egomotion_io::simulation::{SequenceFolder, Simulation};

use crate::args::SimulateArgs;
use crate::exit::{Ending, choice_error};
use crate::process::set_threads;
use crate::terminal::{self, frames_bar, stop_signal};

/// Render frame by frame and write.
pub fn simulate(args: &SimulateArgs) -> Result<Ending> {
    set_threads(args.threads)?;
    let world = Simulation::new(&args.options()).map_err(choice_error)?;
    for warning in &world.warnings {
        terminal::tell(warning);
    }
    let name = &world.sequence.name;
    let out: PathBuf = args.out.clone().unwrap_or_else(|| Path::new("egomotion-out").join(name));
    let folder = SequenceFolder::create(&out, world.frames)?;
    let stop = stop_signal("frame");
    folder.write_scene(&world)?;
    let bar = frames_bar(world.frames, args.quiet);
    bar.set_message(name.clone());
    let mut done = 0;
    while done < world.frames && !stop.load(Ordering::Relaxed) {
        folder.write_frame(&world, done)?;
        done += 1;
        bar.inc(1);
    }
    bar.finish_and_clear();
    // What tells of all frames at once comes last, and of the frames that are there.
    folder.write_course(&world, done)?;
    let rig = &world.sequence.rig;
    writeln!(
        terminal::stdout(),
        "{}: {done} of {} frames of {name}, {}x{} px, f {:.3} px, baseline {:.4} m, {}",
        out.display(),
        world.frames,
        rig.width_px,
        rig.height_px,
        rig.focal_px,
        rig.baseline_m,
        world.noise_in_words()
    )?;
    Ok(Ending::of(done == world.frames))
}
