//! What the device says of itself when it enumerates, from its profile.
//!
//! Four interfaces in two functions: video control and streaming (UVC 1.1), and the serial port's
//! communications and data interface (CDC-ACM).

use crate::profile::{Profile, Speed, Transfer};
use crate::protocol::PixelFormat;
use crate::protocol::usb::descriptor::{class, kind, string, video};
use crate::protocol::usb::uvc;

/// Interface of video control.
pub(super) const VIDEO_CONTROL: u8 = 0;
/// Interface of video streaming.
pub(super) const VIDEO_STREAMING: u8 = 1;
/// Interface of the serial port's control.
pub(super) const SERIAL_CONTROL: u8 = 2;
/// Interface of the serial port's data.
pub(super) const SERIAL_DATA: u8 = 3;
/// Interfaces in all.
pub(super) const INTERFACES: u8 = 4;

/// Frames to the host.
pub(super) const VIDEO_IN: u8 = 1;
/// Notifications to the host.
pub(super) const NOTIFY_IN: u8 = 2;
/// Serial data to the host.
pub(super) const SERIAL_IN: u8 = 3;
/// Serial data to the device.
pub(super) const SERIAL_OUT: u8 = 3;

/// Addresses of all endpoints but the control endpoint's, with their direction in bit 7.
pub(super) const ENDPOINTS: [u8; 4] = [
    TO_HOST | VIDEO_IN,
    TO_HOST | NOTIFY_IN,
    TO_HOST | SERIAL_IN,
    SERIAL_OUT,
];

/// Entity of the camera, with the exposure control.
pub(super) const CAMERA_TERMINAL: u8 = 1;
/// Entity with the gain control.
pub(super) const PROCESSING_UNIT: u8 = 2;
const OUTPUT_TERMINAL: u8 = 3;

const CLOCK_HZ: u32 = 48_000_000;
/// Packets that the kernel puts into one transfer: one payload is one transfer then.
const PACKETS_PER_PAYLOAD: u32 = 32;
/// Largest bulk packet at full speed.
const FULL_SPEED_PACKET: u16 = 64;
const TO_HOST: u8 = 0x80;
const BULK: u8 = 2;
const INTERRUPT: u8 = 3;
/// Isochronous and asynchronous.
const ISOCHRONOUS: u8 = 5;

/// A format that the camera offers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Mode {
    pub(super) format: PixelFormat,
    pub(super) width: u32,
    pub(super) height: u32,
}

impl Mode {
    /// Bytes of a frame.
    pub(super) fn frame_len(&self) -> u32 {
        self.width * self.height * self.format.bytes_per_pixel() as u32
    }
}

/// All that enumerates.
#[derive(Debug, Clone)]
pub(super) struct Descriptors {
    pub(super) device: Vec<u8>,
    pub(super) configuration: Vec<u8>,
    /// What the device would be at its other speed; SuperSpeed devices have none.
    pub(super) qualifier: Option<Vec<u8>>,
    /// The configuration at full speed, of a high-speed device on a slow port.
    pub(super) other_speed: Option<Vec<u8>>,
    /// Capabilities of a SuperSpeed device.
    pub(super) bos: Option<Vec<u8>>,
    /// Strings from number 1 on.
    strings: Vec<String>,
    /// Formats from number 1 on.
    pub(super) modes: Vec<Mode>,
    /// Frame intervals in units of 100 ns, the shortest and default first.
    pub(super) intervals: Vec<u32>,
    /// Largest payload in bytes.
    pub(super) max_payload: u32,
    pub(super) transfer: Transfer,
}

impl Descriptors {
    /// The descriptors of a profile whose camera offers these modes, the first by default.
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

    /// A string descriptor; number 0 lists the languages: English (United States).
    pub(super) fn string(&self, number: u8) -> Option<Vec<u8>> {
        match number {
            0 => Some(vec![4, kind::STRING, 0x09, 0x04]),
            n => self
                .strings
                .get(usize::from(n) - 1)
                .map(|text| string(text)),
        }
    }

    /// What a host gets that asks for nothing in particular.
    pub(super) fn default_negotiation(&self) -> uvc::Negotiation {
        self.negotiation(1, self.intervals[0])
    }

    /// The agreement on a mode, from 1, at an interval.
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

/// Units of 100 ns of a profile's interval in microseconds.
fn interval_units(us: f64) -> u32 {
    (us * 10.0).round().clamp(1.0, f64::from(u32::MAX)) as u32
}

/// USB 2.0 extension and SuperSpeed capability (USB 3.2, 9.6.2).
fn bos() -> Vec<u8> {
    let extension = [7, kind::DEVICE_CAPABILITY, 2, 2, 0, 0, 0];
    // Speeds: 5 Gbit/s; all functions from it on.
    let speed = [10, kind::DEVICE_CAPABILITY, 3, 0, 8, 0, 3, 0, 0, 0];
    let total = (5 + extension.len() + speed.len()) as u16;
    let [low, high] = total.to_le_bytes();
    [&[5, kind::BOS, low, high, 2][..], &extension, &speed].concat()
}

#[derive(Clone, Copy)]
struct Draft {
    usb: crate::profile::Usb,
    super_speed: bool,
    /// Largest packet of a bulk endpoint.
    packet: u16,
}

impl Draft {
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
        // Attributes: bus powered; bit 7 is always set.
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

    fn video_control(&self) -> Vec<u8> {
        // Exposure time, absolute: bit 3.
        let camera = [
            18,
            kind::CS_INTERFACE,
            video::INPUT_TERMINAL,
            CAMERA_TERMINAL,
            1,
            2,
            0,
            0,
            0,
            0,
            0,
            0,
            0,
            0,
            3,
            0x08,
            0,
            0,
        ];
        // Gain: bit 9.
        let processing = [
            12,
            kind::CS_INTERFACE,
            video::PROCESSING_UNIT,
            PROCESSING_UNIT,
            CAMERA_TERMINAL,
            0,
            0,
            2,
            0,
            0x02,
            0,
            0,
        ];
        let output = [
            9,
            kind::CS_INTERFACE,
            video::OUTPUT_TERMINAL,
            OUTPUT_TERMINAL,
            1,
            1,
            0,
            PROCESSING_UNIT,
            0,
        ];
        let total = (13 + camera.len() + processing.len() + output.len()) as u16;
        let [low, high] = total.to_le_bytes();
        let clock = CLOCK_HZ.to_le_bytes();
        let head = [
            13,
            kind::CS_INTERFACE,
            video::CONTROL_HEADER,
            0x10,
            0x01,
            low,
            high,
            clock[0],
            clock[1],
            clock[2],
            clock[3],
            1,
            VIDEO_STREAMING,
        ];
        let interface = interface(
            VIDEO_CONTROL,
            0,
            0,
            [class::VIDEO, class::VIDEO_CONTROL, 0],
            4,
        );
        [&interface[..], &head, &camera, &processing, &output].concat()
    }

    fn video_streaming(&self, modes: &[Mode], intervals: &[u32]) -> Vec<u8> {
        let formats: Vec<u8> = modes
            .iter()
            .zip(1..)
            .flat_map(|(mode, number)| format_and_frame(mode, number, intervals))
            .collect();
        let count = modes.len() as u8;
        let head_len = 13 + count;
        let [low, high] = (u16::from(head_len) + formats.len() as u16).to_le_bytes();
        let mut head = vec![
            head_len,
            kind::CS_INTERFACE,
            video::INPUT_HEADER,
            count,
            low,
            high,
            TO_HOST | VIDEO_IN,
            0,
            OUTPUT_TERMINAL,
            0,
            0,
            0,
            1,
        ];
        head.extend(std::iter::repeat_n(0, modes.len()));
        let class = [class::VIDEO, class::VIDEO_STREAMING, 0];
        match self.usb.transfer {
            Transfer::Bulk => [
                interface(VIDEO_STREAMING, 0, 1, class, 0),
                head,
                formats,
                self.endpoint(TO_HOST | VIDEO_IN, BULK, self.packet, 0, 15),
            ]
            .concat(),
            Transfer::Isochronous => {
                let endpoint = if self.super_speed {
                    self.endpoint(TO_HOST | VIDEO_IN, ISOCHRONOUS, 1024, 1, 2)
                } else if self.packet == FULL_SPEED_PACKET {
                    self.endpoint(TO_HOST | VIDEO_IN, ISOCHRONOUS, 1023, 1, 0)
                } else {
                    // Three packets of 1024 bytes a microframe.
                    self.endpoint(TO_HOST | VIDEO_IN, ISOCHRONOUS, 2 << 11 | 1024, 1, 0)
                };
                [
                    interface(VIDEO_STREAMING, 0, 0, class, 0),
                    head,
                    formats,
                    interface(VIDEO_STREAMING, 1, 1, class, 0),
                    endpoint,
                ]
                .concat()
            }
        }
    }

    fn serial(&self) -> Vec<u8> {
        let call = [5, kind::CS_INTERFACE, 1, 0, SERIAL_DATA];
        // Line coding and control lines; break.
        let abilities = [4, kind::CS_INTERFACE, 2, 0x06];
        let union = [5, kind::CS_INTERFACE, 6, SERIAL_CONTROL, SERIAL_DATA];
        // 16 ms: as a power of two of microframes, at full speed as they are.
        let every = if self.packet == FULL_SPEED_PACKET {
            16
        } else {
            8
        };
        let notify = self.endpoint(TO_HOST | NOTIFY_IN, INTERRUPT, 16, every, 0);
        [
            // Abstract control model, AT commands: what drivers look for.
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

    /// An endpoint, with its companion at SuperSpeed.
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

/// VS_FORMAT_UNCOMPRESSED, VS_FRAME_UNCOMPRESSED and VS_COLORFORMAT of one mode.
fn format_and_frame(mode: &Mode, number: u8, intervals: &[u32]) -> Vec<u8> {
    let bits = 8 * mode.format.bytes_per_pixel() as u8;
    let mut bytes = vec![
        27,
        kind::CS_INTERFACE,
        video::FORMAT_UNCOMPRESSED,
        number,
        1,
    ];
    bytes.extend(uvc::guid(mode.format));
    bytes.extend([bits, 1, 0, 0, 0, 0]);
    let len = mode.frame_len();
    let rate = |interval: u32| {
        let bits = u64::from(len) * 8 * 10_000_000 / u64::from(interval.max(1));
        u32::try_from(bits).unwrap_or(u32::MAX)
    };
    let slowest = intervals.last().copied().unwrap_or(1);
    bytes.extend([26 + 4 * intervals.len() as u8, kind::CS_INTERFACE]);
    bytes.extend([video::FRAME_UNCOMPRESSED, 1, 0]);
    bytes.extend((mode.width as u16).to_le_bytes());
    bytes.extend((mode.height as u16).to_le_bytes());
    for word in [rate(slowest), rate(intervals[0]), len, intervals[0]] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.push(intervals.len() as u8);
    bytes.extend(intervals.iter().flat_map(|interval| interval.to_le_bytes()));
    // BT.709 primaries, linear transfer, SMPTE 170M matrix.
    bytes.extend([6, kind::CS_INTERFACE, video::COLOR_FORMAT, 1, 6, 4]);
    bytes
}
