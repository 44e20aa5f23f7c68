//! Tests which parts of a frame each transfer carries, and that frames are not copied.

use super::*;
use phasmid_protocol::PixelFormat;
use phasmid_protocol::usb::Setup;
use phasmid_protocol::usb::usbip::{HEADER_LEN, PACKET_LEN};
use std::io::IoSlice;

const NOW: Duration = Duration::from_secs(1);
const LATER: Duration = Duration::from_secs(2);

fn frame(len: usize) -> Arc<Frame> {
    Arc::new(Frame {
        id: 1,
        pattern_index: None,
        width: len as u32,
        height: 1,
        format: PixelFormat::Grey,
        exposure_start_ns: 0,
        exposure_end_ns: 1,
        data: (0..len).map(|i| i as u8).collect(),
    })
}

/// Submits a transfer with room for packets of the lengths `packets`, or for a payload of `length`
/// bytes.
fn transfer(video: &mut Video, seqnum: u32, length: u32, packets: &[u32]) {
    let submit = Submit {
        seqnum,
        device: 0,
        input: true,
        endpoint: 1,
        flags: 0,
        length,
        packets: (!packets.is_empty()).then_some(packets.len() as u32),
        interval: 0,
        setup: Setup::default(),
    };
    let room = |&length| Packet {
        offset: 0,
        length,
        actual: 0,
        status: 0,
    };
    let packets: Vec<Packet> = packets.iter().map(room).collect();
    video.submit(submit, &packets, NOW);
}

/// No pixel is copied between the frame given to the link and the write to the socket: every pixel
/// is written from the frame's own memory.
#[test]
fn pixels_are_written_from_the_frame_itself() {
    for isochronous in [false, true] {
        let mut video = Video::default();
        let frame = frame(100_000);
        for seqnum in 0..8 {
            let packets: &[u32] = if isochronous { &[3072; 8] } else { &[] };
            transfer(&mut video, seqnum, 16_384, packets);
        }
        assert!(video.put(frame.clone()));
        let mut outgoing = Outgoing::default();
        assert!(!video.pump(16_384, LATER, &mut outgoing));
        let mut slices = [IoSlice::new(&[]); 256];
        let count = outgoing.slices(&mut slices);
        let memory = frame.data.as_ptr_range();
        let (mut at, mut other) = (memory.start, 0);
        for slice in slices[..count].iter().filter(|slice| !slice.is_empty()) {
            let range = slice.as_ptr_range();
            if memory.contains(&range.start) {
                assert_eq!(range.start, at, "pixels are in order and without gaps");
                at = range.end;
            } else {
                other += slice.len();
            }
        }
        assert_eq!(at, memory.end, "the whole frame is written");
        // Only headers of transfers and payloads, and packet descriptors, are written from other
        // memory.
        let payloads = 100_000_usize.div_ceil(if isochronous { 3070 } else { 16_382 });
        let transfers = if isochronous { 8 } else { payloads };
        let packets = if isochronous { 64 } else { 0 };
        let wanted = transfers * HEADER_LEN + payloads * 2 + packets * PACKET_LEN;
        assert_eq!(other, wanted, "isochronous: {isochronous}");
    }
}

#[test]
fn packets_without_room_for_a_header_stay_empty() {
    let mut video = Video::default();
    transfer(&mut video, 1, 20, &[0, 1, 2, 6, 6]);
    assert!(video.put(frame(8)));
    let mut outgoing = Outgoing::default();
    assert!(!video.pump(3072, LATER, &mut outgoing));
    let mut slices = [IoSlice::new(&[]); 64];
    let count = outgoing.slices(&mut slices);
    let bytes: Vec<u8> = slices[..count].iter().flat_map(|s| s.to_vec()).collect();
    let table = &bytes[bytes.len() - 5 * PACKET_LEN..];
    let packets = table.as_chunks::<PACKET_LEN>().0;
    let actual: Vec<u32> = packets.iter().map(|p| Packet::decode(p).actual).collect();
    assert_eq!(actual, [0, 0, 2, 6, 6]);
}
