//! The video function of a configuration, located by its class codes (UVC 1.1, chapter 3).

use super::topology::{Configuration, Endpoint, Interface, TransferKind, long, word};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::PixelFormat;
use phasmid_protocol::usb::descriptor::{class, video};
use phasmid_protocol::usb::uvc;

/// Terminal type of a camera input: ITT_CAMERA.
const CAMERA: u16 = 0x0201;
/// Bit in a camera terminal's `bmControls`: exposure time, absolute.
const EXPOSURE: usize = 3;
/// Bit in a processing unit's `bmControls`: gain.
const GAIN: usize = 9;

/// A video mode that a camera offers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VideoMode {
    /// `bFormatIndex`.
    pub format_index: u8,
    /// `bFrameIndex`.
    pub frame_index: u8,
    /// Pixel format.
    pub format: PixelFormat,
    /// Width, in pixels.
    pub width: u32,
    /// Height, in pixels.
    pub height: u32,
    /// Default frame interval, in units of 100 ns.
    pub default_interval: u32,
    /// Frame intervals, in units of 100 ns; for a range: minimum, maximum and step.
    pub intervals: Vec<u32>,
    /// Whether `intervals` describes a range.
    pub is_range: bool,
}

impl VideoMode {
    /// Returns the size of a frame, in bytes.
    pub fn frame_len(&self) -> u64 {
        self.format.frame_bytes(self.width, self.height) as u64
    }
}

/// A camera, as described by its descriptors.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VideoFunction {
    /// Release of the video class, binary coded decimal.
    pub uvc_bcd: u16,
    /// Number of the control interface.
    pub control: u8,
    /// Number of the streaming interface.
    pub streaming: u8,
    /// Id of the entity with the exposure control.
    pub exposure_entity: Option<u8>,
    /// Id of the entity with the gain control.
    pub gain_entity: Option<u8>,
    /// Modes in the supported pixel formats, the device's first choice first.
    pub modes: Vec<VideoMode>,
    /// Alternate settings of the streaming interface that carry the stream, each with its endpoint:
    /// one bulk setting, or the isochronous settings, slowest first.
    pub carriers: Vec<(u8, Endpoint)>,
}

impl VideoFunction {
    /// Finds the first camera.
    ///
    /// # Errors
    /// Returns an error if there is none, or if its descriptors are invalid.
    pub fn find(configuration: &Configuration) -> Result<Self> {
        Self::first(configuration).map_err(Error::device)
    }

    fn first(configuration: &Configuration) -> Result<Self, String> {
        let is = |interface: &&Interface, subclass| {
            interface.class[..2] == [class::VIDEO, subclass] && interface.setting == 0
        };
        let control = configuration
            .interfaces
            .iter()
            .find(|i| is(i, class::VIDEO_CONTROL))
            .ok_or("the device has no camera (no video control interface)")?;
        let header = extra(control, video::CONTROL_HEADER).ok_or("no video control header")?;
        let listed = header.get(12..).unwrap_or_default();
        let streaming = configuration
            .interfaces
            .iter()
            .find(|i| is(i, class::VIDEO_STREAMING) && listed.contains(&i.number))
            .ok_or("the camera has no streaming interface")?;
        let input = extra(streaming, video::INPUT_HEADER)
            .filter(|d| d.len() >= 13)
            .ok_or("no video input header")?;
        let address = input[6];
        let mut carriers: Vec<(u8, Endpoint)> = configuration
            .settings(streaming.number)
            .flat_map(|i| i.endpoints.iter().map(|e| (i.setting, e.clone())))
            .filter(|(_, e)| e.address == address && address & 0x80 != 0)
            .filter(|(_, e)| matches!(e.kind, TransferKind::Bulk | TransferKind::Isochronous))
            .filter(|(_, e)| e.max_packet > 0)
            .collect();
        carriers.sort_by_key(|(_, e)| e.bytes_per_interval);
        if carriers.is_empty() {
            return Err(format!("no endpoint {address:#04x} carries the stream"));
        }
        let modes = modes(streaming);
        if modes.is_empty() {
            return Err(
                "video formats: the camera offers none that can be read; expected one of Y800, \
                 YUY2, Y10, Y12, Y16, Y10P and Y12P"
                    .to_owned(),
            );
        }
        let cameras = control
            .extra
            .iter()
            .filter(|d| d[2] == video::INPUT_TERMINAL && d.len() >= 15 && word(d, 4) == CAMERA);
        let units = control
            .extra
            .iter()
            .filter(|d| d[2] == video::PROCESSING_UNIT && d.len() >= 8);
        let entity = |d: &Vec<u8>| d[3];
        Ok(Self {
            uvc_bcd: word(header, 3),
            control: control.number,
            streaming: streaming.number,
            exposure_entity: cameras.filter(|d| has(d, 14, EXPOSURE)).map(entity).next(),
            gain_entity: units.filter(|d| has(d, 7, GAIN)).map(entity).next(),
            modes,
            carriers,
        })
    }
}

/// Tests a bit in the bitmap whose length byte is at offset `at`.
fn has(descriptor: &[u8], at: usize, bit: usize) -> bool {
    let len = usize::from(descriptor[at]);
    bit / 8 < len
        && descriptor
            .get(at + 1 + bit / 8)
            .is_some_and(|byte| byte >> (bit % 8) & 1 == 1)
}

fn extra(interface: &Interface, subtype: u8) -> Option<&[u8]> {
    let found = interface.extra.iter().find(|d| d[2] == subtype);
    found.map(Vec::as_slice)
}

fn modes(streaming: &Interface) -> Vec<VideoMode> {
    let mut modes = Vec::new();
    let mut format = None;
    for d in &streaming.extra {
        match d[2] {
            video::FORMAT_UNCOMPRESSED if d.len() >= 27 => {
                format = uvc::format(&d[5..21]).map(|format| (d[3], d[22], format));
            }
            video::FRAME_UNCOMPRESSED if d.len() >= 26 => {
                let Some((format_index, first, format)) = format else {
                    continue;
                };
                let mode = VideoMode {
                    format_index,
                    frame_index: d[3],
                    format,
                    width: word(d, 5).into(),
                    height: word(d, 7).into(),
                    default_interval: long(d, 21),
                    intervals: d[26..].chunks_exact(4).map(|b| long(b, 0)).collect(),
                    is_range: d[25] == 0,
                };
                if mode.frame_len() == 0 {
                    continue;
                }
                // List the default frame size of a format before the format's other sizes.
                let same = |m: &VideoMode| m.format_index == format_index;
                let begin = modes.iter().position(same).unwrap_or(modes.len());
                let at = if mode.frame_index == first {
                    begin
                } else {
                    modes.len()
                };
                modes.insert(at, mode);
            }
            video::FRAME_UNCOMPRESSED | video::COLOR_FORMAT | video::INPUT_HEADER => {}
            // Frame descriptors after another format descriptor belong to that format.
            _ => format = None,
        }
    }
    modes
}
