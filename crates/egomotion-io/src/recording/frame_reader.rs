//! Frames from their files: images, rectified where they are raw, depth, and maps and tracks that others computed.

use std::path::{Path, PathBuf};
use std::time::Instant;

use egomotion::geometry::{Grid, Image};
use egomotion::observe::{DisparityMap, FlowField, RectificationMap, Rectifier};
use egomotion::pipeline::{DepthCamera, Frame, Unanswered};

use super::source_frame::{FrameInput, SourceFrame};
use crate::image::undistort;
use crate::maps::{depth, pfm, precomputed};
use crate::source::{DepthSensor, FrameFiles, Sequence};
use crate::tables::tracks::TrackTable;
use crate::{IoError, image};

/// Where the parts of a frame come from.
#[derive(Debug, Default)]
pub struct Reader {
    /// Turns raw images into rectified ones.
    pub rectifier: Option<Rectifier>,
    /// Takes disparity from depth images in place of the right ones.
    pub depth: Option<(DepthCamera, DepthSensor)>,
    /// Each file holds both images.
    pub side_by_side: bool,
    /// Folder of disparity maps that take the place of our own.
    pub disparity: Option<PathBuf>,
    /// Folder of flow maps that take the place of our own.
    pub flow: Option<PathBuf>,
    /// Tracks that take the place of images.
    pub tracks: Option<TrackTable>,
}

impl Reader {
    /// Compute what the frames of a sequence need; with `depth` its depth images take the place of right ones.
    pub fn new(sequence: &Sequence, depth: bool) -> Self {
        let sensor = sequence.depth_sensor.filter(|_| depth);
        let camera =
            |sensor: DepthSensor| Some((DepthCamera { rig: sequence.rig?, noise: sensor.noise }, sensor));
        Self {
            rectifier: sequence.rectification.as_ref().map(Rectifier::new),
            depth: sensor.and_then(camera),
            side_by_side: sequence.side_by_side,
            ..Self::default()
        }
    }

    /// The images of a stereo pair.
    pub fn pair(sequence: &Sequence, files: &FrameFiles) -> Result<(Image, Image), Unanswered> {
        let right = files.right.as_ref().ok_or(Unanswered::MissingRight)?;
        Self::new(sequence, false).images(files, right)
    }

    /// Read one frame; what cannot be read becomes the frame's status. The `last` frame has no flow.
    pub(super) fn read(&self, files: &FrameFiles, time_s: f64, last: bool) -> SourceFrame {
        let start = Instant::now();
        let input = match &self.tracks {
            Some(table) => {
                Ok(FrameInput::Tracks(table.frames.get(&files.index).cloned().unwrap_or_default()))
            }
            None => self.frame(files, time_s, last).map(|frame| FrameInput::Images(Box::new(frame))),
        };
        SourceFrame {
            index: files.index,
            time_s,
            input,
            truth: files.truth,
            decode_ms: start.elapsed().as_secs_f64() * 1e3,
            bytes: self.bytes(files),
        }
    }

    /// Size of all files of a frame together.
    pub(super) fn bytes(&self, files: &FrameFiles) -> u64 {
        let given = [
            (&self.disparity, precomputed::DISPARITY_EXTENSIONS),
            (&self.flow, precomputed::FLOW_EXTENSIONS),
        ];
        let given = given.map(|(folder, endings)| {
            precomputed::find(folder.as_deref()?, &files.left, files.index, endings)
        });
        let own = [Some(&files.left), files.right.as_ref(), files.depth.as_ref()];
        let all = own.into_iter().flatten().chain(given.iter().flatten());
        all.filter_map(|file| file.metadata().ok()).map(|about| about.len()).sum()
    }

    fn frame(&self, files: &FrameFiles, time_s: f64, last: bool) -> Result<Frame, Unanswered> {
        let given =
            self.disparity.as_deref().map(|folder| precomputed_disparity(folder, files)).transpose()?;
        let flow = self
            .flow
            .as_deref()
            .filter(|_| !last)
            .map(|folder| precomputed_flow(folder, files))
            .transpose()?;
        if let Some((camera, sensor)) = &self.depth {
            let file = files.depth.as_ref().ok_or(Unanswered::MissingDepth)?;
            let left = image::read(&files.left).map_err(bad)?;
            let depth_m = depth::read(file, sensor.levels_per_m).map_err(bad)?;
            let (left, depth_m) = match &sensor.lens {
                Some(lens) => (undistort::image(lens, &left), undistort::depth(lens, &depth_m)),
                None => (left, depth_m),
            };
            let frame = camera.frame(time_s, left, &depth_m);
            return Ok(Frame { disparity: given.or(frame.disparity), flow, ..frame });
        }
        if self.side_by_side {
            let whole = image::read(&files.left).map_err(bad)?;
            let (left, right) = self.rectified(halves(&whole), &files.left, &files.left)?;
            return Ok(Frame { time_s, left, right: Some(right), disparity: given, flow });
        }
        let (left, right) = match (&files.right, &given) {
            (Some(right), _) => self.images(files, right).map(|(left, right)| (left, Some(right)))?,
            (None, Some(_)) => (self.left(files)?, None),
            (None, None) => return Err(Unanswered::MissingRight),
        };
        Ok(Frame { time_s, left, right, disparity: given, flow })
    }

    /// The left and right image of a frame, rectified.
    pub fn images(&self, files: &FrameFiles, right: &Path) -> Result<(Image, Image), Unanswered> {
        let (left_image, right_image) =
            (image::read(&files.left).map_err(bad)?, image::read(right).map_err(bad)?);
        if left_image.size() != right_image.size() {
            let ((w, h), (wr, hr)) = (left_image.size(), right_image.size());
            return Err(Unanswered::BadImage(format!(
                "{}: {wr}x{hr} pixels, but the left image has {w}x{h}; give pairs of one size",
                right.display()
            )));
        }
        self.rectified((left_image, right_image), &files.left, right)
    }

    /// Both images on the rig's grid.
    fn rectified(
        &self,
        (left, right): (Image, Image),
        left_path: &Path,
        right_path: &Path,
    ) -> Result<(Image, Image), Unanswered> {
        let Some(rectifier) = &self.rectifier else { return Ok((left, right)) };
        Ok((rectified(rectifier.left(), left, left_path)?, rectified(rectifier.right(), right, right_path)?))
    }

    fn left(&self, files: &FrameFiles) -> Result<Image, Unanswered> {
        let image = image::read(&files.left).map_err(bad)?;
        match &self.rectifier {
            None => Ok(image),
            Some(rectifier) => rectified(rectifier.left(), image, &files.left),
        }
    }
}

/// Pixels that the left and the right image do not show, where there are any, `true`.
pub fn unseen(rectifier: Option<&Rectifier>) -> [Option<Grid<bool>>; 2] {
    let Some(rectifier) = rectifier else { return [None, None] };
    [rectifier.left(), rectifier.right()]
        .map(|map| Some(map.unseen()).filter(|unseen| unseen.values().contains(&true)).cloned())
}

/// The left and the right half of an image.
pub fn halves(whole: &Image) -> (Image, Image) {
    let (width, height) = (whole.width() / 2, whole.height());
    let half = |from: usize| Grid::from_fn(width, height, |u, v| whole.at(from + u, v));
    (half(0), half(width))
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

fn bad(error: IoError) -> Unanswered {
    Unanswered::BadImage(error.to_string())
}

/// The map of a frame, with its standard deviation where the folder has one beside it as `--maps` writes it.
fn precomputed_disparity(folder: &Path, files: &FrameFiles) -> Result<DisparityMap, Unanswered> {
    let file = precomputed::find(folder, &files.left, files.index, precomputed::DISPARITY_EXTENSIONS);
    let shift = precomputed::read_disparity(&file.ok_or(Unanswered::MissingDisparity)?).map_err(bad)?;
    let sigma = sigma_folder(folder)
        .and_then(|folder| precomputed::find(&folder, &files.left, files.index, &["pfm"]));
    Ok(match sigma {
        Some(sigma) => DisparityMap { shift, sigma: pfm::read(&sigma).map_err(bad)? },
        None => DisparityMap::given(shift, |_| precomputed::DEFAULT_SIGMA_PX),
    })
}

/// `disparity_sigma` beside `disparity`.
fn sigma_folder(folder: &Path) -> Option<PathBuf> {
    let name = folder.file_name()?.to_str()?;
    Some(folder.with_file_name(format!("{name}_sigma"))).filter(|folder| folder.is_dir())
}

fn precomputed_flow(folder: &Path, files: &FrameFiles) -> Result<FlowField, Unanswered> {
    let file = precomputed::find(folder, &files.left, files.index, precomputed::FLOW_EXTENSIONS);
    let [u, v] = precomputed::read_flow(&file.ok_or(Unanswered::MissingFlow)?).map_err(bad)?;
    Ok(FlowField::given(u, v, precomputed::DEFAULT_SIGMA_PX))
}
