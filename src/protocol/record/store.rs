//! Output of a recording: a file, or memory in tests and fuzzing.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};

/// Takes a recording, and can be cut back to its last whole record.
pub trait Store: Write + Send {
    /// Truncates it to the first `len` bytes.
    ///
    /// # Errors
    /// Returns an error if the system call fails.
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
