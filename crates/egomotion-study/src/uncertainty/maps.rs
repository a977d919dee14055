//! Figures 4 and 5: the synthetic world, and the variance of VZ over its image.

use super::coefficients::Variances;
use super::pixel::{ExactPixel, PixelNoise};
use crate::synthetic::{EDGE_RAYS, FrameTime, SyntheticWorld};
use crate::{Content, Figure, Panel};
use egomotion::geometry::rounding_variance;
use egomotion::geometry::{Field, Grid, Twist};
use egomotion::pipeline::Approach;
use egomotion::sim::{Sequence, View, reference_pose};

/// Largest variance that Figure 5 shows, in mm²: where the paper clips it.
const LARGEST_SHOWN_MM2: f32 = 3000.0;

/// Figure 4: left and right image and disparity at the sequence's first pose.
pub(super) fn figure_4(sequence: &Sequence) -> Figure {
    let phi = sequence.phi_cyclopean(0).unwrap_or(Twist::zero());
    let images = View::new(&sequence.scene, &sequence.rig, reference_pose(&phi, 0)).render(EDGE_RAYS);
    let world = SyntheticWorld::new(&sequence.scene, &sequence.rig, &phi, 0, 1.0);
    let (width, height) = (sequence.rig.width_px, sequence.rig.height_px);
    let disparity = world.disparity(FrameTime::Now);
    let field = Field::from_grid(Grid::from_fn(width, height, |u, v| {
        disparity.get(v * width + u).map_or(f32::NAN, |&d| d as f32)
    }));
    let seen = || disparity.iter().copied().filter(|d| d.is_finite());
    let range = (seen().fold(f64::MAX, f64::min) as f32, seen().fold(0.0, f64::max) as f32);
    let map = Content::Map { field, name: "disparity (px)".to_owned(), range };
    Figure {
        id: "figure-04".to_owned(),
        title: "Figure 4. Intensity images and disparity field of the synthetic world".to_owned(),
        caption: "Ground, front wall, side walls, a sphere and a box; b = 130 mm, f = 5 mm, pixels of \
                  0.012 mm. The texture is ours: the paper gives none."
            .to_owned(),
        columns: 3,
        panels: vec![
            Panel { title: "left image".to_owned(), content: Content::Picture(images.left) },
            Panel { title: "right image".to_owned(), content: Content::Picture(images.right) },
            Panel { title: "disparity".to_owned(), content: map },
        ],
    }
}

/// Figure 5: variance of VZ at every usable pixel with the rounding error of 1/4 px on disparity and flow.
pub(super) fn figure_5(sequence: &Sequence) -> Figure {
    let phi = sequence.phi_cyclopean(0).unwrap_or(Twist::zero());
    let world = SyntheticWorld::new(&sequence.scene, &sequence.rig, &phi, 0, 1.0);
    let sigma = rounding_variance(0.25).sqrt();
    let noise = PixelNoise { disparity_px: sigma, flow_px: sigma };
    let bf = world.rig.depth_disparity_product();
    let mut fields = [(); 6].map(|()| Grid::filled(world.rig.width_px, world.rig.height_px, f32::NAN));
    for pixel in world.usable_in(Approach::Differential) {
        let Some(at) = ExactPixel::at(&world, pixel.index) else { continue };
        let Variances { printed, corrected } = Variances::of(&at, &noise, bf);
        let mm2 = [printed[0], corrected[0], corrected[1], corrected[2], corrected[3]].map(|v| 1e6 * v);
        let ratio = corrected[0] / corrected[1];
        for (field, value) in fields.iter_mut().zip(mm2.into_iter().chain([ratio])) {
            field.set(at.pixel.0, at.pixel.1, value as f32);
        }
    }
    let titles = [
        "(39), DCCE DIFF, as printed",
        "(39c), DCCE DIFF",
        "(44), DV DIFF",
        "(47c), DCCE DISC",
        "(50), DV DISC",
        "(39c)/(44): DCCE against DV",
    ];
    let panel = |(title, field): (&str, Grid<f32>)| {
        let ratio = title.contains("against");
        let name = if ratio { "ratio of variances" } else { "variance of VZ (mm²)" };
        let range = if ratio { (0.0, 4.0) } else { (0.0, LARGEST_SHOWN_MM2) };
        let content = Content::Map { field: Field::from_grid(field), name: name.to_owned(), range };
        Panel { title: title.to_owned(), content }
    };
    Figure {
        id: "figure-05".to_owned(),
        title: "Figure 5. Variance of VZ over the image".to_owned(),
        caption: "Sequence C, one step; variance (1/4)²/12 = 0.0052 px² on disparity and flow, clipped at \
                  3000 mm² as in the paper, which shows (39) only. Pixels beside an edge and those that one \
                  camera does not see have no value. The farther a point, the larger its variance; the \
                  ratio DCCE/DV follows (1 + |v|²)/4, above 1 where the image moves faster than √3 px."
            .to_owned(),
        columns: 3,
        panels: titles.into_iter().zip(fields).map(panel).collect(),
    }
}
