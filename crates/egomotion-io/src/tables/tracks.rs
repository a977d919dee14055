//! Stereo tracks that others made: CSV, or `.npz` with an array `features` of (4, tracks, frames).

use std::collections::BTreeMap;
use std::path::Path;

use egomotion::geometry::StereoRig;
use egomotion::pipeline::TrackPoint;

use crate::maps::npy::Array;
use crate::maps::npz;
use crate::maps::npz::Npz;
use crate::{IoError, read};

/// Tracks frame by frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TrackTable {
    /// The points of each frame, by the frame's number.
    pub frames: BTreeMap<usize, Vec<TrackPoint>>,
    /// Time stamps in seconds by the frame's number, where the file has them.
    pub times_s: BTreeMap<usize, f64>,
    /// The rig, where the file has `K` and `b`; its size is that of what the tracks cover.
    pub rig: Option<StereoRig>,
}

/// Largest number of a frame plus 1: a bound on what one wrong digit in a file can ask for.
const MAX_FRAMES: usize = 10_000_000;
/// What to do about a CSV file of tracks that cannot be read: its columns.
const ADVICE_ON_COLUMNS: &str = "give frame,track,u_left,v_left,u_right,v_right and perhaps time_s";

/// Tracks from a file, told by its name: `.npz`, or else CSV.
///
/// # Errors
/// The file cannot be read, or [`decode_npz`] or [`parse_csv`] refuses it.
pub(crate) fn read(path: &Path) -> Result<TrackTable, IoError> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npz")) {
        decode_npz(&npz::read(path)?, path)
    } else {
        parse_csv(&read::text(path)?, path)
    }
}

/// Tracks from CSV with the columns `frame,track,u_left,v_left,u_right,v_right[,time_s]` in any order, named in its
/// first line; `path` names it in errors.
///
/// # Errors
/// Names the line: a column is missing, a value is no number, or a track occurs twice in a frame.
pub fn parse_csv(text: &str, path: &Path) -> Result<TrackTable, IoError> {
    let refuse =
        |line: u64, reason: String| IoError::new(path, reason, ADVICE_ON_COLUMNS).at_line(line as usize);
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(text.as_bytes());
    let head = reader.headers().map_err(|error| refuse(1, error.to_string()))?.clone();
    let column = |name: &str| head.iter().position(|column| column == name);
    let needed = |name: &str| column(name).ok_or_else(|| refuse(1, format!("has no column {name}")));
    let (frame, track) = (needed("frame")?, needed("track")?);
    let places = [needed("u_left")?, needed("v_left")?, needed("u_right")?, needed("v_right")?];
    let time = column("time_s");
    let mut table = TrackTable::default();
    let mut seen = std::collections::BTreeSet::new();
    for record in reader.records() {
        let record = record.map_err(|error| {
            let line = error.position().map_or(1, |position| position.line());
            refuse(line, "is not CSV of one width".into())
        })?;
        let line = record.position().map_or(1, csv::Position::line);
        let word = |i: usize| record.get(i).unwrap_or_default();
        let whole = |i: usize| -> Result<u64, IoError> {
            word(i).parse().map_err(|_| refuse(line, format!("\"{:.40}\" is not a whole number", word(i))))
        };
        let number = |i: usize| read::number(word(i)).map_err(|reason| refuse(line, reason));
        let (frame, track) = (whole(frame)?, whole(track)?);
        let frame = usize::try_from(frame)
            .ok()
            .filter(|frame| *frame < MAX_FRAMES)
            .ok_or_else(|| refuse(line, format!("frame {frame} is beyond {MAX_FRAMES}")))?;
        if !seen.insert((frame, track)) {
            return Err(refuse(line, format!("track {track} occurs twice in frame {frame}")));
        }
        let [ul, vl, ur, vr] =
            [number(places[0])?, number(places[1])?, number(places[2])?, number(places[3])?];
        table.frames.entry(frame).or_default().push(TrackPoint { track, left: (ul, vl), right: (ur, vr) });
        if let Some(time) = time {
            table.times_s.insert(frame, number(time)?);
        }
    }
    if table.frames.is_empty() { Err(refuse(1, "holds no track".into())) } else { Ok(table) }
}

/// Tracks from the content of an `.npz`: `features` of (4, tracks, frames) holding u and v in the left image and in
/// the right one, negative where a track is not seen; perhaps `K` (3, 3), `b` in metres, `time_stamps`; `path` names
/// it in errors.
///
/// # Errors
/// An array is missing or damaged, or has another shape.
pub fn decode_npz(content: &[u8], path: &Path) -> Result<TrackTable, IoError> {
    let mut npz = Npz::open(content, path)?;
    let refuse = |reason: String| {
        IoError::new(path, reason, "give features of (4, tracks, frames): u, v left, u, v right")
    };
    let features = npz.array("features")?;
    let &[4, tracks, frames] = features.shape.as_slice() else {
        return Err(refuse(format!("features has the shape {:?}", features.shape)));
    };
    let at = |row: usize, track: usize, frame: usize| {
        features.values.get((row * tracks + track) * frames + frame).copied().unwrap_or(f64::NAN)
    };
    let mut table = TrackTable::default();
    for frame in 0..frames {
        let points = (0..tracks).filter_map(|track| {
            let place = [0, 1, 2, 3].map(|row| at(row, track, frame));
            let seen = place.iter().all(|c| *c >= 0.0 && c.is_finite());
            let [ul, vl, ur, vr] = place;
            seen.then_some(TrackPoint { track: track as u64, left: (ul, vl), right: (ur, vr) })
        });
        table.frames.insert(frame, points.collect());
    }
    if npz.has("time_stamps") {
        let times = npz.array("time_stamps")?;
        if times.values.len() != frames {
            return Err(refuse(format!("has {} time stamps for {frames} frames", times.values.len())));
        }
        table.times_s = times.values.into_iter().enumerate().collect();
    }
    if npz.has("K") && npz.has("b") {
        table.rig = Some(rig(&npz.array("K")?, &npz.array("b")?, &table).map_err(refuse)?);
    }
    Ok(table)
}

/// The rig of `K` and `b`, as large as the tracks reach and as the principal point lies in its middle.
fn rig(camera: &Array, baseline: &Array, table: &TrackTable) -> Result<StereoRig, String> {
    let (&[fx, _, cx, _, fy, cy, ..], [3, 3]) = (camera.values.as_slice(), camera.shape.as_slice()) else {
        return Err(format!("K has the shape {:?}, not (3, 3)", camera.shape));
    };
    let &[baseline_m] = baseline.values.as_slice() else { return Err("b is not one number".into()) };
    let points = || table.frames.values().flatten();
    let furthest = |c: fn(&TrackPoint) -> f64, middle: f64| {
        // The conversion saturates; a size beyond reason is refused by the rig's own pixels.
        points().map(c).fold(2.0 * middle, f64::max).ceil().clamp(1.0, 1e5) as usize + 1
    };
    let size = (furthest(|p| p.left.0, cx), furthest(|p| p.left.1, cy));
    let rig = StereoRig::new(fx, (cx, cy), baseline_m, size).map_err(|error| error.to_string())?;
    let rig = StereoRig { focal_y_px: fy, ..rig };
    rig.check().map(|()| rig).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        parse_csv(text, Path::new("t.csv")).unwrap_err().to_string()
    }

    #[test]
    fn columns_are_told_by_their_names() {
        let text = "track, frame,u_left,v_left,u_right,v_right,time_s\n7,3,10.5,20,8,20.1,1.5\n# note\n8,3,1,2,0.5,2,1.5\n7,4,11,20,8.5,20,1.6\n";
        let table = parse_csv(text, Path::new("t.csv")).unwrap();
        assert_eq!(table.frames[&3].len(), 2);
        assert_eq!(table.frames[&4], [TrackPoint { track: 7, left: (11.0, 20.0), right: (8.5, 20.0) }]);
        assert_eq!(table.times_s, BTreeMap::from([(3, 1.5), (4, 1.6)]));
        assert_eq!(table.rig, None);
    }

    #[test]
    fn a_bad_line_is_named() {
        let head = "frame,track,u_left,v_left,u_right,v_right\n";
        assert!(refused("frame,track\n").contains("t.csv:1: has no column u_left"));
        assert!(refused(head).contains("holds no track"));
        assert!(refused(&format!("{head}0,1,x,2,3,4\n")).contains("t.csv:2: \"x\" is not a number"));
        assert!(
            refused(&format!("{head}0,1,1,2,3,4\n0,1,1,2,3,4\n")).contains("t.csv:3: track 1 occurs twice")
        );
        assert!(refused(&format!("{head}-1,1,1,2,3,4\n")).contains("t.csv:2: \"-1\" is not a whole number"));
        assert!(refused(&format!("{head}0,1,1,2\n")).contains("t.csv:2: is not CSV of one width"));
        assert!(refused(&format!("{head}99999999999,1,1,2,3,4\n")).contains("beyond"));
    }

    #[test]
    fn what_is_no_archive_is_refused() {
        let error = decode_npz(b"PK nothing", Path::new("t.npz")).unwrap_err().to_string();
        assert!(error.contains("t.npz: is not a whole .npz file"), "{error}");
    }
}
