//! Probe and commit with unusual requests: the answer is always a format that the camera supports.

use crate::usb::detach::Random;
use crate::usb::served::{HEIGHT, Served, WIDTH};
use phasmid::host::usb::VideoFunction;
use phasmid::link::usb::Event;
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::usb::Setup;
use phasmid::protocol::usb::uvc::request;

const PROBE: u16 = 0x0100;
const COMMIT: u16 = 0x0200;
const STREAMING: u16 = 1;

#[test]
fn any_negotiation_ends_at_supported_values() {
    let served = Served::new(Speed::High, Transfer::Bulk);
    let device = served.open();
    let function = VideoFunction::find(device.configuration()).unwrap();
    let set = |value, bytes: &[u8]| {
        device.set(Setup::CLASS_OUT, request::SET_CUR, value, STREAMING, bytes)
    };
    let get = |request, value| device.get(Setup::CLASS_IN, request, value, STREAMING, 34);
    let mut random = Random(3);
    for round in 0..200 {
        let len = [34, 26][round % 2];
        let wish: Vec<u8> = (0..len).map(|_| random.below(256) as u8).collect();
        set(PROBE, &wish).unwrap();
        let agreed = get(request::GET_CUR, PROBE).unwrap();
        assert_eq!(agreed.len(), 34);
        let long = |at: usize| u32::from_le_bytes(agreed[at..at + 4].try_into().unwrap());
        let mode = function
            .modes
            .iter()
            .find(|m| (m.format_index, m.frame_index) == (agreed[2], agreed[3]))
            .expect("the agreed mode is in the descriptors");
        assert!(mode.intervals.contains(&long(4)), "interval {}", long(4));
        assert_eq!(
            long(18),
            WIDTH * HEIGHT * mode.format.bytes_per_pixel() as u32
        );
        // One payload of 32 packets.
        assert_eq!(long(22), 32 * 512);
        // A negotiated format can be committed.
        set(COMMIT, &agreed).unwrap();
        assert_eq!(get(request::GET_CUR, COMMIT).unwrap(), agreed);
        let event = served.wait(|event| matches!(event, Event::Committed(_)));
        let Event::Committed(told) = event else {
            unreachable!()
        };
        assert_eq!((told.format, told.interval), (agreed[2], long(4)));
    }
    for len in [0usize, 1, 25, 27, 33, 35, 48, 1000] {
        assert!(set(PROBE, &vec![1; len]).is_err(), "{len} bytes");
    }
    for (request, value) in [(request::GET_CUR, 0x0700), (0x99, PROBE)] {
        assert!(get(request, value).is_err());
    }
    assert_eq!(get(request::GET_LEN, PROBE).unwrap(), [34, 0]);
    assert_eq!(get(request::GET_INFO, PROBE).unwrap(), [3]);
    for request in [request::GET_MIN, request::GET_MAX, request::GET_DEF] {
        assert_eq!(get(request, PROBE).unwrap().len(), 34);
    }
}
