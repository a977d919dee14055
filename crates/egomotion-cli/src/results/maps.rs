//! The maps of a frame pair as files: for programs, to look at, and as a cloud of points.

use std::path::{Path, PathBuf};

use anyhow::Result;
use egomotion::geometry::{Field, Grid, StereoRig};
use egomotion::motion::TimeToImpact;
use egomotion::observe::DisparityMap;
use egomotion::pipeline::DenseResults;
use egomotion_io::{disparity_png, flo, flow_png, image, npy, pfm, write};
use egomotion_report::chart::colour::{
    CIVIDIS, ColourMap, ColourScaling, DIVERGING, INFERNO_REVERSED, VIRIDIS,
};

pub use super::cloud::CloudQuantity;
use super::cloud::write_cloud;
use super::colours::{ColourRange, flow_colours};

/// A format of maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapFormat {
    /// PFM, flow as .flo.
    Pfm,
    /// NumPy arrays of single precision.
    Npy,
    /// KITTI's 16-bit PNG, of disparity and flow alone.
    Kitti,
    /// PNG in colours, to look at.
    Colour,
}

/// Which files are written of each frame pair.
#[derive(Debug, Clone, Default)]
pub struct MapFiles {
    pub formats: Vec<MapFormat>,
    pub cloud: Option<CloudQuantity>,
}

/// The folders of maps.
const MAP_FOLDERS: [&str; 8] = [
    "disparity",
    "disparity_sigma",
    "flow",
    "depth_velocity",
    "depth_velocity_sigma",
    "impact",
    "impact_lo",
    "impact_hi",
];

/// The folder of clouds.
const CLOUD_FOLDER: &str = "cloud";

impl MapFiles {
    /// Whether anything is written.
    pub fn any(&self) -> bool {
        !self.formats.is_empty() || self.cloud.is_some()
    }

    /// Make the folders in `out`.
    pub fn folders(&self, out: &Path) -> Result<()> {
        let maps = MAP_FOLDERS.into_iter().filter(|_| !self.formats.is_empty());
        for name in maps.chain(self.cloud.map(|_| CLOUD_FOLDER)) {
            write::folder(&out.join(name))?;
        }
        Ok(())
    }

    /// Remove what a killed run left half written in those folders.
    pub fn sweep(&self, out: &Path) -> Result<()> {
        for name in MAP_FOLDERS.into_iter().chain([CLOUD_FOLDER]) {
            write::sweep(&out.join(name))?;
        }
        Ok(())
    }

    /// Write the maps of the frame pair whose earlier frame has `index` in the source.
    pub fn write(&self, out: &Path, index: usize, dense: &DenseResults, rig: &StereoRig) -> Result<()> {
        if !self.formats.is_empty() {
            let impact = ImpactPlanes::of(dense);
            let disparity = disparity_maps(&dense.disparity);
            for map in disparity.into_iter().chain(motion_maps(dense, &impact)) {
                map.write_all(&self.formats, out, index)?;
            }
            for format in &self.formats {
                write_flow(*format, [&dense.flow.u, &dense.flow.v], &|ending| {
                    map_file(out, "flow", index, ending)
                })?;
            }
        }
        match self.cloud {
            None => Ok(()),
            Some(quantity) => write_cloud(&map_file(out, CLOUD_FOLDER, index, "ply"), quantity, dense, rig),
        }
    }
}

/// Write the disparity of a pair and its σ, with the folders that they need.
pub fn write_disparity(formats: &[MapFormat], out: &Path, index: usize, map: &DisparityMap) -> Result<()> {
    for map in disparity_maps(map) {
        write::folder(&out.join(map.folder))?;
        map.write_all(formats, out, index)?;
    }
    Ok(())
}

fn map_file(out: &Path, folder: &str, index: usize, ending: &str) -> PathBuf {
    out.join(folder).join(format!("{index:06}.{ending}"))
}

/// A map and how it is coloured.
struct ShownMap<'a> {
    folder: &'static str,
    plane: &'a Grid<f32>,
    colours: ColourMap,
    scaling: ColourScaling,
}

fn shown<'a>(
    folder: &'static str,
    plane: &'a Grid<f32>,
    colours: ColourMap,
    scaling: ColourScaling,
) -> ShownMap<'a> {
    ShownMap { folder, plane, colours, scaling }
}

fn disparity_maps(map: &DisparityMap) -> [ShownMap<'_>; 2] {
    [
        shown("disparity", map.shift.grid(), VIRIDIS, ColourScaling::Linear),
        shown("disparity_sigma", map.sigma.grid(), CIVIDIS, ColourScaling::Logarithmic),
    ]
}

/// Time to impact of every pixel with both ends of its 95 % interval, in seconds.
struct ImpactPlanes {
    seconds: Grid<f32>,
    low: Grid<f32>,
    high: Grid<f32>,
}

impl ImpactPlanes {
    fn of(dense: &DenseResults) -> Self {
        let motion = &dense.motion;
        let interval = |impact: &TimeToImpact| impact.interval95_s();
        Self {
            seconds: motion.seconds(TimeToImpact::seconds),
            low: motion.seconds(|impact| Some(interval(impact)?.0)),
            high: motion.seconds(|impact| Some(interval(impact)?.1)),
        }
    }
}

fn motion_maps<'a>(dense: &'a DenseResults, impact: &'a ImpactPlanes) -> [ShownMap<'a>; 5] {
    let motion = &dense.motion;
    let sigma = motion.depth_velocity_sigma.grid();
    [
        shown("depth_velocity", motion.depth_velocity.grid(), DIVERGING, ColourScaling::Symmetric),
        shown("depth_velocity_sigma", sigma, CIVIDIS, ColourScaling::Logarithmic),
        shown("impact", &impact.seconds, INFERNO_REVERSED, ColourScaling::Logarithmic),
        shown("impact_lo", &impact.low, INFERNO_REVERSED, ColourScaling::Logarithmic),
        shown("impact_hi", &impact.high, INFERNO_REVERSED, ColourScaling::Logarithmic),
    ]
}

impl ShownMap<'_> {
    fn write_all(&self, formats: &[MapFormat], out: &Path, index: usize) -> Result<()> {
        formats
            .iter()
            .try_for_each(|format| self.write(*format, &|ending| map_file(out, self.folder, index, ending)))
    }

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
        let range = ColourRange::of(self.plane.values(), self.scaling);
        let (width, height) = self.plane.size();
        let colour = |u, v| range.as_ref().and_then(|range| range.colour(self.plane.at(u, v), self.colours));
        Grid::from_fn(width, height, |u, v| colour(u, v).unwrap_or_default())
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
