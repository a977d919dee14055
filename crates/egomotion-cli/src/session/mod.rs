//! One sequence through the pipeline: the loop that `run` and `demo` share.

mod log;
mod tally;
mod work;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Result;
use egomotion::geometry::{Grid, RigidMotion, StereoRig, Twist};
use egomotion::pipeline::{Config, FrameMotion, Trajectory, Unanswered};
use egomotion_io::recording::{SourceFrame, with_frames};
use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};

use crate::terminal::tell;
use egomotion_report::run::Album;
pub use log::Log;
use work::Work;

/// What is to be run.
pub struct Session<'a> {
    pub rig: StereoRig,
    pub config: &'a Config,
    /// Number of frames, as far as it is known.
    pub frames: usize,
    /// Pixels of the left and of the right image never to use.
    pub masks: [Option<Grid<bool>>; 2],
    /// Frames are tracks, not images.
    pub tracks: bool,
    pub progress: ProgressBar,
}

/// One answered or unanswered frame; its maps are not kept.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Row {
    /// Index of the frame in the source.
    pub index: usize,
    /// That of the earlier frame it was matched with.
    pub reference_index: Option<usize>,
    pub motion: FrameMotion,
    /// True φ over the same interval.
    pub truth: Option<Twist>,
}

/// What a session leaves behind.
pub struct Outcome {
    pub rows: Vec<Row>,
    pub trajectory: Trajectory,
    /// True poses, relative to the first frame; only if every frame has one.
    pub truth: Option<Vec<RigidMotion>>,
    /// Pictures of some frames, for the report.
    pub album: Album,
    pub complete: bool,
    pub stages_ms: Vec<(&'static str, f64)>,
    pub frame_ms: f64,
    pub wall_s: f64,
    /// To be removed when the results of a complete session are written.
    pub log: Option<Log>,
}

/// Set when the user asks to stop, which is done after the running `unit` of work; a second time ends the program
/// at once.
pub fn stop_signal(unit: &'static str) -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stop);
    let handler = move || {
        if asked.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        tell(format_args!("stopping after this {unit}; a second Ctrl-C stops at once"));
    };
    // Only a second signal of a process finds a handler there already.
    let _ = ctrlc::set_handler(handler);
    stop
}

/// A progress bar on a terminal, nothing in a pipe.
pub fn progress(frames: usize, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(frames as u64);
    let template = "{msg} {wide_bar} {pos}/{len} frames, {per_sec}, {eta} left";
    bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

impl Session<'_> {
    /// Push every frame that `fetch` has through the pipeline; `look` sees each answer with its maps.
    ///
    /// With a `log` it goes on after the frames that the log holds, and adds those that are done.
    pub fn run(
        &self,
        log: Option<Log>,
        stop: &AtomicBool,
        fetch: impl Fn(usize) -> Option<SourceFrame> + Sync,
        mut look: impl FnMut(&Row) -> Result<()>,
    ) -> Result<Outcome> {
        let mut work = Work::new(self)?;
        if let Some(log) = log {
            work.recall(log, &fetch)?;
        }
        let done = with_frames(stop, work.done(), fetch, |frames| -> Result<()> {
            for fetched in frames {
                work.frame(fetched, &mut look)?;
            }
            Ok(())
        });
        self.progress.finish_and_clear();
        // Whatever failed, what is done need not be done again.
        let kept = work.keep();
        done.and(kept)?;
        Ok(work.outcome(!stop.load(Ordering::Relaxed)))
    }

    /// Say what the user should know of an answer at once.
    fn warn(&self, index: usize, motion: &FrameMotion) {
        let tell = |text: std::fmt::Arguments<'_>| self.progress.suspend(|| tell(text));
        match &motion.motion {
            Err(Unanswered::First) => {}
            Err(why) => tell(format_args!("frame {index}: {why}")),
            Ok(estimate) if !estimate.is_complete() => {
                tell(format_args!("frame {index}: not determined: {}", estimate.undetermined));
            }
            Ok(_) => {}
        }
    }
}
