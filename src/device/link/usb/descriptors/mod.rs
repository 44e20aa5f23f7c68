//! USB descriptors of the device, built from its profile.
//!
//! The device has four interfaces in two functions: the camera has interfaces for video control and
//! streaming (UVC 1.1), the serial port has a communications and a data interface (CDC-ACM).

mod streaming;
mod video_control;

use phasmid_profile::{Profile, Speed, Transfer, Usb};
use phasmid_protocol::PixelFormat;
use phasmid_protocol::usb::descriptor::{class, kind, string};
use phasmid_protocol::usb::uvc;

/// Interface of video control.
pub(super) const VIDEO_CONTROL: u8 = 0;
/// Interface of video streaming.
pub(super) const VIDEO_STREAMING: u8 = 1;
/// Interface of the serial port's control.
pub(super) const SERIAL_CONTROL: u8 = 2;
/// Interface of the serial port's data.
pub(super) const SERIAL_DATA: u8 = 3;
/// Number of interfaces.
pub(super) const INTERFACES: u8 = 4;

/// Endpoint for frames to the host.
pub(super) const VIDEO_IN: u8 = 1;
/// Endpoint for notifications to the host.
pub(super) const NOTIFY_IN: u8 = 2;
/// Endpoint for serial data to the host.
pub(super) const SERIAL_IN: u8 = 3;
/// Endpoint for serial data to the device.
pub(super) const SERIAL_OUT: u8 = 3;

/// Direction bit of an endpoint address: device to host.
const TO_HOST: u8 = 0x80;
/// Endpoint attributes.
const BULK: u8 = 2;
const INTERRUPT: u8 = 3;
/// Isochronous endpoint with asynchronous synchronisation.
const ISOCHRONOUS: u8 = 5;

/// Addresses of all endpoints except the control endpoint, with the direction in bit 7.
pub(super) const ENDPOINTS: [u8; 4] = [
    TO_HOST | VIDEO_IN,
    TO_HOST | NOTIFY_IN,
    TO_HOST | SERIAL_IN,
    SERIAL_OUT,
];

/// Id of the camera terminal, the entity with the exposure control.
pub(super) const CAMERA_TERMINAL: u8 = 1;
/// Id of the processing unit, the entity with the gain control.
pub(super) const PROCESSING_UNIT: u8 = 2;

const CLOCK_HZ: u32 = 48_000_000;
/// Number of isochronous packets per payload, equal to the number that the kernel puts into one
/// transfer.
const PACKETS_PER_PAYLOAD: u32 = 32;
/// Maximum bulk packet size at full speed.
const FULL_SPEED_PACKET: u16 = 64;

/// A format offered by the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Mode {
    pub(super) format: PixelFormat,
    pub(super) width: u32,
    pub(super) height: u32,
}

impl Mode {
    /// Returns the size of a frame in bytes.
    pub(super) fn frame_len(&self) -> u32 {
        self.format.frame_bytes(self.width, self.height) as u32
    }
}

/// All descriptors that a host reads when it enumerates the device.
#[derive(Debug, Clone)]
pub(super) struct Descriptors {
    pub(super) device: Vec<u8>,
    pub(super) configuration: Vec<u8>,
    /// Device qualifier: describes the device at its other speed; `None` for SuperSpeed devices.
    pub(super) qualifier: Option<Vec<u8>>,
    /// Configuration at full speed, for a high-speed device on a full-speed port.
    pub(super) other_speed: Option<Vec<u8>>,
    /// Binary device object store (BOS) of a SuperSpeed device.
    pub(super) bos: Option<Vec<u8>>,
    /// Texts of the string descriptors, which are numbered from 1.
    strings: Vec<String>,
    /// Formats, which are numbered from 1.
    pub(super) modes: Vec<Mode>,
    /// Frame intervals in units of 100 ns; the first is the shortest and the default.
    pub(super) intervals: Vec<u32>,
    /// Maximum payload size in bytes.
    pub(super) max_payload: u32,
    pub(super) transfer: Transfer,
}

impl Descriptors {
    /// Builds the descriptors of a profile whose camera offers these modes; the first mode is the
    /// default.
    pub(super) fn new(profile: &Profile, modes: &[Mode]) -> Self {
        let usb = &profile.usb;
        let super_speed = usb.speed == Speed::Super;
        let packet: u16 = if super_speed { 1024 } else { 512 };
        let max_payload = match usb.transfer {
            Transfer::Bulk => PACKETS_PER_PAYLOAD * u32::from(packet),
            Transfer::Isochronous => 3 * 1024,
        };
        let base = interval_units(profile.camera.frame_interval_us);
        let intervals: Vec<u32> = [1u32, 2, 4]
            .iter()
            .filter_map(|factor| base.checked_mul(*factor))
            .collect();
        let release = usb.release_bcd.to_le_bytes();
        let (vendor, product) = (usb.vendor_id.to_le_bytes(), usb.product_id.to_le_bytes());
        let (version, packet0) = if super_speed { (3, 9) } else { (2, 64) };
        let [class, subclass, protocol] = class::COMPOSITE;
        let device = vec![
            18,
            kind::DEVICE,
            0,
            version,
            class,
            subclass,
            protocol,
            packet0,
            vendor[0],
            vendor[1],
            product[0],
            product[1],
            release[0],
            release[1],
            1,
            2,
            3,
            1,
        ];
        let qualifier = (!super_speed).then(|| {
            vec![
                10,
                kind::DEVICE_QUALIFIER,
                0,
                2,
                class,
                subclass,
                protocol,
                64,
                1,
                0,
            ]
        });
        let id = &profile.identity;
        let draft = Draft {
            usb: profile.usb,
            super_speed,
            packet,
        };
        let full_speed = Draft {
            packet: FULL_SPEED_PACKET,
            ..draft
        };
        let other_speed = (!super_speed).then(|| {
            let mut bytes = full_speed.configuration(modes, &intervals);
            bytes[1] = kind::OTHER_SPEED_CONFIGURATION;
            bytes
        });
        Self {
            device,
            configuration: draft.configuration(modes, &intervals),
            qualifier,
            other_speed,
            bos: super_speed.then(bos),
            strings: vec![
                id.manufacturer.clone(),
                id.model.clone(),
                id.serial.clone(),
                format!("{} camera", id.model),
                format!("{} control", id.model),
            ],
            modes: modes.to_vec(),
            intervals,
            max_payload,
            transfer: usb.transfer,
        }
    }

    /// Returns a string descriptor. Number 0 lists the languages, of which there is one: English
    /// (United States).
    pub(super) fn string(&self, number: u8) -> Option<Vec<u8>> {
        match number {
            0 => Some(vec![4, kind::STRING, 0x09, 0x04]),
            n => self
                .strings
                .get(usize::from(n) - 1)
                .map(|text| string(text)),
        }
    }

    /// Returns the default stream parameters.
    pub(super) fn default_negotiation(&self) -> uvc::Negotiation {
        self.negotiation(1, self.intervals[0])
    }

    /// Returns the stream parameters of a mode (numbered from 1) at an interval in units of 100 ns.
    pub(super) fn negotiation(&self, mode: u8, interval: u32) -> uvc::Negotiation {
        let mode = mode.clamp(1, self.modes.len() as u8);
        uvc::Negotiation {
            hint: 1,
            format: mode,
            frame: 1,
            interval,
            max_frame: self.modes[usize::from(mode) - 1].frame_len(),
            max_payload: self.max_payload,
            clock: CLOCK_HZ,
        }
    }
}

/// Converts a profile's interval from microseconds to units of 100 ns.
fn interval_units(us: f64) -> u32 {
    (us * 10.0).round().clamp(1.0, f64::from(u32::MAX)) as u32
}

/// Returns the BOS descriptor with the USB 2.0 extension and the SuperSpeed capability (USB 3.2,
/// 9.6.2).
fn bos() -> Vec<u8> {
    let extension = [7, kind::DEVICE_CAPABILITY, 2, 2, 0, 0, 0];
    // Supported speed: 5 Gbit/s, which is also the minimum that all functions require.
    let speed = [10, kind::DEVICE_CAPABILITY, 3, 0, 8, 0, 3, 0, 0, 0];
    let total = (5 + extension.len() + speed.len()) as u16;
    let [low, high] = total.to_le_bytes();
    [&[5, kind::BOS, low, high, 2][..], &extension, &speed].concat()
}

/// Parameters from which the descriptors are built.
#[derive(Clone, Copy)]
struct Draft {
    usb: Usb,
    super_speed: bool,
    /// Maximum packet size of a bulk endpoint in bytes.
    packet: u16,
}

impl Draft {
    /// Returns the configuration descriptor with all its subordinate descriptors.
    fn configuration(&self, modes: &[Mode], intervals: &[u32]) -> Vec<u8> {
        let body = [
            association(VIDEO_CONTROL, [class::VIDEO, 3, 0], 4),
            self.video_control(),
            self.video_streaming(modes, intervals),
            association(SERIAL_CONTROL, [class::COMMUNICATIONS, 2, 1], 5),
            self.serial(),
        ]
        .concat();
        let step = if self.super_speed { 8 } else { 2 };
        let power = self.usb.max_power_ma.div_ceil(step).min(255) as u8;
        let [low, high] = (9 + body.len() as u16).to_le_bytes();
        // Attributes: bit 7 is always set, and without bit 6 the device is bus powered.
        let head = [
            9,
            kind::CONFIGURATION,
            low,
            high,
            INTERFACES,
            1,
            0,
            0x80,
            power,
        ];
        [&head[..], &body].concat()
    }

    fn serial(&self) -> Vec<u8> {
        let call = [5, kind::CS_INTERFACE, 1, 0, SERIAL_DATA];
        // Capabilities: line coding and control lines (bit 1), break (bit 2).
        let abilities = [4, kind::CS_INTERFACE, 2, 0x06];
        let union = [5, kind::CS_INTERFACE, 6, SERIAL_CONTROL, SERIAL_DATA];
        // Polling interval of 16 ms: at high speed an exponent of microframes (2^(8-1) x 125 us), at
        // full speed a number of milliseconds.
        let every = if self.packet == FULL_SPEED_PACKET {
            16
        } else {
            8
        };
        let notify = self.endpoint(TO_HOST | NOTIFY_IN, INTERRUPT, 16, every, 0);
        [
            // Abstract control model with AT commands, the class that serial drivers look for.
            interface(SERIAL_CONTROL, 0, 1, [class::COMMUNICATIONS, 2, 1], 5),
            // CDC 1.10.
            vec![5, kind::CS_INTERFACE, 0, 0x10, 0x01],
            call.to_vec(),
            abilities.to_vec(),
            union.to_vec(),
            notify,
            interface(SERIAL_DATA, 0, 2, [class::CDC_DATA, 0, 0], 0),
            self.endpoint(TO_HOST | SERIAL_IN, BULK, self.packet, 0, 0),
            self.endpoint(SERIAL_OUT, BULK, self.packet, 0, 0),
        ]
        .concat()
    }

    /// Returns an endpoint descriptor, at SuperSpeed together with its companion descriptor.
    fn endpoint(&self, address: u8, kind_of: u8, packet: u16, interval: u8, burst: u8) -> Vec<u8> {
        let [low, high] = packet.to_le_bytes();
        let mut bytes = vec![7, kind::ENDPOINT, address, kind_of, low, high, interval];
        if self.super_speed {
            let periodic = kind_of != BULK;
            let each = if periodic {
                packet * (u16::from(burst) + 1)
            } else {
                0
            };
            let [low, high] = each.to_le_bytes();
            bytes.extend([6, kind::ENDPOINT_COMPANION, burst, 0, low, high]);
        }
        bytes
    }
}

fn association(first: u8, [class, subclass, protocol]: [u8; 3], name: u8) -> Vec<u8> {
    vec![
        8,
        kind::INTERFACE_ASSOCIATION,
        first,
        2,
        class,
        subclass,
        protocol,
        name,
    ]
}

/// Returns an interface descriptor for one alternate setting.
fn interface(number: u8, setting: u8, endpoints: u8, class: [u8; 3], name: u8) -> Vec<u8> {
    let [class, subclass, protocol] = class;
    vec![
        9,
        kind::INTERFACE,
        number,
        setting,
        endpoints,
        class,
        subclass,
        protocol,
        name,
    ]
}
