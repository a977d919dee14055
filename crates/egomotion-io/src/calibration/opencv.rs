//! OpenCV's stereo calibration, as its samples write it with `FileStorage`: M1 D1 M2 D2 R T, in YAML or XML.
//!
//! The samples write two files, `intrinsics.yml` and `extrinsics.yml`; either name finds the other.

use std::path::Path;

use egomotion::geometry::Distortion;
use nalgebra::Vector3;

use super::camera::{CameraModel, RawPair, coefficients, comma_separated, distortion, whole_size};
use super::document::{Document, Entry};
use crate::{IoError, read, write};

/// Keys of the left and of the right camera's matrix, in the order in which they are looked for.
const MATRIX_KEYS: [&[&str]; 2] = [
    &[
        "M1",
        "K1",
        "cameraMatrix1",
        "camera_matrix_1",
        "camera_matrix1",
        "camera_matrix_left",
        "left_camera_matrix",
    ],
    &[
        "M2",
        "K2",
        "cameraMatrix2",
        "camera_matrix_2",
        "camera_matrix2",
        "camera_matrix_right",
        "right_camera_matrix",
    ],
];
/// Keys of the left and of the right camera's distortion coefficients.
const DISTORTION_KEYS: [&[&str]; 2] = [
    &["D1", "distCoeffs1", "dist_coeffs_1", "dist_coeffs1", "distortion_coefficients_1", "dist_coeffs_left"],
    &["D2", "distCoeffs2", "dist_coeffs_2", "dist_coeffs2", "distortion_coefficients_2", "dist_coeffs_right"],
];
/// Keys of the rotation from the left camera's frame to the right one's.
const ROTATION_KEYS: &[&str] = &["R", "rotation_matrix"];
/// Keys of the translation that goes with it.
const TRANSLATION_KEYS: &[&str] = &["T", "t", "translation_vector"];
/// Keys of the distortion model's name.
const MODEL_KEYS: &[&str] = &["distortion_model", "camera_model"];

/// The pair of a file, or of its sister (see the module).
///
/// # Errors
/// The file cannot be read, or names the line and key that is missing or wrong.
pub fn read(path: &Path) -> Result<RawPair, IoError> {
    parse(&read::text(path)?, path)
}

/// The same from a text, YAML or XML; `path` names it in errors and finds the sister.
///
/// # Errors
/// Names the line and key that is missing or wrong.
pub fn parse(text: &str, path: &Path) -> Result<RawPair, IoError> {
    pair(&document(text, path)?.root(path), path)
}

fn document(text: &str, path: &Path) -> Result<Document, IoError> {
    if text.trim_start().starts_with('<') { Document::xml(text, path) } else { Document::yaml(text, path) }
}

/// Whether a file has what only this format names so.
pub(super) fn recognise(root: &Entry<'_>) -> bool {
    let root = &inner(root);
    root.find(MATRIX_KEYS[0]).is_some()
        || (root.find(ROTATION_KEYS).is_some() && root.find(TRANSLATION_KEYS).is_some())
}

/// XML files have a root element of their own.
fn inner<'a>(root: &Entry<'a>) -> Entry<'a> {
    root.find(&["opencv_storage"]).unwrap_or_else(|| root.clone())
}

pub(super) fn pair(root: &Entry<'_>, path: &Path) -> Result<RawPair, IoError> {
    let root = inner(root);
    let sister = |one: &str, other: &str| {
        let name = path.file_name()?.to_str()?.replace(one, other);
        Some(path.with_file_name(name)).filter(|sister| sister != path && sister.is_file())
    };
    let whole_file = (root.find(MATRIX_KEYS[0]).is_some(), root.find(ROTATION_KEYS).is_some());
    let other = match whole_file {
        (true, false) => sister("intrinsic", "extrinsic"),
        (false, true) => sister("extrinsic", "intrinsic"),
        _ => None,
    };
    let Some(other) = other else { return pair_of(&root, &root) };
    let other_document = document(&read::text(&other)?, &other)?;
    let other_root = inner(&other_document.root(&other));
    if whole_file.0 { pair_of(&root, &other_root) } else { pair_of(&other_root, &root) }
}

fn pair_of(intrinsics: &Entry<'_>, extrinsics: &Entry<'_>) -> Result<RawPair, IoError> {
    let size = match intrinsics.find(&["image_size", "imageSize", "size"]) {
        Some(entry) => Some(super::camera::size(&entry)?),
        None => {
            match (intrinsics.find(&["image_width", "width"]), intrinsics.find(&["image_height", "height"])) {
                (Some(w), Some(h)) => {
                    let found = whole_size(w.number()?, h.number()?);
                    Some(found.ok_or_else(|| w.refuse("is no image size", "give whole numbers of pixels"))?)
                }
                _ => None,
            }
        }
    };
    let camera = |side: usize| {
        let matrix = intrinsics.get(MATRIX_KEYS[side])?;
        let lens = intrinsics.get(DISTORTION_KEYS[side])?;
        // Without the name of a model four or five coefficients are the plumb bob, eight the rational one.
        CameraModel::of_matrix(&matrix, distortion(intrinsics.find(MODEL_KEYS).as_ref(), &lens)?, size)
    };
    let rotation = extrinsics.get(ROTATION_KEYS)?;
    let turn = match rotation.all_numbers()?[..] {
        // A rotation vector, as some write it.
        [x, y, z] => {
            let omega = Vector3::new(x, y, z);
            egomotion::geometry::Twist { t: Vector3::zeros(), omega }.exp().rotation
        }
        _ => rotation.matrix()?,
    };
    let translation = Vector3::from(extrinsics.get(TRANSLATION_KEYS)?.numbers::<3>()?);
    let right_from_left = rotation.rigid(turn, translation)?;
    Ok(RawPair { left: camera(0)?, right: camera(1)?, right_from_left, body_from_left: None })
}

/// The entries of a file: name, rows, columns, numbers.
fn entries(pair: &RawPair) -> Vec<(&'static str, usize, usize, Vec<f64>)> {
    let pose = &pair.right_from_left;
    let lens = |name, camera: &CameraModel| {
        let coefficients = coefficients(&camera.distortion);
        (name, 1, coefficients.len(), coefficients)
    };
    vec![
        ("M1", 3, 3, pair.left.matrix().to_vec()),
        lens("D1", &pair.left),
        ("M2", 3, 3, pair.right.matrix().to_vec()),
        lens("D2", &pair.right),
        ("R", 3, 3, pose.rotation.transpose().as_slice().to_vec()),
        ("T", 3, 1, pose.translation.as_slice().to_vec()),
    ]
}

/// The common name of both distortions.
fn model(path: &Path, pair: &RawPair) -> Result<&'static str, IoError> {
    let name = |camera: &CameraModel| match camera.distortion {
        Distortion::Equidistant { .. } => "fisheye",
        _ => "plumb_bob",
    };
    let left = name(&pair.left);
    let both = (left == name(&pair.right)).then_some(left);
    both.ok_or_else(|| IoError::new(path, "one camera is a fisheye, the other not", "write Kalibr's format"))
}

/// Write a pair as YAML with OpenCV's head, such that [`read()`] gives it back.
///
/// # Errors
/// The file cannot be written.
pub fn write_yaml(path: &Path, pair: &RawPair) -> Result<(), IoError> {
    let mut text = format!("%YAML:1.0\n---\ndistortion_model: {}\n", model(path, pair)?);
    if let Some((w, h)) = pair.left.size {
        text += &format!("image_width: {w}\nimage_height: {h}\n");
    }
    for (name, rows, cols, numbers) in entries(pair) {
        let data = comma_separated(&numbers);
        text += &format!(
            "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: [ {data} ]\n"
        );
    }
    write::bytes(path, text.as_bytes())
}

/// Write a pair as XML, such that [`read()`] gives it back.
///
/// # Errors
/// The file cannot be written.
pub fn write_xml(path: &Path, pair: &RawPair) -> Result<(), IoError> {
    let model = model(path, pair)?;
    let mut text =
        format!("<?xml version=\"1.0\"?>\n<opencv_storage>\n<distortion_model>{model}</distortion_model>\n");
    if let Some((w, h)) = pair.left.size {
        text += &format!("<image_width>{w}</image_width>\n<image_height>{h}</image_height>\n");
    }
    for (name, rows, cols, numbers) in entries(pair) {
        let data = comma_separated(&numbers).replace(',', "");
        text += &format!(
            "<{name} type_id=\"opencv-matrix\">\n  <rows>{rows}</rows>\n  <cols>{cols}</cols>\n  <dt>d</dt>\n  \
             <data>\n    {data}</data></{name}>\n"
        );
    }
    write::bytes(path, format!("{text}</opencv_storage>\n").as_bytes())
}
