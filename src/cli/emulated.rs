//! Emulated devices of commands: messages about their optics, and their service channel.

use phasmid_core::error::{Error, Result};
use phasmid_device::Device;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

/// Maximum time for an answer on the service channel. Frames in flight are finished first.
const ANSWER: Duration = Duration::from_secs(30);

/// Prints where a device renders, and why it has no factory calibration if it has none. `label` is the
/// profile as given.
///
/// # Errors
/// Returns an error if the requested backend is not available.
pub(super) fn tell(label: &str, device: &mut Device) -> Result<()> {
    if let Some(news) = device.renderer.news()? {
        eprintln!("phasmid: {label}: {news}");
    }
    if let Some(adapter) = device.renderer.adapter() {
        let (name, kind, driver) = (&adapter.name, adapter.kind, &adapter.driver);
        eprintln!("phasmid: {label}: rendering on a GPU, {kind}: {name} ({driver})");
    }
    if let Err(why) = device.machine.firmware().factory_calibration() {
        eprintln!("phasmid: {why}; CALibration:DATA? answers with an error");
    }
    Ok(())
}

/// Connects to a device's service channel, which no physical device has.
///
/// # Errors
/// Returns an error if the socket cannot be opened.
pub(super) fn service(path: &Path) -> Result<UnixStream> {
    let io = |e| Error::io(path, e);
    let stream = UnixStream::connect(path).map_err(io)?;
    stream.set_read_timeout(Some(ANSWER)).map_err(io)?;
    stream.set_write_timeout(Some(ANSWER)).map_err(io)?;
    Ok(stream)
}
