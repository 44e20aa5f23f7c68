//! Reads user-specified files as a whole, if they are regular files within a size limit.

use crate::error::{Error, Result};
use std::fs::{File, Metadata};
use std::io::Read;
use std::path::Path;

/// Reads all bytes of a file.
///
/// # Errors
/// Returns an error if the file cannot be read, is not a regular file (a pipe or device may never
/// end) or is longer than `most` bytes.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>> {
    let io = |e| Error::io(path, e);
    let about = regular(path)?;
    let mut bytes = Vec::new();
    // Limit the read even though the size was checked: the file may grow while it is read, and
    // files in /proc report a size of 0.
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

/// Returns the metadata of a regular file.
///
/// # Errors
/// Returns an error if the metadata cannot be read or the path is not a regular file.
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
    fn reads_only_regular_files_up_to_the_limit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ten");
        std::fs::write(&path, [7; 10]).unwrap();
        assert_eq!(read(&path, 10).unwrap(), [7; 10]);
        let refused = |path: &Path, most| read(path, most).unwrap_err().to_string();
        assert!(refused(&path, 9).contains("10 bytes; expected up to 9 bytes"));
        assert!(refused(dir.path(), 9).contains("not a regular file"));
        #[cfg(unix)]
        assert!(refused(Path::new("/dev/zero"), 9).contains("not a regular file"));
    }
}
