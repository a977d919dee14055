//! The command in the background: begun, waited for, interrupted or killed. Nothing here waits for a time: a test waits
//! for an event, and [`HANG_LIMIT`] only ends one that would wait for ever.

use std::ffi::OsStr;
use std::fs;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use assert_cmd::cargo::cargo_bin;

use crate::process::Ended;

/// Longest time until an event, which only a hang can reach, however busy the machine.
const HANG_LIMIT: Duration = Duration::from_secs(1200);
/// Time between two looks whether the event has come.
const LOOK_INTERVAL: Duration = Duration::from_millis(10);

/// An image in whose place a pipe was put that nobody writes to: a run waits for it as long as nobody stops it.
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

/// A command that goes on beside the test.
pub struct Background {
    child: Child,
    stdout: JoinHandle<Vec<u8>>,
    stderr: Arc<Mutex<String>>,
    stderr_reader: JoinHandle<()>,
}

impl Background {
    /// Begin `run SOURCE --out OUT`.
    pub fn run(source: &Path, out: &Path, options: &str) -> Self {
        let words = ["run".as_ref(), source.as_os_str(), "--out".as_ref(), out.as_os_str()];
        Self::begin(words.into_iter().chain(options.split_whitespace().map(OsStr::new)))
    }

    /// Begin the command with these words.
    pub fn begin<S: AsRef<OsStr>>(words: impl IntoIterator<Item = S>) -> Self {
        let mut command = Command::new(cargo_bin!("egomotion"));
        let mut child = command.args(words).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut stdout = child.stdout.take().unwrap();
        let lines = BufReader::new(child.stderr.take().unwrap()).lines();
        let stderr = Arc::new(Mutex::new(String::new()));
        let told = Arc::clone(&stderr);
        Self {
            child,
            stdout: std::thread::spawn(move || {
                let mut bytes = Vec::new();
                stdout.read_to_end(&mut bytes).unwrap();
                bytes
            }),
            stderr,
            stderr_reader: std::thread::spawn(move || {
                for line in lines {
                    let line = line.unwrap();
                    told.lock().unwrap().extend([line.as_str(), "\n"]);
                }
            }),
        }
    }

    /// Wait until something has happened.
    pub fn wait_for(&mut self, happened: impl Fn() -> bool) {
        let started = Instant::now();
        while !happened() {
            // It may have happened right before the end.
            if let Some(status) = self.child.try_wait().unwrap() {
                assert!(happened(), "ended with {status} before: {}", self.stderr.lock().unwrap());
                return;
            }
            assert!(started.elapsed() < HANG_LIMIT, "it hangs: {}", self.stderr.lock().unwrap());
            std::thread::sleep(LOOK_INTERVAL);
        }
    }

    /// Wait until a file is there, which then is whole.
    pub fn wait_for_file(&mut self, path: &Path) {
        self.wait_for(|| path.exists());
    }

    /// Wait until this was told on standard error.
    pub fn wait_for_message(&mut self, text: &str) {
        let stderr = Arc::clone(&self.stderr);
        self.wait_for(|| stderr.lock().unwrap().contains(text));
    }

    /// Wait until the journal has its head and so many parts.
    pub fn wait_for_parts(&mut self, journal: &Path, parts: usize) {
        self.wait_for(|| whole_lines(journal).len() > parts);
    }

    /// Wait until so many frames are in the journal of a run: it writes them at the latest when no frame comes.
    pub fn wait_for_frames(&mut self, out: &Path, frames: usize) {
        let journal = journal(out);
        self.wait_for(|| frames_in(&whole_lines(&journal)) >= frames);
    }

    /// Ctrl-C.
    pub fn interrupt(&self) {
        let words = ["-INT".to_owned(), self.child.id().to_string()];
        assert!(Command::new("kill").args(words).status().unwrap().success());
    }

    /// End it as the kernel does when memory is short.
    pub fn kill(mut self) {
        self.child.kill().unwrap();
        assert!(self.child.wait().unwrap().code().is_none());
    }

    /// Wait for its end.
    pub fn ended(mut self) -> Ended {
        let status = self.child.wait().unwrap();
        self.stderr_reader.join().unwrap();
        let stderr = self.stderr.lock().unwrap().clone().into_bytes();
        Ended::of(Output { status, stdout: self.stdout.join().unwrap(), stderr })
    }
}

/// The journal of a run.
pub fn journal(out: &Path) -> PathBuf {
    out.join("run.parts.jsonl")
}

/// The lines of a journal that were written to their end: its head, then its parts.
pub fn whole_lines(journal: &Path) -> Vec<String> {
    let text = fs::read_to_string(journal).unwrap_or_default();
    let lines = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
    lines.map(str::to_owned).collect()
}

/// Number of frames in the journal of a run.
pub fn frames_in(lines: &[String]) -> usize {
    lines.iter().map(|line| line.matches("reference_index:").count()).sum()
}
