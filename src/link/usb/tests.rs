//! The device as a state machine, without a socket.

use super::session::{Session, UsbDevice};
use super::{CameraState, Event, Fault};
use crate::profile::{Profile, Speed, Transfer};
use crate::protocol::usb::cdc::DeviceLines;
use crate::protocol::usb::usbip::{Command, HEADER_LEN, PACKET_LEN, Packet, Reply, Submit, status};
use crate::protocol::usb::uvc::{self, Negotiation, payload};
use crate::protocol::usb::{Setup, cdc, request};
use crate::protocol::{Frame, PixelFormat};
use std::sync::Arc;
use std::time::Duration;

const NOW: Duration = Duration::from_secs(1);
const WIDTH: u32 = 300;
const HEIGHT: u32 = 200;

fn device(speed: Speed, transfer: Transfer) -> UsbDevice {
    let mut profile = Profile::load("webcam-grey").unwrap();
    profile.usb.speed = speed;
    profile.usb.transfer = transfer;
    let camera = CameraState {
        exposure_ns: 12_000_000,
        gain_db: 0.0,
    };
    let formats = [PixelFormat::Grey, PixelFormat::Yuyv];
    let device = UsbDevice::new(&profile, 1, (WIDTH, HEIGHT), &formats, camera).unwrap();
    assert!(device.with(Session::attach));
    device
}

fn frame(id: u64) -> Arc<Frame> {
    let pixels = 0..WIDTH as usize * HEIGHT as usize;
    Arc::new(Frame {
        id,
        pattern_index: None,
        width: WIDTH,
        height: HEIGHT,
        format: PixelFormat::Grey,
        exposure_start_ns: 0,
        exposure_end_ns: 1,
        data: pixels.map(|i| (i as u64 * 7 + id * 31) as u8).collect(),
    })
}

/// A host that looks at replies one at a time.
struct Host {
    device: UsbDevice,
    seqnum: u32,
}

impl Host {
    fn new(device: UsbDevice) -> Self {
        Self { device, seqnum: 0 }
    }

    fn submit(&mut self, endpoint: u8, input: bool, length: u32, setup: Setup, data: &[u8]) -> u32 {
        self.seqnum += 1;
        let submit = Submit {
            seqnum: self.seqnum,
            device: self.device.info().id(),
            input,
            endpoint,
            flags: 0,
            length,
            packets: None,
            interval: 0,
            setup,
        };
        self.command(Command::Submit(submit), data, &[], NOW);
        self.seqnum
    }

    fn command(&mut self, command: Command, data: &[u8], packets: &[Packet], now: Duration) {
        let data = data.to_vec();
        let done = self
            .device
            .with(|session| session.command(command, data, packets, now));
        done.unwrap();
    }

    fn unlink(&mut self, target: u32) -> Vec<(Reply, Vec<u8>)> {
        self.seqnum += 1;
        let seqnum = self.seqnum;
        self.command(Command::Unlink { seqnum, target }, &[], &[], NOW);
        self.replies()
    }

    /// What waits to be written, cut into replies; isochronous ones keep their descriptors.
    fn replies(&mut self) -> Vec<(Reply, Vec<u8>)> {
        let bytes = self.device.with(|session| {
            let mut slices = [std::io::IoSlice::new(&[]); 4096];
            let count = session.outgoing.slices(&mut slices);
            let bytes: Vec<u8> = slices[..count].iter().flat_map(|s| s.to_vec()).collect();
            session.outgoing.advance(bytes.len());
            assert!(session.outgoing.is_empty());
            bytes
        });
        let mut rest = &bytes[..];
        let mut replies = Vec::new();
        while let Some((header, behind)) = rest.split_first_chunk::<HEADER_LEN>() {
            let reply = Reply::decode(header).unwrap();
            // Written out for inputs only: the tests' outputs have no data.
            let len = match reply {
                Reply::Submit {
                    actual,
                    packets,
                    seqnum,
                    ..
                } if seqnum & OUTPUT == 0 => {
                    actual as usize + packets.unwrap_or(0) as usize * PACKET_LEN
                }
                _ => 0,
            };
            replies.push((reply, behind[..len].to_vec()));
            rest = &behind[len..];
        }
        assert!(rest.is_empty());
        replies
    }

    fn control(
        &mut self,
        kind: u8,
        request: u8,
        value: u16,
        index: u16,
        data: &[u8],
    ) -> Option<Vec<u8>> {
        let input = kind & 0x80 != 0;
        let length = if input { 4096 } else { data.len() as u16 };
        let setup = Setup {
            kind,
            request,
            value,
            index,
            length,
        };
        if !input {
            self.seqnum |= OUTPUT;
        }
        let seqnum = self.submit(0, input, length.into(), setup, data);
        let replies = self.replies();
        self.seqnum &= !OUTPUT;
        let [
            (
                Reply::Submit {
                    seqnum: answered,
                    status,
                    ..
                },
                bytes,
            ),
        ] = &replies[..]
        else {
            panic!("{replies:?}");
        };
        assert_eq!(*answered, seqnum);
        (*status == status::OK).then(|| bytes.clone())
    }

    fn start(&mut self) -> Negotiation {
        self.control(Setup::STANDARD_OUT, request::SET_CONFIGURATION, 1, 0, &[])
            .unwrap();
        let wanted = Negotiation {
            hint: 1,
            format: 1,
            frame: 1,
            interval: 0,
            max_frame: 0,
            max_payload: 0,
            clock: 0,
        };
        let set = |host: &mut Self, selector: u8| {
            let value = u16::from(selector) << 8;
            host.control(
                Setup::CLASS_OUT,
                uvc::request::SET_CUR,
                value,
                1,
                &wanted.encode(),
            )
            .unwrap();
            host.control(Setup::CLASS_IN, uvc::request::GET_CUR, value, 1, &[])
                .unwrap()
        };
        set(self, uvc::selector::PROBE);
        Negotiation::decode(&set(self, uvc::selector::COMMIT)).unwrap()
    }

    /// Puts frames and reads payloads until there are none; each frame's bytes and header bits.
    fn stream(&mut self, ids: std::ops::Range<u64>, payload: u32) -> Vec<(Vec<u8>, Vec<u8>)> {
        for _ in 0..64 {
            self.submit(1, true, payload, Setup::default(), &[]);
        }
        for id in ids {
            assert!(self.device.put(frame(id), NOW));
        }
        let mut frames: Vec<(Vec<u8>, Vec<u8>)> = vec![Default::default()];
        for (reply, bytes) in self.replies() {
            let Reply::Submit {
                status: status::OK, ..
            } = reply
            else {
                panic!("{reply:?}");
            };
            assert_eq!(usize::from(bytes[0]), payload::HEADER_LEN);
            let (data, bits) = frames.last_mut().unwrap();
            data.extend(&bytes[2..]);
            bits.push(bytes[1]);
            if bytes[1] & payload::EOF != 0 {
                frames.push(Default::default());
            }
        }
        assert_eq!(
            frames.pop(),
            Some(Default::default()),
            "frames end with their last payload"
        );
        frames
    }
}

/// Marks the numbers of transfers to the device, whose replies carry no data.
const OUTPUT: u32 = 1 << 31;

#[test]
fn frames_go_out_whole_and_in_order_in_bulk() {
    for speed in [Speed::High, Speed::Super] {
        let mut host = Host::new(device(speed, Transfer::Bulk));
        assert!(!host.device.put(frame(0), NOW), "nobody reads");
        let agreed = host.start();
        assert_eq!(agreed.max_frame, WIDTH * HEIGHT);
        let first = host.submit(1, true, agreed.max_payload, Setup::default(), &[]);
        assert!(host.device.is_streaming());
        let events = host.device.take_events();
        assert!(events.contains(&Event::Started) && events.contains(&Event::Committed(agreed)));
        assert_eq!(
            host.unlink(first),
            [(
                Reply::Unlink {
                    seqnum: first + 1,
                    status: status::UNLINKED
                },
                vec![]
            )]
        );
        assert!(!host.device.is_streaming(), "everything was taken back");
        for (id, (data, bits)) in (1..4).zip(host.stream(1..4, agreed.max_payload)) {
            assert_eq!(data, frame(id).data);
            let toggled = (id % 2) as u8;
            assert!(
                bits.iter()
                    .all(|b| b & payload::FID == toggled && b & payload::EOH != 0)
            );
        }
        // The endpoint is cleared: the stream is over, what waits is forgotten.
        host.control(Setup::ENDPOINT_OUT, request::CLEAR_FEATURE, 0, 0x81, &[])
            .unwrap();
        assert!(!host.device.is_streaming());
    }
}

#[test]
fn an_unlink_after_the_answer_comes_too_late() {
    let mut host = Host::new(device(Speed::High, Transfer::Bulk));
    let agreed = host.start();
    let urb = host.submit(1, true, agreed.max_payload, Setup::default(), &[]);
    assert!(host.device.put(frame(1), NOW));
    let replies = host.unlink(urb);
    assert!(
        matches!(replies[0].0, Reply::Submit { seqnum, status: status::OK, .. } if seqnum == urb)
    );
    assert!(matches!(
        replies[1].0,
        Reply::Unlink {
            status: status::OK,
            ..
        }
    ));
}

#[test]
fn faults_show_as_they_would_on_a_bus() {
    let mut host = Host::new(device(Speed::Super, Transfer::Bulk));
    let payload = host.start().max_payload;
    host.device.inject(Fault::PayloadError);
    host.device.inject(Fault::ShortFrame);
    host.device.inject(Fault::FrozenFid);
    let frames = host.stream(1..5, payload);
    assert!(frames[0].1.iter().all(|bits| bits & payload::ERR != 0));
    assert_eq!(frames[1].0, frame(2).data[..frame(2).data.len() / 2]);
    assert_eq!(frames[2].1[0] & payload::FID, frames[1].1[0] & payload::FID);
    assert_eq!(frames[3].0, frame(4).data);
    host.device.inject(Fault::Slow(Duration::from_secs(2)));
    assert!(host.device.put(frame(5), NOW));
    assert_eq!(host.replies(), []);
    let due = host.device.with(|session| session.video.next_due());
    assert_eq!(due, Some(NOW + Duration::from_secs(2)));
    host.device.with(|session| session.pump(due.unwrap()));
    assert_eq!(host.replies().len(), 2);
    host.device.inject(Fault::Stall);
    assert!(host.device.put(frame(6), NOW));
    let stalled = host.replies();
    assert!(
        !stalled.is_empty()
            && stalled.iter().all(|(reply, _)| {
                matches!(
                    reply,
                    Reply::Submit {
                        status: status::STALL,
                        ..
                    }
                )
            })
    );
    host.submit(1, true, payload, Setup::default(), &[]);
    assert!(
        matches!(
            host.replies()[0].0,
            Reply::Submit {
                status: status::STALL,
                ..
            }
        ),
        "halted"
    );
    host.control(Setup::ENDPOINT_OUT, request::CLEAR_FEATURE, 0, 0x81, &[])
        .unwrap();
    assert_eq!(host.stream(7..8, payload)[0].0, frame(7).data);
}

#[test]
fn isochronous_transfers_end_in_time_with_or_without_a_frame() {
    let mut host = Host::new(device(Speed::High, Transfer::Isochronous));
    host.start();
    host.control(Setup::INTERFACE_OUT, request::SET_INTERFACE, 1, 1, &[])
        .unwrap();
    let packets: Vec<Packet> = (0..32)
        .map(|i| Packet {
            offset: i * 3072,
            length: 3072,
            actual: 0,
            status: -18,
        })
        .collect();
    let submit = |host: &mut Host| {
        host.seqnum += 1;
        let submit = Submit {
            seqnum: host.seqnum,
            device: 0,
            input: true,
            endpoint: 1,
            flags: 0,
            length: 32 * 3072,
            packets: Some(32),
            interval: 1,
            setup: Setup::default(),
        };
        host.command(Command::Submit(submit), &[], &packets, NOW);
    };
    submit(&mut host);
    assert!(host.device.put(frame(1), NOW));
    assert_eq!(host.replies(), [], "not before its time");
    submit(&mut host);
    let due = host
        .device
        .with(|session| session.video.next_due())
        .unwrap();
    assert_eq!(due, NOW + 32 * Duration::from_micros(125));
    host.device.with(|session| session.pump(due));
    let (reply, bytes) = host.replies().remove(0);
    let Reply::Submit {
        actual,
        packets: Some(32),
        ..
    } = reply
    else {
        panic!("{reply:?}")
    };
    let (data, table) = bytes.split_at(actual as usize);
    let mut at = 0;
    let mut seen = Vec::new();
    for descriptor in table.as_chunks::<PACKET_LEN>().0 {
        let packet = Packet::decode(descriptor);
        assert_eq!(packet.status, status::OK);
        let part = &data[at..at + packet.actual as usize];
        at += part.len();
        seen.extend_from_slice(part.get(2..).unwrap_or_default());
    }
    assert_eq!((at, seen), (data.len(), frame(1).data.clone()));
    host.device.with(|session| session.pump(2 * due));
    let (reply, _) = host.replies().remove(0);
    assert!(
        matches!(
            reply,
            Reply::Submit {
                actual: 0,
                status: status::OK,
                ..
            }
        ),
        "an empty one"
    );
}

#[test]
fn controls_are_the_camera_s_and_know_their_bounds() {
    let mut host = Host::new(device(Speed::High, Transfer::Bulk));
    let exposure = u16::from(uvc::selector::EXPOSURE_TIME_ABSOLUTE) << 8;
    let get = |host: &mut Host, request| {
        let bytes = host
            .control(Setup::CLASS_IN, request, exposure, 0x0100, &[])
            .unwrap();
        u32::from_le_bytes(bytes.try_into().unwrap())
    };
    assert_eq!(get(&mut host, uvc::request::GET_CUR), 120);
    assert_eq!(get(&mut host, uvc::request::GET_MIN), 1);
    assert_eq!(get(&mut host, uvc::request::GET_MAX), 5000);
    let set = |host: &mut Host, units: u32| {
        host.control(
            Setup::CLASS_OUT,
            uvc::request::SET_CUR,
            exposure,
            0x0100,
            &units.to_le_bytes(),
        )
    };
    set(&mut host, 50).unwrap();
    assert!(
        host.device
            .take_events()
            .contains(&Event::Exposure(5_000_000))
    );
    assert_eq!(set(&mut host, 5001), None);
    let error = u16::from(uvc::selector::REQUEST_ERROR_CODE) << 8;
    let code = host
        .control(Setup::CLASS_IN, uvc::request::GET_CUR, error, 0, &[])
        .unwrap();
    assert_eq!(code, [uvc::error_code::OUT_OF_RANGE]);
    host.device.set_camera(CameraState {
        exposure_ns: 7_000_000,
        gain_db: 3.0,
    });
    assert_eq!(get(&mut host, uvc::request::GET_CUR), 70);
    let gain = u16::from(uvc::selector::GAIN) << 8;
    let now = host
        .control(Setup::CLASS_IN, uvc::request::GET_CUR, gain, 0x0200, &[])
        .unwrap();
    assert_eq!(now, 300u16.to_le_bytes());
}

#[test]
fn the_port_carries_bytes_lines_and_breaks() {
    let mut host = Host::new(device(Speed::High, Transfer::Bulk));
    let lines = |host: &mut Host, value| {
        let request = cdc::request::SET_CONTROL_LINE_STATE;
        host.control(Setup::CLASS_OUT, request, value, 2, &[])
            .unwrap();
    };
    lines(&mut host, 3);
    host.seqnum |= OUTPUT;
    host.submit(3, false, 6, Setup::default(), b"*IDN?\n");
    host.replies();
    host.seqnum &= !OUTPUT;
    let events = host.device.take_events();
    assert!(
        events.contains(&Event::Received(b"*IDN?\n".to_vec())),
        "{events:?}"
    );
    assert!(host.device.send(b"Phasma\n", NOW));
    host.submit(3, true, 4, Setup::default(), &[]);
    host.submit(3, true, 4, Setup::default(), &[]);
    let data: Vec<u8> = host
        .replies()
        .into_iter()
        .flat_map(|(_, bytes)| bytes)
        .collect();
    assert_eq!(data, b"Phasma\n");
    host.submit(2, true, 16, Setup::default(), &[]);
    let told = |host: &mut Host| DeviceLines::from_notification(&host.replies()[0].1);
    assert_eq!(told(&mut host), Some(DeviceLines::default()));
    host.submit(2, true, 16, Setup::default(), &[]);
    assert_eq!(host.replies(), [], "nothing new");
    let ready = DeviceLines {
        dcd: false,
        dsr: true,
    };
    host.device.set_lines(ready, NOW);
    assert_eq!(told(&mut host), Some(ready));
    assert!(
        host.control(
            Setup::CLASS_OUT,
            cdc::request::SET_LINE_CODING,
            0,
            2,
            &[0; 7]
        )
        .is_none()
    );
}

#[test]
fn a_flood_is_no_driver() {
    let mut host = Host::new(device(Speed::High, Transfer::Bulk));
    let result = (0..2000).try_for_each(|seqnum| {
        let submit = Submit {
            seqnum,
            device: 0,
            input: true,
            endpoint: 3,
            flags: 0,
            length: 64,
            packets: None,
            interval: 0,
            setup: Setup::default(),
        };
        host.device
            .with(|session| session.command(Command::Submit(submit), Vec::new(), &[], NOW))
    });
    assert!(result.unwrap_err().to_string().contains("1024"));
    host.device.with(Session::detach);
    assert!(host.device.with(Session::attach), "free again");
    host.seqnum = 1;
    assert!(
        host.control(Setup::STANDARD_IN, request::GET_DESCRIPTOR, 0x0100, 0, &[])
            .is_some()
    );
}

/// A firmware that takes nothing: settings are replaced, and what cannot be ends the connection.
#[test]
fn a_flood_of_events_is_bounded() {
    let mut host = Host::new(device(Speed::High, Transfer::Bulk));
    let exposure = u16::from(uvc::selector::EXPOSURE_TIME_ABSOLUTE) << 8;
    let set = uvc::request::SET_CUR;
    for units in 1..=5000u32 {
        let data = units.to_le_bytes();
        host.control(Setup::CLASS_OUT, set, exposure, 0x0100, &data)
            .unwrap();
    }
    let waiting = host.device.with(|session| session.waiting_events());
    assert_eq!(waiting, 2, "attached, exposure");
    let toggle = |seqnum: u32| {
        let setup = Setup {
            kind: Setup::CLASS_OUT,
            request: cdc::request::SET_CONTROL_LINE_STATE,
            value: 1 | (seqnum as u16 & 1) << 1,
            index: 2,
            length: 0,
        };
        let submit = Submit {
            setup,
            ..submit(seqnum, 0, 0)
        };
        host.device
            .with(|session| session.command(Command::Submit(submit), Vec::new(), &[], NOW))
    };
    let error = (0..5000).try_for_each(toggle).unwrap_err().to_string();
    assert!(error.contains("1024"), "{error}");
    host.device.with(Session::detach);
    let reattached = host.device.with(Session::attach);
    assert!(!reattached, "not before the firmware has caught up");
    let events = host.device.take_events();
    assert!((1024..1032).contains(&events.len()), "{}", events.len());
    assert_eq!(events[1], Event::Exposure(500_000_000));
    assert_eq!(events.last(), Some(&Event::Detached));
    assert!(host.device.with(Session::attach));
}

/// A transfer of that number without packets.
fn submit(seqnum: u32, endpoint: u8, length: u32) -> Submit {
    Submit {
        seqnum,
        device: 0,
        input: endpoint != 0,
        endpoint,
        flags: 0,
        length,
        packets: None,
        interval: 0,
        setup: Setup::default(),
    }
}

#[test]
fn isochronous_packets_that_wait_are_bounded() {
    let host = Host::new(device(Speed::High, Transfer::Isochronous));
    let packets = vec![Packet::decode(&[0; PACKET_LEN]); 1024];
    let result = (0..500).try_for_each(|seqnum| {
        let submit = Submit {
            packets: Some(1024),
            ..submit(seqnum, 1, 0)
        };
        let command = Command::Submit(submit);
        host.device
            .with(|session| session.command(command, Vec::new(), &packets, NOW))
    });
    let error = result.unwrap_err().to_string();
    assert!(error.contains("65536 isochronous"), "{error}");
}

#[test]
fn a_transfer_without_room_for_a_header_overflows_and_loses_nothing() {
    let mut host = Host::new(device(Speed::High, Transfer::Bulk));
    let agreed = host.start();
    let urb = host.submit(1, true, 1, Setup::default(), &[]);
    assert!(host.device.put(frame(1), NOW));
    let replies = host.replies();
    assert!(
        matches!(replies[..], [(Reply::Submit { seqnum, status: status::OVERFLOW, actual: 0, .. }, _)] if seqnum == urb),
        "{replies:?}"
    );
    let frames = host.stream(2..3, agreed.max_payload);
    assert_eq!(frames[0].0, frame(1).data);
    assert_eq!(frames[1].0, frame(2).data);
}
