//! A figure of the library as SVG: panels on a grid, one legend for all of them.

mod axis;
mod layout;
mod map;
mod plot;
mod style;
#[cfg(test)]
mod tests;

use egomotion_study::{Content, Figure, Panel};
use maud::{Markup, html};

use layout::{LabelSpace, PANEL_WIDTH, TITLE_PX, text_width};
use map::Map;
use plot::Plot;
use style::{Style, styles};

/// Height of a panel of lines; one of maps has the height of its maps.
const PLOT_HEIGHT: f64 = 272.0;
/// Space between panels, in SVG units.
const PANEL_GAP: f64 = 18.0;
/// Size of a caption's letters, in SVG units.
const CAPTION_PX: f64 = 11.5;
/// Share of the room of a text that its letters are meant to fill, no unit: fonts that are wider than expected fill the rest.
const FONT_SHARE: f64 = 0.87;
/// From one line of a caption to the next, in SVG units.
const CAPTION_LINE: f64 = 16.0;
/// Fonts that look alike, of which every system has one; the last is any without serifs.
const FONTS: &str = "Helvetica, Arial, Liberation Sans, DejaVu Sans, sans-serif";

/// What a panel holds, ready to be drawn.
enum Drawable<'a> {
    Plot(Plot<'a>),
    Map(Map<'a>),
    Picture(&'a egomotion::geometry::Image),
}

impl<'a> Drawable<'a> {
    fn new(panel: &'a Panel) -> Self {
        match &panel.content {
            Content::Plot { x, y, series } => Self::Plot(Plot::new(x, y, series)),
            Content::Map { field, name, range } => Self::Map(Map::new(field, name, *range)),
            Content::Picture(image) => Self::Picture(image),
        }
    }

    fn room(&self) -> LabelSpace {
        if let Self::Plot(plot) = self { plot.room() } else { LabelSpace::default() }
    }

    fn height(&self, room: LabelSpace) -> f64 {
        match self {
            // Long names of places make a panel taller, not its plot flatter.
            Self::Plot(_) => PLOT_HEIGHT + (room.bottom - 37.0).max(0.0),
            Self::Map(map) => map.height(),
            Self::Picture(image) => map::picture_height(image),
        }
    }
}

/// A figure in pieces that a page or a file puts together.
pub(crate) struct Drawing {
    /// Panels in a row.
    pub columns: usize,
    /// Height of each panel, alike in a row, and its inside.
    pub panels: Vec<(f64, Markup)>,
    /// Samples of 30 × 12 units with their names.
    pub legend: Vec<(Markup, String)>,
}

impl Drawing {
    /// Draw the panels of a figure; `id` is unique on a page and names what is inside.
    pub(crate) fn new(figure: &Figure, id: &str) -> Self {
        let styles = styles(figure);
        let drawables: Vec<Drawable<'_>> = figure.panels.iter().map(Drawable::new).collect();
        let room = drawables.iter().map(Drawable::room).fold(LabelSpace::default(), LabelSpace::or);
        let columns = figure.columns.clamp(1, figure.panels.len().max(1));
        let heights = drawables.chunks(columns).flat_map(|row| {
            let tallest = row.iter().map(|drawable| drawable.height(room)).fold(60.0, f64::max);
            std::iter::repeat_n(tallest, row.len())
        });
        let panel = |(k, (height, (drawable, panel))): (usize, (f64, (&Drawable<'_>, &Panel)))| {
            let id = format!("{id}-{k}");
            let (left, content) = match drawable {
                Drawable::Plot(plot) => (room.left, plot.draw(room, height, &styles, &id)),
                Drawable::Map(map) => (map::LEFT, map.draw(height, &id)),
                Drawable::Picture(image) => (map::LEFT, map::picture(image, height, &panel.title)),
            };
            let title = html! { text x=(left) y="15" font-size=(TITLE_PX) font-weight="bold" fill="#111" { (panel.title) } };
            (height, html! { (title) (content) })
        };
        Self {
            columns,
            panels: heights.zip(drawables.iter().zip(&figure.panels)).enumerate().map(panel).collect(),
            legend: legend(&styles, &drawables),
        }
    }

    /// Each panel as an SVG of its own.
    pub(crate) fn apart(&self) -> Markup {
        html! {
            @for (height, inside) in &self.panels {
                svg viewBox=(format!("0 0 {PANEL_WIDTH} {height:.1}")) font-family=(FONTS) role="img" { (inside) }
            }
        }
    }

    /// The panels on their grid, and the height of all.
    fn together(&self) -> (Markup, f64) {
        let (mut places, mut top) = (Vec::new(), 0.0);
        for row in self.panels.chunks(self.columns) {
            places.extend((0..row.len()).map(|k| (PANEL_GAP + k as f64 * (PANEL_WIDTH + PANEL_GAP), top)));
            top += row.first().map_or(0.0, |(height, _)| height + PANEL_GAP);
        }
        let markup = html! {
            @for ((_, inside), (x, y)) in self.panels.iter().zip(&places) {
                g transform=(format!("translate({x:.1} {y:.1})")) { (inside) }
            }
        };
        (markup, top)
    }
}

/// Names with their samples, and what bars and triangles mean where there are any.
fn legend(styles: &[Style], drawables: &[Drawable<'_>]) -> Vec<(Markup, String)> {
    let named = styles.iter().filter(|style| !style.name.is_empty());
    let mut entries: Vec<(Markup, String)> = named.map(|s| (s.sample(), s.name.clone())).collect();
    let extras = drawables
        .iter()
        .filter_map(|d| if let Drawable::Plot(plot) = d { Some(plot.extras()) } else { None });
    let (bars, beyond) = extras.fold((false, false), |a, b| (a.0 || b.0, a.1 || b.1));
    if bars {
        let bar = html! { path d="M15 0.5V11.5M12.5 0.5h5M12.5 11.5h5" stroke="#4a4f55" fill="none" {} };
        entries.push((bar, "± 2 standard errors".into()));
    }
    if beyond {
        let triangle = html! { path d="M15 2l4.5 7.5h-9z" fill="#4a4f55" {} };
        entries.push((triangle, "beyond the edge".into()));
    }
    entries
}

/// The figure as a file of its own: title, legend, panels, and its caption below them.
pub fn svg(figure: &Figure) -> String {
    let drawing = Drawing::new(figure, "panel");
    let wide = PANEL_GAP + drawing.columns as f64 * (PANEL_WIDTH + PANEL_GAP);
    let title = lines(&figure.title, wide - 2.0 * PANEL_GAP, 15.0);
    let legend_top = PANEL_GAP + 20.0 * title.len() as f64 + 6.0;
    let (legend, legend_rows) = legend_at(&drawing.legend, wide - 2.0 * PANEL_GAP);
    let panels_top = legend_top + 19.0 * legend_rows as f64 + 8.0;
    let (panels, panels_height) = drawing.together();
    let caption = lines(&figure.caption, FONT_SHARE * (wide - 2.0 * PANEL_GAP), CAPTION_PX);
    let caption_top = panels_top + panels_height;
    let tall = caption_top + CAPTION_LINE * caption.len() as f64 + 0.5 * PANEL_GAP;
    let picture = html! {
        svg xmlns="http://www.w3.org/2000/svg" width=(format!("{wide:.0}")) height=(format!("{tall:.0}"))
            viewBox=(format!("0 0 {wide:.0} {tall:.0}")) font-family=(FONTS) {
            title { (figure.title) }
            rect width="100%" height="100%" fill="#fff" {}
            g font-size="15" font-weight="bold" fill="#111" {
                @for (k, line) in title.iter().enumerate() {
                    text x=(PANEL_GAP) y=(format!("{:.0}", PANEL_GAP + 12.0 + 20.0 * k as f64)) { (line) }
                }
            }
            g transform=(format!("translate({PANEL_GAP} {legend_top:.1})")) font-size=(TITLE_PX) fill="#111" { (legend) }
            g transform=(format!("translate(0 {panels_top:.1})")) { (panels) }
            g font-size=(CAPTION_PX) fill="#33383d" {
                @for (k, line) in caption.iter().enumerate() {
                    text x=(PANEL_GAP) y=(format!("{:.1}", caption_top + CAPTION_LINE * k as f64 + 8.0)) { (line) }
                }
            }
        }
    };
    // XML takes no control characters, escaped or not.
    let mut text = picture.into_string();
    text.retain(|c| !c.is_control() && !matches!(c, '\u{fffe}' | '\u{ffff}'));
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{text}\n")
}

/// The legend in rows of at most that width, and how many they are.
fn legend_at(entries: &[(Markup, String)], most: f64) -> (Markup, usize) {
    let (mut x, mut row) = (0.0, 0);
    let places: Vec<(f64, f64)> = entries
        .iter()
        .map(|(_, name)| {
            let wide = 36.0 + text_width(name, TITLE_PX) / FONT_SHARE + 14.0;
            if x > 0.0 && x + wide > most {
                (x, row) = (0.0, row + 1);
            }
            let place = (x, 19.0 * row as f64);
            x += wide;
            place
        })
        .collect();
    let markup = html! {
        @for ((sample, name), (x, y)) in entries.iter().zip(&places) {
            g transform=(format!("translate({x:.1} {y:.1})")) { (sample) text x="36" y="10" { (name) } }
        }
    };
    (markup, if entries.is_empty() { 0 } else { row + 1 })
}

/// A text in lines of at most that width.
fn lines(text: &str, most: f64, size_px: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if text_width(line, size_px) + text_width(word, size_px) < most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}
