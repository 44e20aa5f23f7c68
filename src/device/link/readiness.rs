//! Registers file descriptors with the event loop and waits for them.

use std::os::fd::OwnedFd;
use tokio::io::unix::AsyncFd;

/// Registers a non-blocking descriptor with the running event loop.
///
/// # Errors
/// Returns the system's error.
pub(super) fn watched(fd: OwnedFd) -> std::io::Result<AsyncFd<OwnedFd>> {
    // SAFETY: an `OwnedFd` is an open descriptor of its own until it is dropped, and `AsyncFd` drops
    // it only after taking it out of the event loop. Nothing in this module calls `get_mut`, the
    // only way to replace the descriptor.
    #[allow(unsafe_code)]
    let registered = unsafe { AsyncFd::register(fd) };
    registered.map_err(std::io::Error::from)
}

/// Waits until a descriptor may be ready and clears its readiness; the caller then uses it until
/// the system reports that it would block.
pub(super) async fn stirs(fd: &AsyncFd<OwnedFd>) -> std::io::Result<()> {
    fd.readable().await?.clear_ready();
    Ok(())
}
