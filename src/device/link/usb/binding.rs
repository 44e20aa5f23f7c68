//! Connects the firmware to its USB device: translates host actions to firmware calls and reports
//! the firmware's state to the host.

use super::{CameraState, Event, UsbDevice};
use crate::{CameraControls, Firmware, State, Stream, StreamSink};
use phasmid_core::error::{Error, Result};
use phasmid_profile::{DsrUse, Profile, RtsUse, Usb};
use phasmid_protocol::usb::cdc::{DeviceLines, HostLines};
use phasmid_protocol::usb::uvc;
use phasmid_protocol::{Frame, PixelFormat};
use std::sync::Arc;
use std::time::Duration;

/// A USB device and the firmware state that it shows to a host.
pub struct Binding {
    device: UsbDevice,
    usb: Usb,
    host_lines: HostLines,
    lines: DeviceLines,
}

/// An event for the loop that serves the serial port.
pub(in crate::link) enum PortEvent {
    /// Bytes were received.
    Data(Vec<u8>),
    /// The host has closed the port.
    HungUp,
}

impl Binding {
    /// Creates the USB device of a profile in front of its firmware. `number`, from 1, is its
    /// position on the bus.
    ///
    /// # Errors
    /// Returns an error if the frames are too large for the video class.
    pub fn new(profile: &Profile, firmware: &Firmware, number: u32) -> Result<Self> {
        let stream = firmware.stream();
        let mut formats = vec![stream.format];
        let others = profile.camera.sensor.formats().iter().copied();
        formats.extend(others.filter(|&format| {
            let pairs = format != PixelFormat::Yuyv || stream.width.is_multiple_of(2);
            // uvcvideo has no code for packed formats and would list them without a name, so a
            // device offers a packed format only if its profile selects that format.
            format != stream.format && pairs && !format.is_packed()
        }));
        let controls = camera_state(firmware);
        let size = (stream.width, stream.height);
        Ok(Self {
            device: UsbDevice::new(profile, number, size, &formats, controls)?,
            usb: profile.usb,
            host_lines: HostLines::default(),
            lines: DeviceLines::default(),
        })
    }

    /// Returns the device to serve.
    pub fn device(&self) -> &UsbDevice {
        &self.device
    }

    /// Returns whether a host reads frames.
    pub(in crate::link) fn attended(&self) -> bool {
        self.device.is_streaming()
    }

    /// Returns whether a host reads frames and its queue has room for another frame of a
    /// free-running camera.
    pub(in crate::link) fn keeps_up(&self) -> bool {
        self.device.is_streaming() && !self.device.is_crowded()
    }

    /// Queues a frame for the host; ignores frames whose format differs from the stream's.
    pub(in crate::link) fn put(&self, frame: &Arc<Frame>, now: Duration) {
        self.device.put(frame.clone(), now);
    }

    /// Returns the number of frames lost because the host reads too slowly.
    pub(in crate::link) fn lost(&self) -> u64 {
        self.device.lost()
    }

    /// Sends a reply. Returns `false` if too many replies are queued.
    pub(in crate::link) fn send(&self, bytes: &[u8], now: Duration) -> bool {
        self.device.send(bytes, now)
    }

    /// Waits for an event from a host.
    pub(in crate::link) async fn changed(&self) {
        self.device.changed().await;
    }

    /// Applies the host's events to the firmware at device time `now_ns`. Returns the events that
    /// concern the serial port.
    pub(in crate::link) fn work_off(
        &mut self,
        firmware: &mut Firmware,
        now_ns: u64,
    ) -> Vec<PortEvent> {
        let mut port = Vec::new();
        for event in self.device.take_events() {
            let controls = firmware.camera_controls();
            match event {
                Event::Received(bytes) => port.push(PortEvent::Data(bytes)),
                Event::Exposure(exposure_ns) => {
                    firmware.set_camera_controls(CameraControls {
                        exposure_ns,
                        ..controls
                    });
                }
                Event::Gain(gain_db) => {
                    firmware.set_camera_controls(CameraControls {
                        gain_db,
                        ..controls
                    });
                }
                Event::Committed(agreed) => {
                    let format = self.device.format(agreed.format);
                    let interval_ns = u64::from(agreed.interval) * uvc::INTERVAL_UNIT_NS;
                    firmware.set_stream(format, interval_ns);
                }
                Event::Lines(lines) => {
                    let rises = lines.rts && !self.host_lines.rts;
                    if rises && self.usb.rts == RtsUse::Trigger {
                        firmware.external_trigger(now_ns);
                    }
                    if self.host_lines.dtr && !lines.dtr {
                        port.push(PortEvent::HungUp);
                    }
                    self.host_lines = lines;
                }
                Event::LineCoding(line) => firmware.set_line_coding(line),
                // A break on the serial line clears the input, as on a terminal.
                Event::Break(true) | Event::Detached => port.push(PortEvent::HungUp),
                Event::Break(false) | Event::Attached | Event::Started | Event::Stopped => {}
            }
        }
        port
    }

    /// Reports the firmware's state to the host.
    pub(in crate::link) fn refresh(&mut self, firmware: &Firmware, now: Duration) {
        self.device.set_camera(camera_state(firmware));
        let running = matches!(firmware.state(), State::Running { .. });
        let lines = DeviceLines {
            dcd: true,
            dsr: self.usb.dsr == DsrUse::Ready || running,
        };
        if lines != self.lines {
            self.lines = lines;
            self.device.set_lines(lines, now);
        }
    }

    /// Returns the sink that rejects frame formats which the device did not announce to the host.
    pub(in crate::link) fn gate(&self, stream: Stream) -> Gate {
        Gate {
            device: self.device.clone(),
            stream,
        }
    }
}

fn camera_state(firmware: &Firmware) -> CameraState {
    let CameraControls {
        exposure_ns,
        gain_db,
    } = firmware.camera_controls();
    CameraState {
        exposure_ns,
        gain_db,
        settable_ns: firmware.settable_exposure_ns(),
    }
}

/// Rejects changes to frame sizes and formats that contradict the USB descriptors of the device.
pub(in crate::link) struct Gate {
    device: UsbDevice,
    /// Frame size and format that the device was created for.
    stream: Stream,
}

impl StreamSink for Gate {
    fn announce(&mut self, stream: &Stream) -> Result<()> {
        if (stream.width, stream.height) != (self.stream.width, self.stream.height) {
            return Err(Error::device(format!(
                "the USB camera has frames of {} x {} pixels",
                self.stream.width, self.stream.height
            )));
        }
        if !self.device.offers(stream.format) {
            return Err(Error::device(format!(
                "the USB camera does not offer {}; set it as `format` in the profile's [camera]",
                stream.format.name()
            )));
        }
        if self.device.is_streaming() && stream.format != self.stream.format {
            return Err(Error::device("a host reads from the USB camera"));
        }
        self.stream = *stream;
        Ok(())
    }
}
