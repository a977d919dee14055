//! TUM, KITTI and EuRoC trajectories.
#![no_main]

use std::path::Path;

use egomotion_io::trajectory;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|content: &[u8]| {
    let _ = trajectory::parse(&String::from_utf8_lossy(content), None, Path::new("poses.txt"));
});
