//! The places of the slider.

use super::report::Report;

/// Most places of the slider where there are no pictures: with more a step is smaller than a pixel of its thumb's way,
/// with fewer a long run is seen in jumps.
const MAX_SLIDER_POSITIONS: usize = 200;

/// A place of the slider: a row, and its picture if there is one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SliderPosition {
    pub row: usize,
    pub picture: Option<usize>,
}

impl Report<'_> {
    /// Where the slider can stop: at each picture, or at some rows where there are none.
    pub(crate) fn slider_positions(&self) -> Vec<SliderPosition> {
        let pictured: Vec<SliderPosition> = self
            .album
            .pictures()
            .iter()
            .enumerate()
            .filter(|(_, picture)| picture.row < self.frames.len())
            .map(|(k, picture)| SliderPosition { row: picture.row, picture: Some(k) })
            .collect();
        if !pictured.is_empty() {
            return pictured;
        }
        let step = self.frames.len().div_ceil(MAX_SLIDER_POSITIONS).max(1);
        (1..self.frames.len()).step_by(step).map(|row| SliderPosition { row, picture: None }).collect()
    }
}
