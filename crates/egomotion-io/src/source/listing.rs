//! Numbered image files of two folders, brought together frame by frame.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use super::layout::KNOWN_LAYOUTS;
use super::sequence::FrameFiles;
use crate::{IoError, image};

/// The images of a folder by the key that `key` finds in their stems; empty if there is no such folder.
pub(super) fn numbered<K: Ord>(
    folder: &Path,
    key: impl Fn(&str) -> Option<K>,
) -> Result<BTreeMap<K, PathBuf>, IoError> {
    by_key(folder, key, image::has_image_extension)
}

/// The text files of a folder in the same way.
pub(super) fn texts<K: Ord>(
    folder: &Path,
    key: impl Fn(&str) -> Option<K>,
) -> Result<BTreeMap<K, PathBuf>, IoError> {
    ending(folder, &["txt"], key)
}

/// The files of a folder with one of some endings in the same way.
pub(super) fn ending<K: Ord>(
    folder: &Path,
    endings: &[&str],
    key: impl Fn(&str) -> Option<K>,
) -> Result<BTreeMap<K, PathBuf>, IoError> {
    by_key(folder, key, |path| path.extension().and_then(OsStr::to_str).is_some_and(|e| endings.contains(&e)))
}

fn by_key<K: Ord>(
    folder: &Path,
    key: impl Fn(&str) -> Option<K>,
    is_one: impl Fn(&Path) -> bool,
) -> Result<BTreeMap<K, PathBuf>, IoError> {
    let mut files = BTreeMap::new();
    if !folder.is_dir() {
        return Ok(files);
    }
    let failed = |error: std::io::Error| IoError::system(folder, "list", &error);
    for entry in folder.read_dir().map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let stem = path.file_stem().and_then(OsStr::to_str).filter(|_| is_one(&path));
        if let Some(key) = stem.and_then(&key) {
            files.insert(key, path);
        }
    }
    Ok(files)
}

/// The folders in a folder, in the order of their names.
pub(super) fn folders(folder: &Path) -> Result<Vec<PathBuf>, IoError> {
    let failed = |error: std::io::Error| IoError::system(folder, "list", &error);
    let mut found = Vec::new();
    for entry in folder.read_dir().map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_dir() {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// A number written in digits alone.
pub(super) fn digits(text: &str) -> Option<usize> {
    text.bytes().all(|b| b.is_ascii_digit()).then(|| text.parse().ok())?
}

/// Frames of the numbers that either folder has, times still 0.
///
/// A frame whose left image is lost keeps its place, under the name that the right one has.
pub(super) fn pairs(
    left_folder: &Path,
    left: &BTreeMap<usize, PathBuf>,
    right: &BTreeMap<usize, PathBuf>,
) -> Vec<FrameFiles> {
    let indices: BTreeSet<usize> = left.keys().chain(right.keys()).copied().collect();
    let frame = |index: usize| {
        let right = right.get(&index).cloned();
        let name = right.as_deref().and_then(Path::file_name).unwrap_or_default();
        let left = left.get(&index).cloned().unwrap_or_else(|| left_folder.join(name));
        FrameFiles { index, left, right, depth: None, time_s: 0.0, truth: None }
    };
    indices.into_iter().map(frame).collect()
}

/// Size of the images, from the first one that can be read.
pub(super) fn image_size(frames: &[FrameFiles]) -> Result<(usize, usize), IoError> {
    let mut files = frames.iter().flat_map(|f| std::iter::once(&f.left).chain(&f.right));
    let first = files.next().map(|path| image::size(path));
    match first {
        Some(Err(error)) => files.find_map(|path| image::size(path).ok()).ok_or(error),
        Some(size) => size,
        None => Err(IoError::new(Path::new(""), "no images", KNOWN_LAYOUTS)),
    }
}

/// Both folders must hold images.
pub(super) fn check_both(left: (&Path, bool), right: (&Path, bool), named: &str) -> Result<(), IoError> {
    for ((folder, empty), side) in [(left, "left"), (right, "right")] {
        if empty {
            let advice = format_args!("give the {side} images as PNG files named {named}").to_string();
            return Err(IoError::new(folder, format_args!("holds no {side} image"), advice));
        }
    }
    Ok(())
}
