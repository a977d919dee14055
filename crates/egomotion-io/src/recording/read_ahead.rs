//! Frames read ahead of the one that is being worked on.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use super::Recording;
use super::source_frame::SourceFrame;

/// Frames that wait while an earlier one is worked on. Two hide the time of reading where a frame takes about as long to
/// read as to work on; each more holds the images of one more frame in memory.
const FRAMES_AHEAD: usize = 2;

/// Run `work` on frames from `first` on that `read` provides on a thread of its own, in order.
///
/// It ends where `read` has no more; `stop` ends the reading between two frames.
pub fn with_frames<T>(
    stop: &AtomicBool,
    first: usize,
    read: impl Fn(usize) -> Option<SourceFrame> + Sync,
    work: impl FnOnce(Receiver<SourceFrame>) -> T,
) -> T {
    std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel(FRAMES_AHEAD);
        let read = &read;
        scope.spawn(move || send(first, read, &sender, || stop.load(Ordering::Relaxed)));
        work(receiver)
    })
}

/// The frames of a recording in order, read on a thread of its own that ends when the receiver is dropped.
pub fn read_ahead(recording: Arc<Recording>) -> Receiver<SourceFrame> {
    let (sender, receiver) = sync_channel(FRAMES_AHEAD);
    std::thread::spawn(move || send(0, &|k| recording.read_frame(k), &sender, || false));
    receiver
}

fn send(
    first: usize,
    read: &impl Fn(usize) -> Option<SourceFrame>,
    sender: &SyncSender<SourceFrame>,
    stopped: impl Fn() -> bool,
) {
    for frame in (first..).map_while(read) {
        // The receiver is gone when the work ended early.
        if stopped() || sender.send(frame).is_err() {
            break;
        }
    }
}
