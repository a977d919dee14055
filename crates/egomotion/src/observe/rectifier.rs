//! Raw images turned into rectified ones, through maps that are computed once.

use rayon::prelude::*;

use super::pyramid::fill_rows;
use super::spline;
use crate::geometry::{Grid, Image, StereoRectification};
use crate::simd::vectorised;
use nalgebra::Vector2;

/// How far a raw place may lie beyond the centres of the border pixels and still belong to them, in pixels.
const HALF_PIXEL: f64 = 0.5;

/// Turns the raw images of a pair into rectified ones.
///
/// Grey levels between pixels are those of a cubic spline: a bilinear mean would take up to half of the
/// contrast of fine texture, more where it falls between pixels, which later shifts matches.
#[derive(Debug, Clone, PartialEq)]
pub struct Rectifier {
    left: RectificationMap,
    right: RectificationMap,
}

/// Where each pixel of one rectified image comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct RectificationMap {
    /// (u, v) in the raw image, kept within it; NaN where the lens model ends.
    places: Grid<[f32; 2]>,
    unseen: Grid<bool>,
    raw: (usize, usize),
}

impl Rectifier {
    /// Compute the maps of both images.
    pub fn new(pair: &StereoRectification) -> Self {
        let size = (pair.rig().width_px, pair.rig().height_px);
        let map = |raw, from: &(dyn Fn(f64, f64) -> Option<Vector2<f64>> + Sync)| {
            RectificationMap::new(size, raw, from)
        };
        Self {
            left: map(pair.left().size(), &|u, v| pair.raw_left(u, v)),
            right: map(pair.right().size(), &|u, v| pair.raw_right(u, v)),
        }
    }

    /// The map of the left image.
    pub fn left(&self) -> &RectificationMap {
        &self.left
    }

    /// The map of the right image.
    pub fn right(&self) -> &RectificationMap {
        &self.right
    }
}

impl RectificationMap {
    /// The map into images of `size` (width, height), from ones of size `raw`, where `from` tells the raw
    /// place of a pixel.
    fn new(
        size: (usize, usize),
        raw: (usize, usize),
        from: &(dyn Fn(f64, f64) -> Option<Vector2<f64>> + Sync),
    ) -> Self {
        let (width, height) = size;
        let last = Vector2::new((raw.0.max(1) - 1) as f64, (raw.1.max(1) - 1) as f64);
        let mut places = Grid::filled(width, height, [f32::NAN; 2]);
        let mut unseen = Grid::filled(width, height, true);
        let rows = places.values_mut().par_chunks_mut(width.max(1));
        let rows = rows.zip(unseen.values_mut().par_chunks_mut(width.max(1))).enumerate();
        rows.for_each(|(v, (places, unseen))| {
            for (u, (place, unseen)) in places.iter_mut().zip(unseen).enumerate() {
                if let Some(found) = from(u as f64, v as f64) {
                    let within = found.sup(&Vector2::zeros()).inf(&last);
                    *unseen = (found - within).amax() > HALF_PIXEL;
                    *place = [within.x as f32, within.y as f32];
                }
            }
        });
        Self { places, unseen, raw }
    }

    /// Size (width, height) of the raw images.
    pub fn raw_size(&self) -> (usize, usize) {
        self.raw
    }

    /// Pixels that the raw image does not show, where `true`.
    pub fn unseen(&self) -> &Grid<bool> {
        &self.unseen
    }

    /// Where the raw image shows pixel (u, v), which must lie inside; kept within the image. `None` where the
    /// lens model ends.
    pub fn place(&self, u: usize, v: usize) -> Option<[f32; 2]> {
        Some(self.places.at(u, v)).filter(|[x, _]| !x.is_nan())
    }

    /// Rectify an image into `out`, whose memory is used again; `false`, and nothing done, if `raw` has not
    /// the size of the camera's images.
    ///
    /// What the raw image does not show repeats its border, or is black where the lens model ends.
    pub fn warp(&self, raw: &Image, out: &mut Image) -> bool {
        if raw.size() != self.raw {
            return false;
        }
        let coefficients = spline::coefficients(raw);
        fill_rows(
            out,
            self.places.size(),
            || (),
            |(), v, out| warp_row(&coefficients, self.places.row(v), out),
        );
        true
    }
}

vectorised! {
/// The grey levels at `places` of the image whose coefficients these are.
warp_row(coefficients: &Image, places: &[[f32; 2]], out: &mut [f32]) {
    for (value, &[x, y]) in out.iter_mut().zip(places) {
        let inside = inner(coefficients, x, y);
        *value = inside.or_else(|| spline::sample(coefficients, x, y)).unwrap_or(0.0);
    }
}
}

/// The same as [`spline::sample`] away from the border, four columns at a time.
#[inline(always)]
fn inner(coefficients: &Image, x: f32, y: f32) -> Option<f32> {
    if !(x >= 1.0 && y >= 1.0) {
        return None;
    }
    let (u0, v0) = (x as usize, y as usize);
    let width = coefficients.width();
    if u0 + 3 > width {
        return None;
    }
    let (wu, wv) = (spline::weights(x - u0 as f32), spline::weights(y - v0 as f32));
    let mut columns = [0.0_f32; 4];
    let mut rest = coefficients.values().get((v0 - 1) * width + u0 - 1..)?;
    for (k, w) in wv.into_iter().enumerate() {
        for (sum, c) in columns.iter_mut().zip(rest.first_chunk::<4>()?) {
            *sum += w * c;
        }
        if k < 3 {
            rest = rest.get(width..)?;
        }
    }
    Some(columns[0] * wu[0] + columns[1] * wu[1] + columns[2] * wu[2] + columns[3] * wu[3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Camera, Distortion, Twist};
    use nalgebra::Vector3;

    fn pair(distortion: Distortion, f: f64) -> StereoRectification {
        let camera = Camera::new((f, f), (159.0, 121.0), distortion, (320, 240)).unwrap();
        let turn = Twist { t: Vector3::new(-0.1, 0.001, 0.0), omega: Vector3::new(0.01, -0.02, 0.005) };
        StereoRectification::new(camera, camera, turn.exp(), (320, 240)).unwrap()
    }

    #[test]
    fn a_warped_image_is_the_scene_seen_by_the_rectified_camera() {
        // Grey levels as a function of direction, five pixels a period at the finest.
        let grey = |d: &Vector3<f64>| {
            let (x, y) = (240.0 * d.x / d.z, 240.0 * d.y / d.z);
            120.0 + 50.0 * (1.2 * x).sin() * (0.3 * y).cos() + 50.0 * (0.9 * y + 0.4 * x).sin()
        };
        for lens in [
            Distortion::RadialTangential { k: [-0.28, 0.07, 0.0], p: [1e-3, -1e-3] },
            Distortion::Equidistant { k: [0.003, 0.001, -0.002, 0.0] },
        ] {
            let pair = pair(lens, 240.0);
            let rectifier = Rectifier::new(&pair);
            let raw = Grid::from_fn(320, 240, |u, v| {
                let pixel = Vector2::new(u as f64, v as f64);
                grey(&pair.left().direction(&pixel).unwrap()) as f32
            });
            let mut out = Grid::filled(0, 0, 0.0);
            assert!(rectifier.left().warp(&raw, &mut out));
            let rig = pair.rig();
            let mut square = 0.0;
            for v in 10..230 {
                for u in 10..310 {
                    let (x, y) = rig.image_from_pixel(u as f64, v as f64);
                    let ray = pair.rectified_left_from_left().tr_mul(&Vector3::new(x, y, rig.focal_px));
                    square += (f64::from(out.at(u, v)) - grey(&ray)).powi(2);
                }
            }
            let error = (square / (220.0 * 300.0)).sqrt();
            // The signal's standard deviation is 43; bilinear interpolation errs by 5.
            assert!(error < 0.5, "{lens:?}: {error}");
        }
    }

    #[test]
    fn what_no_image_shows_is_told() {
        let lens = Distortion::RadialTangential { k: [-0.28, 0.07, 0.0], p: [0.0; 2] };
        let rectifier = Rectifier::new(&pair(lens, 240.0));
        let none = |map: &RectificationMap| map.unseen().values().iter().all(|&unseen| !unseen);
        assert!(none(rectifier.left()) && none(rectifier.right()));
        // A map that reaches past its image on the left, and into nothing on the right.
        let from = |u: f64, v: f64| (u < 41.0).then(|| Vector2::new(u - 1.6, v));
        let map = RectificationMap::new((42, 30), (40, 30), &from);
        let unseen: Vec<usize> = (0..42).filter(|&u| map.unseen().at(u, 3)).collect();
        assert_eq!(unseen, [0, 1, 41]);
        assert_eq!((map.place(0, 1), map.place(41, 1)), (Some([0.0, 1.0]), None));
        let mut out = Grid::filled(42, 30, 1.0);
        assert!(map.warp(&Grid::filled(40, 30, 50.0), &mut out));
        assert!(out.row(7)[..41].iter().all(|v| (v - 50.0).abs() < 1e-3) && out.at(41, 7) == 0.0);
        assert!(!map.warp(&Grid::filled(5, 2, 50.0), &mut out));
    }
}
