//! `motion.csv`: φ, its covariance and the time to impact, one row for each frame from the second on.

use std::path::Path;

use egomotion::geometry::Gaussian;
use nalgebra::{Matrix6, Vector6};

use crate::{IoError, read, write};

/// One row: what a frame says about the motion since an earlier one.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionRow {
    /// Index of the later frame in the source.
    pub frame: usize,
    /// Its time, in seconds.
    pub time_s: f64,
    /// The interval that φ is over, in seconds.
    pub dt_s: Option<f64>,
    /// φ, or nothing where there is no answer.
    pub motion: Option<EstimatedMotion>,
    /// Time to impact of the nearest obstacle with its 95 % interval (value, low, high), in seconds.
    pub impact_s: Option<[f64; 3]>,
    /// `ok`, `partial`, or why there is no answer.
    pub status: String,
}

/// φ of one row.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimatedMotion {
    /// φ = (tX, tY, tZ, ΩX, ΩY, ΩZ), scene motion of the left camera or of that which the run's summary names, in metres and radians; a component that is not
    /// observed is 0 with an infinite variance.
    pub phi: Gaussian<6>,
    /// What of the covariance is new in this pair of frames, and not shared with others; `None` in tables that do not say.
    pub own: Option<Matrix6<f64>>,
    /// Which components are determined.
    pub observed: [bool; 6],
    /// Number of rows that went into the estimate.
    pub rows: usize,
    /// How many of them are inliers.
    pub inliers: usize,
}

impl EstimatedMotion {
    /// Whether every component is determined.
    pub(crate) fn is_complete(&self) -> bool {
        self.observed == [true; 6]
    }

    /// The column `observed`: of each component 1 or 0.
    pub(crate) fn observed_word(&self) -> String {
        self.observed.map(|observed| if observed { '1' } else { '0' }).iter().collect()
    }
}

/// Columns before those of the covariance: frame, time stamp (s), interval (s), and φ in metres and radians.
const COLUMNS_BEFORE_COVARIANCE: [&str; 9] = ["frame", "time_s", "dt_s", "tx", "ty", "tz", "wx", "wy", "wz"];
/// Columns after those of the covariance; times to impact are in seconds.
const COLUMNS_AFTER_COVARIANCE: [&str; 7] =
    ["rows", "inliers", "observed", "impact_s", "impact_lo_s", "impact_hi_s", "status"];
/// Number of the columns up to the status; a covariance has 21, its upper triangle. Those of `own` may follow.
const COLUMN_COUNT: usize = COLUMNS_BEFORE_COVARIANCE.len() + 21 + COLUMNS_AFTER_COVARIANCE.len();
/// What to do about a table that cannot be read.
const ADVICE_ON_FORMAT: &str = "give a motion.csv as `egomotion run` writes it";

/// The upper triangle of the covariance, row by row.
pub(crate) fn upper_triangle() -> impl Iterator<Item = (usize, usize)> {
    (0..6).flat_map(|i| (i..6).map(move |j| (i, j)))
}

/// The names of a covariance's columns.
pub(crate) fn covariance_columns(name: &str) -> impl Iterator<Item = String> {
    upper_triangle().map(move |(i, j)| format!("{name}_{i}{j}"))
}

fn head() -> Vec<String> {
    COLUMNS_BEFORE_COVARIANCE
        .map(String::from)
        .into_iter()
        .chain(covariance_columns("cov"))
        .chain(COLUMNS_AFTER_COVARIANCE.map(String::from))
        .chain(covariance_columns("own"))
        .collect()
}

/// The table as text; numbers are written so that they read back the same.
pub fn text(rows: &[MotionRow]) -> String {
    let mut text = head().join(",") + "\n";
    for row in rows {
        text += &(record(row).join(",") + "\n");
    }
    text
}

/// Write the table.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, rows: &[MotionRow]) -> Result<(), IoError> {
    write::bytes(path, text(rows).as_bytes())
}

fn record(row: &MotionRow) -> Vec<String> {
    let number = |v: f64| format!("{v:?}");
    let mut record = vec![row.frame.to_string(), number(row.time_s)];
    record.push(row.dt_s.map_or(String::new(), number));
    match &row.motion {
        Some(motion) => {
            let shown =
                |i: usize| if motion.observed[i] { number(motion.phi.mean[i]) } else { String::new() };
            record.extend((0..6).map(shown));
            record.extend(upper_triangle().map(|(i, j)| number(motion.phi.cov[(i, j)])));
            record.extend([motion.rows.to_string(), motion.inliers.to_string()]);
            record.push(motion.observed_word());
        }
        None => record.extend(std::iter::repeat_n(String::new(), 6 + 21 + 3)),
    }
    match row.impact_s {
        Some(seconds) => record.extend(seconds.map(number)),
        None => record.extend(std::iter::repeat_n(String::new(), 3)),
    }
    record.push(row.status.clone());
    match row.motion.as_ref().and_then(|motion| motion.own) {
        Some(own) => record.extend(upper_triangle().map(|(i, j)| number(own[(i, j)]))),
        None => record.extend(std::iter::repeat_n(String::new(), 21)),
    }
    record
}

/// The rows of a file; see [`parse`].
///
/// # Errors
/// The file cannot be read, or [`parse`] refuses it.
pub fn read(path: &Path) -> Result<Vec<MotionRow>, IoError> {
    parse(&read::text(path)?, path)
}

/// The rows of a text; `path` names it in errors.
///
/// # Errors
/// Names the line: other columns, a wrong count of fields, or a field that is not what its column says.
pub fn parse(text: &str, path: &Path) -> Result<Vec<MotionRow>, IoError> {
    let mut lines = text.lines().enumerate().map(|(n, line)| (n + 1, line.trim_end_matches('\r')));
    let refuse = |line: usize, reason: String| IoError::new(path, reason, ADVICE_ON_FORMAT).at_line(line);
    match lines.next() {
        Some((_, first))
            if [head().join(","), head()[..COLUMN_COUNT].join(",")].contains(&first.to_owned()) => {}
        _ => return Err(refuse(1, "has not the columns of a motion table".into())),
    }
    let rows = lines.filter(|(_, line)| !line.trim().is_empty());
    rows.map(|(n, line)| row(line).map_err(|reason| refuse(n, reason))).collect()
}

fn row(line: &str) -> Result<MotionRow, String> {
    let fields = Fields(line.split(',').collect());
    if ![COLUMN_COUNT, COLUMN_COUNT + 21].contains(&fields.0.len()) {
        return Err(format!("the row has {} fields, not {}", fields.0.len(), COLUMN_COUNT + 21));
    }
    let last = COLUMN_COUNT - COLUMNS_AFTER_COVARIANCE.len();
    let impact = [3, 4, 5].map(|k| fields.number(last + k));
    Ok(MotionRow {
        frame: fields.count(0)?,
        time_s: fields.number(1)?.ok_or("the time is missing")?,
        dt_s: fields.number(2)?,
        motion: if fields.0[last + 2].is_empty() { None } else { Some(fields.motion()?) },
        impact_s: match impact {
            [Ok(Some(seconds)), Ok(Some(low)), Ok(Some(high))] => Some([seconds, low, high]),
            [seconds, low, high] => seconds.and(low).and(high).map(|_| None)?,
        },
        status: fields.0[COLUMN_COUNT - 1].to_owned(),
    })
}

/// The fields of one row.
struct Fields<'a>(Vec<&'a str>);

impl Fields<'_> {
    /// A number, infinite ones included; nothing where the field is empty.
    fn number(&self, i: usize) -> Result<Option<f64>, String> {
        let field = self.0[i];
        if field.is_empty() {
            return Ok(None);
        }
        let number = field.parse::<f64>().ok().filter(|v| !v.is_nan());
        number.map(Some).ok_or_else(|| format!("\"{field}\" is not a number"))
    }

    fn count(&self, i: usize) -> Result<usize, String> {
        self.0[i].parse().map_err(|_| format!("\"{}\" is not a whole number", self.0[i]))
    }

    fn motion(&self) -> Result<EstimatedMotion, String> {
        let last = COLUMN_COUNT - COLUMNS_AFTER_COVARIANCE.len();
        let word = self.0[last + 2];
        let observed: Vec<bool> = word.chars().map(|c| c == '1').collect();
        let observed =
            observed.try_into().ok().filter(|_| word.chars().all(|c| matches!(c, '0' | '1'))).ok_or_else(
                || format!("\"{word}\" does not say of six components whether they are observed"),
            )?;
        let mut phi = Gaussian { mean: Vector6::zeros(), cov: Matrix6::zeros() };
        for i in 0..6 {
            phi.mean[i] = self.number(3 + i)?.unwrap_or(0.0);
        }
        phi.cov = self.covariance(COLUMNS_BEFORE_COVARIANCE.len())?;
        let said = self.0.get(COLUMN_COUNT).is_some_and(|field| !field.is_empty());
        let own = said.then(|| self.covariance(COLUMN_COUNT)).transpose()?;
        Ok(EstimatedMotion { phi, own, observed, rows: self.count(last)?, inliers: self.count(last + 1)? })
    }

    /// The covariance whose upper triangle begins at a field.
    fn covariance(&self, first: usize) -> Result<Matrix6<f64>, String> {
        let mut cov = Matrix6::zeros();
        for (k, (i, j)) in upper_triangle().enumerate() {
            let value = self.number(first + k)?.ok_or("the covariance is not complete")?;
            (cov[(i, j)], cov[(j, i)]) = (value, value);
        }
        Ok(cov)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows() -> Vec<MotionRow> {
        let cov = Matrix6::from_fn(|i, j| if i == j { 1.0 + i as f64 } else { 0.1 / (1 + i + j) as f64 });
        let phi = Gaussian { mean: Vector6::new(0.1, -1.0 / 3.0, 1e-9, 2e-3, 0.0, -5.5), cov };
        let mut partial = phi;
        partial.mean[2] = 0.0;
        partial.cov[(2, 2)] = f64::INFINITY;
        let motion = |phi, observed| {
            let own = Some(cov * 0.25);
            Some(EstimatedMotion { phi, own, observed, rows: 900, inliers: 800 })
        };
        let row = |frame, motion, impact_s, status: &str| MotionRow {
            frame,
            time_s: 0.1 * frame as f64,
            dt_s: (frame > 3).then_some(0.1),
            motion,
            impact_s,
            status: status.into(),
        };
        vec![
            row(3, None, None, "bad_image"),
            row(4, motion(phi, [true; 6]), Some([1.5, 1.2, f64::INFINITY]), "ok"),
            row(5, motion(partial, [true, true, false, true, true, true]), None, "partial"),
        ]
    }

    #[test]
    fn what_is_written_is_read() {
        let text = text(&rows());
        assert_eq!(parse(&text, Path::new("motion.csv")).unwrap(), rows());
        assert!(text.starts_with("frame,time_s,dt_s,tx,ty,tz,wx,wy,wz,cov_00,cov_01,"));
        assert!(
            text.contains(",cov_55,rows,inliers,observed,impact_s,impact_lo_s,impact_hi_s,status,own_00,")
        );
        assert!(text.lines().next().is_some_and(|head| head.ends_with(",own_55")));
    }

    #[test]
    fn a_table_without_what_is_new_in_each_pair_is_read() {
        let short = |line: &str| line.split(',').take(COLUMN_COUNT).collect::<Vec<_>>().join(",") + "\n";
        let old: String = text(&rows()).lines().map(short).collect();
        let mut expected = rows();
        expected.iter_mut().filter_map(|row| row.motion.as_mut()).for_each(|motion| motion.own = None);
        assert_eq!(parse(&old, Path::new("motion.csv")).unwrap(), expected);
    }

    #[test]
    fn what_is_wrong_is_named_by_its_line() {
        let whole = text(&rows());
        let refused = |text: &str| parse(text, Path::new("m.csv")).unwrap_err().to_string();
        assert!(refused("").contains("m.csv:1: has not the columns"));
        assert!(refused(&whole.replace("cov_00", "cov")).contains("m.csv:1: has not the columns"));
        assert!(refused(&whole.replace(",bad_image", "")).contains("m.csv:2: the row has 57 fields, not 58"));
        assert!(refused(&whole.replace("111111", "11211")).contains("m.csv:3: \"11211\" does not say"));
        assert!(refused(&whole.replace("-5.5", "x")).contains("m.csv:3: \"x\" is not a number"));
        assert!(
            refused(&whole.replace(",900,", ",-900,")).contains("m.csv:3: \"-900\" is not a whole number")
        );
        assert!(refused(&whole.replace(",1.2,", ",NaN,")).contains("m.csv:3: \"NaN\" is not a number"));
    }
}
