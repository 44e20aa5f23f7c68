//! Where a recording goes: a file, or memory in tests and fuzzing.

use crate::error::{Error, Result};
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

/// Takes a recording, and can be cut back to its last whole record.
pub trait Store: Write + Send {
    /// Forgets all but the first `len` bytes.
    ///
    /// # Errors
    /// What the system refuses.
    fn cut_back(&mut self, len: u64) -> io::Result<()>;
}

impl Store for File {
    fn cut_back(&mut self, len: u64) -> io::Result<()> {
        self.set_len(len)?;
        self.seek(SeekFrom::Start(len)).map(drop)
    }
}

impl Store for Vec<u8> {
    fn cut_back(&mut self, len: u64) -> io::Result<()> {
        self.truncate(usize::try_from(len).unwrap_or(usize::MAX));
        Ok(())
    }
}

/// Makes the file of a recording; `flag` is what the user said it with.
///
/// # Errors
/// A file that is there already, unless `force`; what is there and is no file; what the system
/// refuses.
pub fn create(path: &Path, flag: &str, force: bool) -> Result<File> {
    let place = format!("{flag} {}", path.display());
    let mut options = File::options();
    options.write(true);
    if force {
        match std::fs::metadata(path) {
            Ok(about) if !about.is_file() => {
                let allowed = "a file, not a folder, pipe or device";
                return Err(Error::input(place, "not a regular file", allowed));
            }
            _ => options.create(true).truncate(true),
        };
    } else {
        options.create_new(true);
    }
    options.open(path).map_err(|e| match e.kind() {
        io::ErrorKind::AlreadyExists => {
            let allowed = "a new file, or --force to overwrite";
            Error::input(place, "is there already", allowed)
        }
        _ => Error::io(place, e),
    })
}
