//! Colour maps that read the same to colour-blind eyes and in grey, and the scales they show.

use std::fmt::Write as _;

use super::plot::extent;

/// A colour: red, green, blue.
pub type Rgb = [u8; 3];

/// A colour map, as evenly spaced stops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColourMap(&'static [u32]);

/// Viridis (van der Walt and Smith, matplotlib).
pub const VIRIDIS: ColourMap = ColourMap(&[
    0x440154, 0x482878, 0x3e4989, 0x31688e, 0x26828e, 0x1f9e89, 0x35b779, 0x6ece58, 0xb5de2b, 0xfde725,
]);

/// Cividis (Nuñez, Anderton and Renslow 2018).
pub const CIVIDIS: ColourMap = ColourMap(&[
    0x00224e, 0x123570, 0x3b496c, 0x575d6d, 0x707173, 0x8a8678, 0xa59c74, 0xc3b369, 0xe1cc55, 0xfee838,
]);

/// Inferno (matplotlib) from bright to dark: what is urgent glows.
pub const EMBER: ColourMap = ColourMap(&[
    0xfcffa4, 0xf7d13d, 0xfb9b06, 0xed6925, 0xcf4446, 0xa52c60, 0x781c6d, 0x4a0c6b, 0x1b0c41, 0x000004,
]);

/// Orange – white – blue, from ColorBrewer's Oranges and Blues: negative, zero, positive.
pub const DIVERGING: ColourMap = ColourMap(&[
    0x7f2704, 0xb84203, 0xe5660f, 0xfd9a50, 0xfdd0a2, 0xf7f7f7, 0xc6dbef, 0x7fb8dc, 0x3787c0, 0x125ba0, 0x08306b,
]);

impl ColourMap {
    /// The colour at `share`, 0 … 1; outside it is that of the end.
    pub fn at(&self, share: f64) -> Rgb {
        let Some(last) = self.0.len().checked_sub(1) else { return [0; 3] };
        let place = share.clamp(0.0, 1.0) * last as f64;
        let index = (place as usize).min(last);
        let rest = place - index as f64;
        let [a, b] = [index, (index + 1).min(last)].map(|i| self.0[i].to_be_bytes());
        std::array::from_fn(|k| (f64::from(a[k + 1]) * (1.0 - rest) + f64::from(b[k + 1]) * rest).round() as u8)
    }

    /// The map as a CSS gradient from left to right.
    pub fn css_gradient(&self) -> String {
        let mut css = String::from("linear-gradient(90deg");
        for stop in self.0 {
            // Writing to a string cannot fail.
            let _ = write!(css, ",#{stop:06x}");
        }
        css.push(')');
        css
    }
}

/// How a quantity is spread over a colour map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Spread {
    /// Evenly.
    Linear,
    /// Evenly on both sides of zero, which is the map's middle.
    Symmetric,
    /// By ratios; for positive quantities.
    Logarithmic,
}

impl Spread {
    /// The value as it is spread: itself, or its logarithm.
    pub fn coordinate(self, value: f64) -> f64 {
        if self == Self::Logarithmic { value.ln() } else { value }
    }

    /// The value of a coordinate.
    pub fn value(self, coordinate: f64) -> f64 {
        if self == Self::Logarithmic { coordinate.exp() } else { coordinate }
    }

    /// One range of coordinates for the ranges of many pictures.
    pub fn common(self, ranges: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
        let (mut lows, mut highs): (Vec<f64>, Vec<f64>) = ranges.unzip();
        // The middle of the pictures decides, so that a single bad one does not.
        let low = egomotion::estimate::median(&mut lows);
        let high = egomotion::estimate::median(&mut highs);
        let Some((low, high)) = extent([low, high]) else { return (0.0, 1.0) };
        match self {
            Self::Symmetric => {
                let most = low.abs().max(high.abs()).max(f64::MIN_POSITIVE);
                (-most, most)
            }
            Self::Linear | Self::Logarithmic if high - low < 1e-9 => (low, low + 1e-9 + 0.01 * low.abs()),
            Self::Linear | Self::Logarithmic => (low, high),
        }
    }
}
