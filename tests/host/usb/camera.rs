//! Frames arrive in order and without loss, over repeated streams and with faults.

use crate::usb::served::{Served, TIMEOUT, frame};
use phasmid::host::Camera;
use phasmid::host::usb::{UsbCamera, VideoControl, VideoFunction};
use phasmid::link::usb::{Event, Fault};
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::PixelFormat;
use phasmid::protocol::usb::{Setup, request};
use std::time::{Duration, Instant};

fn streams(speed: Speed, transfer: Transfer, frames: u64) {
    let served = Served::new(speed, transfer);
    let device = served.open();
    let mut camera = UsbCamera::open(&device, None).unwrap();
    for id in 0..frames {
        let got = camera.next_frame(TIMEOUT).unwrap().expect("a frame");
        let want = frame(id, PixelFormat::Grey);
        assert_eq!(got.id, id + 1);
        assert_eq!(
            (got.width, got.height, got.format),
            (want.width, want.height, want.format)
        );
        assert!(got.data == want.data, "frame {id} differs");
        camera.give_back(got.data);
    }
    drop(camera);
    served.wait(|event| *event == Event::Stopped);
    assert!(!served.device().is_streaming());
}

#[test]
fn streams_bulk_at_high_speed() {
    streams(Speed::High, Transfer::Bulk, 300);
}

#[test]
fn streams_bulk_at_superspeed() {
    streams(Speed::Super, Transfer::Bulk, 300);
}

#[test]
fn streams_isochronous_at_high_speed() {
    streams(Speed::High, Transfer::Isochronous, 20);
}

/// Isochronous transfers end by the clock, so some end while others are being unlinked. The device
/// still works afterwards.
#[test]
fn an_isochronous_stream_that_is_ended_at_any_moment_leaves_the_device() {
    let served = Served::new(Speed::High, Transfer::Isochronous);
    let device = served.open();
    for round in 0..30 {
        let mut camera = UsbCamera::open(&device, None).unwrap();
        let got = camera.next_frame(TIMEOUT).unwrap().expect("a frame");
        assert!(got.data == frame(0, PixelFormat::Grey).data);
        std::thread::sleep(Duration::from_micros(137 * round));
        drop(camera);
        let configuration = device.get(Setup::STANDARD_IN, request::GET_CONFIGURATION, 0, 0, 1);
        assert_eq!(configuration.unwrap(), [1], "the connection still works");
    }
}

#[test]
fn cancelled_transfers_do_not_delay_the_next_stream() {
    let served = Served::new(Speed::High, Transfer::Isochronous);
    let device = served.open();
    for _ in 0..50 {
        drop(UsbCamera::open(&device, None).unwrap());
    }
    let mut camera = UsbCamera::open(&device, None).unwrap();
    let start = Instant::now();
    camera.next_frame(TIMEOUT).unwrap().expect("a frame");
    // About 130 ms of transfers were in flight each time.
    let waited = start.elapsed();
    assert!(waited < Duration::from_secs(2), "{waited:?}");
}

#[test]
fn a_stream_starts_again_in_another_format() {
    let served = Served::new(Speed::High, Transfer::Bulk);
    let device = served.open();
    let function = VideoFunction::find(device.configuration()).unwrap();
    assert_eq!(function.modes.len(), 2);
    for mode in function.modes.iter().chain(&function.modes) {
        let mut camera = UsbCamera::open(&device, Some(mode)).unwrap();
        assert_eq!(camera.mode(), mode);
        for id in 0..10 {
            let got = camera.next_frame(TIMEOUT).unwrap().expect("a frame");
            assert_eq!(got.format, mode.format);
            assert!(
                got.data == frame(id, mode.format).data,
                "{mode:?}, frame {id}"
            );
        }
    }
}

#[test]
fn paused_reader_misses_no_frame() {
    let served = Served::new(Speed::Super, Transfer::Bulk);
    let device = served.open();
    let mut camera = UsbCamera::open(&device, None).unwrap();
    std::thread::sleep(Duration::from_millis(200));
    for id in 0..1500 {
        let got = camera.next_frame(TIMEOUT).unwrap().expect("a frame");
        assert!(got.data == frame(id, PixelFormat::Grey).data, "frame {id}");
    }
}

#[test]
fn exposure_and_gain_are_read_and_set() {
    let served = Served::new(Speed::High, Transfer::Bulk);
    let device = served.open();
    let camera = UsbCamera::open(&device, None).unwrap();
    let exposure = camera
        .control(VideoControl::Exposure)
        .unwrap()
        .expect("a control");
    assert_eq!(exposure.current, 120);
    assert!(exposure.range.contains(&exposure.default) && exposure.step == 1);
    camera.set_control(VideoControl::Exposure, 70).unwrap();
    let event = served.wait(|event| matches!(event, Event::Exposure(_)));
    assert_eq!(event, Event::Exposure(7_000_000));
    let read = camera.control(VideoControl::Exposure).unwrap().unwrap();
    assert_eq!(read.current, 70);
    let gain = camera
        .control(VideoControl::Gain)
        .unwrap()
        .expect("a control");
    camera
        .set_control(VideoControl::Gain, 150.min(*gain.range.end()))
        .unwrap();
    served.wait(|event| matches!(event, Event::Gain(_)));
    let beyond = exposure.range.end() + 1;
    let refused = camera
        .set_control(VideoControl::Exposure, beyond)
        .unwrap_err();
    assert!(refused.to_string().contains("stall"), "{refused}");
    assert_eq!(
        camera
            .control(VideoControl::Exposure)
            .unwrap()
            .unwrap()
            .current,
        70
    );
}

#[test]
fn faults_damage_their_frame_and_the_stream_goes_on() {
    for (fault, says) in [
        (Fault::PayloadError, "reports an error"),
        (Fault::ShortFrame, "30000 of 60000"),
        (Fault::FrozenFid, "identifier"),
        (Fault::Stall, "halted"),
    ] {
        let served = Served::new(Speed::High, Transfer::Bulk);
        let device = served.open();
        let mut camera = UsbCamera::open(&device, None).unwrap();
        camera.next_frame(TIMEOUT).unwrap().expect("a frame");
        served.device().inject(fault);
        let mut last = 0;
        let (error, before) = loop {
            match camera.next_frame(TIMEOUT) {
                Ok(frame) => last = frame.expect("a frame").id,
                Err(error) => break (error.to_string(), last),
            }
            assert!(last < 4000, "{fault:?} does nothing");
        };
        assert!(error.contains(says), "{fault:?}: {error}");
        assert!(camera.has_skipped(), "{fault:?}");
        let next = camera.next_frame(TIMEOUT).unwrap().expect("a frame");
        assert!(!camera.has_skipped());
        // The damaged frame has a number of its own, so the next frame's number is larger by two.
        assert_eq!(next.id, before + 2, "{fault:?}");
        let number = u64::from_le_bytes(next.data[..8].try_into().unwrap());
        assert!(
            next.data == frame(number, PixelFormat::Grey).data,
            "{fault:?}"
        );
    }
}
