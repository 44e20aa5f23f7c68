//! Data from sockets.

use phasmid::host::usb::Configuration;
use phasmid::protocol::data_line::{self, Found};
use phasmid::protocol::record::{Event, Reader, Summary, encode_record};
use phasmid::protocol::service::{Reply, Request};
use phasmid::protocol::usb::usbip::{Command, DeviceInfo, Operation};
use phasmid::protocol::usb::{cdc, descriptor, uvc};
use phasmid::protocol::wire::{FrameDecoder, encode_header};
use phasmid::protocol::{Frame, PixelFormat};

/// Reads a frame socket's stream in pieces of many lengths; every resulting frame must be complete.
pub fn frames(bytes: &[u8]) -> bool {
    let mut decoder = FrameDecoder::default();
    let mut rest = bytes;
    let mut whole = false;
    for len in (1..).step_by(13) {
        let space = decoder.space();
        let take = rest.len().min(space.len()).min(len);
        space[..take].copy_from_slice(&rest[..take]);
        rest = &rest[take..];
        match decoder.advance(take) {
            Ok(Some(frame)) => {
                assert_eq!(
                    frame.data.len(),
                    frame.format.frame_bytes(frame.width, frame.height)
                );
                encode_header(&frame);
                whole = true;
            }
            Ok(None) => {}
            Err(_) if decoder.in_step() => {}
            Err(_) => return false,
        }
        if rest.is_empty() {
            break;
        }
    }
    whole
}

/// Reads the first row of an image as an embedded data line.
pub fn data_line(bytes: &[u8]) -> bool {
    let mut lined = false;
    for (format, width) in [
        (PixelFormat::Grey, 256),
        (PixelFormat::Y16, 300),
        (PixelFormat::Y12P, 301),
    ] {
        let row = format.row_bytes(width);
        let mut data = bytes.to_vec();
        data.resize(2 * row, 0);
        let frame = Frame {
            id: 1,
            pattern_index: None,
            width,
            height: 2,
            format,
            exposure_start_ns: 0,
            exposure_end_ns: 0,
            data,
        };
        let (frame, found) = data_line::strip(frame);
        let height = if found == Found::Line { 1 } else { 2 };
        assert_eq!(frame.data.len(), row * frame.height as usize);
        assert!(frame.height == height || found == Found::Damaged);
        lined |= found == Found::Line;
    }
    lined
}

/// Reads a line of the service channel, as a request and as a reply.
pub fn service(bytes: &[u8]) -> bool {
    let mut known = false;
    if let Ok(request) = Request::parse(bytes) {
        known = true;
        let line = request.to_line();
        assert_eq!(Request::parse(line.as_bytes()), Ok(request));
    }
    if let Ok(reply) = Reply::parse(bytes) {
        known = true;
        assert_eq!(Reply::parse(reply.to_line().as_bytes()).unwrap(), reply);
    }
    known
}

/// Reads a recording: records must be written as the bytes from which they were read, up to the
/// position at which reading stops.
pub fn recording(bytes: &[u8]) -> bool {
    let Ok(mut reader) = Reader::new(bytes, "recording") else {
        return false;
    };
    let mut records = 0;
    while let Ok(Some(record)) = reader.read() {
        let start = usize::try_from(record.offset).unwrap();
        let written = encode_record(record.number, record.time_ns, record.channel, &record.event);
        // The same JSON value has many representations.
        if !matches!(record.event, Event::About(_)) {
            assert!(bytes[start..].starts_with(&written));
        }
        records += 1;
    }
    assert_eq!(reader.read(), Ok(None));
    let summary = Summary::of(&mut Reader::new(bytes, "recording").unwrap());
    assert_eq!(summary.records, records);
    records > 0
}

/// Reads records of USB and USB/IP.
pub fn usb_records(bytes: &[u8]) -> bool {
    let mut known = Configuration::parse(bytes).is_ok();
    known |= descriptor::text(bytes).is_some();
    assert!(descriptor::Walk::new(bytes).count() <= bytes.len());
    let _ = uvc::format(bytes);
    let _ = cdc::DeviceLines::from_notification(bytes);
    if let Some(coding) = cdc::LineCoding::decode(bytes) {
        assert_eq!(cdc::LineCoding::decode(&coding.encode()), Some(coding));
    }
    if let Some(header) = bytes.first_chunk() {
        known |= Command::decode(header).is_ok();
    }
    if let Some(header) = bytes.first_chunk() {
        known |= Operation::decode(*header).is_ok();
    }
    if let Some(record) = bytes.first_chunk() {
        DeviceInfo::decode(record);
    }
    known
}
