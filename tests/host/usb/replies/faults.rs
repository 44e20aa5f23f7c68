//! Faults as they would appear on a bus.

use super::{Host, frame, status_of};
use phasmid::link::usb::Fault;
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::usb::usbip::{PACKET_LEN, Packet, status};
use phasmid::protocol::usb::uvc::payload;
use std::time::Duration;

#[test]
fn damaged_short_and_frozen_frames_are_followed_by_whole_ones() {
    let mut host = Host::new(Speed::Super, Transfer::Bulk);
    let payload = host.start().max_payload;
    host.device.inject(Fault::PayloadError);
    host.device.inject(Fault::ShortFrame);
    host.device.inject(Fault::FrozenFid);
    let frames = host.stream(1..5, payload);
    assert!(frames[0].1.iter().all(|bits| bits & payload::ERR != 0));
    assert_eq!(frames[1].0, frame(2).data[..frame(2).data.len() / 2]);
    assert_eq!(frames[2].1[0] & payload::FID, frames[1].1[0] & payload::FID);
    assert_eq!(frames[3].0, frame(4).data);
}

#[test]
fn a_slow_frame_comes_when_its_time_is_over() {
    let mut host = Host::new(Speed::Super, Transfer::Bulk);
    let payload = host.start().max_payload;
    for _ in 0..8 {
        host.read(1, payload);
    }
    host.device.inject(Fault::Slow(Duration::from_secs(2)));
    assert!(host.put(5));
    host.wire.advance(Duration::from_millis(1999));
    assert_eq!(host.replies(), []);
    host.wire.advance(Duration::from_millis(1));
    assert_eq!(host.replies().len(), 2);
}

#[test]
fn stall_ends_waiting_transfers_and_lasts_until_cleared() {
    let mut host = Host::new(Speed::Super, Transfer::Bulk);
    let payload = host.start().max_payload;
    for _ in 0..8 {
        host.read(1, payload);
    }
    host.device.inject(Fault::Stall);
    assert!(host.put(6));
    let stalled = host.replies();
    assert_eq!(stalled.len(), 8);
    assert!(stalled.iter().all(|r| status_of(&r.0) == status::STALL));
    host.read(1, payload);
    assert_eq!(status_of(&host.replies()[0].0), status::STALL, "halted");
    host.clear_halt();
    assert_eq!(host.stream(7..8, payload)[0].0, frame(7).data);
}

#[test]
fn a_stalled_isochronous_transfer_answers_for_each_packet() {
    let mut host = Host::new(Speed::High, Transfer::Isochronous);
    host.start_isochronous();
    host.read_packets(3, 1024);
    host.device.inject(Fault::Stall);
    assert!(host.put(1));
    host.wire.advance(Duration::from_millis(1));
    let (reply, table) = host.replies().remove(0);
    assert_eq!(status_of(&reply), status::STALL);
    let packets: Vec<Packet> = table
        .as_chunks::<PACKET_LEN>()
        .0
        .iter()
        .map(Packet::decode)
        .collect();
    assert_eq!(packets.len(), 3);
    assert!(
        packets
            .iter()
            .all(|p| (p.actual, p.status) == (0, status::STALL))
    );
}
