//! The console: a page in the browser that shows a scanner at work. A web server on the loopback
//! interface serves the page, which is embedded, and one WebSocket to each viewer.
//!
//! The console opens no camera and no port, and decodes nothing. It sees what an [`Observer`] sees and
//! shows each [`Measurement`] that it is given, so the same page works for an emulated device that is
//! being served and for a scanner that a host drives.
//!
//! | module | contents |
//! | --- | --- |
//! | `access` | tokens, cookies, and the checks of `Host` and `Origin` |
//! | `assets` | the files of the page |
//! | `connections` | the listener, which limits connections |
//! | `hub` | the latest frame and scan of each source, the viewers, and who has control |
//! | `measurement` | the views of a scan |
//! | `operator` | requests of viewers that a scanner answers |
//! | `recording` | a recording that a viewer has started |
//! | `room` | a patient in a treatment room, and where the patient is from scan to scan |
//! | `sequence` | a sequence as a scanner runs it, and as recordings note it |
//! | `server` | routes and headers |
//! | `traffic` | the recent traffic |
//! | `upload` | recordings that viewers send |
//! | `viewer` | one WebSocket |
//! | `views` | the messages that show a measurement |
//! | `wire` | the messages of a WebSocket |

mod access;
mod assets;
mod connections;
mod hub;
mod measurement;
mod operator;
mod recording;
mod room;
mod sequence;
mod server;
mod traffic;
mod upload;
mod viewer;
mod views;
mod wire;

use access::Access;
use connections::Connections;
use hub::Hub;
pub use measurement::{About, Field, FileKind, Layer, Measurement, Points, Scale};
pub use operator::{Calibration, Operator, Request, Run};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::Frame;
use phasmid_protocol::record::Observer;
pub use room::{Room, RoomRow, RoomScan, Stated, Surface};
pub use sequence::Sequence;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;
use tokio::net::TcpListener;
use tokio::sync::oneshot;

/// How a console is served.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ConsoleOptions {
    /// Port of the loopback interface; 0 picks a free port.
    pub port: u16,
    /// Folder for recordings and uploads of viewers; without it, viewers can neither record nor
    /// upload.
    pub recordings: Option<PathBuf>,
}

/// A console, until this value is dropped.
///
/// A person who opens [`Self::url`] may control the scanner; a person who opens [`Self::view_url`]
/// may only watch. Each of the two addresses contains a random token.
#[must_use = "the console is served only as long as this value exists"]
pub struct Console {
    access: Arc<Access>,
    hub: Arc<Hub>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Console {
    /// Starts to serve the page.
    ///
    /// # Errors
    /// Returns an error if the port is taken, or if the system has no random numbers or refuses a
    /// thread.
    pub fn start(options: &ConsoleOptions) -> Result<Self> {
        let place = format!("console, port {}", options.port);
        let io = |e| Error::io(&place, e);
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, options.port));
        let listener = std::net::TcpListener::bind(address).map_err(io)?;
        listener.set_nonblocking(true).map_err(io)?;
        let access = Arc::new(Access::new(listener.local_addr().map_err(io)?.port())?);
        let hub = Arc::new(Hub::new(options.recordings.clone(), access.view_token()));
        let runtime = tokio::runtime::Builder::new_current_thread();
        let runtime = { runtime }.enable_all().build().map_err(io)?;
        let listener = {
            let _inside = runtime.enter();
            TcpListener::from_std(listener).map_err(io)?
        };
        let pages = server::routes(access.clone(), hub.clone());
        let (stop, stopped) = oneshot::channel();
        let thread = std::thread::Builder::new().name("console".into());
        let serve = move || {
            runtime.block_on(async {
                tokio::select! {
                    // Serving never ends by itself.
                    _ = axum::serve(Connections::new(listener), pages) => {}
                    _ = stopped => {}
                }
            });
            // Do not wait for views that are still being computed.
            runtime.shutdown_background();
        };
        Ok(Self {
            access,
            hub,
            stop: Some(stop),
            thread: Some(thread.spawn(serve).map_err(io)?),
        })
    }

    /// Returns the address of the page for those who may control the scanner.
    pub fn url(&self) -> String {
        self.access.url(access::Role::Control)
    }

    /// Returns the address of the page for those who may only watch.
    pub fn view_url(&self) -> String {
        self.access.url(access::Role::View)
    }

    /// Adds a scanner.
    pub fn source(&self, name: impl Into<String>) -> Source {
        Source {
            hub: self.hub.clone(),
            index: self.hub.add(name.into(), false),
        }
    }

    /// Adds a source that plays recordings.
    pub fn playback(&self, name: impl Into<String>) -> Source {
        Source {
            hub: self.hub.clone(),
            index: self.hub.add(name.into(), true),
        }
    }
}

/// A scanner that a console shows.
#[derive(Clone)]
pub struct Source {
    hub: Arc<Hub>,
    index: usize,
}

impl Source {
    /// Returns the observer whose events are shown.
    pub fn observer(&self) -> Observer {
        let (hub, source) = (self.hub.clone(), self.index);
        Observer::new(move |time_ns, channel, event| hub.see(source, time_ns, channel, event))
    }

    /// Forgets everything that this source has shown, for example at the start of another
    /// recording. Set `device_times` if the times of the following events are on the device's
    /// clock, like the exposure times; latencies are shown only in that case.
    pub fn restart(&self, device_times: bool) {
        self.hub.restart(self.index, device_times);
    }

    /// Forgets the latest frame, the state of the links and, if `measurement` is set, the
    /// measurement. Call this when the playback of a recording jumps to another time.
    pub fn rewind(&self, measurement: bool) {
        self.hub.rewind(self.index, measurement);
    }

    /// Shows, from now on, for each frame the pattern of this sequence that the frame reports.
    pub fn show_sequence(&self, sequence: Arc<Sequence>) {
        self.hub.show_sequence(self.index, sequence);
    }

    /// Returns the latest frame.
    pub fn frame(&self) -> Option<Arc<Frame>> {
        self.hub.frame(self.index)
    }

    /// Returns the measurement that is shown.
    pub fn measurement(&self) -> Option<Arc<dyn Measurement>> {
        self.hub.measurement(self.index)
    }

    /// Lets viewers operate the scanner. An earlier operator that answers one of the same kinds of
    /// requests is replaced.
    pub fn operate(&self, operator: Arc<dyn Operator>) {
        self.hub.operate(self.index, operator);
    }

    /// Shows a text about the current activity or why it failed; `None` removes the text.
    pub fn say(&self, status: Option<String>) {
        self.hub.say(self.index, status);
    }

    /// Shows a treatment room instead of a scanner.
    pub fn show_room(&self, room: Arc<Room>) {
        self.hub.show_room(self.index, room);
    }

    /// Shows the result of a scan in the room, and the patient in it. The latest 3000 results are kept.
    /// Returns the number of the result.
    pub fn show_tracked(&self, row: RoomRow, scan: Arc<RoomScan>) -> u64 {
        self.hub.show_tracked(self.index, row, scan)
    }

    /// Adds [`RoomRow::truth`] to a result, by its number, if it is still kept.
    pub fn add_truth(&self, result: u64, truth: [f64; 4]) {
        self.hub.add_truth(self.index, result, truth);
    }

    /// Shows a measurement instead of the last one.
    pub fn show(&self, measurement: Arc<dyn Measurement>) {
        self.hub.show(self.index, measurement);
    }
}

impl std::fmt::Debug for Source {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Source")
    }
}

impl std::fmt::Debug for Console {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Console")
    }
}

impl Drop for Console {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        // A `Source` may keep the hub alive, but recordings end with the console.
        self.hub.close();
    }
}
