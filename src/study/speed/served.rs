//! A device that is served within the process, as `phasmid serve --clock fast` serves one: on a
//! thread of its own, its USB side on another.

use super::links::Missing;
use phasmid_core::error::{Error, Result};
use phasmid_device::faults::Faults;
use phasmid_device::link::usb::{Binding, Nodes, UsbDevice, UsbServer, attach};
use phasmid_device::link::{
    Device, RunDir, SharedScene, Tcp, Timeline, UsbLink, VideoOutput, serve,
};
use phasmid_device::port::Port;
use phasmid_device::{Firmware, Machine, SerialLine};
use phasmid_host::monotonic_ns;
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::Endpoints;
use phasmid_protocol::faults::Schedule;
use phasmid_protocol::service::ClockPace;
use phasmid_render::Renderer;
use std::path::Path;
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::watch;

/// How frames leave besides the frame socket.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Not at all.
    None,
    /// A TCP port of the loopback interface.
    Tcp,
    /// A USB device, served over USB/IP on the loopback interface.
    Usb,
    /// The same, handed to this machine's kernel as well.
    Kernel,
    /// The first free V4L2 node that is labelled for it.
    Video,
}

/// A device that is served; it ends with this value.
pub struct Served {
    /// Where it can be reached.
    pub at: Endpoints,
    stop: watch::Sender<bool>,
    threads: Vec<JoinHandle<Result<()>>>,
}

impl Served {
    /// Serves a device from a directory of its own.
    ///
    /// # Errors
    /// Nodes that this machine does not have; ports and sockets that the system refuses.
    pub fn start(
        profile: &Profile,
        scene: &Scene,
        seed: u64,
        exit: Exit,
        dir: &Path,
    ) -> Result<Self, Missing> {
        let begin = monotonic_ns();
        let wall = move || Duration::from_nanos(monotonic_ns().saturating_sub(begin));
        let renderer = Renderer::new(profile, scene, seed)?;
        let schedule = Schedule::default();
        let machine = Machine::new(
            Firmware::new(profile, &[])?,
            Port::default(),
            SerialLine::new(&profile.control),
            Faults::new(&schedule, &profile.name),
        );
        let (stop, stopped) = watch::channel(false);
        let mut threads = Vec::new();
        let usb = match exit {
            Exit::Usb | Exit::Kernel => {
                let with_kernel = exit == Exit::Kernel;
                let firmware = machine.firmware();
                let (link, thread) = usb(profile, firmware, wall, stopped.clone(), with_kernel)?;
                threads.push(thread);
                Some(link)
            }
            _ => None,
        };
        let video = match exit {
            Exit::Video => {
                let stream = machine.firmware().stream();
                let power_on = Duration::from_nanos(begin);
                let bits = profile.camera.sensor.bits;
                let opened = VideoOutput::open_any(&stream, bits, power_on);
                Some(opened.map_err(Missing::Lack)?)
            }
            _ => None,
        };
        let device = Device {
            machine,
            renderer,
            seat: Timeline::new(ClockPace::Fast, wall).seat(),
            shared_scene: SharedScene::new(scene),
            rig: scene.rig,
            name: profile.name.clone(),
            profile: profile.name.clone(),
            scene: scene.name.clone(),
            seed,
            // The port's default, as is the port here.
            dialect: "scpi".to_owned(),
            baud: profile.control.baud,
            tcp: (exit == Exit::Tcp).then_some(Tcp {
                port: 0,
                token: None,
            }),
            video,
            usb,
            recording: None,
            notice: |_| {},
        };
        let (ready, up) = mpsc::channel();
        let run_dir = RunDir::claim(dir)?;
        threads.push(std::thread::spawn(move || {
            let tell = |at: &Endpoints| {
                // Whoever asked may have gone.
                let _ = ready.send(at.clone());
            };
            runtime()?.block_on(serve(device, run_dir, wall, tell, until(stopped)))
        }));
        match up.recv() {
            Ok(at) => Ok(Self { at, stop, threads }),
            // It has ended, and says why.
            Err(_) => {
                end(&stop, &mut threads)?;
                Err(Error::device("the device was never ready").into())
            }
        }
    }

    /// Ends it.
    ///
    /// # Errors
    /// What it ended with.
    pub fn stop(mut self) -> Result<()> {
        end(&self.stop, &mut self.threads)
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // Who wants to know has asked.
        let _ = end(&self.stop, &mut self.threads);
    }
}

fn end(stop: &watch::Sender<bool>, threads: &mut Vec<JoinHandle<Result<()>>>) -> Result<()> {
    stop.send_replace(true);
    let died = |_| Err(Error::device("a device's thread has died"));
    let ended = threads.drain(..).map(|t| t.join().unwrap_or_else(died));
    ended.fold(Ok(()), Result::and)
}

/// How long the kernel's drivers may take to make their nodes.
const NODES: Duration = Duration::from_secs(10);
const POLL: Duration = Duration::from_millis(20);

/// Exports the USB side of a device, and hands it to this machine's kernel where that is wanted.
fn usb(
    profile: &Profile,
    firmware: &Firmware,
    wall: impl Fn() -> Duration + Clone + Send + Sync + 'static,
    stopped: watch::Receiver<bool>,
    with_kernel: bool,
) -> Result<(UsbLink, JoinHandle<Result<()>>), Missing> {
    let binding = Binding::new(profile, firmware, 1)?;
    let device = binding.device().clone();
    let bus_id = device.info().bus_id.clone();
    let (ready, up) = mpsc::channel();
    let thread = std::thread::spawn(move || {
        runtime()?.block_on(async move {
            let any = std::net::SocketAddr::from(([127, 0, 0, 1], 0));
            let server = UsbServer::bind(any, vec![device.clone()]).await?;
            let address = server.address().unwrap_or(any);
            let nodes = match with_kernel {
                true => attached(device, wall.clone()).await,
                false => Ok(Nodes::default()),
            };
            let lacks = nodes.is_err();
            // Whoever asked may have gone.
            let _ = ready.send(nodes.map(|nodes| (address, nodes)));
            if lacks {
                return Ok(());
            }
            tokio::select! {
                () = server.run(wall) => {}
                () = until(stopped) => {}
            }
            Ok(())
        })
    });
    let Ok(told) = up.recv() else {
        let died = |_| Err(Error::device("the USB server has died"));
        thread.join().unwrap_or_else(died)?;
        return Err(Error::device("the USB server was never ready").into());
    };
    let (listen, nodes) = told.map_err(Missing::Lack)?;
    let link = UsbLink {
        binding,
        address: format!("usb:{listen}/{bus_id}"),
        nodes,
    };
    Ok((link, thread))
}

/// Hands a device to the kernel and waits for both of its nodes, or says what this machine lacks.
async fn attached(
    device: UsbDevice,
    wall: impl Fn() -> Duration + Send + 'static,
) -> Result<Nodes, String> {
    let attachment = attach(device).map_err(|e| e.to_string())?;
    let port = attachment.port().clone();
    tokio::spawn(async move {
        // The kernel lets go, or breaks off: the device is gone either way.
        let _ = attachment.run(wall).await;
    });
    let waited = tokio::time::timeout(NODES, async {
        while !port.nodes().is_complete() {
            tokio::time::sleep(POLL).await;
        }
    });
    // Whether in time or not, what is there counts.
    let _ = waited.await;
    let nodes = port.nodes();
    let driver = match (&nodes.camera, &nodes.tty) {
        (Some(_), Some(_)) => return Ok(nodes),
        (None, _) => "uvcvideo has made no camera",
        (_, None) => "cdc_acm has made no port",
    };
    Err(format!("{driver} of it within {} s", NODES.as_secs()))
}

async fn until(mut stopped: watch::Receiver<bool>) {
    // A sender that is gone is an end too.
    let _ = stopped.wait_for(|&stop| stop).await;
}

fn runtime() -> Result<Runtime> {
    let runtime = Builder::new_current_thread().enable_all().build();
    runtime.map_err(|e| Error::io("event loop", e))
}
