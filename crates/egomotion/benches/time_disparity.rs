//! Disparity of pairs named on standard input, timed: what `bench/disparity.py` runs beside OpenCV.
//!
//! Each line is `LEFT RIGHT LEVELS MATCHER OUT`: two PNG files, the number of levels, `semi-global`,
//! `area-correlation` or either with `+measured` (nothing filled in), and the file for the raw
//! little-endian f32 of disparity and then of σ, row by row. The answer is the time in milliseconds.

use std::collections::HashMap;
use std::error::Error;
use std::io::{BufRead, Write};
use std::path::Path;
use std::time::Instant;

use egomotion::observe::disparity::{DisparityMatcher, DisparityOptions, Matcher};

fn main() -> Result<(), Box<dyn Error>> {
    if std::env::args().len() > 1 {
        println!("bench/disparity.py runs this program, without arguments");
        return Ok(());
    }
    let mut matchers = HashMap::new();
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let &[left, right, levels, kind, out] = words.as_slice() else {
            return Err(format!("not LEFT RIGHT LEVELS MATCHER OUT: {line}").into());
        };
        let (name, fill) = kind.strip_suffix("+measured").map_or((kind, true), |name| (name, false));
        let matcher = match name {
            "semi-global" => Matcher::SemiGlobal,
            "area-correlation" => Matcher::AreaCorrelation,
            _ => return Err(format!("no matcher {name}").into()),
        };
        let options = DisparityOptions { levels: levels.parse()?, matcher, fill, ..Default::default() };
        let matcher = matchers
            .entry((levels.to_owned(), kind.to_owned()))
            .or_insert_with(|| DisparityMatcher::new(options));
        let left = egomotion_io::image::read(Path::new(left))?;
        let right = egomotion_io::image::read(Path::new(right))?;
        let start = Instant::now();
        let map = matcher.compute(&left, &right)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let planes = [map.shift.grid(), map.sigma.grid()];
        let bytes: Vec<u8> = planes.iter().flat_map(|p| p.values()).flat_map(|x| x.to_le_bytes()).collect();
        std::fs::write(out, bytes)?;
        println!("{ms:.3}");
        std::io::stdout().flush()?;
    }
    Ok(())
}
