//! Depth images.
#![no_main]

use std::path::Path;

use egomotion_io::depth;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|content: &[u8]| {
    let _ = depth::decode_png(content, 1000.0, Path::new("depth.png"));
});
