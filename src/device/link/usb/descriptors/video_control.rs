//! The video control interface: a camera terminal with exposure, a processing unit with gain, and
//! an output terminal.

use super::{
    CAMERA_TERMINAL, CLOCK_HZ, Draft, PROCESSING_UNIT, VIDEO_CONTROL, VIDEO_STREAMING, interface,
};
use phasmid_protocol::usb::descriptor::{class, kind, video};

/// Id of the output terminal, the entity at which the video stream leaves the video function.
pub(super) const OUTPUT_TERMINAL: u8 = 3;

impl Draft {
    pub(super) fn video_control(&self) -> Vec<u8> {
        // Bit 3: exposure time, absolute.
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
        // Bit 9: gain.
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
}
