//! Cut, mutated and random input: every reader answers or gives a one-line error that names the file.
#![allow(missing_docs)]

mod kinds;

use std::fs;
use std::path::Path;

use egomotion_io::calibration::KittiCalibration;
use egomotion_io::image;
use kinds::{Reader, kinds, target};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Run a reader; an error must be one line that starts with the file's name.
fn check(name: &str, content: &[u8], read: Reader) -> bool {
    match read(content, Path::new(name)) {
        Ok(()) => true,
        Err(error) => {
            let message = error.to_string();
            assert!(
                message.starts_with(name) && message.contains("; ") && !message.contains('\n'),
                "{message}"
            );
            false
        }
    }
}

#[test]
fn good_files_are_read() {
    for (name, content, read, _) in kinds() {
        assert!(check(name, &content, read), "{name}");
    }
}

#[test]
fn a_cut_file_is_an_error_at_every_sixteenth() {
    for (name, content, read, must_refuse) in kinds() {
        for sixteenth in 0..16 {
            let answered = check(name, &content[..content.len() * sixteenth / 16], read);
            assert!(!(answered && must_refuse), "{name} cut at {sixteenth}/16 was taken for whole");
        }
        // The last bytes too: a writer may be stopped anywhere.
        for cut in 1..24.min(content.len()) {
            let answered = check(name, &content[..content.len() - cut], read);
            assert!(!(answered && must_refuse), "{name} without its last {cut} bytes was taken for whole");
        }
    }
}

#[test]
fn mutated_files_do_not_panic() {
    let mut rng = Pcg64Mcg::seed_from_u64(2003);
    for (name, content, read, _) in kinds() {
        let mut answered = 0;
        for round in 0..1500 {
            let mut mutated = content.clone();
            // Half of the rounds hit the head, where sizes and keys stand.
            let reach = if round % 2 == 0 { mutated.len() } else { mutated.len().min(48) };
            for _ in 0..rng.random_range(1..4) {
                let at = rng.random_range(0..reach);
                mutated[at] = if name.ends_with("txt") {
                    b"0123456789.-+e \nPinfa:#"[rng.random_range(0..23)]
                } else {
                    rng.random()
                };
            }
            answered += usize::from(check(name, &mutated, read));
        }
        assert!(answered < 1500, "{name}: no mutation was noticed");
    }
}

#[test]
fn random_content_is_refused() {
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    for (name, _, read, _) in kinds() {
        for length in (0..400).step_by(3) {
            let noise: Vec<u8> = (0..length).map(|_| rng.random()).collect();
            assert!(!check(name, &noise, read), "{name}");
        }
    }
}

#[test]
fn damaged_sizes_in_intact_chunks_do_not_panic() {
    // Check sums hide the head of a PNG from plain mutations, so they are mended here.
    let mut rng = Pcg64Mcg::seed_from_u64(11);
    for (name, content, read, _) in kinds().into_iter().filter(|kind| kind.0.ends_with("png")) {
        for _ in 0..400 {
            let mut mutated = content.clone();
            let at = rng.random_range(16..29);
            mutated[at] = if rng.random() { rng.random_range(0..20) } else { rng.random() };
            let sum = crc32(&mutated[12..29]).to_be_bytes();
            mutated[29..33].copy_from_slice(&sum);
            check(name, &mutated, read);
        }
    }
}

/// The check sum of a PNG chunk, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
    let over = |crc, byte: &u8| (0..8).fold(crc ^ u32::from(*byte), |c, _| step(c));
    !bytes.iter().fold(!0, over)
}

#[test]
fn files_that_cannot_be_read_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("none.png");
    assert!(image::read(&missing).unwrap_err().to_string().contains("none.png: cannot read"));
    assert!(image::size(&missing).unwrap_err().to_string().contains("check the path"));
    assert!(image::read(folder.path()).is_err());
    let binary = folder.path().join("calib.txt");
    fs::write(&binary, [0xff, 0xfe, 0x00]).unwrap();
    assert!(
        KittiCalibration::read(&binary).unwrap_err().to_string().contains("calib.txt: is not a text file")
    );
}

/// What fuzzing found, in a folder for each target.
#[test]
fn found_cases_are_refused() {
    let found = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/malformed/found");
    let mut count = 0;
    for (name, _, read, _) in kinds() {
        let Ok(cases) = fs::read_dir(found.join(target(name))) else { continue };
        for case in cases {
            let case = case.unwrap().path();
            assert!(!check(name, &fs::read(&case).unwrap(), read), "{}", case.display());
            count += 1;
        }
    }
    assert!(count > 0, "the cases are in {}", found.display());
}

#[test]
fn nothing_is_allocated_on_the_word_of_a_head() {
    let found = include_bytes!("found/flow_png/more_pixels_than_bytes");
    let error = image::decode(found, Path::new("a.png")).unwrap_err().to_string();
    assert!(error.contains("a.png: has a size of 23x8388625 pixels, but only"), "{error}");
}

/// `cargo test -p egomotion-io --test malformed -- --ignored` gives every fuzz target its seeds.
#[test]
#[ignore = "writes into the folder `fuzz`"]
fn seeds_of_the_fuzz_targets() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus");
    for (name, content, _, _) in kinds() {
        let folder = corpus.join(target(name));
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join(name), content).unwrap();
    }
}
