//! A camera that is only looked at.

use phasmid_core::error::Result;
use phasmid_host::{Camera, CameraDriver, monotonic_ns, open_camera};
use phasmid_protocol::record::{Channel, Event, Observer};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

/// Time between two calls of the function that says whether to go on.
const STEP: Duration = Duration::from_millis(100);
/// Time that a camera has to open.
const OPENING: Duration = Duration::from_secs(2);
/// Time between two attempts to open a camera that is gone.
const RETRY: Duration = Duration::from_millis(500);

/// Opens a camera, and shows its frames to an observer until `flow` breaks. A camera that is gone is opened
/// again when it is back.
///
/// # Errors
/// Returns an error if the camera cannot be opened the first time.
///
/// # Examples
/// ```no_run
/// use phasmid::host::CameraDriver;
/// use phasmid::{Console, ConsoleOptions};
/// use std::ops::ControlFlow;
///
/// let console = Console::start(&ConsoleOptions::default())?;
/// println!("open {}", console.url());
/// let observer = console.observer("my camera");
/// phasmid::watch_camera("/dev/video0", CameraDriver::Auto, &observer, || ControlFlow::Continue(()))?;
/// # Ok::<(), phasmid::Error>(())
/// ```
pub fn watch_camera(
    address: &str,
    driver: CameraDriver,
    observer: &Observer,
    mut flow: impl FnMut() -> ControlFlow<()>,
) -> Result<()> {
    let mut camera = open_camera(address, driver, OPENING)?;
    let see = |event| observer.see(monotonic_ns(), Channel::Camera, &event);
    see(Event::Opened);
    while flow().is_continue() {
        match camera.next_frame(STEP) {
            Ok(Some(frame)) => see(Event::Frame(Arc::new(frame))),
            Ok(None) => {}
            Err(damaged) if camera.has_skipped() => see(Event::Note(damaged.to_string())),
            Err(_) => {
                see(Event::Unplugged);
                // Closed first: some drivers open a device only once.
                drop(camera);
                camera = loop {
                    if flow().is_break() {
                        return Ok(());
                    }
                    match open_camera(address, driver, OPENING) {
                        Ok(again) => break again,
                        Err(_) => thread::sleep(RETRY),
                    }
                };
                see(Event::Plugged);
            }
        }
    }
    see(Event::Left);
    Ok(())
}
