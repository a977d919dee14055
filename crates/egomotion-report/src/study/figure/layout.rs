//! Sizes that the panels of all figures share, in SVG units.

/// Width of a panel, in SVG units.
pub(crate) const PANEL_WIDTH: f64 = 360.0;
/// Size of titles and of the names of axes.
pub(crate) const TITLE_PX: f64 = 12.0;
/// Size of tick labels.
pub(crate) const TICK_PX: f64 = 11.0;

/// Space beside a plot that its labels take; panels of a figure share it, so that their axes line up.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct LabelSpace {
    pub left: f64,
    pub bottom: f64,
}

impl LabelSpace {
    /// Above a plot: its title.
    pub(crate) const TOP: f64 = 24.0;
    /// To the right of a plot: half of its last label.
    pub(crate) const RIGHT: f64 = 10.0;

    /// The space that both need.
    pub(crate) fn or(self, other: Self) -> Self {
        Self { left: self.left.max(other.left), bottom: self.bottom.max(other.bottom) }
    }
}

/// Width of a text, estimated from its letters as the usual fonts draw them.
pub(crate) fn text_width(text: &str, size_px: f64) -> f64 {
    let of = |c: char| match c {
        'i' | 'j' | 'l' | 'I' | '.' | ',' | ':' | ';' | '\'' | '|' | '·' => 0.26,
        'f' | 't' | 'r' | ' ' | '(' | ')' | '[' | ']' | '-' | '/' | '⁻' | '¹' => 0.34,
        'm' | 'w' | 'M' | 'W' | '%' | '—' => 0.87,
        c if c.is_uppercase() => 0.70,
        _ => 0.56,
    };
    size_px * text.chars().map(of).sum::<f64>()
}
