//! The README's program in Rust, run on a recording; here because it needs both libraries.

use std::fs;

use egomotion::sim::{SensorNoise, Sequence};
use egomotion_io::image;

mod program {
    include!("program.rs");

    pub fn run() -> Result<(), Box<dyn std::error::Error>> {
        main()
    }
}

#[test]
fn the_program_of_the_readme_runs() {
    let readme = include_str!("../../../../README.md");
    assert!(readme.contains(include_str!("program.rs")), "program.rs is not the README's program any more");
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("my-recording");
    let drive = Sequence::named("demo", Some((320, 240)), Some(3), 1.0).unwrap();
    for camera in ["left", "right"] {
        fs::create_dir_all(folder.join(camera)).unwrap();
    }
    for k in 0..drive.frames() {
        let images = SensorNoise::default().expose(&drive.view(k).unwrap().render(2), k as u64);
        image::write_grey(&folder.join(format!("left/{k}.png")), &images.left).unwrap();
        image::write_grey(&folder.join(format!("right/{k}.png")), &images.right).unwrap();
    }
    let rig = &drive.rig;
    let text = format!(
        "focal_px = {:?}\ncx_px = {:?}\ncy_px = {:?}\nbaseline_m = {:?}\n",
        rig.focal_px, rig.cx_px, rig.cy_px, rig.baseline_m
    );
    fs::write(folder.join("rig.toml"), text).unwrap();
    // The only test of this program: nobody else minds where it is.
    std::env::set_current_dir(place.path()).unwrap();
    program::run().unwrap();
}
