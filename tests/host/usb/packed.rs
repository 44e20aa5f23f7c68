//! Formats of 10 and 12 bits, packed or not, over USB.

use crate::usb::fuzz::sample;
use crate::usb::served::{HEIGHT, Served, TIMEOUT, WIDTH, frame};
use phasmid::host::usb::{UsbCamera, VideoFunction};
use phasmid::host::{Camera, Intake};
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::PixelFormat;

#[test]
fn formats_of_10_and_12_bits_stream_and_become_y16() {
    let formats = [
        PixelFormat::Y16,
        PixelFormat::Y10,
        PixelFormat::Y12,
        PixelFormat::Y10P,
        PixelFormat::Y12P,
    ];
    let profile = sample::profile(Speed::High, Transfer::Bulk);
    let served = Served::offering(&profile, 1, &formats);
    let device = served.open();
    let function = VideoFunction::find(device.configuration()).unwrap();
    let offered: Vec<_> = function.modes.iter().map(|mode| mode.format).collect();
    assert_eq!(offered, formats);
    for mode in &function.modes {
        let len = mode.format.frame_bytes(WIDTH, HEIGHT);
        assert_eq!(mode.frame_len(), len as u64);
        let camera = UsbCamera::open(&device, Some(mode)).unwrap();
        let mut camera = Intake::new(camera);
        for id in 0..3 {
            let got = camera.next_frame(TIMEOUT).unwrap().expect("a frame");
            let sent = frame(id, mode.format).into_luma();
            assert_eq!(got.format, PixelFormat::Y16);
            assert!(got.data == sent.data, "{:?}, frame {id}", mode.format);
        }
    }
}
