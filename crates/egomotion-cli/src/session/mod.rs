//! One sequence through the pipeline: the loop that `run` and `demo` share.

mod frame_result;
mod outcome;
mod run_log;
mod running;
mod stage_times;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use anyhow::Result;
use egomotion::geometry::{Grid, StereoRig};
use egomotion::pipeline::{Config, FrameMotion, Unanswered};
use egomotion_io::recording::{SourceFrame, with_frames};
use indicatif::ProgressBar;

use crate::terminal::tell;
pub use frame_result::FrameResult;
pub use outcome::Outcome;
pub use run_log::RunLog;
use running::RunningSession;

/// Time without a new frame after which what is done is written to the log. Nothing else is to be done then, and a
/// source that has stalled may never go on; a source that is merely slow is not written for every frame.
const STALL: Duration = Duration::from_secs(1);

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

impl Session<'_> {
    /// Push every frame that `fetch` has through the pipeline; `look` sees each answer with its maps.
    ///
    /// With a `log` it goes on after the frames that the log holds, and adds those that are done.
    pub fn run(
        &self,
        log: Option<RunLog>,
        stop: &AtomicBool,
        fetch: impl Fn(usize) -> Option<SourceFrame> + Sync,
        mut look: impl FnMut(&FrameResult) -> Result<()>,
    ) -> Result<Outcome> {
        let mut running = RunningSession::new(self)?;
        if let Some(log) = log {
            running.recall(log, &fetch)?;
        }
        let done = with_frames(stop, running.done(), fetch, |frames| -> Result<()> {
            while let Some(fetched) = next_frame(&frames, || running.keep())? {
                running.frame(fetched, &mut look)?;
            }
            Ok(())
        });
        self.progress.finish_and_clear();
        // Whatever failed, what is done need not be done again.
        let kept = running.keep();
        done.and(kept)?;
        Ok(running.outcome(!stop.load(Ordering::Relaxed)))
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

/// The next frame, or `None` after the last one; `stalled` is called each time that none comes for a while.
fn next_frame(
    frames: &Receiver<SourceFrame>,
    mut stalled: impl FnMut() -> Result<()>,
) -> Result<Option<SourceFrame>> {
    loop {
        match frames.recv_timeout(STALL) {
            Ok(fetched) => return Ok(Some(fetched)),
            Err(RecvTimeoutError::Timeout) => stalled()?,
            Err(RecvTimeoutError::Disconnected) => return Ok(None),
        }
    }
}
