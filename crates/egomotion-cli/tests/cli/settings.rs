//! What helps with first steps: settings with their meaning, completions, manual pages, typos.

use std::fs;

use egomotion::pipeline::Config;
use tempfile::TempDir;

use crate::process::egomotion;

#[test]
fn the_settings_are_the_defaults_each_with_its_meaning() {
    let ended = egomotion(["config"]);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    assert_eq!(toml::from_str::<Config>(&ended.stdout).unwrap(), Config::default());
    let lines: Vec<&str> = ended.stdout.lines().collect();
    let mut settings = 0;
    for pair in lines.windows(2) {
        assert!(pair[1].chars().count() <= 100, "{}", pair[1]);
        if pair[1].contains(" = ") && !pair[1].starts_with('#') || pair[1].starts_with('[') {
            assert!(pair[0].starts_with("# "), "nothing is said of {}", pair[1]);
            settings += 1;
        }
    }
    assert!(settings > 50, "{settings}");
    // No digits that a number of single precision does not have, and the choices of a word.
    assert!(ended.stdout.contains("max_sigma_px = 0.7\n"), "{}", ended.stdout);
    assert!(ended.stdout.contains("#   dcce: The paper's depth change constraint"), "{}", ended.stdout);
}

#[test]
fn every_shell_and_the_manual() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let ended = egomotion(["completions", shell]);
        assert_eq!(ended.code, 0, "{shell}: {}", ended.stderr);
        assert!(ended.stdout.contains("calibration") && ended.stdout.contains("simulate"), "{shell}");
    }
    let page = egomotion(["man"]).stdout;
    assert!(page.contains(".TH egomotion 1") && page.contains("depth velocity"), "{page}");
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("man");
    assert_eq!(egomotion(["man", "--out", out.to_str().unwrap()]).code, 0);
    let run = fs::read_to_string(out.join("egomotion-run.1")).unwrap();
    assert!(run.contains(".TH egomotion-run 1") && run.contains("calibration"), "{run}");
    for name in ["demo", "simulate", "evaluate", "info", "study", "config", "completions", "man"] {
        assert!(out.join(format!("egomotion-{name}.1")).is_file(), "{name}");
    }
}

#[test]
fn typos_are_answered_with_what_was_meant() {
    for (args, meant) in [
        (vec!["evalute", "x"], "'evaluate'"),
        (vec!["run", "x", "--calibraton", "y"], "'--calibration'"),
        (vec!["run", "x", "--method", "dcc"], "'dcce'"),
        (vec!["completions", "bsh"], "'bash'"),
    ] {
        let ended = egomotion(&args);
        assert_eq!(ended.code, 2, "{args:?}");
        assert!(ended.stderr.contains(meant), "{args:?}: {}", ended.stderr);
    }
}
