//! Writing files that appear whole or not at all.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use tempfile::{Builder, NamedTempFile};

use crate::IoError;

/// How the names of unfinished files begin, by which [`sweep`] knows them.
const TEMPORARY_PREFIX: &str = ".egomotion-";

/// Write a whole file at once, replacing one of the same name; it appears complete or not at all.
///
/// # Errors
/// Names the file: its folder is missing or not writable, the disk is full, a folder has its name.
pub fn bytes(path: &Path, content: &[u8]) -> Result<(), IoError> {
    atomically(path, |file| file.write_all(content))
}

/// Write a file piece by piece; it appears under its name only when it is complete and on the disk.
///
/// The content goes to a temporary file in the same folder, is flushed and synced, and renamed.
/// When anything fails the temporary file goes away, and a file of that name stays as it was.
///
/// # Errors
/// Names the file: its folder is missing or not writable, the disk is full, a folder has its name.
pub(crate) fn atomically(
    path: &Path,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), IoError> {
    let written = || -> io::Result<()> {
        let mut file = BufWriter::with_capacity(1 << 16, temporary_beside(path)?);
        content(&mut file)?;
        let file = file.into_inner().map_err(io::IntoInnerError::into_error)?;
        file.as_file().sync_all()?;
        file.persist(path).map_err(|failed| failed.error)?;
        Ok(())
    };
    written().map_err(|error| IoError::system(path, "write", &error))
}

/// Remove what writing left half done in a folder when the program was killed; without the folder nothing.
///
/// # Errors
/// A file cannot be removed, or the folder not be read.
pub fn sweep(path: &Path) -> Result<(), IoError> {
    let swept = || -> io::Result<()> {
        let entries = match fs::read_dir(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            other => other?,
        };
        for entry in entries {
            let entry = entry?;
            if entry.file_name().to_string_lossy().starts_with(TEMPORARY_PREFIX)
                && entry.file_type()?.is_file()
            {
                fs::remove_file(entry.path())?;
            }
        }
        Ok(())
    };
    swept().map_err(|error| IoError::system(path, "tidy up", &error))
}

/// Make a folder and those above it.
///
/// # Errors
/// Names the folder: not permitted, or a file has its name.
pub fn folder(path: &Path) -> Result<(), IoError> {
    fs::create_dir_all(path).map_err(|error| IoError::system(path, "make the folder", &error))
}

fn temporary_beside(path: &Path) -> io::Result<NamedTempFile> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = Builder::new();
    builder.prefix(TEMPORARY_PREFIX);
    // A temporary file is private by default; a result is as readable as any file of this user.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        bytes(&path, b"old").unwrap();
        let half = |file: &mut dyn Write| {
            file.write_all(b"new, but")?;
            Err(io::Error::from(io::ErrorKind::StorageFull))
        };
        let error = atomically(&path, half).unwrap_err().to_string();
        assert!(error.contains("a.txt: cannot write") && error.contains("free some space"), "{error}");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["a.txt"]);
        bytes(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn a_place_that_cannot_be_written_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("none").join("a.txt");
        assert!(bytes(&missing, b"x").unwrap_err().to_string().contains("a.txt: cannot write"));
        let taken = folder.path().join("taken");
        super::folder(&taken.join("deep")).unwrap();
        assert!(bytes(&taken, b"x").unwrap_err().to_string().contains("taken: cannot write"));
        assert_eq!(names(folder.path()), ["taken"]);
        bytes(&folder.path().join("b.txt"), b"x").unwrap();
        assert!(super::folder(&folder.path().join("b.txt")).is_err());
    }

    #[test]
    fn what_a_killed_program_left_is_swept() {
        let folder = tempfile::tempdir().unwrap();
        for name in [".egomotion-x1y2", ".other", "motion.csv"] {
            fs::write(folder.path().join(name), "half").unwrap();
        }
        super::folder(&folder.path().join(".egomotion-folder")).unwrap();
        sweep(folder.path()).unwrap();
        let mut left = names(folder.path());
        left.sort();
        assert_eq!(left, [".egomotion-folder", ".other", "motion.csv"]);
        sweep(&folder.path().join("none")).unwrap();
        assert!(sweep(&folder.path().join("motion.csv")).unwrap_err().to_string().contains("cannot tidy up"));
    }

    #[cfg(unix)]
    #[test]
    fn a_result_is_as_readable_as_any_other_file() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (ours, plain) = (folder.path().join("a"), folder.path().join("b"));
        bytes(&ours, b"x").unwrap();
        fs::write(&plain, b"x").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }
}
