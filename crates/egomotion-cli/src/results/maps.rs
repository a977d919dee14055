//! The maps of a frame pair as files: for programs, for eyes, and as a cloud of points.

use std::path::{Path, PathBuf};

use anyhow::Result;
use egomotion::geometry::{Field, Grid, StereoRig};
use egomotion::metrics::quantile;
use egomotion::motion::TimeToImpact;
use egomotion::observe::DisparityMap;
use egomotion::pipeline::maps::MotionMaps;
use egomotion::pipeline::stereo::DenseResults;
use egomotion_io::ply::{self, CloudPoint};
use egomotion_io::{disparity_png, flo, flow_png, image, npy, pfm, write};
use nalgebra::Vector3;

use crate::args::{CloudArg, MapFormat};
use egomotion_report::chart::colour::{CIVIDIS, ColourMap, DIVERGING, EMBER, Spread, VIRIDIS};

/// Which files are written of each frame pair.
#[derive(Debug, Clone, Default)]
pub struct MapFiles {
    pub formats: Vec<MapFormat>,
    pub cloud: Option<CloudArg>,
}

/// A map and how it is shown.
struct Shown<'a> {
    folder: &'static str,
    plane: &'a Grid<f32>,
    colours: ColourMap,
    spread: Spread,
}

/// The folders of maps.
const FOLDERS: [&str; 8] = [
    "disparity",
    "disparity_sigma",
    "flow",
    "depth_velocity",
    "depth_velocity_sigma",
    "impact",
    "impact_lo",
    "impact_hi",
];

impl MapFiles {
    /// Whether anything is written.
    pub fn any(&self) -> bool {
        !self.formats.is_empty() || self.cloud.is_some()
    }

    /// Make the folders in `out`.
    pub fn folders(&self, out: &Path) -> Result<()> {
        let maps = FOLDERS.into_iter().filter(|_| !self.formats.is_empty());
        for name in maps.chain(self.cloud.map(|_| "cloud")) {
            write::folder(&out.join(name))?;
        }
        Ok(())
    }

    /// Remove what a killed run left half written in those folders.
    pub fn sweep(&self, out: &Path) -> Result<()> {
        for name in FOLDERS.into_iter().chain(["cloud"]) {
            write::sweep(&out.join(name))?;
        }
        Ok(())
    }

    /// Write disparity alone.
    pub fn write_disparity(&self, out: &Path, index: usize, map: &DisparityMap) -> Result<()> {
        for shown in [
            Shown { folder: "disparity", plane: map.shift.grid(), colours: VIRIDIS, spread: Spread::Linear },
            Shown {
                folder: "disparity_sigma",
                plane: map.sigma.grid(),
                colours: CIVIDIS,
                spread: Spread::Logarithmic,
            },
        ] {
            write::folder(&out.join(shown.folder))?;
            let file = |ending: &str| out.join(shown.folder).join(format!("{index:06}.{ending}"));
            for format in &self.formats {
                shown.write(*format, &file)?;
            }
        }
        Ok(())
    }

    /// Write the maps of the frame pair whose earlier frame has `index` in the source.
    pub fn write(&self, out: &Path, index: usize, dense: &DenseResults, rig: &StereoRig) -> Result<()> {
        let motion = &dense.motion;
        let interval = |impact: &TimeToImpact| impact.interval95_s();
        let file = |folder: &str, ending: &str| out.join(folder).join(format!("{index:06}.{ending}"));
        if !self.formats.is_empty() {
            let shown = |folder, plane, colours, spread| Shown { folder, plane, colours, spread };
            for map in [
                shown("disparity", dense.disparity.shift.grid(), VIRIDIS, Spread::Linear),
                shown("disparity_sigma", dense.disparity.sigma.grid(), CIVIDIS, Spread::Logarithmic),
                shown("depth_velocity", motion.depth_velocity.grid(), DIVERGING, Spread::Symmetric),
                shown(
                    "depth_velocity_sigma",
                    motion.depth_velocity_sigma.grid(),
                    CIVIDIS,
                    Spread::Logarithmic,
                ),
                shown("impact", &motion.seconds(TimeToImpact::seconds), EMBER, Spread::Logarithmic),
                shown(
                    "impact_lo",
                    &motion.seconds(|impact| Some(interval(impact)?.0)),
                    EMBER,
                    Spread::Logarithmic,
                ),
                shown(
                    "impact_hi",
                    &motion.seconds(|impact| Some(interval(impact)?.1)),
                    EMBER,
                    Spread::Logarithmic,
                ),
            ] {
                for format in &self.formats {
                    map.write(*format, &|ending| file(map.folder, ending))?;
                }
            }
            for format in &self.formats {
                write_flow(*format, [&dense.flow.u, &dense.flow.v], &|ending| file("flow", ending))?;
            }
        }
        match self.cloud {
            None => Ok(()),
            Some(quantity) => cloud(&file("cloud", "ply"), quantity, dense, rig),
        }
    }
}

impl Shown<'_> {
    fn write(&self, format: MapFormat, file: &dyn Fn(&str) -> PathBuf) -> Result<()> {
        match format {
            MapFormat::Pfm => pfm::write(&file("pfm"), self.plane)?,
            MapFormat::Npy => npy::write(&file("npy"), self.plane)?,
            // KITTI's format is of disparity; nothing else has one of 16 bits.
            MapFormat::Kitti if self.folder == "disparity" => {
                disparity_png::write(&file("png"), &Field::from_grid(self.plane.clone()))?;
            }
            MapFormat::Kitti => {}
            MapFormat::Colour => image::write_rgb(&file("colour.png"), &self.coloured())?,
        }
        Ok(())
    }

    /// Missing pixels are black; a hundredth of the values at either end has the colour of the end.
    fn coloured(&self) -> Grid<[u8; 3]> {
        let scale = Scale::of(self.plane.values(), self.spread);
        let (width, height) = self.plane.size();
        let colour = |u, v| scale.as_ref().and_then(|scale| scale.colour(self.plane.at(u, v), self.colours));
        Grid::from_fn(width, height, |u, v| colour(u, v).unwrap_or_default())
    }
}

/// Colours over the range that holds nearly all values.
struct Scale {
    spread: Spread,
    ends: (f64, f64),
}

impl Scale {
    fn of(values: &[f32], spread: Spread) -> Option<Self> {
        let known = values.iter().map(|&v| spread.coordinate(f64::from(v))).filter(|v| v.is_finite());
        let known: Vec<f64> = known.collect();
        let (low, high) = (quantile(&known, 0.01)?, quantile(&known, 0.99)?);
        let most = low.abs().max(high.abs());
        let ends = if spread == Spread::Symmetric { (-most, most) } else { (low, high) };
        Some(Self { spread, ends })
    }

    /// `None` for what is missing.
    fn colour(&self, value: f32, colours: ColourMap) -> Option<[u8; 3]> {
        let at = Some(self.spread.coordinate(f64::from(value))).filter(|at| !at.is_nan())?;
        let width = (self.ends.1 - self.ends.0).max(f64::MIN_POSITIVE);
        Some(colours.at((at - self.ends.0) / width))
    }
}

/// Flow has the formats of its own.
fn write_flow(format: MapFormat, flow: [&Field; 2], file: &dyn Fn(&str) -> PathBuf) -> Result<()> {
    match format {
        MapFormat::Pfm => flo::write(&file("flo"), &flow.map(Clone::clone))?,
        MapFormat::Npy => npy::write_flow(&file("npy"), flow)?,
        MapFormat::Kitti => flow_png::write(&file("png"), &flow.map(Clone::clone))?,
        MapFormat::Colour => image::write_rgb(&file("colour.png"), &flow_colours(flow))?,
    }
    Ok(())
}

/// Direction as hue, length as saturation up to the 99th percentile; missing is black.
fn flow_colours([u, v]: [&Field; 2]) -> Grid<[u8; 3]> {
    let (width, height) = u.size();
    let at = |x, y| Some((f64::from(u.get(x, y)?), f64::from(v.get(x, y)?)));
    let lengths: Vec<f64> =
        (0..height).flat_map(|y| (0..width).filter_map(move |x| at(x, y))).map(|(a, b)| a.hypot(b)).collect();
    let longest = quantile(&lengths, 0.99).unwrap_or(1.0).max(f64::MIN_POSITIVE);
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

/// Every pixel with depth and an answer as a point, coloured by the quantity.
fn cloud(path: &Path, quantity: CloudArg, dense: &DenseResults, rig: &StereoRig) -> Result<()> {
    let motion = &dense.motion;
    let seconds = motion.seconds(TimeToImpact::seconds);
    let (values, colours, spread) = match quantity {
        CloudArg::Vz => (motion.depth_velocity.grid(), DIVERGING, Spread::Symmetric),
        CloudArg::Impact => (&seconds, EMBER, Spread::Logarithmic),
    };
    let Some(scale) = Scale::of(values.values(), spread) else {
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
            colour: scale.colour(value, colours)?,
            value,
            sigma: sigma(quantity, motion, u, v)?,
        })
    };
    let points: Vec<CloudPoint> =
        (0..height).flat_map(|v| (0..width).filter_map(move |u| point(u, v))).collect();
    Ok(ply::write(path, quantity.name(), &points)?)
}

/// σ of a pixel's quantity; that of time to impact to first order.
fn sigma(quantity: CloudArg, motion: &MotionMaps, u: usize, v: usize) -> Option<f32> {
    match quantity {
        CloudArg::Vz => motion.depth_velocity_sigma.get(u, v),
        CloudArg::Impact => {
            let seconds = motion.impact(u, v)?.seconds()? as f32;
            Some(motion.looming_sigma.get(u, v)? * seconds * seconds)
        }
    }
}
