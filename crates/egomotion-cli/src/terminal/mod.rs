//! The terminal: what is printed, how far the work is, and the keys that stop it.

mod ctrl_c;
mod progress;
mod streams;

pub use ctrl_c::stop_signal;
pub use progress::{frames_bar, parts_bar};
pub use streams::{command_line, print_json, stdout, tell};
