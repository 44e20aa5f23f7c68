//! Files that a user names: read whole, if they are files and not too large.

use crate::error::{Error, Result};
use std::fs::{File, Metadata};
use std::io::Read;
use std::path::Path;

/// The bytes of a file.
///
/// # Errors
/// What the system refuses, what is not a file (a pipe or a device has no end that one could wait
/// for), and more than `most` bytes.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>> {
    let io = |e| Error::io(path, e);
    let about = regular(path)?;
    let mut bytes = Vec::new();
    // It may grow meanwhile, and files of /proc say that they are empty.
    let file = File::open(path).map_err(io)?;
    file.take(most + 1).read_to_end(&mut bytes).map_err(io)?;
    let size = about.len().max(bytes.len() as u64);
    if size > most {
        return Err(Error::input(
            path.display(),
            format!("{size} bytes"),
            format!("up to {most} bytes"),
        ));
    }
    Ok(bytes)
}

/// What the system knows of a file.
///
/// # Errors
/// What it refuses, and what is not a file.
pub fn regular(path: &Path) -> Result<Metadata> {
    let about = std::fs::metadata(path).map_err(|e| Error::io(path, e))?;
    if about.is_file() {
        return Ok(about);
    }
    Err(Error::input(
        path.display(),
        "not a regular file",
        "a file, not a folder, pipe or device",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_bounded_and_of_files_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ten");
        std::fs::write(&path, [7; 10]).unwrap();
        assert_eq!(read(&path, 10).unwrap(), [7; 10]);
        let refused = |path: &Path, most| read(path, most).unwrap_err().to_string();
        assert!(refused(&path, 9).contains("10 bytes; allowed: up to 9 bytes"));
        assert!(refused(dir.path(), 9).contains("not a regular file"));
        #[cfg(unix)]
        assert!(refused(Path::new("/dev/zero"), 9).contains("not a regular file"));
    }
}
