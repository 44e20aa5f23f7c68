//! Tests single requests on the control endpoint: requests that USB 2.0 (chapter 9) and UVC 1.1
//! (chapter 4) require a device to answer, and requests that they require it to reject.

use crate::usb::served::{Served, TIMEOUT, frame};
use phasmid::host::usb::{UsbCamera, UsbDevice, UsbPort, VideoFunction};
use phasmid::host::{Camera, CommandPort};
use phasmid::link::usb::Event;
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::PixelFormat;
use phasmid::protocol::usb::usbip::status;
use phasmid::protocol::usb::{Setup, request, uvc};

const BULK: Transfer = Transfer::Bulk;
const VIDEO_IN: u8 = 0x81;
const NOTIFY_IN: u8 = 0x82;
const SERIAL_IN: u8 = 0x83;
const SERIAL_OUT: u8 = 0x03;

fn halt(device: &UsbDevice, request: u8, endpoint: u8) -> bool {
    let (kind, feature) = (Setup::ENDPOINT_OUT, request::ENDPOINT_HALT);
    device
        .set(kind, request, feature, endpoint.into(), &[])
        .is_ok()
}

/// Returns the first byte of an endpoint's status; `None` if there is no such endpoint.
fn endpoint_status(device: &UsbDevice, endpoint: u8) -> Option<u8> {
    let get = request::GET_STATUS;
    let status = device
        .get(Setup::ENDPOINT_IN, get, 0, endpoint.into(), 2)
        .ok()?;
    assert_eq!((status.len(), status[1]), (2, 0));
    Some(status[0])
}

#[test]
fn halted_endpoints_end_waiting_transfers_and_resume() {
    let served = Served::new(Speed::High, BULK);
    let device = served.open();
    for endpoint in [VIDEO_IN, NOTIFY_IN, SERIAL_IN, SERIAL_OUT] {
        assert_eq!(endpoint_status(&device, endpoint), Some(0));
        let input = endpoint & 0x80 != 0;
        let waiting = input.then(|| device.client().submit(endpoint, 512, &[]).unwrap());
        if endpoint == NOTIFY_IN {
            // The endpoint reports the lines once to the first request; the next request waits.
            waiting.unwrap().wait(TIMEOUT).unwrap().unwrap();
            drop(device.client().submit(endpoint, 512, &[]).unwrap());
        } else if let Some(waiting) = waiting {
            assert!(halt(&device, request::SET_FEATURE, endpoint));
            let ended = waiting.wait(TIMEOUT).unwrap().expect("an end");
            assert_eq!(ended.status, status::STALL, "{endpoint:#x}");
        }
        assert!(halt(&device, request::SET_FEATURE, endpoint));
        assert_eq!(endpoint_status(&device, endpoint), Some(1));
        let data: &[u8] = if input { &[] } else { b"lost" };
        let refused = device.client().submit(endpoint, 512, data).unwrap();
        let refused = refused.wait(TIMEOUT).unwrap().expect("an end");
        assert_eq!(refused.status, status::STALL, "{endpoint:#x}");
        assert!(halt(&device, request::CLEAR_FEATURE, endpoint));
        assert_eq!(endpoint_status(&device, endpoint), Some(0));
    }
    let mut port = UsbPort::open(&device).unwrap();
    port.send(b"kept", TIMEOUT).unwrap();
    let mut buffer = [0; 9];
    assert_eq!(port.receive(&mut buffer, TIMEOUT).unwrap(), 4);
    assert_eq!(buffer[..4], *b"KEPT", "refused bytes do not arrive");
    let mut camera = UsbCamera::open(&device, None).unwrap();
    let got = camera.next_frame(TIMEOUT).unwrap().expect("a frame");
    assert!(got.data == frame(0, PixelFormat::Grey).data);
}

#[test]
fn requests_for_absent_parts_are_refused() {
    let served = Served::new(Speed::High, BULK);
    let device = served.open();
    for endpoint in [0x01, 0x02, 0x04, 0x84, 0x8F] {
        assert_eq!(endpoint_status(&device, endpoint), None, "{endpoint:#x}");
        for request in [request::SET_FEATURE, request::CLEAR_FEATURE] {
            assert!(!halt(&device, request, endpoint), "{endpoint:#x}");
        }
    }
    let get = |kind, request, value, index| device.get(kind, request, value, index, 64);
    let (device_in, interface_in) = (Setup::STANDARD_IN, Setup::INTERFACE_IN);
    assert_eq!(get(device_in, request::GET_STATUS, 0, 0).unwrap(), [0, 0]);
    assert_eq!(
        get(interface_in, request::GET_STATUS, 0, 3).unwrap(),
        [0, 0]
    );
    assert!(get(interface_in, request::GET_STATUS, 0, 4).is_err());
    assert_eq!(
        get(interface_in, request::GET_INTERFACE, 0, 3).unwrap(),
        [0]
    );
    assert!(get(interface_in, request::GET_INTERFACE, 0, 4).is_err());
    // Invalid descriptors: a second configuration, a string number too large, an unknown type.
    for value in [0x0201, 0x0306, 0x03FF, 0x0F00, 0x4200] {
        let descriptor = get(device_in, request::GET_DESCRIPTOR, value, 0);
        assert!(descriptor.is_err(), "{value:#06x}");
    }
    // Vendor requests, and class requests that are not addressed to an interface.
    assert!(get(0xC0, 1, 0, 0).is_err());
    assert!(get(0xA0, uvc::request::GET_CUR, 0x0200, 0).is_err());
    assert!(get(Setup::CLASS_IN, uvc::request::GET_CUR, 0x0200, 9).is_err());
    let configure = |value| {
        let set = request::SET_CONFIGURATION;
        device.set(Setup::STANDARD_OUT, set, value, 0, &[]).is_ok()
    };
    assert!(!configure(2) && configure(0));
    assert_eq!(
        get(device_in, request::GET_CONFIGURATION, 0, 0).unwrap(),
        [0]
    );
    assert!(configure(1));
}

#[test]
fn alternate_settings_start_and_end_an_isochronous_stream() {
    for (transfer, known) in [
        (Transfer::Isochronous, [true, true, false]),
        (BULK, [true, false, false]),
    ] {
        let served = Served::new(Speed::High, transfer);
        let device = served.open();
        for (setting, known) in (0..).zip(known) {
            assert_eq!(
                device.set_interface(1, setting).is_ok(),
                known,
                "{transfer:?} {setting}"
            );
            if known {
                let get = request::GET_INTERFACE;
                let told = device.get(Setup::INTERFACE_IN, get, 0, 1, 1).unwrap();
                assert_eq!(told, [setting]);
            }
        }
        for other in [0, 2, 3] {
            assert!(device.set_interface(other, 0).is_ok());
            assert!(device.set_interface(other, 1).is_err());
        }
        assert!(device.set_interface(4, 0).is_err());
        device.set_interface(1, 0).unwrap();
        let mut camera = UsbCamera::open(&device, None).unwrap();
        camera.next_frame(TIMEOUT).unwrap().expect("a frame");
        assert!(served.device().is_streaming());
        device.set_interface(1, 0).unwrap();
        served.wait(|event| *event == Event::Stopped);
    }
}

/// A transfer too small for a payload header is the host's mistake and affects only that host.
#[test]
fn transfers_without_room_for_a_header_end_with_an_overflow() {
    let served = Served::new(Speed::High, BULK);
    let device = served.open();
    drop(UsbCamera::open(&device, None).unwrap());
    for length in [0, 1] {
        let transfer = device.client().submit(VIDEO_IN, length, &[]).unwrap();
        let ended = transfer.wait(TIMEOUT).unwrap().expect("an end");
        assert_eq!((ended.status, ended.actual), (status::OVERFLOW, 0));
    }
    device.clear_halt(VIDEO_IN).unwrap();
    let mut camera = UsbCamera::open(&device, None).unwrap();
    let got = camera.next_frame(TIMEOUT).unwrap().expect("a frame");
    assert!(got.data == frame(0, PixelFormat::Grey).data);
}

/// Makes a request to the video control interface, for a selector of an entity; returns the data if
/// it succeeds.
fn video(device: &UsbDevice, request: u8, entity: u16, selector: u8) -> Option<Vec<u8>> {
    let (value, index) = (u16::from(selector) << 8, entity << 8);
    device.get(Setup::CLASS_IN, request, value, index, 64).ok()
}

fn error_code(device: &UsbDevice) -> u8 {
    let selector = uvc::selector::REQUEST_ERROR_CODE;
    let code = video(device, uvc::request::GET_CUR, 0, selector).unwrap();
    assert_eq!(code.len(), 1);
    code[0]
}

#[test]
fn controls_tell_their_length_abilities_step_and_bounds() {
    let served = Served::new(Speed::High, BULK);
    let device = served.open();
    let function = VideoFunction::find(device.configuration()).unwrap();
    let (terminal, unit) = (
        function.exposure_entity.unwrap(),
        function.gain_entity.unwrap(),
    );
    let number = |bytes: Vec<u8>| bytes.iter().rev().fold(0u64, |n, b| n << 8 | u64::from(*b));
    for (entity, selector, len) in [
        (terminal, uvc::selector::EXPOSURE_TIME_ABSOLUTE, 4),
        (unit, uvc::selector::GAIN, 2),
    ] {
        let get = |request| video(&device, request, entity.into(), selector).unwrap();
        assert_eq!(get(uvc::request::GET_LEN), [len, 0]);
        assert_eq!(
            get(uvc::request::GET_INFO),
            [3],
            "the control can be read and set"
        );
        let ranged = [
            uvc::request::GET_MIN,
            uvc::request::GET_DEF,
            uvc::request::GET_MAX,
            uvc::request::GET_CUR,
            uvc::request::GET_RES,
        ];
        let [min, default, max, current, step] = ranged.map(|request| {
            let bytes = get(request);
            assert_eq!(bytes.len(), usize::from(len), "request {request:#x}");
            number(bytes)
        });
        assert!(min <= default && default <= max && min < max && step == 1);
        assert!((min..=max).contains(&current));
        // Both ends of the range can be set and read back; values outside the range change nothing.
        let set = |value: u64| {
            let bytes = &value.to_le_bytes()[..usize::from(len)];
            let (value, index) = (u16::from(selector) << 8, u16::from(entity) << 8);
            let cur = uvc::request::SET_CUR;
            device
                .set(Setup::CLASS_OUT, cur, value, index, bytes)
                .is_ok()
        };
        for (value, fits) in [(min, true), (max, true), (max + 1, false)] {
            assert_eq!(set(value), fits, "{value}");
            assert_eq!(number(get(uvc::request::GET_CUR)), value.min(max));
            assert_eq!(
                error_code(&device),
                uvc::error_code::NONE,
                "success clears the error code"
            );
            if !fits {
                assert!(!set(value));
                assert_eq!(error_code(&device), uvc::error_code::OUT_OF_RANGE);
            }
        }
    }
}

#[test]
fn error_code_tells_why_the_last_request_failed() {
    let served = Served::new(Speed::High, BULK);
    let device = served.open();
    let (cur, gain) = (uvc::request::GET_CUR, uvc::selector::GAIN);
    for (request, entity, selector, code) in [
        (cur, 9, gain, uvc::error_code::INVALID_UNIT),
        (cur, 1, 0x7F, uvc::error_code::INVALID_CONTROL),
        (cur, 2, 0x7F, uvc::error_code::INVALID_CONTROL),
        // The power mode, which is a control of the interface itself.
        (cur, 0, 0x01, uvc::error_code::INVALID_CONTROL),
        (0x99, 2, gain, uvc::error_code::INVALID_REQUEST),
    ] {
        assert_eq!(video(&device, request, entity, selector), None);
        assert_eq!(error_code(&device), code, "{entity} {selector:#x}");
        assert_eq!(
            error_code(&device),
            code,
            "reading the error code does not clear it"
        );
        video(&device, cur, 2, gain).unwrap();
        assert_eq!(error_code(&device), uvc::error_code::NONE);
    }
}

#[test]
fn the_nearest_interval_is_agreed_on() {
    let served = Served::new(Speed::High, BULK);
    let device = served.open();
    let function = VideoFunction::find(device.configuration()).unwrap();
    let mode = &function.modes[0];
    let probe = u16::from(uvc::selector::PROBE) << 8;
    let get = |request| device.get(Setup::CLASS_IN, request, probe, 1, 34).unwrap();
    let agreed = |interval: u32| {
        let mut wish = [0; 34];
        wish[..4].copy_from_slice(&[1, 0, mode.format_index, mode.frame_index]);
        wish[4..8].copy_from_slice(&interval.to_le_bytes());
        device
            .set(Setup::CLASS_OUT, uvc::request::SET_CUR, probe, 1, &wish)
            .unwrap();
        u32::from_le_bytes(get(uvc::request::GET_CUR)[4..8].try_into().unwrap())
    };
    let offered = &mode.intervals;
    assert_eq!(offered.len(), 3);
    for (at, &interval) in offered.iter().enumerate() {
        for near in [interval, interval - 9, interval + 9] {
            assert_eq!(agreed(near), offered[at]);
        }
    }
    assert_eq!(
        agreed(0),
        offered[0],
        "without a requested interval, the shortest"
    );
    assert_eq!(agreed(u32::MAX), offered[2]);
    // No field of the structure has a resolution (GET_RES): each value comes from a list.
    assert_eq!(get(uvc::request::GET_RES), [0; 34]);
}
