//! KITTI's disparity maps.
#![no_main]

use std::path::Path;

use egomotion_io::disparity_png;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|content: &[u8]| {
    let _ = disparity_png::decode(content, Path::new("d.png"));
});
