//! The device's replies one by one, without a socket, to a host that checks each reply.

mod controls;
mod faults;
mod floods;
mod isochronous;
mod port;
mod stream;

use crate::usb::fuzz::ledger::Ledger;
use crate::usb::fuzz::sample;
use crate::usb::fuzz::wire::Wire;
use phasmid::link::usb::UsbDevice;
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::usb::usbip::{Command, HEADER_LEN, Packet, Reply, Submit, status};
use phasmid::protocol::usb::uvc::{self, Negotiation, payload};
use phasmid::protocol::usb::{Setup, request};
use phasmid::protocol::{Frame, PixelFormat};
use std::sync::Arc;

fn frame(id: u64) -> Arc<Frame> {
    Arc::new(sample::frame(id, PixelFormat::Grey))
}

/// Returns the status of a completed transfer.
fn status_of(reply: &Reply) -> i32 {
    match reply {
        Reply::Submit { status, .. } => *status,
        Reply::Unlink { .. } => panic!("{reply:?}"),
    }
}

struct Host {
    device: UsbDevice,
    wire: Wire,
    ledger: Ledger,
    seqnum: u32,
}

impl Host {
    fn new(speed: Speed, transfer: Transfer) -> Self {
        let device = sample::device(&sample::profile(speed, transfer), 1);
        Self {
            wire: Wire::new(&device),
            device,
            ledger: Ledger::default(),
            seqnum: 0,
        }
    }

    fn send(&mut self, command: Command, behind: &[u8]) {
        let bytes = [&command.encode()[..], behind].concat();
        self.ledger.sent(&bytes);
        self.wire.send(&bytes);
    }

    /// Submits a transfer and returns its sequence number.
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
        self.send(Command::Submit(submit), data);
        self.seqnum
    }

    /// Submits a transfer to the host.
    fn read(&mut self, endpoint: u8, length: u32) -> u32 {
        self.submit(endpoint, true, length, Setup::default(), &[])
    }

    /// Submits an isochronous transfer of the camera.
    fn read_packets(&mut self, count: u32, length: u32) -> u32 {
        self.seqnum += 1;
        let submit = Submit {
            seqnum: self.seqnum,
            device: self.device.info().id(),
            input: true,
            endpoint: 1,
            flags: 0,
            length: count * length,
            packets: Some(count),
            interval: 1,
            setup: Setup::default(),
        };
        let packet = |i| Packet {
            offset: i * length,
            length,
            actual: 0,
            status: -18,
        };
        let table: Vec<u8> = (0..count).flat_map(|i| packet(i).encode()).collect();
        self.send(Command::Submit(submit), &table);
        self.seqnum
    }

    fn unlink(&mut self, target: u32) -> Vec<(Reply, Vec<u8>)> {
        self.seqnum += 1;
        let seqnum = self.seqnum;
        self.send(Command::Unlink { seqnum, target }, &[]);
        self.replies()
    }

    /// Passes a frame to the device; returns `false` if it is rejected.
    fn put(&mut self, id: u64) -> bool {
        let taken = self.device.put(frame(id), self.wire.now());
        self.wire.poll();
        taken
    }

    /// Returns the replies received since the last call, each with the data after its header.
    fn replies(&mut self) -> Vec<(Reply, Vec<u8>)> {
        self.wire.poll();
        let whole = self.ledger.received(&self.wire.take());
        let cut = |bytes: Vec<u8>| {
            let (header, behind) = bytes.split_first_chunk::<HEADER_LEN>().unwrap();
            (Reply::decode(header).unwrap(), behind.to_vec())
        };
        whole.into_iter().map(cut).collect()
    }

    /// Sends a request; returns `None` if it is refused.
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
        let seqnum = self.submit(0, input, length.into(), setup, data);
        let replies = self.replies();
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

    /// Configures the device and negotiates its first format.
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
        let (set, get) = (uvc::request::SET_CUR, uvc::request::GET_CUR);
        let [_, agreed] = [uvc::selector::PROBE, uvc::selector::COMMIT].map(|selector| {
            let value = u16::from(selector) << 8;
            self.control(Setup::CLASS_OUT, set, value, 1, &wanted.encode())
                .unwrap();
            self.control(Setup::CLASS_IN, get, value, 1, &[]).unwrap()
        });
        Negotiation::decode(&agreed).unwrap()
    }

    /// Ends a stream by clearing the halt of the camera's endpoint.
    fn clear_halt(&mut self) {
        self.control(Setup::ENDPOINT_OUT, request::CLEAR_FEATURE, 0, 0x81, &[])
            .unwrap();
    }

    /// Puts frames and reads payloads until there are no more; returns each frame's bytes and
    /// header bits.
    fn stream(&mut self, ids: std::ops::Range<u64>, payload: u32) -> Vec<(Vec<u8>, Vec<u8>)> {
        for _ in 0..64 {
            self.read(1, payload);
        }
        for id in ids {
            assert!(self.put(id));
        }
        let mut frames: Vec<(Vec<u8>, Vec<u8>)> = vec![Default::default()];
        for (reply, bytes) in self.replies() {
            assert_eq!(status_of(&reply), status::OK);
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
