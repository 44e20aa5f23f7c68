//! A USB device behind a server, with a firmware that echoes serial data and sends numbered frames.

pub use crate::usb::fuzz::sample::{HEIGHT, WIDTH, frame};

use crate::usb::fuzz::sample;
use phasmid::host::usb::{UsbAddress, UsbDevice};
use phasmid::link::usb::UsbDevice as Emulated;
use phasmid::link::usb::{Event, UsbServer};
use phasmid::profile::{Profile, Speed, Transfer};
use phasmid::protocol::PixelFormat;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::sync::oneshot;

/// Number of frames that the firmware sends in a stream.
pub const SENT: u64 = 5000;
pub const TIMEOUT: Duration = Duration::from_secs(20);

/// Devices served on a port of their own until this value is dropped.
pub struct Served {
    pub host: String,
    pub devices: Vec<Emulated>,
    pub start: Instant,
    events: Mutex<Receiver<Event>>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Served {
    pub fn new(speed: Speed, transfer: Transfer) -> Self {
        Self::several(1, speed, transfer)
    }

    pub fn several(count: u32, speed: Speed, transfer: Transfer) -> Self {
        let profile = sample::profile(speed, transfer);
        Self::of(&profile, count)
    }

    pub fn of(profile: &Profile, count: u32) -> Self {
        Self::offering(profile, count, &[PixelFormat::Grey, PixelFormat::Yuyv])
    }

    /// Serves devices whose cameras offer these formats.
    pub fn offering(profile: &Profile, count: u32, formats: &[PixelFormat]) -> Self {
        let devices: Vec<Emulated> = (1..=count)
            .map(|i| sample::device_of(profile, i, formats))
            .collect();
        let formats = formats.to_vec();
        let start = Instant::now();
        let (events, seen) = channel();
        let (address, bound) = channel();
        let (stop, stopped) = oneshot::channel();
        let exported = devices.clone();
        let thread = std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .build();
            runtime.unwrap().block_on(async move {
                let any = "127.0.0.1:0".parse().unwrap();
                let server = UsbServer::bind(any, exported.clone()).await.unwrap();
                address.send(server.address().unwrap()).unwrap();
                for device in exported {
                    tokio::spawn(firmware(device, formats.clone(), start, events.clone()));
                }
                tokio::select! {
                    () = server.run(move || start.elapsed()) => {}
                    _ = stopped => {}
                }
            });
        });
        Self {
            host: bound.recv().unwrap().to_string(),
            devices,
            start,
            events: Mutex::new(seen),
            stop: Some(stop),
            thread: Some(thread),
        }
    }

    pub fn device(&self) -> &Emulated {
        &self.devices[0]
    }

    /// Opens the first device as a host does.
    pub fn open(&self) -> Arc<UsbDevice> {
        let address = UsbAddress::parse(&format!("usb:{}/1-1", self.host), "test").unwrap();
        // The server notices with a delay that the previous host has disconnected.
        let until = Instant::now() + TIMEOUT;
        loop {
            match UsbDevice::open(&address, TIMEOUT) {
                Ok(device) => return Arc::new(device),
                Err(e) if e.to_string().contains("refuses") && Instant::now() < until => {
                    std::thread::sleep(Duration::from_millis(2));
                }
                Err(e) => panic!("{e}"),
            }
        }
    }

    /// Waits for an event for which `wanted` is true, and returns it.
    pub fn wait(&self, wanted: impl Fn(&Event) -> bool) -> Event {
        let events = self.events.lock().unwrap();
        let until = Instant::now() + TIMEOUT;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let event = events.recv_timeout(left).expect("an event in time");
            if wanted(&event) {
                return event;
            }
        }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.stop.take().unwrap().send(());
        let ended = self.thread.take().unwrap().join();
        assert!(
            ended.is_ok() || std::thread::panicking(),
            "the server has panicked"
        );
    }
}

/// Echoes lines in upper case, and sends frames while a host reads them.
async fn firmware(
    device: Emulated,
    formats: Vec<PixelFormat>,
    start: Instant,
    events: Sender<Event>,
) {
    let mut id = 0;
    let mut format = formats[0];
    loop {
        tokio::select! {
            () = device.changed() => {}
            () = tokio::time::sleep(Duration::from_millis(1)) => {}
        }
        for event in device.take_events() {
            if let Event::Received(bytes) = &event {
                device.send(&bytes.to_ascii_uppercase(), start.elapsed());
            }
            match &event {
                Event::Started => id = 0,
                Event::Committed(agreed) => format = formats[usize::from(agreed.format) - 1],
                _ => {}
            }
            // The test may have ended.
            let _ = events.send(event);
        }
        // Frames that do not fit now are sent later.
        while id < SENT && device.put(Arc::new(frame(id, format)), start.elapsed()) {
            id += 1;
        }
    }
}
