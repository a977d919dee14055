//! Frames on their way in: read (or rendered) ahead of the one that is being worked on.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Instant;

use egomotion::geometry::{Grid, Image, RigidMotion};
use egomotion::observe::{RectificationMap, Rectifier};
use egomotion::pipeline::Unanswered;
use egomotion_io::image;
use egomotion_io::source::{FrameFiles, Sequence};

/// One frame as it comes out of its files.
pub struct Fetched {
    /// Index of the frame in the source.
    pub index: usize,
    pub time_s: f64,
    /// Left and right image, or why they cannot be used.
    pub pair: Result<(Image, Image), Unanswered>,
    /// True pose world_from_camera.
    pub truth: Option<RigidMotion>,
    pub decode_ms: f64,
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

/// Reads the frames of a sequence, and rectifies them where they are raw.
#[derive(Debug)]
pub struct Reader {
    rectifier: Option<Rectifier>,
}

impl Reader {
    /// Compute what the frames of a sequence need.
    pub fn new(sequence: &Sequence) -> Self {
        Self { rectifier: sequence.rectification.as_ref().map(Rectifier::new) }
    }

    /// Pixels that the left image does not show, if there are any, where `true`.
    ///
    /// The right image needs no mask: a rectified view shows what both images have, and where a lens model
    /// ends before that the right image is black, which matches no texture.
    pub fn unseen(&self) -> Option<&Grid<bool>> {
        let unseen = self.rectifier.as_ref().map(|rectifier| rectifier.left().unseen());
        unseen.filter(|unseen| unseen.values().contains(&true))
    }

    /// Read the images of one frame; what cannot be read becomes the frame's status.
    pub fn read(&self, files: &FrameFiles, time_s: f64) -> Fetched {
        let start = Instant::now();
        let pair = match &files.right {
            None => Err(Unanswered::MissingRight),
            Some(right) => self.images(files, right),
        };
        Fetched {
            index: files.index,
            time_s,
            pair,
            truth: files.truth,
            decode_ms: start.elapsed().as_secs_f64() * 1e3,
        }
    }

    /// The left and right image of a frame, rectified.
    pub fn images(&self, files: &FrameFiles, right: &Path) -> Result<(Image, Image), Unanswered> {
        let read = |path| image::read(path).map_err(|e| Unanswered::BadImage(e.to_string()));
        let (left_image, right_image) = (read(&files.left)?, read(right)?);
        if left_image.size() != right_image.size() {
            let ((w, h), (wr, hr)) = (left_image.size(), right_image.size());
            return Err(Unanswered::BadImage(format!(
                "{}: {wr}x{hr} pixels, but the left image has {w}x{h}; give pairs of one size",
                right.display()
            )));
        }
        match &self.rectifier {
            None => Ok((left_image, right_image)),
            Some(rectifier) => Ok((
                rectified(rectifier.left(), left_image, &files.left)?,
                rectified(rectifier.right(), right_image, right)?,
            )),
        }
    }
}

fn rectified(map: &RectificationMap, raw: Image, path: &Path) -> Result<Image, Unanswered> {
    let mut out = Grid::filled(0, 0, 0.0);
    if map.warp(&raw, &mut out) {
        return Ok(out);
    }
    let ((w, h), (wc, hc)) = (raw.size(), map.raw_size());
    let reason = format!("{}: {w}x{h} pixels, but the camera's images have {wc}x{hc}", path.display());
    Err(Unanswered::BadImage(reason))
}
