//! Ctrl-C: the first one asks to stop, the second one stops at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::streams::tell;

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
