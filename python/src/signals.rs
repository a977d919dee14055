//! Ctrl-C while the library works.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;

/// Time between two looks at Ctrl-C: it may wait so long, and the interpreter is woken so often.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(50);

/// The answer of work on a thread of its own, or the exception of a signal that comes meanwhile.
///
/// The library cannot be stopped in the middle: after a signal the work runs out, and nobody waits for it.
pub fn interruptible<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    let (sender, receiver) = channel();
    let receiver = Mutex::new(receiver);
    // Nobody hears of it any more if the receiver has gone.
    let worker = thread::spawn(move || drop(sender.send(work())));
    let answer = || receiver.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(SIGNAL_INTERVAL);
    loop {
        match py.detach(answer) {
            Ok(answer) => return Ok(answer),
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    match worker.join() {
        Err(panic) => std::panic::resume_unwind(panic),
        Ok(()) => Err(crate::error::value("the work ended without an answer")),
    }
}
