//! Checks of message framing.

use super::reading::Check;
use crate::dialect::command::{Framing, LineEnds};
use crate::dialect::file::{Endian, FramingKind, LineFile, PacketFile};
use crate::dialect::packet::Layout;
use crate::scpi::MAX_BLOCK_BYTES;
use phasmid_core::error::Result;
use std::ops::Range;
use std::sync::Arc;

/// Maximum packet length in bytes.
const MAX_PACKET: usize = 4096;
/// Maximum line length that a file may set.
const MAX_LINE: usize = 64 << 10;

pub(super) fn framing(check: &Check<'_>) -> Result<Framing> {
    let file = check.file;
    let allowed = "[line] for framing \"line\", [packet] for framing \"packet\"";
    let wants = |kind| file.framing == kind;
    check.that(
        file.line.is_none() || wants(FramingKind::Line),
        "line",
        "lines in another framing",
        allowed,
    )?;
    check.that(
        file.packet.is_some() == wants(FramingKind::Packet),
        "packet",
        "[packet] with another framing, or missing with this one",
        allowed,
    )?;
    match (file.framing, &file.packet) {
        (FramingKind::Packet, Some(packet)) => layout(check, packet).map(Framing::Packet),
        (FramingKind::Line, _) => {
            let line = file.line.clone().unwrap_or_default();
            lines(check, &line).map(Framing::Line)
        }
        _ => Ok(Framing::Scpi(Arc::new(LineEnds {
            to_device: "\n".to_owned(),
            to_host: "\n".to_owned(),
            comment: None,
            any_case: true,
            max: MAX_BLOCK_BYTES,
        }))),
    }
}

fn lines(check: &Check<'_>, line: &LineFile) -> Result<Arc<LineEnds>> {
    for (field, end) in [
        ("line.to_device", &line.to_device),
        ("line.to_host", &line.to_host),
    ] {
        check.that(
            ["\n", "\r", "\r\n"].contains(&end.as_str()),
            field,
            format!("{end:?}"),
            r#""\n", "\r" or "\r\n""#,
        )?;
    }
    if let Some(comment) = &line.comment {
        check.that(
            (1..=8).contains(&comment.len()) && comment.bytes().all(|b| b.is_ascii_graphic()),
            "line.comment",
            format!("{comment:?}"),
            "1 to 8 characters without a space",
        )?;
    }
    check.that(
        (16..=MAX_LINE).contains(&line.max_bytes),
        "line.max_bytes",
        line.max_bytes,
        format!("16 to {MAX_LINE}"),
    )?;
    Ok(Arc::new(LineEnds {
        to_device: line.to_device.clone(),
        to_host: line.to_host.clone(),
        comment: line.comment.clone(),
        any_case: line.any_case,
        max: line.max_bytes,
    }))
}

fn layout(check: &Check<'_>, packet: &PacketFile) -> Result<Arc<Layout>> {
    check.that(
        packet.size_bytes.is_some() != packet.max_bytes.is_some(),
        "packet",
        "size_bytes and max_bytes, or neither",
        "size_bytes for packets of equal size, max_bytes for others",
    )?;
    check.that(
        packet.size_bytes.is_some() || packet.length.is_some(),
        "packet.max_bytes",
        "packets of variable length without a length field",
        "length = { at, bytes, from }, or size_bytes",
    )?;
    let max = packet.size_bytes.or(packet.max_bytes).unwrap_or(0);
    check.that(
        (2..=MAX_PACKET).contains(&max),
        "packet",
        format!("{max} bytes"),
        format!("2 to {MAX_PACKET}"),
    )?;
    let bytes =
        |field: &str, bytes: usize| check.that((1..=4).contains(&bytes), field, bytes, "1 to 4");
    bytes("packet.code.bytes", packet.code.bytes)?;
    let reply_code = packet.reply.code.unwrap_or(true);
    let reply_data_at = packet.reply.data_at.unwrap_or(packet.data_at);
    let room = max.saturating_sub(packet.checksum.map_or(0, |sum| sum.len()));
    for (field, at) in [
        ("packet.data_at", packet.data_at),
        ("packet.reply.data_at", reply_data_at),
    ] {
        check.that(at <= room, field, at, format!("0 to {room}"))?;
    }
    if let Some(flags) = &packet.flags {
        let bits: Vec<u8> = [flags.read, flags.reply, flags.error]
            .into_iter()
            .flatten()
            .collect();
        let apart = bits
            .iter()
            .enumerate()
            .all(|(i, bit)| !bits[..i].contains(bit));
        check.that(
            apart && bits.iter().all(|bit| *bit < 8),
            "packet.flags",
            format!("bits {bits:?}"),
            "different bits, 0 to 7",
        )?;
    }
    if let Some(length) = &packet.length {
        bytes("packet.length.bytes", length.bytes)?;
        let most = packet.data_at.min(reply_data_at);
        check.that(
            length.from <= most,
            "packet.length.from",
            length.from,
            format!("0 to {most}, where the data begin"),
        )?;
    }
    apart(check, packet, reply_code, reply_data_at)?;
    Ok(Arc::new(Layout {
        size: packet.size_bytes,
        max,
        start: packet.start.clone(),
        flags: packet.flags,
        sequence: packet.sequence.map(|sequence| sequence.at),
        length: packet.length,
        code: packet.code,
        data_at: packet.data_at,
        reply_code,
        reply_data_at,
        big: packet.endian == Endian::Big,
        checksum: packet.checksum,
    }))
}

/// Checks that header fields do not overlap.
fn apart(
    check: &Check<'_>,
    packet: &PacketFile,
    reply_code: bool,
    reply_data_at: usize,
) -> Result<()> {
    let span = |at: usize, bytes: usize| at..at.saturating_add(bytes);
    let code = span(packet.code.at, packet.code.bytes);
    let mut fields: Vec<(&str, Range<usize>)> = vec![("packet.start", 0..packet.start.len())];
    fields.extend(packet.flags.map(|f| ("packet.flags", span(f.at, 1))));
    fields.extend(packet.sequence.map(|s| ("packet.sequence", span(s.at, 1))));
    fields.extend(
        packet
            .length
            .map(|l| ("packet.length", span(l.at, l.bytes))),
    );
    fields.push(("packet.code", code));
    for (i, (field, own)) in fields.iter().enumerate() {
        let clash = fields[..i]
            .iter()
            .find(|(_, other)| own.start < other.end && other.start < own.end);
        let found = format!("bytes {} to {}", own.start, own.end.saturating_sub(1));
        if let Some((other, _)) = clash {
            check.that(
                false,
                field,
                &found,
                format!("bytes that do not overlap {other}"),
            )?;
        }
        let data_at = match *field {
            "packet.code" if !reply_code => packet.data_at,
            _ => packet.data_at.min(reply_data_at),
        };
        check.that(
            own.end <= data_at,
            field,
            found,
            format!("bytes before the data, which begin at {data_at}"),
        )?;
    }
    Ok(())
}
