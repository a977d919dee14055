//! Archives of NumPy arrays, as stereo tracks.
#![no_main]

use std::path::Path;

use egomotion_io::tracks;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|content: &[u8]| {
    let _ = tracks::decode_npz(content, Path::new("tracks.npz"));
});
