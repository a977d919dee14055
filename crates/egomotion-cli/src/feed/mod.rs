//! Frames on their way in: read (or rendered) ahead of the one that is being worked on.

mod reader;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};

use egomotion::geometry::RigidMotion;
use egomotion::pipeline::{Frame, TrackPoint, Unanswered};

pub use reader::{Reader, halves, unseen};

/// One frame as it comes out of its files.
pub struct Fetched {
    /// Index of the frame in the source.
    pub index: usize,
    pub time_s: f64,
    /// What is given of this time, or why it cannot be used.
    pub frame: Result<Given, Unanswered>,
    /// True pose world_from_camera.
    pub truth: Option<RigidMotion>,
    pub decode_ms: f64,
    /// Size of its files together; 0 where there are none.
    pub bytes: u64,
}

/// What is given of one time.
pub enum Given {
    /// Images, and perhaps maps.
    Frame(Box<Frame>),
    /// Points of tracks that others made.
    Tracks(Vec<TrackPoint>),
}

/// Frames fetched while earlier ones are worked on.
const AHEAD: usize = 2;

/// Run `work` on frames from `first` on that `fetch` provides on a thread of its own, in order.
///
/// It ends where `fetch` has no more; `stop` ends the fetching between two frames.
pub fn with_frames<T>(
    stop: &AtomicBool,
    first: usize,
    fetch: impl Fn(usize) -> Option<Fetched> + Sync,
    work: impl FnOnce(Receiver<Fetched>) -> T,
) -> T {
    std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel(AHEAD);
        let fetch = &fetch;
        scope.spawn(move || {
            for fetched in (first..).map_while(fetch) {
                // The receiver is gone when the work ended early.
                if stop.load(Ordering::Relaxed) || sender.send(fetched).is_err() {
                    break;
                }
            }
        });
        work(receiver)
    })
}
