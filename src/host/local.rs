//! Unix domain sockets, with a stub for systems that do not have them.

#[cfg(not(unix))]
pub(super) use absent::UnixStream;
#[cfg(unix)]
pub(super) use std::os::unix::net::UnixStream;

#[cfg(not(unix))]
mod absent {
    use std::io::{Error, ErrorKind, Read, Result};
    use std::path::Path;
    use std::time::Duration;

    /// Uninhabited stand-in for a Unix stream: connecting always fails.
    pub(crate) enum UnixStream {}

    impl UnixStream {
        pub(crate) fn connect(_: &Path) -> Result<Self> {
            Err(Error::new(
                ErrorKind::Unsupported,
                "sockets by path need Linux or another Unix; tcp:HOST:PORT works here",
            ))
        }

        pub(crate) fn set_read_timeout(&self, _: Option<Duration>) -> Result<()> {
            match *self {}
        }
    }

    impl Read for UnixStream {
        fn read(&mut self, _: &mut [u8]) -> Result<usize> {
            match *self {}
        }
    }
}
