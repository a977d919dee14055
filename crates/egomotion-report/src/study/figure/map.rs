//! A panel that holds a map in false colours with its bar, or a picture.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use egomotion::geometry::{Field, Grid, Image};
use maud::{Markup, html};

use super::layout::{LabelSpace, PANEL_WIDTH, TICK_PX, TITLE_PX, text_width};
use crate::chart::axes::AxisScale;
use crate::chart::colour::{ColourMap, DIVERGING, Rgb, VIRIDIS};
use crate::chart::raster::{centres, encode, means};

/// Most columns of an embedded picture, so that a figure stays small; a panel is 360 units wide.
const MAX_COLUMNS: usize = 640;
/// Width of the colour bar.
const BAR_PX: f64 = 11.0;
/// Left edge of pictures.
pub(crate) const LEFT: f64 = 4.0;

/// The height that a panel needs for a raster of that size, `beside` units of width being taken.
fn height_for((width, height): (usize, usize), beside: f64) -> f64 {
    let wide = PANEL_WIDTH - LEFT - beside;
    LabelSpace::TOP + (wide * height as f64 / width.max(1) as f64).clamp(20.0, 1.4 * wide) + 8.0
}

/// A quantity at every pixel.
pub(crate) struct Map<'a> {
    field: &'a Field,
    name: &'a str,
    /// Ends of the bar, the first below the second.
    range: (f64, f64),
}

impl<'a> Map<'a> {
    pub(crate) fn new(field: &'a Field, name: &'a str, (low, high): (f32, f32)) -> Self {
        let finite = low.is_finite() && high.is_finite();
        let range = match finite {
            true if high > low => (f64::from(low), f64::from(high)),
            true => (f64::from(low) - 0.5, f64::from(low) + 0.5),
            false => (0.0, 1.0),
        };
        Self { field, name, range }
    }

    /// The height of a panel that it fills.
    pub(crate) fn height(&self) -> f64 {
        height_for(self.field.size(), self.beside())
    }

    fn ticks(&self) -> Vec<(f64, String)> {
        AxisScale::linear(self.range, (0.0, 1.0)).ticks(5)
    }

    /// Width of the bar with its labels and name.
    fn beside(&self) -> f64 {
        let widest = self.ticks().iter().map(|(_, label)| text_width(label, TICK_PX)).fold(0.0, f64::max);
        8.0 + BAR_PX + 6.0 + widest + 20.0
    }

    /// Colours: two-sided about zero where the range is.
    fn colours(&self) -> ColourMap {
        let (low, high) = self.range;
        if (low + high).abs() <= 1e-3 * (high - low) { DIVERGING } else { VIRIDIS }
    }

    /// The map with its bar in a panel of that height; `id` is unique on a page.
    pub(crate) fn draw(&self, height: f64, id: &str) -> Markup {
        let place = Place::inside(self.field.size(), self.beside(), height);
        let bar_x = place.x + place.width + 8.0;
        let bar = AxisScale::linear(self.range, (place.y + place.height, place.y));
        let right = bar_x + BAR_PX;
        let colours = self.colours();
        html! {
            pattern id=(format!("{id}-none")) width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)" {
                path d="M0 0v6" stroke="#d4d7da" stroke-width="3" {}
            }
            linearGradient id=(format!("{id}-bar")) x1="0" x2="0" y1="1" y2="0" {
                @for k in 0..=20 {
                    stop offset=(format!("{}%", 5 * k)) stop-color=(css(colours.at(f64::from(k) / 20.0))) {}
                }
            }
            (place.rect(&format!("url(#{id}-none)")))
            (place.image(self.png(), self.name))
            (place.rect("none"))
            rect x=(n(bar_x)) y=(n(place.y)) width=(BAR_PX) height=(n(place.height)) fill=(format!("url(#{id}-bar)")) stroke="#4a4f55" stroke-width="0.6" {}
            g font-size=(TICK_PX) fill="#33383d" {
                @for (y, label) in self.ticks().into_iter().filter_map(|(v, label)| Some((bar.at(v)?, label))) {
                    path d=(format!("M{right:.1} {y:.1}h3")) stroke="#4a4f55" stroke-width="0.8" {}
                    text x=(n(right + 5.0)) y=(n(y + 3.9)) { (label) }
                }
            }
            text font-size=(TITLE_PX) text-anchor="middle" fill="#111"
                transform=(format!("translate({:.1} {:.1}) rotate(-90)", place.x + place.width + self.beside() - 4.0, place.y + 0.5 * place.height)) { (self.name) }
        }
    }

    fn png(&self) -> Option<Vec<u8>> {
        let small = centres(self.field.grid(), MAX_COLUMNS);
        let (low, high) = self.range;
        let index = |v: f64| {
            if v.is_nan() {
                0
            } else {
                1 + (254.0 * ((v - low) / (high - low)).clamp(0.0, 1.0)).round() as u8
            }
        };
        let (width, height) = small.size();
        let indices = Grid::from_fn(width, height, |u, v| index(small.at(u, v)));
        let colours = self.colours();
        let palette: Vec<Rgb> = (0..=254).map(|k| colours.at(f64::from(k) / 254.0)).collect();
        encode(&indices, Some(&palette))
    }
}

/// The height of a panel that a picture fills.
pub(crate) fn picture_height(image: &Image) -> f64 {
    height_for(image.size(), LabelSpace::RIGHT)
}

/// A picture in grey levels.
pub(crate) fn picture(image: &Image, height: f64, name: &str) -> Markup {
    let place = Place::inside(image.size(), LabelSpace::RIGHT, height);
    let small = means(image, MAX_COLUMNS);
    let (wide, tall) = small.size();
    let levels = Grid::from_fn(wide, tall, |u, v| small.at(u, v).clamp(0.0, 255.0).round() as u8);
    html! { (place.image(encode(&levels, None), name)) (place.rect("none")) }
}

/// Where a raster lies in its panel.
struct Place {
    x: f64,
    y: f64,
    width: f64,
    height: f64,
    /// Fewer pixels than are drawn: they stay squares.
    coarse: bool,
}

impl Place {
    /// As large as it can be, its shape kept.
    fn inside((width, height): (usize, usize), beside: f64, panel_height: f64) -> Self {
        let (room_x, room_y) = (PANEL_WIDTH - LEFT - beside, panel_height - LabelSpace::TOP - 8.0);
        let (w, h) = (width.max(1) as f64, height.max(1) as f64);
        let scale = (room_x / w).min(room_y / h);
        Self { x: LEFT, y: LabelSpace::TOP, width: w * scale, height: h * scale, coarse: w < room_x }
    }

    fn rect(&self, fill: &str) -> Markup {
        html! {
            rect x=(n(self.x)) y=(n(self.y)) width=(n(self.width)) height=(n(self.height)) fill=(fill) stroke="#4a4f55" stroke-width="0.6" {}
        }
    }

    fn image(&self, png: Option<Vec<u8>>, name: &str) -> Markup {
        html! {
            @if let Some(png) = png {
                image x=(n(self.x)) y=(n(self.y)) width=(n(self.width)) height=(n(self.height))
                    preserveAspectRatio="none" style=[self.coarse.then_some("image-rendering:pixelated")]
                    aria-label=(name) href=(format!("data:image/png;base64,{}", STANDARD.encode(png))) {}
            }
        }
    }
}

fn n(value: f64) -> String {
    format!("{value:.1}")
}

fn css([r, g, b]: Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}
