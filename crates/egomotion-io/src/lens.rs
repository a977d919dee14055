//! Images of a distorting lens warped to those of a pinhole with the same intrinsics.
//!
//! To be replaced by the library's camera model where that has the same distortion; the depth camera needs one image
//! warped and no pair rectified.

use egomotion::geometry::{Field, Grid, Image, StereoRig};

/// Radial-tangential distortion (plumb bob): k1, k2, p1, p2, k3, of the normalised coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// k1, k2, k3 of the radial part.
    pub radial: [f64; 3],
    /// p1, p2 of the tangential part.
    pub tangential: [f64; 2],
}

impl Lens {
    /// Where the lens shows what a pinhole with the rig's left intrinsics shows at pixel (u, v).
    pub fn distorted(&self, rig: &StereoRig, u: f64, v: f64) -> (f64, f64) {
        let (x, y) = ((u - rig.cx_px) / rig.focal_px, (v - rig.cy_px) / rig.focal_y_px);
        let ([k1, k2, k3], [p1, p2]) = (self.radial, self.tangential);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
        let yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
        (rig.focal_px * xd + rig.cx_px, rig.focal_y_px * yd + rig.cy_px)
    }

    /// The pinhole's image, bicubic; beyond the border the border is repeated.
    pub fn image(&self, rig: &StereoRig, image: &Image) -> Image {
        let (width, height) = image.size();
        if width == 0 || height == 0 {
            return image.clone();
        }
        Grid::from_fn(width, height, |u, v| {
            let (ud, vd) = self.distorted(rig, u as f64, v as f64);
            cubic(image, ud.clamp(0.0, width as f64 - 1.0), vd.clamp(0.0, height as f64 - 1.0))
        })
    }

    /// The pinhole's depth: that of the nearest pixel, for nothing lies between two surfaces; missing beyond the
    /// border.
    pub fn depth(&self, rig: &StereoRig, depth: &Field) -> Field {
        let (width, height) = depth.size();
        Field::from_grid(Grid::from_fn(width, height, |u, v| {
            let (ud, vd) = self.distorted(rig, u as f64, v as f64);
            let inside = |c: f64, n: usize| c > -0.5 && c < n as f64 - 0.5;
            let nearest = (inside(ud, width) && inside(vd, height))
                .then(|| depth.get(ud.round() as usize, vd.round() as usize));
            nearest.flatten().unwrap_or(f32::NAN)
        }))
    }
}

/// Catmull–Rom interpolation at a place inside.
fn cubic(image: &Image, u: f64, v: f64) -> f32 {
    let (width, height) = image.size();
    let weights = |t: f64| {
        let (t2, t3) = (t * t, t * t * t);
        [
            0.5 * (-t + 2.0 * t2 - t3),
            0.5 * (2.0 - 5.0 * t2 + 3.0 * t3),
            0.5 * (t + 4.0 * t2 - 3.0 * t3),
            0.5 * (t3 - t2),
        ]
    };
    let place = |c: f64, k: usize, n: usize| ((c.floor() as usize + k).saturating_sub(1)).min(n - 1);
    let (across, down) = (weights(u - u.floor()), weights(v - v.floor()));
    let row = |k: usize| {
        let row = image.row(place(v, k, height));
        (0..4).map(|i| across[i] * f64::from(row[place(u, i, width)])).sum::<f64>()
    };
    (0..4).map(|k| down[k] * row(k)).sum::<f64>() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_distortion_changes_nothing_and_a_shift_is_a_shift() {
        let rig = StereoRig::new(50.0, (9.5, 7.5), 0.1, (20, 16)).unwrap();
        let image = Grid::from_fn(20, 16, |u, v| (u * u + 3 * v) as f32);
        let none = Lens { radial: [0.0; 3], tangential: [0.0; 2] };
        assert!(
            none.image(&rig, &image).values().iter().zip(image.values()).all(|(a, b)| (a - b).abs() < 1e-3)
        );
        // A cubic reproduces a parabola between its pixels.
        assert!((cubic(&image, 4.25, 6.5) - (4.25 * 4.25 + 19.5)).abs() < 1e-4);
    }

    /// One point by OpenCV's projectPoints with the camera of freiburg1.
    #[test]
    fn a_point_of_freiburg1_lies_where_opencv_has_it() {
        let rig = StereoRig::new(517.3, (318.6, 255.3), 0.1, (640, 480)).unwrap();
        let rig = StereoRig { focal_y_px: 516.5, ..rig };
        let lens = Lens { radial: [0.2624, -0.9531, 1.1633], tangential: [-0.0054, 0.0026] };
        let (u, v) = lens.distorted(&rig, OPENCV[0], OPENCV[1]);
        assert!((u - OPENCV[2]).abs() < 1e-6 && (v - OPENCV[3]).abs() < 1e-6, "{u} {v}");
    }

    const OPENCV: [f64; 4] = [40.0, 30.0, 30.3462820, 20.3310511];
}
