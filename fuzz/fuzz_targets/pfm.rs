//! PFM maps.
#![no_main]

use std::path::Path;

use egomotion_io::pfm;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|content: &[u8]| {
    let _ = pfm::decode(content, Path::new("map.pfm"));
});
