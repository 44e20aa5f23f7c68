//! Isochronous transfers end in time, with or without a frame.

use super::{Host, frame, status_of};
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::usb::usbip::{PACKET_LEN, Packet, Reply, status};
use phasmid::protocol::usb::{Setup, request};
use std::time::Duration;

impl Host {
    /// Same as [`Host::start`], and also selects the alternate setting that carries the stream.
    pub(super) fn start_isochronous(&mut self) {
        self.start();
        self.control(Setup::INTERFACE_OUT, request::SET_INTERFACE, 1, 1, &[])
            .unwrap();
    }
}

#[test]
fn isochronous_transfers_end_in_time_with_or_without_a_frame() {
    const MICROFRAME: Duration = Duration::from_micros(125);
    let mut host = Host::new(Speed::High, Transfer::Isochronous);
    host.start_isochronous();
    host.read_packets(32, 3072);
    assert!(host.put(1));
    assert_eq!(host.replies(), [], "no reply before the transfer's end");
    host.read_packets(32, 3072);
    host.wire.advance(31 * MICROFRAME);
    assert_eq!(host.replies(), [], "no reply a microframe too early");
    host.wire.advance(MICROFRAME);
    let replies = host.replies();
    let [(Reply::Submit { actual, .. }, bytes)] = &replies[..] else {
        panic!("{replies:?}")
    };
    let (data, table) = bytes.split_at(*actual as usize);
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
    host.wire.advance(32 * MICROFRAME);
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
        "the transfer is empty"
    );
}

#[test]
fn transfers_of_the_wrong_kind_are_refused() {
    let mut host = Host::new(Speed::High, Transfer::Isochronous);
    host.start_isochronous();
    host.read(1, 3072);
    assert_eq!(status_of(&host.replies()[0].0), status::STALL);
    let mut host = Host::new(Speed::High, Transfer::Bulk);
    host.start();
    host.read_packets(2, 512);
    assert_eq!(status_of(&host.replies()[0].0), status::STALL);
}
