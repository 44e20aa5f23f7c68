//! Unix domain sockets (a stub on systems that do not have them), TCP connections to `HOST:PORT`,
//! and the token for devices that require one.

#[cfg(not(unix))]
pub(super) use absent::UnixStream;
#[cfg(unix)]
pub(super) use std::os::unix::net::UnixStream;

use phasmid_core::error::{Error, Result};
use phasmid_protocol::admission::Token;
use std::net::{TcpStream, ToSocketAddrs};
use std::path::Path;
use std::time::Duration;

/// Environment variable that names the file with the token for cameras at `tcp:` addresses.
pub(super) const TOKEN_FILE: &str = "PHASMID_TCP_TOKEN_FILE";

/// Reads the token for cameras at `tcp:` addresses, if the environment names a file with one.
///
/// # Errors
/// Returns an error if the file cannot be read or holds no token.
pub(super) fn token() -> Result<Option<Token>> {
    let file = std::env::var_os(TOKEN_FILE).filter(|file| !file.is_empty());
    let token = file.map(|file| Token::read(Path::new(&file)));
    token.transpose().map_err(|e| e.at(TOKEN_FILE))
}

/// Connects to the first of the host's addresses that answers, waiting up to `timeout` for each.
/// `place` is the address as shown in messages.
///
/// # Errors
/// Returns an error if the host cannot be resolved or does not answer.
pub(super) fn connect(host: &str, timeout: Duration, place: &str) -> Result<TcpStream> {
    let addresses = host
        .to_socket_addrs()
        .map_err(|e| Error::input(place, e, "a host name that can be resolved"))?;
    let mut last = Error::device(format!("{place}: the host has no address"));
    for address in addresses {
        match TcpStream::connect_timeout(&address, timeout) {
            Ok(stream) => return Ok(stream),
            Err(e) => last = Error::io(place, e),
        }
    }
    Err(last)
}

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
