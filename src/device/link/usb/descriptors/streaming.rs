//! The video streaming interface: formats, frames, and the endpoint that carries them.

use super::video_control::OUTPUT_TERMINAL;
use super::{
    BULK, Draft, FULL_SPEED_PACKET, ISOCHRONOUS, Mode, TO_HOST, VIDEO_IN, VIDEO_STREAMING,
    interface,
};
use phasmid_profile::Transfer;
use phasmid_protocol::usb::descriptor::{class, kind, video};
use phasmid_protocol::usb::uvc;

impl Draft {
    pub(super) fn video_streaming(&self, modes: &[Mode], intervals: &[u32]) -> Vec<u8> {
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
                    // Three packets of 1024 bytes per microframe.
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
}

/// Returns the descriptors VS_FORMAT_UNCOMPRESSED, VS_FRAME_UNCOMPRESSED and VS_COLORFORMAT of one
/// mode.
fn format_and_frame(mode: &Mode, number: u8, intervals: &[u32]) -> Vec<u8> {
    let bits = mode.format.bits_per_pixel() as u8;
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
