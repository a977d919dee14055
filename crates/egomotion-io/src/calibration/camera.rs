//! What every format says of one camera and of a pair.

use egomotion::geometry::{Camera, Distortion, RigidMotion, StereoRectification};

use super::document::Entry;
use crate::IoError;

/// Longest baseline that is taken for metres: a longer one is a calibration in millimetres.
const LARGEST_BASELINE_M: f64 = 20.0;

/// One camera as a file describes it: the image size is often not in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraModel {
    /// Focal lengths (fx, fy), in pixels.
    pub focal_px: (f64, f64),
    /// Principal point (cx, cy), in pixels.
    pub centre_px: (f64, f64),
    /// What the lens does.
    pub distortion: Distortion,
    /// (width, height) of the image, in pixels.
    pub size: Option<(usize, usize)>,
}

/// Two cameras as they are, and the pose between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RawPair {
    /// The left camera.
    pub left: CameraModel,
    /// The right camera.
    pub right: CameraModel,
    /// Points of the left camera's frame in the right one's, in metres.
    pub right_from_left: RigidMotion,
    /// Pose of the left camera in the frame of the body that carries it (EuRoC's T_BS), where the file has it.
    pub body_from_left: Option<RigidMotion>,
}

impl RawPair {
    /// The rectification of the pair for images of `size`, which the file's own size must be, if it has one.
    ///
    /// # Errors
    /// What is wrong, without the file's name.
    pub(super) fn rectification(&self, size: (usize, usize)) -> Result<StereoRectification, String> {
        let camera = |model: &CameraModel, side: &str| {
            if let Some((w, h)) = model.size.filter(|own| *own != size) {
                let (wi, hi) = size;
                return Err(format!(
                    "the {side} camera is calibrated for {w}x{h} pixels, the images have {wi}x{hi}"
                ));
            }
            let made = Camera::new(model.focal_px, model.centre_px, model.distortion, size);
            made.map_err(|error| format!("the {side} camera: {error}"))
        };
        let baseline_m = self.right_from_left.translation.norm();
        if baseline_m > LARGEST_BASELINE_M {
            return Err(format!("the cameras are {baseline_m} m apart; is that in millimetres?"));
        }
        let (left, right) = (camera(&self.left, "left")?, camera(&self.right, "right")?);
        StereoRectification::new(left, right, self.right_from_left, size).map_err(|e| e.to_string())
    }
}

impl CameraModel {
    /// fx, fy, cx, cy of a 3×3 camera matrix.
    pub(super) fn of_matrix(
        matrix: &Entry<'_>,
        distortion: Distortion,
        size: Option<(usize, usize)>,
    ) -> Result<Self, IoError> {
        let k = matrix.matrix()?;
        let expected = [(0, 1, 0.0), (1, 0, 0.0), (2, 0, 0.0), (2, 1, 0.0), (2, 2, 1.0)];
        if expected.iter().any(|&(i, j, value)| (k[(i, j)] - value).abs() > 1e-6 * k[(0, 0)].abs()) {
            return Err(matrix.refuse("is no camera matrix without skew", "give fx 0 cx, 0 fy cy, 0 0 1"));
        }
        Ok(Self { focal_px: (k[(0, 0)], k[(1, 1)]), centre_px: (k[(0, 2)], k[(1, 2)]), distortion, size })
    }

    /// Its matrix, row by row.
    pub(super) fn matrix(&self) -> [f64; 9] {
        let ((fx, fy), (cx, cy)) = (self.focal_px, self.centre_px);
        [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    }
}

/// A distortion by any of the names that the formats give it, `None` for the plumb bob or, with eight
/// coefficients, the rational model. Coefficients are in OpenCV's order k1 k2 p1 p2 k3 k4 k5 k6.
pub(super) fn distortion(name: Option<&Entry<'_>>, coefficients: &Entry<'_>) -> Result<Distortion, IoError> {
    let c = coefficients.all_numbers()?;
    let refuse = |wanted: &str| {
        let reason = format_args!("{} distortion coefficients", c.len()).to_string();
        Err(coefficients.refuse(reason, format_args!("give {wanted}")))
    };
    let model = name.map(Entry::text).transpose()?.unwrap_or("plumb_bob").to_lowercase();
    match model.as_str() {
        "none" => Ok(Distortion::None),
        "equidistant" | "equi" | "fisheye" | "kannala_brandt4" => match c[..] {
            [k1, k2, k3, k4] => Ok(Distortion::Equidistant { k: [k1, k2, k3, k4] }),
            _ => refuse("k1 k2 k3 k4"),
        },
        "plumb_bob" | "radial-tangential" | "radtan" | "rational_polynomial" | "pinhole" => match c[..] {
            [] => Ok(Distortion::None),
            _ if c.iter().all(|&c| c == 0.0) => Ok(Distortion::None),
            [k1, k2, p1, p2] => Ok(Distortion::RadialTangential { k: [k1, k2, 0.0], p: [p1, p2] }),
            [k1, k2, p1, p2, k3] => Ok(Distortion::RadialTangential { k: [k1, k2, k3], p: [p1, p2] }),
            [k1, k2, p1, p2, k3, k4, k5, k6, ref rest @ ..] if rest.iter().all(|&c| c == 0.0) => {
                Ok(Distortion::Rational { k: [k1, k2, k3, k4, k5, k6], p: [p1, p2] })
            }
            _ if c.len() > 8 => refuse("no more than 8; thin prisms and tilted sensors are not modelled"),
            _ => refuse("k1 k2 p1 p2, with k3, or with k3 … k6"),
        },
        other => {
            let known = "use radial-tangential (plumb_bob), rational_polynomial or equidistant, or rectify the images";
            let at = name.unwrap_or(coefficients);
            Err(at.refuse(format_args!("the distortion model {other:?} is not known"), known))
        }
    }
}

/// Coefficients in OpenCV's order.
pub(super) fn coefficients(distortion: &Distortion) -> Vec<f64> {
    match *distortion {
        Distortion::None => vec![0.0; 4],
        Distortion::RadialTangential { k: [k1, k2, k3], p: [p1, p2] } => vec![k1, k2, p1, p2, k3],
        Distortion::Rational { k: [k1, k2, k3, k4, k5, k6], p: [p1, p2] } => {
            vec![k1, k2, p1, p2, k3, k4, k5, k6]
        }
        Distortion::Equidistant { k } => k.to_vec(),
    }
}

/// Width and height as whole numbers.
pub(super) fn size(entry: &Entry<'_>) -> Result<(usize, usize), IoError> {
    let [width, height] = entry.numbers()?;
    whole_size(width, height)
        .ok_or_else(|| entry.refuse("is no image size", "give width and height in pixels"))
}

/// Width and height, if they are whole, positive and not beyond any image.
pub(super) fn whole_size(width: f64, height: f64) -> Option<(usize, usize)> {
    let side = |n: f64| ((1.0..1e6).contains(&n) && n.fract() == 0.0).then_some(n as usize);
    Some((side(width)?, side(height)?))
}

/// Numbers with commas between, written so that they read back the same.
pub(super) fn comma_separated(numbers: &[f64]) -> String {
    numbers.iter().map(|n| format!("{n:?}")).collect::<Vec<_>>().join(", ")
}

/// The 16 numbers of a rigid motion.
pub(super) fn row_major_4x4(motion: &RigidMotion) -> [f64; 16] {
    let (r, t) = (&motion.rotation, &motion.translation);
    let mut m = [0.0; 16];
    for i in 0..3 {
        m[4 * i..4 * i + 4].copy_from_slice(&[r[(i, 0)], r[(i, 1)], r[(i, 2)], t[i]]);
    }
    m[15] = 1.0;
    m
}
