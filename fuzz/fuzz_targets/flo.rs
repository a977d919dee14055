//! Middlebury flow.
#![no_main]

use std::path::Path;

use egomotion_io::flo;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|content: &[u8]| {
    let _ = flo::decode(content, Path::new("flow.flo"));
});
