//! Messages about emulated devices.

use phasmid_core::error::Result;
use phasmid_device::Device;
#[cfg(target_os = "linux")]
use phasmid_device::link::Notice;

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

/// Returns the receiver of a served device's messages that prints them.
#[cfg(target_os = "linux")]
pub(super) fn printed() -> Notice {
    Notice::new(|message| eprintln!("phasmid: {message}"))
}
