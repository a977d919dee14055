//! Several NumPy arrays in one file (`.npz`): a zip archive of `.npy` files.

use std::io::{Cursor, Read};
use std::path::Path;

use egomotion::geometry::Field;
use zip::ZipArchive;

use crate::maps::npy::{self, Array};
use crate::{IoError, read};

/// The largest array that is unpacked, in bytes (1 GiB): a bound on memory, whatever the archive promises.
const MAX_ARRAY_BYTES: u64 = 1 << 30;

/// The arrays of an `.npz`, read one by one.
pub(crate) struct Npz<'a> {
    archive: ZipArchive<Cursor<&'a [u8]>>,
    path: &'a Path,
}

impl<'a> Npz<'a> {
    /// The archive in some content; `path` names it in errors.
    ///
    /// # Errors
    /// The content is no zip archive.
    pub(crate) fn open(content: &'a [u8], path: &'a Path) -> Result<Self, IoError> {
        let archive = ZipArchive::new(Cursor::new(content)).map_err(|error| {
            let reason = format!("is not a whole .npz file: {error}");
            IoError::new(path, reason, "give arrays written by np.savez")
        })?;
        Ok(Self { archive, path })
    }

    /// Whether there is an array of this name.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.archive.index_for_name(&format!("{name}.npy")).is_some()
    }

    /// The array of this name.
    ///
    /// # Errors
    /// There is none, it is damaged, larger than 1 GiB, or no array of numbers.
    pub(crate) fn array(&mut self, name: &str) -> Result<Array, IoError> {
        let refuse = |reason: String| IoError::new(self.path, reason, "give arrays written by np.savez");
        let file = self.archive.by_name(&format!("{name}.npy"));
        let file = file.map_err(|error| refuse(format!("has no array \"{name}\": {error}")))?;
        let mut content = Vec::new();
        let read = file.take(MAX_ARRAY_BYTES + 1).read_to_end(&mut content);
        read.map_err(|error| refuse(format!("array \"{name}\" is damaged: {error}")))?;
        if content.len() as u64 > MAX_ARRAY_BYTES {
            return Err(refuse(format!("array \"{name}\" is larger than {MAX_ARRAY_BYTES} bytes")));
        }
        let array = npy::decode(&content, self.path);
        array.map_err(|error| IoError { reason: format!("array \"{name}\" {}", error.reason), ..error })
    }
}

/// The only array of a file as a map (height, width); every value that is not finite is missing.
///
/// # Errors
/// The file cannot be read, or does not hold just one array of two axes.
pub(crate) fn read_map(path: &Path) -> Result<Field, IoError> {
    let content = read(path)?;
    let mut npz = Npz::open(&content, path)?;
    let names: Vec<String> =
        npz.archive.file_names().flatten().map(|name| name.trim_end_matches(".npy").to_owned()).collect();
    let [name] = names.as_slice() else {
        let reason = format_args!("holds {} arrays, not one map", names.len()).to_string();
        return Err(IoError::new(path, reason, "give one array of (height, width)"));
    };
    npy::map(&npz.array(name)?, path)
}

/// The content of an `.npz` file for [`Npz::open`].
///
/// # Errors
/// The file cannot be read.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, IoError> {
    read::bytes(path)
}
