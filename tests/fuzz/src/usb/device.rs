//! A hostile host against the device: whatever the host sends, it gets valid replies or is
//! disconnected, and the next host finds the device unchanged.

use super::choices::Choices;
use super::ledger::Ledger;
use super::sample;
use super::wire::Wire;
use phasmid::link::usb::{Event, Fault, UsbDevice};
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::PixelFormat;
use phasmid::protocol::usb::cdc::DeviceLines;
use phasmid::protocol::usb::usbip::{Command, HEADER_LEN, Packet, Reply, Submit, status};
use phasmid::protocol::usb::uvc::{self, Negotiation};
use phasmid::protocol::usb::{Setup, cdc, request};
use std::sync::Arc;
use std::time::Duration;

/// Maximum number of events queued for a firmware, including a few for a host that disconnects.
const MAX_EVENTS: usize = 1024 + 8;
/// Maximum number of serial bytes queued for a firmware, including the bytes of the last transfer.
const MAX_RECEIVED: usize = (64 << 10) + (1 << 20);

/// Actions of a script.
const CONFIGURE: u8 = 0;
const NEGOTIATE: u8 = 1;
const STANDARD: u8 = 2;
const CLASS: u8 = 3;
const READ_VIDEO: u8 = 4;
const READ_SERIAL: u8 = 5;
const NOTIFY: u8 = 6;
const WRITE_SERIAL: u8 = 7;
const UNLINK: u8 = 8;
const FRAME: u8 = 9;
const FIRMWARE: u8 = 10;
const TIME: u8 = 11;
const FAULT: u8 = 12;
const DAMAGED: u8 = 13;
const NOISE: u8 = 14;
const FLOW: u8 = 15;
const AGAIN: u8 = 16;
const REPLUG: u8 = 17;
const ENDPOINT: u8 = 18;
const STEPS: u8 = 19;

/// Runs a script of a host's actions against a device.
pub fn run(script: &[u8]) {
    let mut choices = Choices::new(script);
    let speed = choices.pick(&[Speed::High, Speed::Super]);
    let transfer = choices.pick(&[Transfer::Bulk, Transfer::Isochronous]);
    let device = sample::device(&sample::profile(speed, transfer), 1);
    let mut host = Host {
        wire: Wire::new(&device),
        device,
        transfer,
        ledger: Ledger::default(),
        seqnum: 0,
        last: Vec::new(),
        frames: 0,
    };
    while !choices.is_empty() && !host.wire.has_ended() {
        host.step(&mut choices);
    }
    host.finish();
}

/// Returns scripts that reach deep states of the device.
pub fn seeds() -> Vec<Vec<u8>> {
    let start = [CONFIGURE, NEGOTIATE, 0, 0];
    let bulk = |depth: u8| [READ_VIDEO, 0, AGAIN, depth, FRAME, 2, FIRMWARE];
    let serial = [
        CLASS,
        2,
        2,
        6,
        0,
        READ_SERIAL,
        2,
        NOTIFY,
        0,
        WRITE_SERIAL,
        5,
        b'*',
        b'I',
        b'D',
        b'N',
        b'?',
        FIRMWARE,
        WRITE_SERIAL,
        1,
        b'\n',
        FIRMWARE,
        TIME,
        3,
    ];
    let unlinks = [
        READ_VIDEO,
        0,
        READ_VIDEO,
        0,
        UNLINK,
        1,
        UNLINK,
        0,
        FRAME,
        0,
        UNLINK,
        5,
        READ_SERIAL,
        0,
        UNLINK,
        0,
        FIRMWARE,
    ];
    let iso = [
        STANDARD, 2, 10, 2, 2, 0, READ_VIDEO, 31, READ_VIDEO, 7, FRAME, 1, TIME, 200, TIME, 40,
    ];
    let faults = [
        FAULT, 0, FAULT, 2, FAULT, 6, READ_VIDEO, 0, FRAME, 3, TIME, 255, FIRMWARE,
    ];
    let odd = [
        DAMAGED, 6, 0x10, AGAIN, 3, ENDPOINT, 9, 0, NOISE, 3, 1, 2, 3, REPLUG, FLOW, 20, 1,
    ];
    let join = |speed: u8, transfer: u8, parts: &[&[u8]]| {
        [&[speed, transfer][..], &parts.concat()].concat()
    };
    vec![
        join(0, 0, &[&start, &bulk(8), &serial, &unlinks]),
        join(1, 0, &[&start, &bulk(30), &faults, &bulk(9), &serial]),
        join(0, 1, &[&start, &iso, &serial, &iso, &unlinks]),
        join(1, 1, &[&start, &iso, &faults, &iso]),
        join(0, 0, &[&start, &serial, &bulk(5), &odd]),
        join(
            1,
            0,
            &[&[FLOW, 60, 3], &start, &bulk(40), &[FLOW, 255, 9], &serial],
        ),
        join(
            0,
            0,
            &[
                &[CLASS, 0, 2, 6, 1, AGAIN, 255],
                &start,
                &[CLASS, 2, 2, 6, 6, AGAIN, 255],
            ],
        ),
    ]
}

struct Host {
    wire: Wire,
    device: UsbDevice,
    transfer: Transfer,
    ledger: Ledger,
    seqnum: u32,
    /// The last command sent, with its payload.
    last: Vec<u8>,
    frames: u64,
}

impl Host {
    fn step(&mut self, choices: &mut Choices<'_>) {
        match choices.byte() % STEPS {
            CONFIGURE => self.control(Setup::STANDARD_OUT, request::SET_CONFIGURATION, 1, 0, &[]),
            NEGOTIATE => self.negotiate(choices),
            STANDARD => self.standard(choices),
            CLASS => self.class(choices),
            READ_VIDEO => self.read_video(choices),
            READ_SERIAL => self.read(3, [512, 64, 4096, 0][choices.below(4)]),
            NOTIFY => self.read(2, [16, 8, 64, 0][choices.below(4)]),
            WRITE_SERIAL => {
                let data = choices.bytes(64);
                self.submit(3, false, data.len() as u32, Setup::default(), &data, None);
            }
            UNLINK => {
                let target = self.seqnum.wrapping_sub(choices.byte().into());
                self.seqnum += 1;
                let seqnum = self.seqnum;
                self.send(Command::Unlink { seqnum, target }.encode().to_vec());
            }
            FRAME => {
                for _ in 0..=choices.below(8) {
                    let format = choices.pick(&[PixelFormat::Grey, PixelFormat::Yuyv]);
                    let frame = Arc::new(sample::frame(self.frames, format));
                    self.frames += u64::from(self.device.put(frame, self.wire.now()));
                }
                self.wire.poll();
            }
            FIRMWARE => self.firmware(),
            TIME => {
                let time = Duration::from_micros(125) * u32::from(choices.byte()).pow(2);
                self.wire.advance(time);
            }
            FAULT => {
                let slow = Fault::Slow(Duration::from_millis(choices.byte().into()));
                let faults = [
                    Fault::PayloadError,
                    Fault::Stall,
                    Fault::ShortFrame,
                    Fault::FrozenFid,
                    slow,
                ];
                self.device.inject(choices.pick(&faults));
            }
            DAMAGED => {
                let mut bytes = self.last.clone();
                let at = 4 * choices.below(bytes.len().min(HEADER_LEN) / 4);
                let word = choices.word().to_be_bytes();
                bytes.splice(at..(at + 4).min(bytes.len()), word);
                self.send(bytes);
            }
            NOISE => self.send(choices.bytes(200)),
            FLOW => {
                let room = usize::from(choices.byte()).pow(2);
                let piece = [1, 47, 48, 1000, usize::MAX][choices.below(5)];
                self.wire.set_flow(room, piece);
            }
            AGAIN => {
                for _ in 0..choices.byte() {
                    let mut bytes = self.last.clone();
                    if bytes.len() >= HEADER_LEN {
                        self.seqnum += 1;
                        bytes[4..8].copy_from_slice(&self.seqnum.to_be_bytes());
                    }
                    self.send(bytes);
                }
            }
            REPLUG => {
                self.device.unplug(true);
                self.wire.poll();
                self.device.unplug(false);
            }
            _ => {
                let endpoint = choices.byte() % 16;
                let input = choices.byte() & 1 == 1;
                let data = choices.bytes(8);
                let data = if input { &[][..] } else { &data };
                self.submit(
                    endpoint,
                    input,
                    data.len() as u32,
                    Setup::default(),
                    data,
                    None,
                );
            }
        }
        let bytes = self.wire.take();
        self.ledger.received(&bytes);
    }

    fn send(&mut self, bytes: Vec<u8>) {
        self.ledger.sent(&bytes);
        self.wire.send(&bytes);
        self.last = bytes;
    }

    fn submit(
        &mut self,
        endpoint: u8,
        input: bool,
        length: u32,
        setup: Setup,
        data: &[u8],
        packets: Option<&[Packet]>,
    ) {
        self.seqnum += 1;
        let submit = Submit {
            seqnum: self.seqnum,
            device: self.device.info().id(),
            input,
            endpoint,
            flags: 0,
            length,
            packets: packets.map(|packets| packets.len() as u32),
            interval: 1,
            setup,
        };
        let table = packets.unwrap_or_default().iter().flat_map(Packet::encode);
        let mut bytes = Command::Submit(submit).encode().to_vec();
        bytes.extend(data);
        bytes.extend(table);
        self.send(bytes);
    }

    fn control(&mut self, kind: u8, request: u8, value: u16, index: u16, data: &[u8]) {
        let input = kind & 0x80 != 0;
        let length = if input { 4096 } else { data.len() as u16 };
        let setup = Setup {
            kind,
            request,
            value,
            index,
            length,
        };
        self.submit(0, input, length.into(), setup, data, None);
    }

    fn read(&mut self, endpoint: u8, length: u32) {
        self.submit(endpoint, true, length, Setup::default(), &[], None);
    }

    fn negotiate(&mut self, choices: &mut Choices<'_>) {
        let (format, interval) = (choices.byte().wrapping_add(1), choices.word());
        let wanted = Negotiation {
            hint: 1,
            format,
            frame: 1,
            interval,
            max_frame: 0,
            max_payload: 0,
            clock: 0,
        };
        for selector in [uvc::selector::PROBE, uvc::selector::COMMIT] {
            let (value, data) = (u16::from(selector) << 8, wanted.encode());
            self.control(Setup::CLASS_OUT, uvc::request::SET_CUR, value, 1, &data);
            self.control(Setup::CLASS_IN, uvc::request::GET_CUR, value, 1, &[]);
        }
    }

    fn standard(&mut self, choices: &mut Choices<'_>) {
        let kind = choices.pick(&[
            Setup::STANDARD_IN,
            Setup::STANDARD_OUT,
            Setup::INTERFACE_OUT,
            Setup::INTERFACE_IN,
            Setup::ENDPOINT_OUT,
            Setup::ENDPOINT_IN,
            0x40,
            0xFF,
        ]);
        let request = choices.byte() % 52;
        let value = choices.value(&[0, 1, 0x100, 0x200, 0x300, 0x301, 0x303, 0x600, 0xF00]);
        let index = choices.value(&[0, 1, 2, 3, 0x81, 0x82, 0x83, 0x409]);
        let data = choices.bytes(8);
        self.control(kind, request, value, index, &data);
    }

    fn class(&mut self, choices: &mut Choices<'_>) {
        // Controls: exposure, gain and error code; probe and commit; line coding, lines and break.
        let index = choices.pick(&[0x0100, 0x0200, 2, 1, 0, 3]);
        let control = choices.pick(&[0x0400, 0x0200, 3, 1, 0x0100, 0]);
        let (kind, request, data) = match choices.byte() % 12 {
            0 => (Setup::CLASS_IN, uvc::request::GET_CUR, vec![]),
            1 => (Setup::CLASS_IN, uvc::request::GET_MAX, vec![]),
            2 => (Setup::CLASS_IN, uvc::request::GET_INFO, vec![]),
            3 => (Setup::CLASS_OUT, uvc::request::SET_CUR, choices.bytes(40)),
            4 => (Setup::CLASS_OUT, uvc::request::SET_CUR, vec![120, 0, 0, 0]),
            5 => (Setup::CLASS_OUT, uvc::request::SET_CUR, vec![120, 0]),
            6 => (
                Setup::CLASS_OUT,
                cdc::request::SET_CONTROL_LINE_STATE,
                vec![],
            ),
            7 => (
                Setup::CLASS_OUT,
                cdc::request::SET_LINE_CODING,
                vec![0, 194, 1, 0, 0, 0, 8],
            ),
            8 => (Setup::CLASS_IN, cdc::request::GET_LINE_CODING, vec![]),
            9 => (Setup::CLASS_OUT, cdc::request::SEND_BREAK, vec![]),
            _ => (choices.byte(), choices.byte(), choices.bytes(50)),
        };
        self.control(kind, request, control, index, &data);
    }

    fn read_video(&mut self, choices: &mut Choices<'_>) {
        let choice = choices.byte();
        if self.transfer == Transfer::Bulk && choice < 250 {
            return self.read(1, [32768, 16384, 512, 2, 1, 0][usize::from(choice % 6)]);
        }
        let count = usize::from(choice) + 1;
        let length = [3072, 1024, 1, 0][usize::from(choice >> 6)];
        let packets: Vec<Packet> = (0..count as u32)
            .map(|i| Packet {
                offset: i * length,
                length,
                actual: 0,
                status: -18,
            })
            .collect();
        let length = length * count as u32;
        self.submit(1, true, length, Setup::default(), &[], Some(&packets));
    }

    /// Imitates a firmware that keeps up with the host: echoes data, and then raises a serial line.
    fn firmware(&mut self) {
        let now = self.wire.now();
        for event in take_events(&self.device) {
            if let Event::Received(bytes) = event {
                self.device.send(&bytes, now);
                let dsr = bytes.len() % 2 == 1;
                self.device.set_lines(DeviceLines { dcd: true, dsr }, now);
            }
        }
        self.wire.poll();
    }

    fn finish(mut self) {
        self.wire.set_flow(usize::MAX, usize::MAX);
        self.wire.advance(Duration::from_secs(60));
        let bytes = self.wire.take();
        self.ledger.received(&bytes);
        // The host may cause the connection to end in any way.
        let _ = self.wire.close();
        take_events(&self.device);
        // The next host finds the device unchanged.
        let mut wire = Wire::new(&self.device);
        let setup = Setup {
            kind: Setup::STANDARD_IN,
            request: request::GET_DESCRIPTOR,
            value: 0x100,
            index: 0,
            length: 18,
        };
        let submit = Submit {
            seqnum: 7,
            device: 0,
            input: true,
            endpoint: 0,
            flags: 0,
            length: 18,
            packets: None,
            interval: 0,
            setup,
        };
        wire.send(&Command::Submit(submit).encode());
        let bytes = wire.take();
        let (header, data) = bytes.split_first_chunk::<HEADER_LEN>().expect("a reply");
        let answered = matches!(
            Reply::decode(header),
            Ok(Reply::Submit {
                seqnum: 7,
                status: status::OK,
                actual: 18,
                ..
            })
        );
        assert!(answered && data[..2] == [18, 1], "{bytes:?}");
        wire.close().expect("a host that leaves");
    }
}

/// Takes the queued events and checks that their number is within the limits.
fn take_events(device: &UsbDevice) -> Vec<Event> {
    let events = device.take_events();
    assert!(events.len() <= MAX_EVENTS, "{} events", events.len());
    let received = |event: &Event| match event {
        Event::Received(bytes) => bytes.len(),
        _ => 0,
    };
    let bytes: usize = events.iter().map(received).sum();
    assert!(bytes <= MAX_RECEIVED, "{bytes} bytes wait");
    events
}
