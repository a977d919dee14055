//! Our own motion.csv.
#![no_main]

use std::path::Path;

use egomotion_io::motion_table;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|content: &[u8]| {
    let _ = motion_table::parse(&String::from_utf8_lossy(content), Path::new("motion.csv"));
});
