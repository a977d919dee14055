//! Frames on their way in: read (or rendered) ahead of the one that is being worked on.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Instant;

use egomotion::geometry::{Field, Grid, Image, RigidMotion, StereoRig};
use egomotion::observe::{DisparityMap, FlowField};
use egomotion::pipeline::{DepthCamera, Frame, TrackPoint, Unanswered};
use egomotion_io::source::{DepthSensor, FrameFiles};
use egomotion_io::tracks::TrackTable;
use egomotion_io::{IoError, depth, given, image, pfm};

/// One frame as it comes out of its files.
pub struct Fetched {
    /// Index of the frame in the source.
    pub index: usize,
    pub time_s: f64,
    /// What is given of this time, or why it cannot be used.
    pub frame: Result<Given, Unanswered>,
    /// True pose world_from_camera.
    pub truth: Option<RigidMotion>,
    pub decode_ms: f64,
}

/// What is given of one time.
pub enum Given {
    /// Images, and perhaps maps.
    Frame(Box<Frame>),
    /// Points of tracks that others made.
    Tracks(Vec<TrackPoint>),
}

/// Frames fetched while earlier ones are worked on.
const AHEAD: usize = 2;

/// Run `work` on frames that `fetch` provides on a thread of its own, in order.
///
/// `stop` ends the fetching between two frames.
pub fn with_frames<T>(
    count: usize,
    stop: &AtomicBool,
    fetch: impl Fn(usize) -> Fetched + Sync,
    work: impl FnOnce(Receiver<Fetched>) -> T,
) -> T {
    std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel(AHEAD);
        let fetch = &fetch;
        scope.spawn(move || {
            for k in 0..count {
                // The receiver is gone when the work ended early.
                if stop.load(Ordering::Relaxed) || sender.send(fetch(k)).is_err() {
                    break;
                }
            }
        });
        work(receiver)
    })
}

/// Where the parts of a frame come from.
pub struct Reader<'a> {
    pub rig: StereoRig,
    /// Take disparity from depth images in place of the right ones.
    pub depth: Option<DepthSensor>,
    /// Folder of disparity maps that take the place of our own.
    pub disparity: Option<&'a Path>,
    /// Folder of flow maps that take the place of our own.
    pub flow: Option<&'a Path>,
    /// Tracks that take the place of images.
    pub tracks: Option<&'a TrackTable>,
}

/// Standard deviation of a given disparity or flow that comes without one, in pixels.
const GIVEN_SIGMA_PX: f32 = 0.3;

impl Reader<'_> {
    /// Read one frame; what cannot be read becomes the frame's status. The `last` frame has no flow.
    pub fn read(&self, files: &FrameFiles, time_s: f64, last: bool) -> Fetched {
        let start = Instant::now();
        let frame = match self.tracks {
            Some(table) => Ok(Given::Tracks(table.frames.get(&files.index).cloned().unwrap_or_default())),
            None => self.frame(files, time_s, last).map(|frame| Given::Frame(Box::new(frame))),
        };
        Fetched {
            index: files.index,
            time_s,
            frame,
            truth: files.truth,
            decode_ms: start.elapsed().as_secs_f64() * 1e3,
        }
    }

    fn frame(&self, files: &FrameFiles, time_s: f64, last: bool) -> Result<Frame, Unanswered> {
        let given = self.disparity.map(|folder| given_disparity(folder, files)).transpose()?;
        let flow = self.flow.filter(|_| !last).map(|folder| given_flow(folder, files)).transpose()?;
        if let Some(sensor) = &self.depth {
            let file = files.depth.as_ref().ok_or(Unanswered::MissingDepth)?;
            let left = image::read(&files.left).map_err(bad)?;
            let depth_m = depth::read(file, sensor.levels_per_m).map_err(bad)?;
            let camera = DepthCamera { rig: self.rig, noise: sensor.noise };
            let (left, depth_m) = match &sensor.lens {
                Some(lens) => (lens.image(&self.rig, &left), lens.depth(&self.rig, &depth_m)),
                None => (left, depth_m),
            };
            let frame = camera.frame(time_s, left, &depth_m);
            return Ok(Frame { disparity: given.or(frame.disparity), flow, ..frame });
        }
        let right = match (&files.right, &given) {
            (Some(right), _) => Some(right),
            (None, Some(_)) => None,
            (None, None) => return Err(Unanswered::MissingRight),
        };
        let left = image::read(&files.left).map_err(bad)?;
        let right = right.map(|right| read_right(&left, right)).transpose()?;
        Ok(Frame { time_s, left, right, disparity: given, flow })
    }
}

fn bad(error: IoError) -> Unanswered {
    Unanswered::BadImage(error.to_string())
}

fn read_right(left: &Image, right: &Path) -> Result<Image, Unanswered> {
    let image = image::read(right).map_err(bad)?;
    if left.size() != image.size() {
        let ((w, h), (wr, hr)) = (left.size(), image.size());
        return Err(Unanswered::BadImage(format!(
            "{}: {wr}x{hr} pixels, but the left image has {w}x{h}; give rectified pairs of one size",
            right.display()
        )));
    }
    Ok(image)
}

/// The map of a frame, with its standard deviation where the folder has one beside it as `--maps` writes it.
fn given_disparity(folder: &Path, files: &FrameFiles) -> Result<DisparityMap, Unanswered> {
    let file = given::find(folder, &files.left, files.index, given::DISPARITY);
    let shift = given::disparity(&file.ok_or(Unanswered::MissingDisparity)?).map_err(bad)?;
    let sigma =
        sigma_folder(folder).and_then(|folder| given::find(&folder, &files.left, files.index, &["pfm"]));
    Ok(match sigma {
        Some(sigma) => DisparityMap { shift, sigma: pfm::read(&sigma).map_err(bad)? },
        None => DisparityMap::given(shift, |_| GIVEN_SIGMA_PX),
    })
}

/// `disparity_sigma` beside `disparity`.
fn sigma_folder(folder: &Path) -> Option<PathBuf> {
    let name = folder.file_name()?.to_str()?;
    Some(folder.with_file_name(format!("{name}_sigma"))).filter(|folder| folder.is_dir())
}

fn given_flow(folder: &Path, files: &FrameFiles) -> Result<FlowField, Unanswered> {
    let file = given::find(folder, &files.left, files.index, given::FLOW);
    let [u, v] = given::flow(&file.ok_or(Unanswered::MissingFlow)?).map_err(bad)?;
    let (width, height) = u.size();
    let both =
        |value: f32| Grid::from_fn(width, height, |x, y| if known(&u, &v, x, y) { value } else { f32::NAN });
    let variance = GIVEN_SIGMA_PX * GIVEN_SIGMA_PX;
    Ok(FlowField { cov_uu: both(variance), cov_uv: both(0.0), cov_vv: both(variance), u, v })
}

fn known(u: &Field, v: &Field, x: usize, y: usize) -> bool {
    u.get(x, y).is_some() && v.get(x, y).is_some()
}
