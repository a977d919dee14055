//! Colours of maps that are written to be looked at.

use egomotion::geometry::{Field, Grid};
use egomotion::metrics::quantile;
use egomotion_report::chart::colour::{ColourMap, ColourScaling};

/// Quantiles of the values that have the colours of the two ends. A hundredth lies beyond each: with fewer a single
/// wrong match would take most of the colours for itself, with more the ends would be flat.
const COLOUR_RANGE_QUANTILES: (f64, f64) = (0.01, 0.99);

/// Colours over the range that holds nearly all values.
pub struct ColourRange {
    scaling: ColourScaling,
    ends: (f64, f64),
}

impl ColourRange {
    /// The range of these values; `None` if none is known.
    pub fn of(values: &[f32], scaling: ColourScaling) -> Option<Self> {
        let known = values.iter().map(|&v| scaling.coordinate(f64::from(v))).filter(|v| v.is_finite());
        let known: Vec<f64> = known.collect();
        let (low, high) =
            (quantile(&known, COLOUR_RANGE_QUANTILES.0)?, quantile(&known, COLOUR_RANGE_QUANTILES.1)?);
        let most = low.abs().max(high.abs());
        let ends = if scaling == ColourScaling::Symmetric { (-most, most) } else { (low, high) };
        Some(Self { scaling, ends })
    }

    /// The colour of a value; `None` for what is missing.
    pub fn colour(&self, value: f32, colours: ColourMap) -> Option<[u8; 3]> {
        let at = Some(self.scaling.coordinate(f64::from(value))).filter(|at| !at.is_nan())?;
        let width = (self.ends.1 - self.ends.0).max(f64::MIN_POSITIVE);
        Some(colours.at((at - self.ends.0) / width))
    }
}

/// Direction as hue, length as saturation up to the upper end of the range; missing is black.
pub fn flow_colours([u, v]: [&Field; 2]) -> Grid<[u8; 3]> {
    let (width, height) = u.size();
    let at = |x, y| Some((f64::from(u.get(x, y)?), f64::from(v.get(x, y)?)));
    let lengths: Vec<f64> =
        (0..height).flat_map(|y| (0..width).filter_map(move |x| at(x, y))).map(|(a, b)| a.hypot(b)).collect();
    let longest = quantile(&lengths, COLOUR_RANGE_QUANTILES.1).unwrap_or(1.0).max(f64::MIN_POSITIVE);
    let colour = |(a, b): (f64, f64)| {
        let saturation = (a.hypot(b) / longest).min(1.0);
        let turn = b.atan2(a);
        std::array::from_fn(|k| {
            let wave = 0.5 + 0.5 * (turn - std::f64::consts::TAU * k as f64 / 3.0).cos();
            (255.0 * (1.0 - saturation * (1.0 - wave))) as u8
        })
    };
    Grid::from_fn(width, height, |x, y| at(x, y).map(colour).unwrap_or_default())
}
