//! The video class's controls.

use super::Host;
use phasmid::link::usb::{CameraState, Event};
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::usb::{Setup, uvc};

#[test]
fn controls_are_the_camera_s_and_know_their_bounds() {
    let mut host = Host::new(Speed::High, Transfer::Bulk);
    let exposure = u16::from(uvc::selector::EXPOSURE_TIME_ABSOLUTE) << 8;
    let get = |host: &mut Host, request| {
        let bytes = host.control(Setup::CLASS_IN, request, exposure, 0x0100, &[]);
        u32::from_le_bytes(bytes.unwrap().try_into().unwrap())
    };
    assert_eq!(get(&mut host, uvc::request::GET_CUR), 120);
    assert_eq!(get(&mut host, uvc::request::GET_MIN), 1);
    assert_eq!(get(&mut host, uvc::request::GET_MAX), 5000);
    let set = |host: &mut Host, units: u32| {
        let (request, data) = (uvc::request::SET_CUR, units.to_le_bytes());
        host.control(Setup::CLASS_OUT, request, exposure, 0x0100, &data)
    };
    set(&mut host, 50).unwrap();
    let events = host.device.take_events();
    assert!(events.contains(&Event::Exposure(5_000_000)));
    assert_eq!(set(&mut host, 5001), None);
    let error = u16::from(uvc::selector::REQUEST_ERROR_CODE) << 8;
    let code = host
        .control(Setup::CLASS_IN, uvc::request::GET_CUR, error, 0, &[])
        .unwrap();
    assert_eq!(code, [uvc::error_code::OUT_OF_RANGE]);
    host.device.set_camera(CameraState {
        exposure_ns: 7_000_000,
        gain_db: 3.0,
        settable_ns: Some(u64::MAX),
    });
    assert_eq!(get(&mut host, uvc::request::GET_CUR), 70);
    // A period of 9 ms limits the exposure. During a sequence, nothing can be set.
    let say = |host: &mut Host, settable_ns| {
        host.device.set_camera(CameraState {
            exposure_ns: 7_000_000,
            gain_db: 3.0,
            settable_ns,
        });
        host.device.take_events();
        set(host, 100)
    };
    say(&mut host, Some(9_000_000)).unwrap();
    assert_eq!(host.device.take_events(), [Event::Exposure(9_000_000)]);
    assert_eq!(get(&mut host, uvc::request::GET_CUR), 90);
    assert_eq!(say(&mut host, None), None);
    let told = host.control(Setup::CLASS_IN, uvc::request::GET_CUR, error, 0, &[]);
    assert_eq!(told.unwrap(), [uvc::error_code::WRONG_STATE]);
    assert_eq!(host.device.take_events(), []);
    assert_eq!(get(&mut host, uvc::request::GET_CUR), 70);
    let gain = u16::from(uvc::selector::GAIN) << 8;
    let now = host
        .control(Setup::CLASS_IN, uvc::request::GET_CUR, gain, 0x0200, &[])
        .unwrap();
    assert_eq!(now, 300u16.to_le_bytes());
}
