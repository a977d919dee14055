//! The wheel: built, installed in a fresh virtual environment, tested there by `tests/*.py`.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::thread;

/// What the tests need besides the wheel's own dependencies.
const NEEDED: [&str; 15] = [
    "maturin>=1.9,<2",
    "numpy",
    "pytest>=8",
    "hypothesis>=6",
    "mypy>=1.11",
    "pandas>=2",
    "pyarrow>=14",
    "evo>=1.30",
    "ray[default]>=2.40",
    "fsspec",
    "matplotlib>=3.6",
    "nbclient>=0.7",
    "nbformat>=5.2",
    "ipykernel>=6",
    "rerun-sdk>=0.24",
];

#[test]
fn the_wheel_passes_its_tests() {
    let Some(python) = python() else {
        println!("SKIPPED for want of Python 3.10 or newer with the module venv");
        return;
    };
    let folder = tempfile::Builder::new().prefix("egomotion-wheel").tempdir().unwrap();
    let environment = folder.path().join("environment");
    let made = Command::new(&python).args(["-m", "venv"]).arg(&environment).output().unwrap();
    if !made.status.success() {
        println!("SKIPPED for want of Python 3.10 or newer with the module venv");
        return;
    }
    let bin = environment.join(if cfg!(windows) { "Scripts" } else { "bin" });
    let own = bin.join("python");
    let installed = Command::new(&own)
        .args(["-m", "pip", "install", "-q", "--no-compile"])
        .args(NEEDED)
        .output()
        .unwrap();
    if !installed.status.success() {
        println!("SKIPPED for want of Python packages: {}", last_line(&installed));
        return;
    }
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let wheels = folder.path().join("wheels");
    let build = |command: &mut Command| {
        // The profile of tests is optimised, and its dependencies are built.
        command.args(["build", "--profile", "dev", "--locked", "--out"]).arg(&wheels).current_dir(here);
    };
    passes(&bin.join("maturin"), build);
    let wheel = std::fs::read_dir(&wheels).unwrap().next().unwrap().unwrap().path();
    let name = wheel.file_name().unwrap().to_str().unwrap();
    assert!(name.contains("cp310-abi3"), "{name}");
    passes(&own, |command| {
        command.args(["-m", "pip", "install", "-q"]).arg(&wheel);
    });
    // From a folder of its own, so that nothing but the wheel can be imported. Ray's tests mostly wait.
    let python = |arguments: &[&str]| {
        passes(&own, |command| {
            if let Some(built) = command_of_the_workspace() {
                command.env("EGOMOTION_COMMAND", built);
            }
            command.arg("-m").args(arguments).current_dir(folder.path());
        });
    };
    let place = |name: &str| here.join(name).to_str().unwrap().to_owned();
    let (tests, ray, settings) = (place("tests"), place("tests/test_ray.py"), place("pyproject.toml"));
    let pytest = ["pytest", "-q", "-p", "no:cacheprovider"];
    thread::scope(|scope| {
        scope.spawn(|| python(&[&pytest[..], &[&ray]].concat()));
        scope.spawn(|| python(&[&pytest[..], &["--ignore", &ray, &tests]].concat()));
    });
    python(&["mypy", "--config-file", &settings, &tests]);
    python(&["mypy.stubtest", "egomotion._native"]);
}

/// The command `egomotion`, which the tests of the whole workspace build; its answers are compared.
fn command_of_the_workspace() -> Option<PathBuf> {
    let beside = std::env::current_exe().ok()?.parent()?.parent()?.join("egomotion");
    Some(beside.with_extension(std::env::consts::EXE_EXTENSION)).filter(|path| path.is_file())
}

/// A Python that is new enough.
fn python() -> Option<PathBuf> {
    let new_enough = "import sys, venv; sys.exit(sys.version_info < (3, 10))";
    let works = |name: &&str| {
        Command::new(name).args(["-c", new_enough]).output().is_ok_and(|output| output.status.success())
    };
    ["python3", "python"].iter().find(|name| works(name)).map(PathBuf::from)
}

fn passes(program: &Path, prepare: impl FnOnce(&mut Command)) {
    let mut command = Command::new(program);
    prepare(&mut command);
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let words = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{command:?}\n{}\n{}", words(&output.stdout), words(&output.stderr));
}

fn last_line(output: &Output) -> String {
    let words = String::from_utf8_lossy(&output.stderr);
    words.lines().rfind(|line| !line.trim().is_empty()).unwrap_or_default().to_owned()
}
