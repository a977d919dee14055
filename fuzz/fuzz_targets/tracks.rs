//! Stereo tracks as CSV.
#![no_main]

use std::path::Path;

use egomotion_io::tracks;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|content: &[u8]| {
    let _ = tracks::parse_csv(&String::from_utf8_lossy(content), Path::new("tracks.csv"));
});
