//! The quantities that section 7.2 compares.

use serde::{Deserialize, Serialize};

/// A quantity that is estimated, in the paper's units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// VZ in mm per frame, at pixels whose neighbours lie on the same surface and which both cameras see.
    Vz,
    /// VZ in mm per frame wherever something was measured, depth edges and wrong matches too.
    VzAnywhere,
    /// VZ in mm per frame against what the true φ does to the measured depth of a still scene.
    VzStill,
    /// tX in mm per frame.
    Tx,
    /// tY in mm per frame.
    Ty,
    /// tZ in mm per frame.
    Tz,
    /// ΩX in degrees per frame.
    Wx,
    /// ΩY in degrees per frame.
    Wy,
    /// ΩZ in degrees per frame.
    Wz,
    /// Median error of disparity, in pixels.
    Disparity,
    /// Median error of flow, in pixels.
    Flow,
    /// Share of the true image motion that the turn makes, from 0 (all is translation) to 1; without a truth, of the
    /// motion that maximum likelihood finds.
    TurnShare,
}

impl Quantity {
    /// The components of φ, in its order.
    pub const PHI: [Self; 6] = [Self::Tx, Self::Ty, Self::Tz, Self::Wx, Self::Wy, Self::Wz];

    /// Name in a file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vz => "vz",
            Self::VzAnywhere => "vz_anywhere",
            Self::VzStill => "vz_still",
            Self::Tx => "tx",
            Self::Ty => "ty",
            Self::Tz => "tz",
            Self::Wx => "wx",
            Self::Wy => "wy",
            Self::Wz => "wz",
            Self::Disparity => "disparity",
            Self::Flow => "flow",
            Self::TurnShare => "turn_share",
        }
    }

    /// Symbol and unit.
    pub(super) fn heading(self) -> &'static str {
        match self {
            Self::Vz | Self::VzAnywhere | Self::VzStill => "VZ (mm)",
            Self::Tx => "tX (mm)",
            Self::Ty => "tY (mm)",
            Self::Tz => "tZ (mm)",
            Self::Wx => "ΩX (°)",
            Self::Wy => "ΩY (°)",
            Self::Wz => "ΩZ (°)",
            Self::Disparity => "disparity (px)",
            Self::Flow => "flow (px)",
            Self::TurnShare => "share of the turn",
        }
    }

    /// Symbol without its unit.
    pub(super) fn symbol(self) -> &'static str {
        self.heading().split(' ').next().unwrap_or_default()
    }
}
