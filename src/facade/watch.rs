//! Shows the frames of a camera to an observer.

use phasmid_core::error::Result;
use phasmid_host::{Camera, CameraDriver, monotonic_ns, open_camera};
use phasmid_protocol::record::{Channel, Event, Observer};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

/// Time between two calls of `flow`, which decides whether to go on.
const STEP: Duration = Duration::from_millis(100);
/// Maximum time to open a camera.
const OPENING: Duration = Duration::from_secs(2);
/// Time between two attempts to reopen a camera that has disappeared.
const RETRY: Duration = Duration::from_millis(500);

/// Opens a camera, and shows its frames to an observer until `flow` returns `Break`. If the camera
/// disappears, it is reopened when it is available again.
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
/// let observer = console.source("my camera").observer();
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
    let see = |camera: &dyn Camera, event| {
        let channel = match camera.identifies() {
            true => Channel::Camera,
            false => Channel::Counted,
        };
        observer.see(monotonic_ns(), channel, &event);
    };
    see(&camera, Event::Opened);
    while flow().is_continue() {
        match camera.next_frame(STEP) {
            Ok(Some(frame)) => see(&camera, Event::Frame(Arc::new(frame))),
            Ok(None) => {}
            Err(damaged) if camera.has_skipped() => {
                see(&camera, Event::Note(damaged.to_string()));
            }
            Err(why) => {
                see(&camera, Event::Note(why.to_string()));
                see(&camera, Event::Unplugged);
                // Keep the camera object if it can reopen its camera, whose node may come back under
                // another number. Else close the camera before it is opened again, because some cameras
                // can be opened only once at a time.
                let mut gone = camera.has_gone().then_some(camera);
                camera = loop {
                    thread::sleep(RETRY);
                    if flow().is_break() {
                        return Ok(());
                    }
                    if let Some(waiting) = &mut gone {
                        if waiting.reopen(OPENING).is_ok()
                            && let Some(back) = gone.take()
                        {
                            break back;
                        }
                    } else if let Ok(again) = open_camera(address, driver, OPENING) {
                        break again;
                    }
                };
                see(&camera, Event::Plugged);
                see(&camera, Event::Opened);
            }
        }
    }
    see(&camera, Event::Left);
    Ok(())
}
