//! Images of a camera with a lens warped to those of a pinhole with the same intrinsics: a depth camera has one image,
//! and no pair to be rectified.

use egomotion::geometry::{Camera, Field, Grid, Image};
use nalgebra::Vector3;

/// Where the camera shows what the pinhole shows at pixel (u, v); `None` where the lens model does not hold.
fn shown(camera: &Camera, u: usize, v: usize) -> Option<(f64, f64)> {
    let ((fx, fy), (cx, cy)) = (camera.focal_px(), camera.centre_px());
    let place = camera.project(&Vector3::new((u as f64 - cx) / fx, (v as f64 - cy) / fy, 1.0))?;
    Some((place.x, place.y))
}

/// The pinhole's image, bicubic; beyond the border the border is repeated, and what the lens model does not reach is black.
pub(crate) fn image(camera: &Camera, image: &Image) -> Image {
    let (width, height) = image.size();
    let (last_u, last_v) = (width.saturating_sub(1) as f64, height.saturating_sub(1) as f64);
    let level = |(u, v): (f64, f64)| cubic(image, u.clamp(0.0, last_u), v.clamp(0.0, last_v));
    Grid::from_fn(width, height, |u, v| shown(camera, u, v).map_or(0.0, level))
}

/// The pinhole's depth: that of the nearest pixel, for nothing lies between two surfaces; missing beyond the border.
pub(crate) fn depth(camera: &Camera, depth: &Field) -> Field {
    let (width, height) = depth.size();
    let inside = |c: f64, n: usize| c > -0.5 && c < n as f64 - 0.5;
    let nearest = |(u, v): (f64, f64)| {
        (inside(u, width) && inside(v, height)).then(|| depth.get(u.round() as usize, v.round() as usize))?
    };
    let at = |u, v| shown(camera, u, v).and_then(nearest).unwrap_or(f32::NAN);
    Field::from_grid(Grid::from_fn(width, height, at))
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
    use egomotion::geometry::Distortion;

    use super::*;

    #[test]
    fn no_distortion_changes_nothing_and_a_shift_is_a_shift() {
        let camera = Camera::new((50.0, 50.0), (9.5, 7.5), Distortion::None, (20, 16)).unwrap();
        let given = Grid::from_fn(20, 16, |u, v| (u * u + 3 * v) as f32);
        assert!(
            image(&camera, &given).values().iter().zip(given.values()).all(|(a, b)| (a - b).abs() < 1e-3)
        );
        // A cubic reproduces a parabola between its pixels.
        assert!((cubic(&given, 4.25, 6.5) - (4.25 * 4.25 + 19.5)).abs() < 1e-4);
    }

    /// One point by OpenCV's projectPoints with the camera of freiburg1.
    #[test]
    fn a_point_of_freiburg1_lies_where_opencv_has_it() {
        let lens = Distortion::RadialTangential { k: [0.2624, -0.9531, 1.1633], p: [-0.0054, 0.0026] };
        let camera = Camera::new((517.3, 516.5), (318.6, 255.3), lens, (640, 480)).unwrap();
        let (u, v) = shown(&camera, 40, 30).unwrap();
        assert!((u - OPENCV[0]).abs() < 1e-6 && (v - OPENCV[1]).abs() < 1e-6, "{u} {v}");
        // The model holds all over the image.
        assert!((0..480).all(|v| (0..640).all(|u| shown(&camera, u, v).is_some())));
    }

    const OPENCV: [f64; 2] = [30.3462820, 20.3310511];
}
