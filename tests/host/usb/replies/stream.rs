//! Frames in bulk transfers, and transfers that the host unlinks.

use super::{Host, frame};
use crate::usb::fuzz::sample::{HEIGHT, WIDTH};
use phasmid::link::usb::Event;
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::Frame;
use phasmid::protocol::usb::usbip::{Reply, status};
use phasmid::protocol::usb::uvc::payload;
use std::sync::Arc;
use std::time::Duration;

#[test]
fn frames_go_out_whole_and_in_order_in_bulk() {
    for speed in [Speed::High, Speed::Super] {
        let mut host = Host::new(speed, Transfer::Bulk);
        assert!(!host.put(0), "nobody reads");
        let agreed = host.start();
        assert_eq!(agreed.max_frame, WIDTH * HEIGHT);
        let first = host.read(1, agreed.max_payload);
        assert!(host.device.is_streaming());
        let events = host.device.take_events();
        assert!(events.contains(&Event::Started) && events.contains(&Event::Committed(agreed)));
        let unlinked = Reply::Unlink {
            seqnum: first + 1,
            status: status::UNLINKED,
        };
        assert_eq!(host.unlink(first), [(unlinked, vec![])]);
        assert!(!host.device.is_streaming(), "all transfers are unlinked");
        for (id, (data, bits)) in (1..4).zip(host.stream(1..4, agreed.max_payload)) {
            assert_eq!(data, frame(id).data);
            let toggled = (id % 2) as u8;
            assert!(
                bits.iter()
                    .all(|b| b & payload::FID == toggled && b & payload::EOH != 0)
            );
        }
        // Clearing the halt of the endpoint ends the stream and discards queued data.
        host.clear_halt();
        assert!(!host.device.is_streaming());
    }
}

#[test]
fn an_unlink_after_the_answer_comes_too_late() {
    let mut host = Host::new(Speed::High, Transfer::Bulk);
    let agreed = host.start();
    let urb = host.read(1, agreed.max_payload);
    assert!(host.put(1));
    let replies = host.unlink(urb);
    assert!(
        matches!(replies[0].0, Reply::Submit { seqnum, status: status::OK, .. } if seqnum == urb)
    );
    let late = Reply::Unlink {
        seqnum: urb + 1,
        status: status::OK,
    };
    assert_eq!(replies[1].0, late);
}

#[test]
fn transfer_too_short_for_a_header_overflows_without_loss() {
    let mut host = Host::new(Speed::High, Transfer::Bulk);
    let agreed = host.start();
    host.read(1, 1);
    assert!(host.put(1));
    let replies = host.replies();
    assert_eq!(replies.len(), 1);
    assert_eq!(super::status_of(&replies[0].0), status::OVERFLOW);
    let frames = host.stream(2..3, agreed.max_payload);
    assert_eq!(frames[0].0, frame(1).data);
    assert_eq!(frames[1].0, frame(2).data);
}

#[test]
fn a_slow_host_gets_the_newest_of_a_free_camera() {
    let mut host = Host::new(Speed::High, Transfer::Bulk);
    assert!(!host.put(0), "nobody reads");
    let agreed = host.start();
    host.read(1, agreed.max_payload);
    let free = |id: u64| {
        let frame = Frame {
            pattern_index: None,
            ..frame(id).as_ref().clone()
        };
        assert!(host.device.put(Arc::new(frame), Duration::ZERO));
    };
    (1..=101).for_each(free);
    assert!(host.device.is_crowded());
    host.replies();
    let frames = host.stream(0..0, agreed.max_payload);
    let newest: Vec<_> = frames.iter().rev().take(8).map(|(data, _)| data).collect();
    for (data, id) in newest.into_iter().zip((94..=101).rev()) {
        assert_eq!(*data, frame(id).data);
    }
    assert!(
        frames.len() < 10,
        "older frames are dropped: {}",
        frames.len()
    );
    assert_eq!(host.device.lost(), 0, "dropped frames do not count as lost");
}

#[test]
fn triggered_frames_wait_and_those_that_find_no_room_are_counted() {
    let mut host = Host::new(Speed::High, Transfer::Bulk);
    let agreed = host.start();
    host.read(1, agreed.max_payload);
    let put = |id: u32| host.device.put(frame(id.into()), Duration::ZERO);
    let taken = (1..5000).take_while(|&id| put(id)).count();
    assert!((1024..1030).contains(&taken), "{taken} frames wait");
    assert_eq!(host.device.lost(), 1);
}
