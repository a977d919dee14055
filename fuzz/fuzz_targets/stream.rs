//! PNG files end to end.
#![no_main]

use std::path::Path;

use egomotion_io::stream::{ImageStream, StreamFormat};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|content: &[u8]| {
    let mut images = ImageStream::new(content, StreamFormat::Png, Path::new("standard input"));
    while let Ok(Some(_)) = images.next_image() {}
});
