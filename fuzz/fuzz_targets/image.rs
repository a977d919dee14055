//! PNG, JPEG, TIFF, PGM and PPM images.
#![no_main]

use std::path::Path;

use egomotion_io::image;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|content: &[u8]| {
    let _ = image::decode(content, Path::new("image"));
});
