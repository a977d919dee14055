//! Values of options, read from words.

use egomotion::geometry::{RIG_ERRORS, RigErrors};
use egomotion::sim::Sequence;
use egomotion_io::simulation::check_size;

/// Largest errors of a rig that is rendered, in the order and the units of their names: with larger ones it is another rig.
const LARGEST_RIG_ERRORS: [f64; RIG_ERRORS] = [5.0, 5.0, 5.0, 0.2, 0.2, 100.0, 100.0, 0.2];

/// The sequences of the paper's sensitivity study.
pub const PAPER_SEQUENCES: [&str; 3] = ["A", "B", "C"];

/// A whole number of at least 1.
pub fn positive(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("must be at least 1".into()),
        Ok(n) => Ok(n),
        Err(e) => Err(format!("{e}")),
    }
}

/// A finite number that is not negative.
pub fn step(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(step) if step.is_finite() && step >= 0.0 => Ok(step),
        Ok(_) => Err("must be a finite number that is not negative".into()),
        Err(e) => Err(format!("{e}")),
    }
}

/// A positive number of frames a second.
pub fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if rate.is_finite() && rate > 0.0 => Ok(rate),
        Ok(_) => Err("must be a positive number".into()),
        Err(e) => Err(format!("{e}")),
    }
}

/// Errors of a rig: names and values, as `yaw_deg=0.02,pitch_deg=-0.01`.
pub fn rig_errors(text: &str) -> Result<RigErrors, String> {
    let mut vector = RigErrors::default().vector();
    for word in text.split(',') {
        let (name, value) = word.split_once('=').ok_or("give NAME=VALUE, as yaw_deg=0.02")?;
        let k = RigErrors::NAMES.iter().position(|known| *known == name.trim());
        let k = k.ok_or_else(|| format!("{name:?} is not one of {}", RigErrors::NAMES.join(", ")))?;
        let largest = LARGEST_RIG_ERRORS[k];
        let value = number(value.trim()).map_err(|why| format!("{name}: {why}"))?;
        if value.abs() > largest {
            return Err(format!("{name} must lie within -{largest} and {largest}"));
        }
        vector[k] = value * RigErrors::UNITS[k];
    }
    Ok(RigErrors::from_vector(&vector))
}

/// Width and height of images that are rendered, as 640x480.
pub fn size(text: &str) -> Result<(usize, usize), String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("give width x height, as 640x480")?;
    let side = |text: &str| text.parse::<usize>().map_err(|e| format!("{e}"));
    let size = (side(width)?, side(height)?);
    check_size(size).map(|()| size)
}

/// Width and height of any positive size, as 640x480.
pub fn frame_size(text: &str) -> Result<(usize, usize), String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("give width x height, as 640x480")?;
    Ok((positive(width)?, positive(height)?))
}

/// A finite number.
pub fn number(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err("must be a number".into()),
    }
}

/// A finite number above 0.
pub fn above_zero(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if v > 0.0 { Ok(v) } else { Err("must be above 0".into()) })
}

/// A finite number of at least 0.
pub fn not_negative(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if v >= 0.0 { Ok(v) } else { Err("must not be negative".into()) })
}

/// Name of a sequence of the paper's sensitivity study, in either case.
pub fn paper_sequence(text: &str) -> Result<String, String> {
    let known = PAPER_SEQUENCES.into_iter().find(|name| name.eq_ignore_ascii_case(text));
    known.map(str::to_owned).ok_or_else(|| "there are the sequences A, B and C".into())
}

/// Name of a sequence of the manipulator, in either case.
pub fn lab_sequence(text: &str) -> Result<String, String> {
    one_of(Sequence::lab_names(), text)
}

/// Name of any sequence that can be rendered, in either case.
pub fn rendered_sequence(text: &str) -> Result<String, String> {
    one_of(Sequence::names(), text)
}

/// Name of a sequence of the sensitivity study or of the manipulator, in either case.
pub fn study_sequence(text: &str) -> Result<String, String> {
    paper_sequence(text)
        .or_else(|_| lab_sequence(text))
        .map_err(|_| "there are A, B, C and lab-A to lab-M".into())
}

fn one_of(names: impl Iterator<Item = &'static str>, text: &str) -> Result<String, String> {
    let names: Vec<&str> = names.collect();
    let known = names.iter().find(|name| name.eq_ignore_ascii_case(text));
    known.map(|name| (*name).to_owned()).ok_or_else(|| format!("must be of {}", names.join(", ")))
}
