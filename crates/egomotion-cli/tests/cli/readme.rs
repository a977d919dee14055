//! The README as a new user follows it: every command is run on a small recording.

use std::fs;
use std::path::Path;

use assert_cmd::cargo::cargo_bin_cmd;
use egomotion::sim::{SensorNoise, Sequence};
use egomotion_io::image;
use tempfile::TempDir;

use crate::documents::root;
use crate::process::{Ended, names, summary};

const README: &str = include_str!("../../../../README.md");

/// Commands that are not run here, and what runs them instead.
const ELSEWHERE: [(&str, &str); 4] = [
    ("cargo install --path crates/egomotion-cli", "cargo builds the same package for this test"),
    ("cargo test --workspace", "this test is one of them"),
    ("pip install ./python", "python/tests/package.rs builds the wheel and installs it"),
    ("cargo run --release -p egomotion --example NAME", "each example is a test of the package egomotion"),
];

/// Frames of the recording that the README calls `my-recording`.
const FRAMES: usize = 3;

#[test]
fn every_command_does_what_it_says() {
    let place = TempDir::new().unwrap();
    write_recording(&place.path().join("my-recording"));
    let mut excepted = Vec::new();
    for command in commands() {
        if let Some((known, _)) = ELSEWHERE.iter().find(|(known, _)| *known == command) {
            excepted.push(*known);
            continue;
        }
        let words =
            ["cargo run --release -- ", "egomotion "].iter().find_map(|start| command.strip_prefix(start));
        let Some(words) = words else {
            panic!("the README has a command that this test does not know: {command}")
        };
        let ended = call(place.path(), words);
        assert_eq!(ended.code, 0, "{command}: {}", ended.stderr);
        if words == "demo" {
            for line in blocks("text").iter().flat_map(|block| block.lines()) {
                assert!(ended.stdout.contains(line), "{line:?} is not in\n{}", ended.stdout);
            }
        }
    }
    for (known, _) in ELSEWHERE {
        assert!(excepted.contains(&known), "the README has this command no more: {known}");
    }
    let results = place.path().join("egomotion-out").join("my-recording");
    assert_eq!(summary(&results)["counts"]["ok"], FRAMES - 1);
    for name in ["motion.csv", "trajectory_tum.txt", "report.html"] {
        assert!(names(&results).contains(&name.to_owned()), "{name}");
    }
}

#[test]
fn it_is_short_and_its_crates_are_where_it_says() {
    assert!(README.lines().count() <= 130, "{} lines", README.lines().count());
    let [manifest] =
        &blocks("toml").into_iter().filter(|text| text.contains("[dependencies]")).collect::<Vec<_>>()[..]
    else {
        panic!("the README shows one Cargo.toml")
    };
    let manifest: toml::Table = toml::from_str(manifest).unwrap();
    for (name, dependency) in manifest["dependencies"].as_table().unwrap() {
        let path = dependency["path"].as_str().unwrap().strip_prefix("../egomotion/").unwrap();
        let text = fs::read_to_string(root().join(path).join("Cargo.toml")).unwrap();
        let package: toml::Table = toml::from_str(&text).unwrap();
        assert_eq!(package["package"]["name"].as_str(), Some(name.as_str()));
    }
}

/// Every command: the lines of its blocks for a shell, and what stands in a sentence or a table as code.
fn commands() -> Vec<String> {
    let in_blocks =
        blocks("sh").into_iter().flat_map(|block| block.lines().map(str::to_owned).collect::<Vec<_>>());
    let outside = README.split("```").step_by(2).collect::<String>();
    let spans: Vec<String> = outside.split('`').skip(1).step_by(2).map(str::to_owned).collect();
    let is_command = |span: &String| {
        ["cargo ", "pip ", "egomotion ", "python "].iter().any(|program| span.starts_with(program))
    };
    let commands: Vec<String> = in_blocks.chain(spans.into_iter().filter(is_command)).collect();
    commands.iter().filter_map(|line| line.split(" #").next()).map(|line| line.trim().to_owned()).collect()
}

/// The contents of the blocks in a language.
fn blocks(language: &str) -> Vec<String> {
    let inside = README.split("```").skip(1).step_by(2);
    inside.filter_map(|block| block.strip_prefix(language)?.strip_prefix('\n')).map(str::to_owned).collect()
}

fn call(place: &Path, words: &str) -> Ended {
    let mut command = cargo_bin_cmd!("egomotion");
    Ended::of(command.current_dir(place).args(words.split_whitespace()).output().unwrap())
}

/// The drive of the demonstration as the README asks for it, with the `rig.toml` that the README shows.
fn write_recording(folder: &Path) {
    let drive = Sequence::named("demo", None, Some(FRAMES), 1.0).unwrap();
    let noise = SensorNoise::default();
    for camera in ["left", "right"] {
        fs::create_dir_all(folder.join(camera)).unwrap();
    }
    for k in 0..FRAMES {
        let images = noise.expose(&drive.view(k).unwrap().render(2), k as u64);
        image::write_grey(&folder.join(format!("left/{k:06}.png")), &images.left).unwrap();
        image::write_grey(&folder.join(format!("right/{k:06}.png")), &images.right).unwrap();
    }
    let rig = blocks("toml").into_iter().find(|text| text.contains("baseline_m")).unwrap();
    fs::write(folder.join("rig.toml"), rig).unwrap();
}
