//! Calibration files of every format.
#![no_main]

use std::path::Path;

use egomotion_io::calibration::{self, CameraPair};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|content: &[u8]| {
    let path = Path::new("calibration");
    if let Ok(calibration) = calibration::parse(&String::from_utf8_lossy(content), path) {
        let _ = calibration.pair(CameraPair::Grey, (64, 48), path);
    }
});
