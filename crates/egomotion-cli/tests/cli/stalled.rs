//! A run that waits for a frame for ever, as long as nobody stops it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::cargo::cargo_bin;

use crate::process::Ended;

/// An image in whose place a pipe was put that nobody writes to.
pub struct Blocked {
    image: PathBuf,
    content: Vec<u8>,
}

impl Blocked {
    pub fn at(image: PathBuf) -> Self {
        let content = fs::read(&image).unwrap();
        fs::remove_file(&image).unwrap();
        assert!(Command::new("mkfifo").arg(&image).status().unwrap().success());
        Self { image, content }
    }

    /// Let go whoever waits; without a reader that never ends, and so not in the test's own thread.
    pub fn write(&self) {
        let (image, content) = (self.image.clone(), self.content.clone());
        std::thread::spawn(move || fs::write(image, content));
    }

    /// Put the image back.
    pub fn restore(self) {
        fs::remove_file(&self.image).unwrap();
        fs::write(&self.image, &self.content).unwrap();
    }
}

/// Begin `run SOURCE --out OUT`.
pub fn begin(source: &Path, out: &Path, options: &str) -> Child {
    let mut command = Command::new(cargo_bin!("egomotion"));
    command.arg("run").arg(source).arg("--out").arg(out).args(options.split_whitespace());
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Wait until the journal has its head and so many parts.
pub fn wait_for_parts(out: &Path, parts: usize) {
    wait_for(|| journal(out).is_some_and(|text| text.lines().count() > parts));
}

pub fn wait_for(happened: impl Fn() -> bool) {
    let started = Instant::now();
    while !happened() {
        assert!(started.elapsed() < Duration::from_secs(60), "nothing happens");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// The journal of a folder, if it is there.
pub fn journal(out: &Path) -> Option<String> {
    fs::read_to_string(out.join("run.parts.jsonl")).ok()
}

/// End it as the kernel does when memory is short.
pub fn kill(mut child: Child) {
    child.kill().unwrap();
    assert!(child.wait().unwrap().code().is_none());
}

/// Ctrl-C.
pub fn interrupt(child: &Child) {
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
}

pub fn ended(child: Child) -> Ended {
    Ended::of(child.wait_with_output().unwrap())
}
