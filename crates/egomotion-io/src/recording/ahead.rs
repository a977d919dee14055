//! Frames read ahead of the one that is being worked on.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use super::{Fetched, Recording};

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
        scope.spawn(move || send(first, fetch, &sender, || stop.load(Ordering::Relaxed)));
        work(receiver)
    })
}

/// The frames of a recording in order, read on a thread of its own that ends when the receiver is dropped.
pub fn read_ahead(recording: Arc<Recording>) -> Receiver<Fetched> {
    let (sender, receiver) = sync_channel(AHEAD);
    std::thread::spawn(move || send(0, &|k| recording.fetch(k), &sender, || false));
    receiver
}

fn send(
    first: usize,
    fetch: &impl Fn(usize) -> Option<Fetched>,
    sender: &SyncSender<Fetched>,
    stopped: impl Fn() -> bool,
) {
    for fetched in (first..).map_while(fetch) {
        // The receiver is gone when the work ended early.
        if stopped() || sender.send(fetched).is_err() {
            break;
        }
    }
}
