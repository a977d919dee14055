//! Whether φ's covariance is true on a real recording, whose own truth is too coarse to tell.
//!
//! Two runs see disjoint checkerboards of the image, so that their errors are independent but for what all matches
//! share, which cancels: the squared difference of the two motions, in units of their summed covariance, is one for
//! each degree of freedom.
use std::io::Write;
use std::path::PathBuf;

use egomotion::geometry::{Gaussian, Grid};
use egomotion::metrics::Nees;
use egomotion::pipeline::{Config, Observe, StereoFrame, StereoMotion};
use egomotion_io::source::Sequence;
use egomotion_io::{IoError, Source, image};
use nalgebra::Vector6;

/// Side of a square of the board, in pixels.
const CELL_PX: usize = 64;

/// φ of every pair, seen through the squares of one colour.
fn motions(sequence: &Sequence, colour: usize) -> Result<Vec<Option<Gaussian<6>>>, IoError> {
    let rig = sequence.rig.unwrap();
    let config = Config { observe: Observe::Sparse, ..Config::default() };
    let mut pipeline = StereoMotion::new(rig, config).unwrap();
    let hidden = |u: usize, v: usize| (u / CELL_PX + v / CELL_PX) % 2 != colour;
    pipeline.set_mask(Some(Grid::from_fn(rig.width_px, rig.height_px, hidden)));
    let motion = |files: &egomotion_io::source::FrameFiles| {
        let (left, right) = (image::read(&files.left)?, image::read(files.right.as_ref().unwrap())?);
        let answer = pipeline.push(StereoFrame { time_s: files.time_s, left, right });
        let complete = answer.motion.ok().filter(|estimate| estimate.is_complete());
        // What both halves share is not in their difference.
        Ok(complete.zip(answer.parts).map(|(estimate, parts)| Gaussian { cov: parts.own, ..estimate.theta }))
    };
    sequence.frames.iter().map(motion).collect()
}

/// The squared difference of the two halves' motions, and the largest of one component in its standard deviations.
fn differences(sequence: &Sequence) -> Result<(Nees, f64), IoError> {
    let [white, black] = [0, 1].map(|colour| motions(sequence, colour));
    let (mut nees, mut largest) = (Nees::default(), 0.0);
    for (a, b) in white?.into_iter().zip(black?).filter_map(|(a, b)| a.zip(b)) {
        let apart = Gaussian { mean: a.mean - b.mean, cov: a.cov + b.cov };
        nees.add(&apart, &Vector6::zeros());
        largest = (0..6).map(|i| apart.mean[i].abs() / apart.sigma(i)).fold(largest, f64::max);
    }
    Ok((nees, largest))
}

#[test]
fn halves_of_kitti_differ_as_their_covariances_say() -> Result<(), IoError> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let data = std::env::var_os("EGOMOTION_DATA").map_or_else(|| PathBuf::from(default), PathBuf::from);
    for name in ["05", "06"] {
        let folder = data.join("kitti_odometry/sequences").join(name);
        if !folder.exists() {
            // Not `println!`, which the test harness hides when a test passes.
            let _ = writeln!(std::io::stdout(), "SKIPPED split halves: {} is missing", folder.display());
            return Ok(());
        }
        let source = Source::open(&folder)?;
        let (nees, largest) = differences(&source.sequences[0])?;
        let found = nees.per_degree().unwrap();
        println!("{name}: NEES/6 {found} ± {:?}, largest {largest} σ", nees.standard_error());
        assert!((0.7..=1.4).contains(&found), "{name}: {found}");
        assert!(largest < 6.0, "{name}: {largest} σ");
    }
    Ok(())
}
