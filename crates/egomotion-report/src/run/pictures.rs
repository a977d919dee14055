//! Small pictures of images and maps, compressed at once; the colours of the maps are put in when the page is made.

use egomotion::geometry::{Grid, Image};
use egomotion::metrics::quantile;
use egomotion::motion::TimeToImpact;
use egomotion::pipeline::DenseResults;
use jpeg_encoder::{ColorType, Encoder};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::base64_text;
use crate::chart::colour::{CIVIDIS, ColourMap, ColourScaling, DIVERGING, INFERNO_REVERSED, Rgb, VIRIDIS};
use crate::chart::raster::{centres, encode, means, recolour};

/// Quality of the JPEG pictures of the left image, 1 to 100: a larger one makes a larger page.
const JPEG_QUALITY: u8 = 70;

/// Palette entries that hold the values of a quantity, besides entry 0 for a missing pixel. Few, so that the page stays small.
const LEVELS: u8 = 48;
/// Palette entries that hold the values of a σ, which varies from pixel to pixel and is read coarsely: half the bytes.
const SIGMA_LEVELS: u8 = 16;

/// Number of pixels from which the quantiles of a picture are taken: more take longer to sort, fewer miss small parts.
const QUANTILE_PIXELS: usize = 10_000;

/// The maps, each quantity followed by its σ.
pub(crate) const QUANTITIES: [Quantity; 6] = [
    Quantity { name: "Disparity", unit: "px", map: VIRIDIS, scaling: ColourScaling::Linear },
    Quantity { name: "σ of disparity", unit: "px", map: CIVIDIS, scaling: ColourScaling::Logarithmic },
    Quantity { name: "Depth velocity VZ", unit: "m/s", map: DIVERGING, scaling: ColourScaling::Symmetric },
    Quantity { name: "σ of VZ", unit: "m/s", map: CIVIDIS, scaling: ColourScaling::Logarithmic },
    Quantity {
        name: "Time to impact",
        unit: "s",
        map: INFERNO_REVERSED,
        scaling: ColourScaling::Logarithmic,
    },
    Quantity { name: "σ of time to impact", unit: "s", map: CIVIDIS, scaling: ColourScaling::Logarithmic },
];

/// How one quantity is shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Quantity {
    /// Its name.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Its colours.
    pub map: ColourMap,
    /// How they are scaling.
    pub scaling: ColourScaling,
}

/// The pictures of one frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FramePictures {
    /// The frame shown, by its index in the source: the earlier one of the pair that the maps compare.
    pub frame: usize,
    /// The row of the run whose motion starts at this frame.
    pub row: usize,
    size: (usize, usize),
    #[serde(with = "base64_text")]
    left_jpeg: Vec<u8>,
    maps: Vec<MapPicture>,
}

/// A map as PNG of palette indices, evenly scaling over its own range of coordinates; 0 is missing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct MapPicture {
    #[serde(with = "base64_text")]
    png: Vec<u8>,
    levels: u8,
    /// Coordinates of the first and the last level.
    ends: (f64, f64),
    /// Coordinates between which nearly all pixels lie; `None` without a value.
    range: Option<(f64, f64)>,
}

impl FramePictures {
    /// The left image alone, at most `width_px` wide.
    pub fn of_image(frame: usize, row: usize, left: &Image, width_px: usize) -> Self {
        let grey = grey(left, width_px);
        Self { frame, row, size: grey.size(), left_jpeg: jpeg(&grey).unwrap_or_default(), maps: Vec::new() }
    }

    /// The left image and the maps of a frame pair that lies `dt_s` apart.
    pub fn new(
        frame: usize,
        row: usize,
        left: &Image,
        dense: &DenseResults,
        dt_s: f64,
        width_px: usize,
    ) -> Self {
        let plane = |i: usize| match i {
            0 => map(dense.disparity.shift.grid(), 1.0, i, width_px),
            1 => map(dense.disparity.sigma.grid(), 1.0, i, width_px),
            2 => map(dense.motion.depth_velocity.grid(), dt_s.recip(), i, width_px),
            3 => map(dense.motion.depth_velocity_sigma.grid(), dt_s.recip(), i, width_px),
            4 => map(&dense.motion.seconds(TimeToImpact::seconds), 1.0, i, width_px),
            _ => map(&dense.motion.seconds(sigma_s), 1.0, i, width_px),
        };
        let maps = (0..QUANTITIES.len()).into_par_iter().map(plane).collect();
        Self { maps, ..Self::of_image(frame, row, left, width_px) }
    }

    /// (width, height) of the pictures, in pixels.
    pub(crate) fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Bytes that are kept.
    pub(crate) fn bytes(&self) -> usize {
        self.left_jpeg.len() + self.maps.iter().map(|map| map.png.len()).sum::<usize>()
    }

    /// Whether there are maps, or the left image alone.
    pub(crate) fn has_maps(&self) -> bool {
        !self.maps.is_empty()
    }

    /// The left image as JPEG; empty where there is none.
    pub(crate) fn left_jpeg(&self) -> &[u8] {
        &self.left_jpeg
    }

    /// Quantity `i` as PNG in colours scaling over `range` (coordinates); `None` if it is empty.
    pub(crate) fn map_png(&self, i: usize, range: (f64, f64)) -> Option<Vec<u8>> {
        let map = self.maps.get(i)?;
        recolour(&map.png, &map.palette(QUANTITIES.get(i)?.map, range))
    }

    /// Range of the coordinates of quantity `i`: its 2nd to 98th percentile; `None` without a value.
    pub(crate) fn range(&self, i: usize) -> Option<(f64, f64)> {
        self.maps.get(i)?.range
    }
}

/// σ of the time to impact, in seconds, to first order.
fn sigma_s(impact: &TimeToImpact) -> Option<f64> {
    Some(impact.seconds()?.powi(2) * impact.looming.sigma(0))
}

/// The picture of quantity `i`, whose values are `factor` times those of `plane`.
fn map(plane: &Grid<f32>, factor: f64, i: usize, width_px: usize) -> MapPicture {
    let scaling = QUANTITIES[i].scaling;
    let values = centres(plane, width_px);
    let (width, height) = values.size();
    let coordinates = Grid::from_fn(width, height, |u, v| scaling.coordinate(factor * values.at(u, v)));
    let mut present: Vec<f64> = sample(&coordinates).filter(|c| c.is_finite()).collect();
    present.sort_unstable_by(f64::total_cmp);
    let between = |low: f64, high: f64| of_sorted(&present, low).zip(of_sorted(&present, high));
    let ends = between(0.005, 0.995).unwrap_or((0.0, 1.0));
    let (low, high) = ends;
    let levels = if i.is_multiple_of(2) { LEVELS } else { SIGMA_LEVELS };
    let level = |c: f64| {
        let share = if high > low { (c - low) / (high - low) } else { 0.5 };
        1 + (share.clamp(0.0, 1.0) * f64::from(levels - 1)).round() as u8
    };
    let indices = Grid::from_fn(width, height, |u, v| {
        let c = coordinates.at(u, v);
        if c.is_finite() { level(c) } else { 0 }
    });
    let placeholder = vec![[0; 3]; levels.into()];
    let png = encode(&indices, Some(&placeholder)).unwrap_or_default();
    MapPicture { png, levels, ends, range: between(0.02, 0.98) }
}

/// The value below which this share of sorted values lies, between two of them in proportion.
fn of_sorted(values: &[f64], share: f64) -> Option<f64> {
    let place = share * values.len().checked_sub(1)? as f64;
    let (below, above) = (*values.get(place as usize)?, *values.get(place.ceil() as usize)?);
    Some(below + place.fract() * (above - below))
}

impl MapPicture {
    /// The colour of each index, the missing one first, when the colours are scaling over `common`.
    fn palette(&self, map: ColourMap, common: (f64, f64)) -> Vec<Rgb> {
        let (low, high) = self.ends;
        let share = |k: u8| {
            let coordinate = low + (high - low) * f64::from(k) / f64::from(self.levels - 1);
            (coordinate - common.0) / (common.1 - common.0)
        };
        std::iter::once([0; 3]).chain((0..self.levels).map(|k| map.at(share(k)))).collect()
    }
}

/// Grey levels from black to the brightest, 8 bit.
fn grey(image: &Image, width_px: usize) -> Grid<u8> {
    let mean = means(image, width_px);
    let brightest = quantile(&sample(&mean).collect::<Vec<_>>(), 0.999).unwrap_or(0.0).max(1.0);
    // Eight-bit images keep their exposure, others are scaled.
    let white = if brightest <= 255.0 { 255.0 } else { brightest };
    let level = |v: f64| ((v / white).clamp(0.0, 1.0) * 255.0).round() as u8;
    Grid::from_fn(mean.width(), mean.height(), |u, v| level(mean.at(u, v)))
}

/// Enough of a picture's values to tell their quantiles.
fn sample(values: &Grid<f64>) -> impl Iterator<Item = f64> {
    let every = values.values().len().div_ceil(QUANTILE_PIXELS).max(1);
    values.values().iter().step_by(every).copied()
}

/// `None` for an empty picture.
fn jpeg(pixels: &Grid<u8>) -> Option<Vec<u8>> {
    let (width, height) = (u16::try_from(pixels.width()).ok()?, u16::try_from(pixels.height()).ok()?);
    let mut content = Vec::new();
    let mut encoder = Encoder::new(&mut content, JPEG_QUALITY);
    encoder.set_optimized_huffman_tables(true);
    encoder.encode(pixels.values(), width, height, ColorType::Luma).ok()?;
    Some(content)
}
