//! Encodes records as bytes.

use super::{
    About, Channel, Event, FILE_MAGIC, HEAD_LEN, MAX_TEXT, RECORD_LEN, RECORD_MAGIC, VERSION,
};
use crate::{Frame, wire};

/// Encodes the file header.
pub fn encode_head() -> [u8; HEAD_LEN] {
    let mut head = [0; HEAD_LEN];
    head[..8].copy_from_slice(&FILE_MAGIC);
    head[8..10].copy_from_slice(&VERSION.to_le_bytes());
    head[10..12].copy_from_slice(&(HEAD_LEN as u16).to_le_bytes());
    let crc = crc32fast::hash(&head[..12]);
    head[12..].copy_from_slice(&crc.to_le_bytes());
    head
}

/// Encodes a whole record as bytes that are to be written with a single write. Texts longer than
/// [`MAX_TEXT`] are truncated.
pub fn encode_record(number: u64, time_ns: u64, channel: Channel, event: &Event) -> Vec<u8> {
    let mut record = vec![0; RECORD_LEN];
    put_payload(&mut record, event);
    let (head, payload) = record.split_at_mut(RECORD_LEN);
    head[..4].copy_from_slice(&RECORD_MAGIC);
    head[4..6].copy_from_slice(&event.code().to_le_bytes());
    head[6..8].copy_from_slice(&(channel as u16).to_le_bytes());
    head[8..16].copy_from_slice(&number.to_le_bytes());
    head[16..24].copy_from_slice(&time_ns.to_le_bytes());
    // The longest payload is the payload of a frame, 128 MiB, so its length fits.
    head[24..28].copy_from_slice(&(payload.len() as u32).to_le_bytes());
    head[28..32].copy_from_slice(&crc32fast::hash(payload).to_le_bytes());
    let crc = crc32fast::hash(&head[..32]);
    head[32..].copy_from_slice(&crc.to_le_bytes());
    record
}

fn put_payload(record: &mut Vec<u8>, event: &Event) {
    match event {
        Event::About(about) => record.extend(json(about)),
        Event::Sent(bytes) | Event::Received(bytes) => record.extend_from_slice(bytes),
        Event::Frame(frame) => put_frame(record, frame),
        Event::Note(text) | Event::Cut(text) => record.extend_from_slice(shortened(text)),
        Event::Opened | Event::Left | Event::End | Event::Unplugged | Event::Plugged => {}
    }
}

fn put_frame(record: &mut Vec<u8>, frame: &Frame) {
    record.reserve_exact(wire::HEADER_LEN + frame.data.len());
    record.extend_from_slice(&wire::encode_header(frame));
    record.extend_from_slice(&frame.data);
}

/// Serializes the file's description; texts are truncated until it fits.
fn json(about: &About) -> Vec<u8> {
    let encode = |about: &About| serde_json::to_vec(about).expect("numbers and strings");
    let bytes = encode(about);
    if bytes.len() <= MAX_TEXT {
        return bytes;
    }
    // No actual name or path is this long. A character takes up to six bytes in JSON.
    let short = |text: &String| text.chars().take(1000).collect();
    encode(&About {
        program: short(&about.program),
        name: short(&about.name),
        control: short(&about.control),
        camera: short(&about.camera),
        profile: about.profile.as_ref().map(short),
        scene: about.scene.as_ref().map(short),
        ..about.clone()
    })
}

/// Returns the longest prefix of a text that fits into [`MAX_TEXT`] bytes.
fn shortened(text: &str) -> &[u8] {
    let end = (0..=text.len().min(MAX_TEXT))
        .rev()
        .find(|&end| text.is_char_boundary(end));
    &text.as_bytes()[..end.unwrap_or(0)]
}
