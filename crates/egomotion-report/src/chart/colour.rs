//! Colour maps that read the same to colour-blind eyes and in grey, and the scales they show.

use std::fmt::Write as _;

use super::axes::extent;

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

/// Inferno (matplotlib) reversed, from bright to dark: what is urgent glows.
pub const INFERNO_REVERSED: ColourMap = ColourMap(&[
    0xfcffa4, 0xf7d13d, 0xfb9b06, 0xed6925, 0xcf4446, 0xa52c60, 0x781c6d, 0x4a0c6b, 0x1b0c41, 0x000004,
]);

/// Orange – white – blue, from ColorBrewer's Oranges and Blues: negative, zero, positive.
pub const DIVERGING: ColourMap = ColourMap(&[
    0x7f2704, 0xb84203, 0xe5660f, 0xfd9a50, 0xfdd0a2, 0xf7f7f7, 0xc6dbef, 0x7fb8dc, 0x3787c0, 0x125ba0,
    0x08306b,
]);

impl ColourMap {
    /// The colour at `share`, 0 … 1; outside it is that of the end, of NaN that of the start.
    pub fn at(&self, share: f64) -> Rgb {
        let Some(last) = self.0.len().checked_sub(1) else { return [0; 3] };
        let place = if share > 0.0 { share.min(1.0) * last as f64 } else { 0.0 };
        let index = (place as usize).min(last);
        let rest = place - index as f64;
        let [a, b] = [index, (index + 1).min(last)].map(|i| self.0[i].to_be_bytes());
        std::array::from_fn(|k| {
            (f64::from(a[k + 1]) * (1.0 - rest) + f64::from(b[k + 1]) * rest).round() as u8
        })
    }

    /// The map as a CSS gradient from left to right.
    pub(crate) fn css_gradient(&self) -> String {
        let mut css = String::from("linear-gradient(90deg");
        for stop in self.0 {
            // Writing to a string cannot fail.
            let _ = write!(css, ",#{stop:06x}");
        }
        css.push(')');
        css
    }
}

/// How the values of a quantity are placed on a colour map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ColourScaling {
    /// Evenly.
    Linear,
    /// Evenly on both sides of zero, which is the map's middle.
    Symmetric,
    /// By ratios; for positive quantities.
    Logarithmic,
}

impl ColourScaling {
    /// The value as it is spread: itself, or its logarithm.
    pub fn coordinate(self, value: f64) -> f64 {
        if self == Self::Logarithmic { value.ln() } else { value }
    }

    /// The value of a coordinate.
    pub(crate) fn value(self, coordinate: f64) -> f64 {
        if self == Self::Logarithmic { coordinate.exp() } else { coordinate }
    }

    /// One range of coordinates for the ranges of many pictures.
    pub(crate) fn common(self, ranges: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
        let (mut lows, mut highs): (Vec<f64>, Vec<f64>) = ranges.unzip();
        lows.sort_unstable_by(f64::total_cmp);
        highs.sort_unstable_by(f64::total_cmp);
        // A few bad pictures decide nothing; a part of the run that is unlike the rest does.
        let bad = (lows.len() / 3).min(1 + lows.len() / 10);
        let low = lows.get(bad).copied().unwrap_or(f64::NAN);
        let high = highs.iter().rev().nth(bad).copied().unwrap_or(f64::NAN);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_meet_their_stops_and_ends() {
        assert_eq!(VIRIDIS.at(0.0), [0x44, 0x01, 0x54]);
        assert_eq!(VIRIDIS.at(7.0), [0xfd, 0xe7, 0x25]);
        assert_eq!(DIVERGING.at(0.5), [0xf7; 3]);
        assert_eq!(CIVIDIS.at(f64::NAN), CIVIDIS.at(0.0));
        assert_eq!(CIVIDIS.at(1.0 / 9.0), [0x12, 0x35, 0x70]);
    }

    #[test]
    fn sequential_maps_grow_steadily_in_lightness() {
        let light = |[r, g, b]: Rgb| 0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b);
        for (map, sign) in [(VIRIDIS, 1.0), (CIVIDIS, 1.0), (INFERNO_REVERSED, -1.0)] {
            let levels: Vec<f64> = (0..=50).map(|k| sign * light(map.at(f64::from(k) / 50.0))).collect();
            assert!(levels.windows(2).all(|w| w[1] > w[0]), "{levels:?}");
        }
    }

    #[test]
    fn one_range_for_all_pictures() {
        let ranges = [(1.0, 4.0), (2.0, 5.0), (-900.0, 1e9)];
        assert_eq!(ColourScaling::Linear.common(ranges.into_iter()), (1.0, 5.0));
        assert_eq!(ColourScaling::Symmetric.common(ranges.into_iter()), (-5.0, 5.0));
        assert_eq!(ColourScaling::Linear.common(std::iter::empty()), (0.0, 1.0));
        // There and back again.
        let ways = [(-12.0, -11.0), (11.0, 12.0)].into_iter().cycle().take(32);
        assert_eq!(ColourScaling::Symmetric.common(ways), (-12.0, 12.0));
        let (low, high) = ColourScaling::Linear.common([(3.0, 3.0)].into_iter());
        assert!(low <= 3.0 && 3.0 < high);
    }
}
