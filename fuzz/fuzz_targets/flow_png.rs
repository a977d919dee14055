//! KITTI's flow maps.
#![no_main]

use std::path::Path;

use egomotion_io::flow_png;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|content: &[u8]| {
    let _ = flow_png::decode(content, Path::new("f.png"));
});
