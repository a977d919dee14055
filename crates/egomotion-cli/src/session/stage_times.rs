//! Time that each stage took, summed over frames.

use egomotion::pipeline::StageTimes;

/// Milliseconds by stage, summed over frames.
#[derive(Default)]
pub struct StageSums {
    decode_ms: f64,
    stages: StageTimes,
    /// Spent on writing and pictures, which is not the pipeline's.
    pub aside_ms: f64,
}

impl StageSums {
    /// Count one frame.
    pub fn add(&mut self, decode_ms: f64, stages: &StageTimes) {
        self.decode_ms += decode_ms;
        self.stages.pyramids_ms += stages.pyramids_ms;
        self.stages.disparity_ms += stages.disparity_ms;
        self.stages.tracks_ms += stages.tracks_ms;
        self.stages.flow_ms += stages.flow_ms;
        self.stages.estimate_ms += stages.estimate_ms;
        self.stages.maps_ms += stages.maps_ms;
    }

    /// Each stage over so many frames.
    pub fn means(&self, count: f64) -> Vec<(&'static str, f64)> {
        let s = &self.stages;
        [
            ("decode", self.decode_ms),
            ("pyramids", s.pyramids_ms),
            ("disparity", s.disparity_ms),
            ("tracks", s.tracks_ms),
            ("flow", s.flow_ms),
            ("estimate", s.estimate_ms),
            ("maps", s.maps_ms),
        ]
        .map(|(name, total)| (name, total / count))
        .to_vec()
    }
}
