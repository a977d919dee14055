//! NumPy arrays.
#![no_main]

use std::path::Path;

use egomotion_io::npy;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|content: &[u8]| {
    let _ = npy::decode(content, Path::new("a.npy"));
});
