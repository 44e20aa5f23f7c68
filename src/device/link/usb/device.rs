//! The handle of a USB device, which the firmware and a host's connection share; only one host can
//! use a device at a time.

use super::descriptors::{Descriptors, INTERFACES, Mode};
use super::function::Function;
use super::session::Session;
use super::{CameraLimits, CameraState, Event, Fault};
use phasmid_core::error::{Error, Result};
use phasmid_profile::{Profile, Speed};
use phasmid_protocol::usb::cdc::DeviceLines;
use phasmid_protocol::usb::descriptor::{Walk, class, kind};
use phasmid_protocol::usb::usbip::DeviceInfo;
use phasmid_protocol::{Frame, PixelFormat};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;

struct Shared {
    session: Mutex<Session>,
    /// Notified when the connection has something to send or may read again.
    outward: Notify,
    /// Notified when the firmware has events to process.
    inward: Notify,
}

/// A USB device that hosts can attach; clones refer to the same device.
#[derive(Clone)]
pub struct UsbDevice {
    shared: Arc<Shared>,
    info: Arc<DeviceInfo>,
}

impl UsbDevice {
    /// Creates the device of a profile, whose camera has `width` x `height` pixels and offers the
    /// given formats, the first by default. `number`, from 1, is the device's position on the bus.
    ///
    /// # Errors
    /// Returns an error if the frames are too large for the video class.
    pub fn new(
        profile: &Profile,
        number: u32,
        (width, height): (u32, u32),
        formats: &[PixelFormat],
        camera: CameraState,
    ) -> Result<Self> {
        let largest = 2 * u64::from(width) * u64::from(height);
        if width > u32::from(u16::MAX) || height > u32::from(u16::MAX) || largest > 1 << 30 {
            return Err(Error::input(
                format!("profile {}", profile.name),
                format!("frames of {width} x {height} pixels"),
                "up to 65535 x 65535 pixels and 1 GiB over USB",
            ));
        }
        let modes: Vec<Mode> = formats
            .iter()
            .map(|&format| Mode {
                format,
                width,
                height,
            })
            .collect();
        let descriptors = Descriptors::new(profile, &modes);
        let ns = |us: f64| (us * 1e3).round() as u64;
        let [shortest, longest] = profile.camera.exposure_range_us;
        let limits = CameraLimits {
            exposure_ns: (ns(shortest), ns(longest)),
            default_exposure_ns: ns(profile.camera.exposure_us),
            max_gain_db: profile.camera.max_gain_db,
        };
        let usb = &profile.usb;
        let info = DeviceInfo {
            bus_id: format!("1-{number}"),
            bus: 1,
            device: number + 1,
            speed: match usb.speed {
                Speed::High => 3,
                Speed::Super => 5,
            },
            vendor: usb.vendor_id,
            product: usb.product_id,
            release: usb.release_bcd,
            class: class::COMPOSITE,
            interfaces: INTERFACES,
        };
        Ok(Self {
            shared: Arc::new(Shared {
                session: Mutex::new(Session::new(Function::new(descriptors, limits, camera))),
                outward: Notify::new(),
                inward: Notify::new(),
            }),
            info: Arc::new(info),
        })
    }

    /// Returns the pixel format that a format number in the negotiated stream parameters stands for.
    pub(super) fn format(&self, number: u8) -> PixelFormat {
        let session = self.session();
        let modes = &session.function.descriptors.modes;
        modes[usize::from(number).clamp(1, modes.len()) - 1].format
    }

    /// Returns whether the camera offers a format.
    pub(super) fn offers(&self, format: PixelFormat) -> bool {
        let session = self.session();
        let modes = &session.function.descriptors.modes;
        modes.iter().any(|mode| mode.format == format)
    }

    /// Returns the device's description for USB/IP.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// Returns the class, subclass and protocol of each interface, each followed by a zero, as in
    /// USB/IP device lists.
    pub(super) fn interface_classes(&self) -> Vec<u8> {
        let configuration = self.session().function.descriptors.configuration.clone();
        Walk::new(&configuration)
            // Count each interface once: only its alternate setting 0.
            .filter(|d| d[1] == kind::INTERFACE && d[3] == 0)
            .flat_map(|d| [d[5], d[6], d[7], 0])
            .collect()
    }

    fn session(&self) -> MutexGuard<'_, Session> {
        let session = self.shared.session.lock();
        session.unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the session, then wakes the connection and the firmware.
    pub(super) fn with<T>(&self, change: impl FnOnce(&mut Session) -> T) -> T {
        let (value, outward, inward) = {
            let mut session = self.session();
            let value = change(&mut session);
            let outward = !session.outgoing.is_empty() || session.unplugged;
            (value, outward, !session.events.is_empty())
        };
        if outward {
            self.shared.outward.notify_one();
        }
        if inward {
            self.shared.inward.notify_one();
        }
        value
    }

    /// Returns whether the firmware's event queue is full, so that hosts have to wait.
    pub(super) fn is_behind(&self) -> bool {
        self.session().events.is_full()
    }

    /// Waits until the connection has something to send, or may read again.
    pub(super) async fn outward(&self) {
        self.shared.outward.notified().await;
    }

    /// Waits for an event from a host; [`Self::take_events`] then returns it.
    pub async fn changed(&self) {
        self.shared.inward.notified().await;
    }

    /// Takes the events that hosts have caused since the last call.
    pub fn take_events(&self) -> Vec<Event> {
        let (events, was_full) = self.with(|session| {
            let was_full = session.events.is_full();
            let events = session.events.take();
            // Serial data that waited until these events were taken can be delivered now.
            session.pump_serial();
            (events, was_full)
        });
        if was_full {
            // The connection may read commands again.
            self.shared.outward.notify_one();
        }
        events
    }

    /// Returns whether a host reads frames.
    pub fn is_streaming(&self) -> bool {
        self.session().video.started
    }

    /// Returns whether as many frames are queued for the host as a free-running camera may queue.
    pub fn is_crowded(&self) -> bool {
        self.session().video.is_crowded()
    }

    /// Queues a frame at time `now` of the connection's clock. Returns `false` if no host reads, the
    /// stream has another format, or too many frames are queued.
    pub fn put(&self, frame: Arc<Frame>, now: Duration) -> bool {
        self.with(|session| {
            let fits = session.function.stream().is_some_and(|stream| {
                session.function.descriptors.modes[usize::from(stream.format) - 1].format
                    == frame.format
                    && stream.max_frame as usize == frame.data.len()
            });
            if !fits || !session.video.started {
                return false;
            }
            let taken = session.video.put(frame);
            if taken {
                session.pump(now);
            } else {
                session.lost += 1;
            }
            taken
        })
    }

    /// Returns the number of frames lost because the host reads too slowly.
    pub fn lost(&self) -> u64 {
        self.session().lost
    }

    /// Sends bytes over the serial port. Returns `false` if too many bytes are queued.
    pub fn send(&self, bytes: &[u8], now: Duration) -> bool {
        self.with(|session| {
            let sent = session.serial.send(bytes);
            session.pump(now);
            sent
        })
    }

    /// Sets the camera state that hosts can read.
    pub fn set_camera(&self, camera: CameraState) {
        self.session().function.set_camera(camera);
    }

    /// Sets the state of the serial lines that the device drives.
    pub fn set_lines(&self, lines: DeviceLines, now: Duration) {
        self.with(|session| {
            session.serial.set_lines(lines);
            session.pump(now);
        });
    }

    /// Queues a fault for the next frame that has no fault yet.
    pub fn inject(&self, fault: Fault) {
        self.session().video.faults.push(fault);
    }

    /// Unplugs the device (`out` is `true`), even while it is attached, or plugs it in again
    /// (`false`).
    pub fn unplug(&self, out: bool) {
        self.with(|session| session.unplugged = out);
    }
}

/// A device attached to a host; dropping this value detaches the device, however the connection
/// ends.
pub(super) struct Attached(UsbDevice);

impl Attached {
    /// Attaches a device.
    ///
    /// # Errors
    /// Returns an error if another host has attached the device, if it is unplugged, or if too many
    /// events wait for the firmware.
    pub(super) fn take(device: &UsbDevice) -> Result<Self> {
        if device.with(Session::attach) {
            Ok(Self(device.clone()))
        } else {
            Err(Error::device(
                "USB: device busy: attached elsewhere or not ready",
            ))
        }
    }

    pub(super) fn device(&self) -> &UsbDevice {
        &self.0
    }
}

impl Drop for Attached {
    fn drop(&mut self) {
        self.0.with(Session::detach);
    }
}
