//! TCP connections to `HOST:PORT`.

use phasmid_core::error::{Error, Result};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

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
