//! A device that is served on threads of its own, even if the calling program has an event loop.

use super::Notice;
use super::device::{ServedDevice, serve};
use super::frame_socket::Tcp;
use super::run_dir::RunDir;
use super::shared_scene::SharedScene;
use super::tap::Recording;
use super::timeline::Timeline;
use super::usb::Binding;
use super::usb::export::{UsbLink, UsbServing, export};
use super::video::VideoOutput;
use crate::Device;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use phasmid_protocol::Endpoints;
use phasmid_protocol::record::Observer;
use phasmid_protocol::service::ClockPace;
use std::hash::{BuildHasher, RandomState};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::watch;

/// V4L2 node that receives a served device's frames.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum CameraNode {
    /// No node: frames go to the frame socket only.
    #[default]
    None,
    /// The first free v4l2loopback node whose label starts with Phasmid.
    Any,
    /// The v4l2loopback node with this path.
    At(PathBuf),
}

/// A file in which every byte and frame of a served device is recorded with its time, for `phasmid
/// replay` and `phasmid record info`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordingFile {
    /// Path of the file, which must not exist.
    pub path: PathBuf,
    /// Start of the recording in seconds since 1970.
    pub started_unix_s: u64,
}

/// Options for serving a device.
#[derive(Debug, Clone)]
pub struct ServeOptions {
    /// Directory for the endpoints; `None` for a private directory in the temporary directory.
    pub run_dir: Option<PathBuf>,
    /// Pace of the device's time.
    pub clock: ClockPace,
    /// Options for serving frames over TCP as well.
    pub tcp: Option<Tcp>,
    /// V4L2 node that also receives the frames, which requires a clock in real time.
    pub camera: CameraNode,
    /// Options for also serving the device as a USB device with camera and serial port.
    pub usb: Option<UsbServing>,
    /// File in which to record the traffic.
    pub record: Option<RecordingFile>,
    /// Receives the traffic as it happens, in the form in which it would be recorded.
    pub observer: Option<Observer>,
    /// Receives messages for the operator.
    pub notice: Notice,
    /// Number of rendering threads; `None` for rayon's global pool. Rendering runs on the device's
    /// own thread, so a rayon pool in which the caller runs is not used.
    pub threads: Option<NonZeroUsize>,
}

impl Default for ServeOptions {
    /// Returns options for a pty and a frame socket in real time.
    fn default() -> Self {
        Self {
            run_dir: None,
            clock: ClockPace::Real,
            tcp: None,
            camera: CameraNode::None,
            usb: None,
            record: None,
            observer: None,
            notice: Notice::default(),
            threads: None,
        }
    }
}

impl Device {
    /// Serves the device on threads of its own until the returned value is dropped.
    ///
    /// # Errors
    /// Returns an error if the run directory cannot be used, or if the system refuses a port, a socket,
    /// a V4L2 node or a USB device.
    pub fn serve(self, options: &ServeOptions) -> Result<Serving> {
        Serving::of(self, options)
    }
}

/// A device that is being served, until this value is dropped.
#[must_use = "the device is served only as long as this value exists"]
#[derive(Debug)]
pub struct Serving {
    endpoints: Endpoints,
    slowdown: watch::Receiver<Option<f64>>,
    device: Worker,
    usb: Option<Worker>,
}

impl Serving {
    /// Serves a device that has a timeline of its own.
    fn of(mut device: Device, options: &ServeOptions) -> Result<Self> {
        // A stop request made for calls in memory must not stop the served device.
        device.renderer.renew_stop();
        // Device time continues from the value that it reached in memory.
        let begin_ns = device.machine.firmware().now_ns();
        let (begin, begun) = (monotonic(), Duration::from_nanos(begin_ns));
        let power_on = begin.saturating_sub(begun);
        let wall = move || monotonic().saturating_sub(begin) + begun;
        if options.camera != CameraNode::None && options.clock != ClockPace::Real {
            return Err(Error::input(
                "clock",
                format!("{:?}, with a V4L2 node", options.clock),
                "Real: a V4L2 reader cannot pause the device, so frames would be lost",
            ));
        }
        let seat = Timeline::new(options.clock, wall).from(begin_ns).seat();
        let shared_scene = SharedScene::new(&device.scene);
        let mut served = ServedDevice::new(device, seat, shared_scene);
        served.tcp.clone_from(&options.tcp);
        served.observer.clone_from(&options.observer);
        served.notice = options.notice.clone();
        served.threads = options.threads;
        let run_dir = match &options.run_dir {
            // Absolute, because device.json is read from other working directories.
            Some(dir) => RunDir::claim(&std::path::absolute(dir).map_err(|e| Error::io(dir, e))?)?,
            None => private_run_dir()?,
        };
        let firmware = served.device.machine.firmware();
        let bits = served.device.profile.camera.sensor.bits;
        let stream = firmware.stream();
        served.video = match &options.camera {
            CameraNode::None => None,
            CameraNode::At(path) => Some(VideoOutput::open(path, &stream, bits, power_on)?),
            CameraNode::Any => {
                let opened = VideoOutput::open_any(&stream, bits, power_on);
                Some(opened?)
            }
        };
        let mut usb = None;
        if let Some(how) = options.usb {
            let binding = Binding::new(&served.device.profile, firmware, 1)?;
            let (link, worker) = serve_usb(binding, how, wall)?;
            served.usb = Some(link);
            usb = Some(worker);
        }
        if let Some(RecordingFile {
            path,
            started_unix_s,
        }) = options.record.clone()
        {
            served.recording = Some(Recording {
                file: new_file::stream(&path, false)?,
                path,
                started_unix_s,
            });
        }
        let serving = Self::start(served, run_dir, wall, || ())?;
        Ok(Self { usb, ..serving })
    }

    /// Serves a device that may share a timeline and a scene with others. `wall` returns how long
    /// the device has been on; `ended` is called when the device ends, whatever the reason.
    ///
    /// # Errors
    /// Returns an error if the system refuses a thread, a port or a socket.
    pub fn start(
        served: ServedDevice,
        run_dir: RunDir,
        wall: impl Fn() -> Duration + Clone + Send + 'static,
        ended: impl FnOnce() + Send + 'static,
    ) -> Result<Self> {
        let (ready, up) = mpsc::channel();
        let (measured, slowdown) = watch::channel(None);
        let mut device = Worker::start("device", move |stopped| {
            let _ended = Last(Some(ended));
            let published = |endpoints: &Endpoints| {
                measured.send_replace(endpoints.slowdown);
                // Only the first call finds a receiver.
                let _ = ready.send(endpoints.clone());
            };
            runtime()?.block_on(serve(served, run_dir, wall, published, until(stopped)))
        })?;
        match up.recv() {
            Ok(endpoints) => Ok(Self {
                endpoints,
                slowdown,
                device,
                usb: None,
            }),
            // The device ended before it was ready; its own error gives the reason.
            Err(_) => {
                device.end()?;
                Err(Error::device("the device was never ready"))
            }
        }
    }

    /// Returns the addresses that the device had when it started.
    pub fn endpoints(&self) -> &Endpoints {
        &self.endpoints
    }

    /// Returns the render time of the latest frames divided by the interval of their exposures;
    /// `None` unless device time is real time and the machine has been too slow to keep up. This is
    /// the current value of [`Endpoints::slowdown`].
    pub fn slowdown(&self) -> Option<f64> {
        *self.slowdown.borrow()
    }

    /// Ends the device and waits until it has ended.
    ///
    /// # Errors
    /// Returns the error with which the device had ended earlier, if any.
    pub fn stop(mut self) -> Result<()> {
        let ended = self.device.end();
        ended.and(self.usb.as_mut().map_or(Ok(()), Worker::end))
    }
}

/// Calls a function when this value is dropped.
struct Last<F: FnOnce()>(Option<F>);

impl<F: FnOnce()> Drop for Last<F> {
    fn drop(&mut self) {
        if let Some(then) = self.0.take() {
            then();
        }
    }
}

/// A thread that ends on request, at the latest when this value is dropped.
#[derive(Debug)]
struct Worker {
    stop: watch::Sender<bool>,
    thread: Option<JoinHandle<Result<()>>>,
}

impl Worker {
    fn start(
        name: &'static str,
        body: impl FnOnce(watch::Receiver<bool>) -> Result<()> + Send + 'static,
    ) -> Result<Self> {
        let (stop, stopped) = watch::channel(false);
        let thread = std::thread::Builder::new().name(name.to_owned());
        let thread = thread.spawn(move || body(stopped));
        Ok(Self {
            stop,
            thread: Some(thread.map_err(|e| Error::io(name, e))?),
        })
    }

    fn end(&mut self) -> Result<()> {
        self.stop.send_replace(true);
        let panicked = |_| Err(Error::device("the thread of a device panicked"));
        match self.thread.take() {
            Some(thread) => thread.join().unwrap_or_else(panicked),
            None => Ok(()),
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // The result is ignored: a caller that needs it calls `stop`.
        let _ = self.end();
    }
}

/// Exports a USB device on a thread of its own, and also attaches it to this machine's kernel if
/// requested.
fn serve_usb(
    binding: Binding,
    how: UsbServing,
    wall: impl Fn() -> Duration + Clone + Send + Sync + 'static,
) -> Result<(UsbLink, Worker)> {
    let (ready, up) = mpsc::channel();
    let mut worker = Worker::start("usb", move |stopped| {
        runtime()?.block_on(async {
            let mut links = export(vec![binding], how, wall).await?;
            let _ = ready.send(links.remove(0));
            until(stopped).await;
            Ok(())
        })
    })?;
    match up.recv() {
        Ok(link) => Ok((link, worker)),
        Err(_) => {
            worker.end()?;
            Err(Error::device("the USB server was never ready"))
        }
    }
}

/// Completes when the value becomes true or its sender is gone.
async fn until(mut stopped: watch::Receiver<bool>) {
    let _ = stopped.wait_for(|&stop| stop).await;
}

fn runtime() -> Result<Runtime> {
    let runtime = Builder::new_current_thread().enable_all().build();
    runtime.map_err(|e| Error::io("event loop", e))
}

/// Prefix of private run directories; sixteen hexadecimal digits follow.
const PRIVATE: &str = "phasmid-";
/// Maximum number of private run directories to try: another process may remove a new directory
/// before it is locked.
const TRIES: usize = 8;

/// Claims a run directory with an unpredictable name in the temporary directory. Removes the run
/// directories that killed programs have left there.
fn private_run_dir() -> Result<RunDir> {
    let parent = std::env::temp_dir();
    for entry in std::fs::read_dir(&parent).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let number = name.to_str().and_then(|name| name.strip_prefix(PRIVATE));
        let is_hex = |number: &str| number.bytes().all(|byte| byte.is_ascii_hexdigit());
        if number.is_some_and(|number| number.len() == 16 && is_hex(number)) {
            // `claim` refuses a directory that is in use or contains foreign files. Dropping the
            // claim deletes the device's files; an empty directory is removed while it is still
            // locked.
            if let Ok(claimed) = RunDir::claim(&entry.path()) {
                let _ = std::fs::remove_dir(entry.path());
                drop(claimed);
            }
        }
    }
    let claim = || {
        // The keys of a `RandomState` are random numbers from the system. The name is short because
        // the path of a socket is limited to about a hundred bytes.
        let number = RandomState::new().hash_one(std::process::id());
        RunDir::claim(&parent.join(format!("{PRIVATE}{number:016x}")))
    };
    let mut claimed = claim();
    for _ in 1..TRIES {
        if claimed.is_ok() {
            break;
        }
        claimed = claim();
    }
    claimed.map_err(|e| e.at("TMPDIR, the folder of temporary files"))
}

/// Returns the system's monotonic time, which V4L2 uses for timestamps of frames.
pub fn monotonic() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    let seconds = u64::try_from(now.tv_sec).unwrap_or(0);
    Duration::from_secs(seconds) + Duration::from_nanos(now.tv_nsec.unsigned_abs())
}
