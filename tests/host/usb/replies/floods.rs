//! Hosts that request more than any driver does: each queue is bounded, and a host that exceeds a
//! bound is disconnected or has to wait.

use super::Host;
use crate::usb::fuzz::wire::Wire;
use phasmid::link::usb::Event;
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::usb::{Setup, cdc, request, uvc};

/// Returns the reason for which the device has ended the connection.
fn reason(host: Host) -> String {
    assert!(host.wire.has_ended());
    host.wire.close().unwrap_err().to_string()
}

#[test]
fn too_many_waiting_transfers_end_the_connection() {
    let mut host = Host::new(Speed::High, Transfer::Bulk);
    for _ in 0..2000 {
        host.read(3, 64);
    }
    let device = host.device.clone();
    assert!(reason(host).contains("1024 transfers"));
    let mut next = Host {
        wire: Wire::new(&device),
        ledger: Default::default(),
        device,
        seqnum: 0,
    };
    let (get, kind) = (request::GET_DESCRIPTOR, Setup::STANDARD_IN);
    assert!(next.control(kind, get, 0x0100, 0, &[]).is_some(), "free");
}

#[test]
fn too_many_waiting_packets_end_the_connection() {
    let mut host = Host::new(Speed::High, Transfer::Isochronous);
    for _ in 0..100 {
        host.read_packets(1024, 0);
    }
    assert!(reason(host).contains("65536 isochronous"));
}

#[test]
fn bytes_beyond_the_buffer_end_the_connection() {
    let mut host = Host::new(Speed::High, Transfer::Bulk);
    let data = vec![b'x'; 16 << 10];
    for _ in 0..300 {
        host.submit(3, false, data.len() as u32, Setup::default(), &data);
    }
    let received = |event: &Event| match event {
        Event::Received(bytes) => bytes.len(),
        _ => 0,
    };
    let taken = host.device.take_events();
    assert_eq!(taken.iter().map(received).sum::<usize>(), 64 << 10);
    assert!(reason(host).contains("before earlier data is accepted"));
}

/// With a firmware that takes no events, settings are replaced, and all other events are bounded
/// over any number of connections.
#[test]
fn events_beyond_the_limit_end_the_connection() {
    let mut host = Host::new(Speed::High, Transfer::Bulk);
    let exposure = u16::from(uvc::selector::EXPOSURE_TIME_ABSOLUTE) << 8;
    let set = uvc::request::SET_CUR;
    for units in 1..=5000u32 {
        let data = units.to_le_bytes();
        host.control(Setup::CLASS_OUT, set, exposure, 0x0100, &data)
            .unwrap();
    }
    let lines = |value| Setup {
        kind: Setup::CLASS_OUT,
        request: cdc::request::SET_CONTROL_LINE_STATE,
        value,
        index: 2,
        length: 0,
    };
    for value in [3, 1].repeat(2000) {
        host.submit(0, false, 0, lines(value), &[]);
    }
    // The host waits; once the firmware takes what is queued, everything arrives in order.
    let device = host.device.clone();
    let mut events = device.take_events();
    assert!((1024..1032).contains(&events.len()), "{}", events.len());
    assert_eq!(events[1], Event::Exposure(500_000_000));
    for _ in 0..8 {
        host.wire.poll();
        let more = device.take_events();
        assert!(more.len() < 1032, "{}", more.len());
        events.extend(more);
    }
    let toggles = events.iter().filter(|e| matches!(e, Event::Lines(_)));
    assert_eq!(toggles.count(), 4000);
    // Hosts that reconnect are refused while too many events are queued.
    host.wire.close().unwrap();
    let refused = (0..2000).filter_map(|_| Wire::new(&device).close().err());
    let refused: Vec<_> = refused.collect();
    assert!(refused.len() > 900, "{}", refused.len());
    assert!(refused[0].to_string().contains("attached elsewhere"));
    let events = device.take_events();
    assert!(events.len() < 1032, "{}", events.len());
    assert_eq!(events.last(), Some(&Event::Detached));
    Wire::new(&device).close().unwrap();
}
