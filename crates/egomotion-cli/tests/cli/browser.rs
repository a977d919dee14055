//! `report.html` in a real browser: every place of the slider, without an error and without the network.
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use assert_cmd::cargo::cargo_bin_cmd;
use serde_json::Value;
use tempfile::TempDir;

/// A Chromium: `EGOMOTION_BROWSER`, or one of its usual names; `None`, and a line that says so, without one.
fn browser() -> Option<PathBuf> {
    let named = std::env::var_os("EGOMOTION_BROWSER").map(PathBuf::from);
    let usual = ["chromium", "chromium-browser", "google-chrome"].map(PathBuf::from);
    let works = |path: &PathBuf| {
        Command::new(path).arg("--version").output().is_ok_and(|output| output.status.success())
    };
    let found = named.into_iter().chain(usual).find(works);
    if found.is_none() {
        // Not `println!`, which the test harness hides when a test passes.
        let _ = writeln!(std::io::stdout(), "SKIPPED for want of a browser: no Chromium here");
    }
    found
}

fn egomotion(args: &[&str]) {
    let output = cargo_bin_cmd!("egomotion").args(args).output().unwrap();
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// A drive of a few small frames.
fn drive(folder: &Path) -> PathBuf {
    let source = folder.join("drive");
    let size = ["--size", "320x240", "--frames", "4", "--quiet"];
    egomotion(&[&["simulate", "--sequence", "demo", "--out", source.to_str().unwrap()], &size[..]].concat());
    source
}

/// Notes what goes wrong from the first moment on.
const WATCH: &str = "<script>window.wrong = [];
addEventListener('error', e => wrong.push(String(e.message || e.target)), true);
addEventListener('unhandledrejection', e => wrong.push(String(e.reason)));
addEventListener('securitypolicyviolation', e => wrong.push('policy: ' + e.blockedURI));
for (const name of ['error', 'warn']) console[name] = (...all) => wrong.push(all.join(' '));
</script>";

/// Uses the page as a reader does, and leaves what it saw as JSON in the title.
const USE: &str = "<script>(async () => {
const seen = { stops: [] };
try {
  // Decoding does not wait for virtual time; loading does.
  if (document.readyState !== 'complete') await new Promise(done => addEventListener('load', done));
  const visible = e => e.getClientRects().length > 0;
  const images = () => [...document.querySelectorAll('.stack img')].filter(visible);
  const marks = () => [...document.querySelectorAll('.cursor, .camera')].map(e => e.getAttribute('transform'));
  const look = () => ({
      sources: images().map(i => i.src.length + i.src.slice(-80)),
      widths: images().map(i => i.naturalWidth),
      says: [...document.querySelectorAll('.player output span')].filter(visible).map(e => e.textContent),
      marks: marks(),
  });
  const slider = document.getElementById('frame');
  for (let k = 0; slider && k <= +slider.max; k++) {
    slider.value = k;
    slider.dispatchEvent(new Event('input'));
    seen.stops.push(look());
  }
  const key = name => document.body.dispatchEvent(new KeyboardEvent('keydown', { key: name, bubbles: true, cancelable: true }));
  if (slider) { key('ArrowLeft'); seen.afterKey = +slider.value; }
  const sigma = document.getElementById('show-sigma');
  if (sigma) { sigma.click(); seen.sigma = look(); }
  const chart = document.querySelector('svg[data-series=body-0]');
  const box = chart.getBoundingClientRect();
  const at = x => ({ clientX: box.left + x * box.width, clientY: box.top + 20, bubbles: true });
  chart.dispatchEvent(new PointerEvent('pointermove', at(0.9)));
  seen.tip = document.querySelector('.tip').textContent;
  chart.dispatchEvent(new PointerEvent('click', at(0.2)));
  if (slider) seen.afterClick = +slider.value;
  const play = document.getElementById('play');
  if (play) {
    play.click();
    await new Promise(done => {
      const look = () => +slider.value === seen.afterClick ? setTimeout(look, 10) : done();
      look();
    });
    play.click();
    seen.afterPlay = +slider.value;
  }
  seen.sideways = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  seen.requests = performance.getEntriesByType('resource').map(e => e.name).filter(n => !n.startsWith('data:'));
} catch (e) { wrong.push(String(e)); }
seen.wrong = wrong;
document.title = JSON.stringify(seen);
})();</script>";

/// Load a page at a width, use it, and say what was seen.
fn seen(browser: &Path, page: &Path, width_px: u32) -> Value {
    let html = std::fs::read_to_string(page).unwrap();
    let head = html.find("<head>").unwrap() + "<head>".len();
    // The watch comes first, so that nothing escapes it; the page's policy does not forbid either.
    let html =
        format!("{}{WATCH}{}", &html[..head], &html[head..]).replace("</body>", &format!("{USE}</body>"));
    let used = page.with_file_name("used.html");
    std::fs::write(&used, html).unwrap();
    let profile = TempDir::new().unwrap();
    let output = Command::new(browser)
        // Without a sandbox, which root cannot have.
        .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-extensions"])
        .args(["--disable-background-networking", "--disable-dev-shm-usage", "--virtual-time-budget=20000"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("--window-size={width_px},900"))
        .arg("--dump-dom")
        .arg(format!("file://{}", used.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout);
    let title =
        dom.split("<title>").nth(1).and_then(|rest| rest.split("</title>").next()).unwrap_or_default();
    let title =
        title.replace("&lt;", "<").replace("&gt;", ">").replace("&nbsp;", "\u{a0}").replace("&amp;", "&");
    serde_json::from_str(&title)
        .unwrap_or_else(|e| panic!("{e}: {title}\n{}", String::from_utf8_lossy(&output.stderr)))
}

fn list<'a>(value: &'a Value, name: &str) -> &'a Vec<Value> {
    value[name].as_array().unwrap_or_else(|| panic!("{name}: {value}"))
}

fn assert_quiet(seen: &Value) {
    assert_eq!(seen["wrong"], serde_json::json!([]), "{seen}");
    assert_eq!(seen["requests"], serde_json::json!([]), "{seen}");
    assert_eq!(seen["sideways"], 0, "the page is wider than its window: {seen}");
}

#[test]
fn the_page_works_in_a_browser() {
    let Some(browser) = browser() else { return };
    let folder = TempDir::new().unwrap();
    let (source, out) = (drive(folder.path()), folder.path().join("dense"));
    egomotion(&["run", source.to_str().unwrap(), "--out", out.to_str().unwrap(), "--quiet"]);
    for width_px in [1280, 500] {
        let seen = seen(&browser, &out.join("report.html"), width_px);
        assert_quiet(&seen);
        // Three pairs of four frames, each with the left image and three maps.
        let stops = list(&seen, "stops");
        assert_eq!(stops.len(), 3);
        for stop in stops {
            assert_eq!((list(stop, "sources").len(), list(stop, "says").len()), (4, 1), "{stop}");
            assert!(list(stop, "widths").iter().all(|w| w.as_u64() > Some(0)), "{stop}");
        }
        for pair in stops.windows(2) {
            for name in ["sources", "marks", "says"] {
                let both = list(&pair[0], name).iter().zip(list(&pair[1], name));
                assert!(both.clone().count() > 0 && both.clone().all(|(a, b)| a != b), "{name}: {seen}");
            }
        }
        // Three charts of velocity rows and more follow, and so does the camera.
        assert!(list(&stops[0], "marks").len() > 12, "{seen}");
        let sigma = list(&seen["sigma"], "sources");
        assert!(
            sigma.len() == 4 && sigma[1..].iter().all(|s| !list(&stops[1], "sources").contains(s)),
            "{seen}"
        );
        assert_eq!((&seen["afterKey"], &seen["afterClick"]), (&1.into(), &0.into()));
        assert_eq!(seen["afterPlay"], 1);
        let tip = seen["tip"].as_str().unwrap();
        assert!(tip.starts_with("Forward, frame 3: ") && tip.contains("/s ("), "{tip}");
    }
}

#[test]
fn without_maps_the_page_works_too() {
    let Some(browser) = browser() else { return };
    let folder = TempDir::new().unwrap();
    let (source, out) = (drive(folder.path()), folder.path().join("sparse"));
    egomotion(&[
        "run",
        source.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
        "--quiet",
        "--observe",
        "sparse",
    ]);
    let seen = seen(&browser, &out.join("report.html"), 1280);
    assert_quiet(&seen);
    let stops = list(&seen, "stops");
    assert_eq!(stops.len(), 3);
    assert!(stops.iter().all(|stop| list(stop, "sources").len() == 1), "{seen}");
    assert_ne!(stops[0]["sources"], stops[1]["sources"]);
}
