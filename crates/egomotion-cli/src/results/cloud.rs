//! A frame pair as a cloud of points, coloured by what moves.

use std::path::Path;

use anyhow::Result;
use egomotion::geometry::StereoRig;
use egomotion::motion::TimeToImpact;
use egomotion::pipeline::DenseResults;
use egomotion::pipeline::MotionMaps;
use egomotion_io::ply::{self, CloudPoint};
use egomotion_report::chart::colour::{ColourScaling, DIVERGING, INFERNO_REVERSED};
use nalgebra::Vector3;

use super::colours::ColourRange;

/// What the colours of a cloud show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CloudQuantity {
    /// Depth velocity.
    Vz,
    /// Time to impact.
    Impact,
}

impl CloudQuantity {
    /// Name of the property in the file.
    fn name(self) -> &'static str {
        match self {
            Self::Vz => "depth_velocity",
            Self::Impact => "impact",
        }
    }
}

/// Every pixel with depth and an answer as a point, coloured by the quantity.
pub fn write_cloud(
    path: &Path,
    quantity: CloudQuantity,
    dense: &DenseResults,
    rig: &StereoRig,
) -> Result<()> {
    let motion = &dense.motion;
    let seconds = motion.seconds(TimeToImpact::seconds);
    let (values, colours, scaling) = match quantity {
        CloudQuantity::Vz => (motion.depth_velocity.grid(), DIVERGING, ColourScaling::Symmetric),
        CloudQuantity::Impact => (&seconds, INFERNO_REVERSED, ColourScaling::Logarithmic),
    };
    let Some(range) = ColourRange::of(values.values(), scaling) else {
        return Ok(ply::write(path, quantity.name(), &[])?);
    };
    let (width, height) = values.size();
    let point = |u: usize, v: usize| {
        let shift = f64::from(dense.disparity.shift.get(u, v)?);
        let (x, y) = rig.image_from_pixel(u as f64, v as f64);
        let position = rig.point(&Vector3::new(x, y, rig.disparity_from_shift(shift)))?;
        let value = values.at(u, v);
        Some(CloudPoint {
            position_m: [position.x as f32, position.y as f32, position.z as f32],
            colour: range.colour(value, colours)?,
            value,
            sigma: sigma(quantity, motion, u, v)?,
        })
    };
    let points: Vec<CloudPoint> =
        (0..height).flat_map(|v| (0..width).filter_map(move |u| point(u, v))).collect();
    Ok(ply::write(path, quantity.name(), &points)?)
}

/// σ of a pixel's quantity; that of time to impact to first order.
fn sigma(quantity: CloudQuantity, motion: &MotionMaps, u: usize, v: usize) -> Option<f32> {
    match quantity {
        CloudQuantity::Vz => motion.depth_velocity_sigma.get(u, v),
        CloudQuantity::Impact => {
            let seconds = motion.impact(u, v)?.seconds()? as f32;
            Some(motion.looming_sigma.get(u, v)? * seconds * seconds)
        }
    }
}
