//! Small pictures of images and maps: palette indices while the run goes on, coloured PNG in the page.

use egomotion::estimate::median;
use egomotion::geometry::{Grid, Image};
use egomotion::metrics::quantile;
use egomotion::motion::TimeToImpact;
use egomotion::pipeline::stereo::DenseResults;

use crate::chart::colour::{CIVIDIS, ColourMap, DIVERGING, EMBER, Rgb, Spread, VIRIDIS};
use crate::chart::raster::{encode, reduce};

/// Greatest width of a picture, in pixels.
const MOST_WIDTH_PX: usize = 480;

/// Most frames of which a page shows pictures.
pub const MOST_PICTURES: usize = 40;

/// Palette entries that hold values; entry 0 is a missing pixel. Few, so that the page stays small.
const LEVELS: u8 = 64;

/// The quantities that are shown as maps, in the order of [`FramePictures`].
pub const QUANTITIES: [Quantity; 4] = [
    Quantity { name: "Time to impact", map: EMBER, spread: Spread::Logarithmic, metres: false, unit: "s" },
    Quantity { name: "Disparity", map: VIRIDIS, spread: Spread::Linear, metres: false, unit: "px" },
    Quantity { name: "Depth velocity VZ", map: DIVERGING, spread: Spread::Symmetric, metres: true, unit: "" },
    Quantity { name: "σ of VZ", map: CIVIDIS, spread: Spread::Logarithmic, metres: true, unit: "" },
];

/// How one quantity is shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// Its name.
    pub name: &'static str,
    /// Its colours.
    pub map: ColourMap,
    /// How they are spread.
    pub spread: Spread,
    /// Whether it is a length, whose unit the page chooses.
    pub metres: bool,
    /// Its unit otherwise.
    pub unit: &'static str,
}

/// The pictures of one frame, small enough to keep for all frames that are shown.
#[derive(Debug, Clone, PartialEq)]
pub struct FramePictures {
    /// Earlier frame of the pair, on whose pixel grid the maps stand.
    pub frame: usize,
    left: Grid<u8>,
    maps: [MapPicture; 4],
}

/// A map as palette indices, evenly spread over its own range of coordinates; 0 is missing.
#[derive(Debug, Clone, PartialEq)]
struct MapPicture {
    indices: Grid<u8>,
    range: Option<(f64, f64)>,
}

impl FramePictures {
    /// The left image and the maps of a frame pair, reduced to 480 pixels in width.
    pub fn new(frame: usize, left: &Image, dense: &DenseResults) -> Self {
        let planes = [
            &dense.motion.seconds(TimeToImpact::seconds),
            dense.disparity.shift.grid(),
            dense.motion.depth_velocity.grid(),
            dense.motion.depth_velocity_sigma.grid(),
        ];
        let maps = std::array::from_fn(|i| MapPicture::new(planes[i], QUANTITIES[i].spread));
        Self { frame, left: grey(left), maps }
    }

    /// (width, height) of the pictures, in pixels.
    pub fn size(&self) -> (usize, usize) {
        self.left.size()
    }

    /// The left image as PNG; `None` if it is empty.
    pub fn left_png(&self) -> Option<Vec<u8>> {
        encode(&self.left, None)
    }

    /// Quantity `i` as PNG in colours spread over `range` (coordinates); `None` if it is empty.
    pub fn map_png(&self, i: usize, range: (f64, f64)) -> Option<Vec<u8>> {
        let map = self.maps.get(i)?;
        encode(&map.indices, Some(&map.palette(QUANTITIES[i].map, range)))
    }

    /// Range of the coordinates of quantity `i`: its 2nd to 98th percentile; `None` without a value.
    pub fn range(&self, i: usize) -> Option<(f64, f64)> {
        self.maps.get(i)?.range
    }
}

impl MapPicture {
    fn new(plane: &Grid<f32>, spread: Spread) -> Self {
        let coordinates = reduce(plane, MOST_WIDTH_PX, |block| {
            let mut present: Vec<f64> = block.filter(|v| v.is_finite()).map(f64::from).collect();
            spread.coordinate(median(&mut present))
        });
        let present: Vec<f64> = coordinates.values().iter().copied().filter(|c| c.is_finite()).collect();
        let range = quantile(&present, 0.02).zip(quantile(&present, 0.98));
        let (low, high) = range.unwrap_or((0.0, 1.0));
        let index = |c: f64| {
            let share = if high > low { (c - low) / (high - low) } else { 0.5 };
            1 + (share.clamp(0.0, 1.0) * f64::from(LEVELS - 1)).round() as u8
        };
        let (width, height) = coordinates.size();
        let indices = Grid::from_fn(width, height, |u, v| {
            let c = coordinates.at(u, v);
            if c.is_finite() { index(c) } else { 0 }
        });
        Self { indices, range }
    }

    /// The colour of each index from 1 on, when the colours are spread over `common`.
    fn palette(&self, map: ColourMap, common: (f64, f64)) -> Vec<Rgb> {
        let (low, high) = self.range.unwrap_or(common);
        let share = |k: u8| {
            let coordinate = low + (high - low) * f64::from(k) / f64::from(LEVELS - 1);
            (coordinate - common.0) / (common.1 - common.0)
        };
        (0..LEVELS).map(|k| map.at(share(k))).collect()
    }
}

/// Grey levels from black to the brightest, 8 bit; 64 levels, so that noise costs little.
fn grey(image: &Image) -> Grid<u8> {
    let mean = reduce(image, MOST_WIDTH_PX, |block| {
        let (sum, n) = block.filter(|v| v.is_finite()).fold((0.0, 0), |(s, n), v| (s + f64::from(v), n + 1));
        sum / f64::from(n.max(1))
    });
    let brightest = quantile(mean.values(), 0.999).unwrap_or(0.0).max(1.0);
    // Eight-bit images keep their exposure, others are scaled.
    let white = if brightest <= 255.0 { 255.0 } else { brightest };
    let level = |v: f64| 4 * ((v / white).clamp(0.0, 1.0) * 63.0).round() as u8;
    Grid::from_fn(mean.width(), mean.height(), |u, v| level(mean.at(u, v)))
}

/// Pictures of at most [`MOST_PICTURES`] frames of a run whose length need not be known, evenly spaced.
#[derive(Debug, Clone)]
pub struct Album {
    pictures: Vec<FramePictures>,
    stride: usize,
    offered: usize,
}

impl Default for Album {
    fn default() -> Self {
        Self { pictures: Vec::new(), stride: 1, offered: 0 }
    }
}

impl Album {
    /// Offer the next frame pair; its pictures are made only if they will be kept.
    pub fn offer(&mut self, make: impl FnOnce() -> FramePictures) {
        if self.pictures.len() == MOST_PICTURES && self.is_due() {
            self.thin();
        }
        if self.is_due() {
            self.pictures.push(make());
        }
        self.offered += 1;
    }

    /// The pictures kept, in order.
    pub fn pictures(&self) -> &[FramePictures] {
        &self.pictures
    }

    fn is_due(&self) -> bool {
        self.offered.is_multiple_of(self.stride)
    }

    /// Keep every other one, now and from here on.
    fn thin(&mut self) {
        let mut keep = false;
        self.pictures.retain(|_| {
            keep = !keep;
            keep
        });
        self.stride *= 2;
    }
}
