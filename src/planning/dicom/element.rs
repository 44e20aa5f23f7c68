//! Parses the data elements of a file (PS3.10 7, PS3.5 7): collects the values of the wanted elements at
//! the top level and skips all other elements.

use phasmid_core::error::{Error, Result};
use std::collections::HashMap;
use std::fmt::Display;

/// Group and element number.
pub(super) type Tag = (u16, u16);

/// Maximum nesting depth of sequences; the standard's objects nest a few levels.
const DEEPEST: usize = 64;

const TRANSFER_SYNTAX: Tag = (0x0002, 0x0010);
const ITEM: Tag = (0xFFFE, 0xE000);
const ITEM_END: Tag = (0xFFFE, 0xE00D);
const SEQUENCE_END: Tag = (0xFFFE, 0xE0DD);
pub(super) const PIXEL_DATA: Tag = (0x7FE0, 0x0010);

/// Undefined length: the value extends to a delimiter.
const UNDEFINED: u32 = u32::MAX;

/// Names of known transfer syntaxes, supported and unsupported.
const SYNTAXES: [(&str, &str); 12] = [
    ("1.2.840.10008.1.2", "implicit VR little endian"),
    ("1.2.840.10008.1.2.1", "explicit VR little endian"),
    (
        "1.2.840.10008.1.2.1.99",
        "deflated explicit VR little endian",
    ),
    ("1.2.840.10008.1.2.2", "explicit VR big endian"),
    ("1.2.840.10008.1.2.4.50", "JPEG baseline"),
    ("1.2.840.10008.1.2.4.51", "JPEG extended"),
    ("1.2.840.10008.1.2.4.57", "JPEG lossless"),
    (
        "1.2.840.10008.1.2.4.70",
        "JPEG lossless, first-order prediction",
    ),
    ("1.2.840.10008.1.2.4.80", "JPEG-LS lossless"),
    ("1.2.840.10008.1.2.4.90", "JPEG 2000 lossless"),
    ("1.2.840.10008.1.2.4.91", "JPEG 2000"),
    ("1.2.840.10008.1.2.5", "RLE lossless"),
];

/// Values of the wanted elements.
pub(super) struct Elements<'a> {
    place: String,
    values: HashMap<Tag, &'a [u8]>,
}

impl<'a> Elements<'a> {
    /// Parses the bytes of a file.
    pub(super) fn parse(bytes: &'a [u8], wanted: &[Tag], place: &str) -> Result<Self> {
        if bytes.get(128..132) != Some(b"DICM") {
            return Err(Error::input(
                place,
                format!("no `DICM` after 128 bytes, {} in all", bytes.len()),
                "a DICOM file",
            ));
        }
        let mut walk = Walk {
            bytes,
            at: 132,
            place,
        };
        let implicit = walk.meta()?;
        let mut elements = Self {
            place: place.to_owned(),
            values: HashMap::new(),
        };
        // For each open item or sequence: whether its elements lack a value representation.
        let mut open = vec![implicit];
        while walk.at < bytes.len() {
            let from = walk.at;
            let tag = walk.tag()?;
            if tag.0 == ITEM.0 {
                let length = walk.u32()?;
                match tag {
                    ITEM if length == UNDEFINED => open.push(*open.last().unwrap_or(&implicit)),
                    ITEM => {
                        walk.take(length as usize)?;
                    }
                    ITEM_END | SEQUENCE_END if open.len() > 1 => {
                        open.pop();
                    }
                    _ => {
                        return Err(walk.wrong(
                            from,
                            "a delimiter outside a sequence",
                            "data elements",
                        ));
                    }
                }
            } else {
                let no_vr = *open.last().unwrap_or(&implicit);
                let (unknown, length) = walk.length(no_vr)?;
                if length != UNDEFINED {
                    let value = walk.take(length as usize)?;
                    if open.len() == 1 && wanted.contains(&tag) {
                        elements.values.entry(tag).or_insert(value);
                    }
                } else if tag == PIXEL_DATA {
                    return Err(walk.wrong(from, "compressed pixels", "uncompressed pixels"));
                } else {
                    // Elements of VR `UN` contain implicit-VR elements.
                    open.push(no_vr || unknown);
                }
            }
            if open.len() > DEEPEST {
                let found = format!("more than {DEEPEST} nested sequences");
                return Err(walk.wrong(from, found, "an image's data elements"));
            }
        }
        if open.len() > 1 {
            return Err(walk.wrong(walk.at, "the end of the file", "the end of a sequence"));
        }
        Ok(elements)
    }

    /// Returns the bytes of an element, unless it is missing or empty.
    pub(super) fn get(&self, tag: Tag) -> Option<&'a [u8]> {
        self.values.get(&tag).copied().filter(|v| !v.is_empty())
    }

    /// Returns a text without surrounding spaces; empty if the element is missing.
    pub(super) fn text(&self, tag: Tag) -> String {
        let bytes = self.get(tag).unwrap_or_default();
        let text = String::from_utf8_lossy(bytes);
        text.trim_matches(|c: char| c.is_whitespace() || c.is_control())
            .chars()
            .take(200)
            .map(|c| if c.is_control() { '\u{fffd}' } else { c })
            .collect()
    }

    /// Returns the numbers of a decimal or integer string, if present.
    pub(super) fn numbers<const N: usize>(&self, tag: Tag, name: &str) -> Result<Option<[f64; N]>> {
        if self.get(tag).is_none() {
            return Ok(None);
        }
        let text = self.text(tag);
        let mut numbers = [0.0; N];
        let mut words = text.split('\\');
        for number in &mut numbers {
            let word = words.next().unwrap_or_default().trim();
            *number = match word.parse() {
                Ok(parsed) if f64::is_finite(parsed) => parsed,
                _ => return Err(self.wrong(tag, name, format!("`{text}`"), needs(N))),
            };
        }
        if words.next().is_some() {
            return Err(self.wrong(tag, name, format!("`{text}`"), needs(N)));
        }
        Ok(Some(numbers))
    }

    /// Returns the numbers of a mandatory element.
    pub(super) fn needed<const N: usize>(&self, tag: Tag, name: &str) -> Result<[f64; N]> {
        self.numbers(tag, name)?
            .ok_or_else(|| self.wrong(tag, name, "nothing", needs(N)))
    }

    /// Returns an unsigned short of a mandatory element.
    pub(super) fn short(&self, tag: Tag, name: &str) -> Result<u16> {
        match self.get(tag) {
            Some(&[low, high]) => Ok(u16::from_le_bytes([low, high])),
            Some(value) => {
                let found = format!("{} bytes", value.len());
                Err(self.wrong(tag, name, found, "an unsigned short"))
            }
            None => Err(self.wrong(tag, name, "nothing", "an unsigned short")),
        }
    }

    /// Returns a finite double, if present.
    pub(super) fn double(&self, tag: Tag) -> Option<f64> {
        let bytes = self.get(tag)?.try_into().ok()?;
        Some(f64::from_le_bytes(bytes)).filter(|x| x.is_finite())
    }

    /// Creates an error about an element.
    pub(super) fn wrong(
        &self,
        tag: Tag,
        name: &str,
        found: impl Display,
        allowed: impl Display,
    ) -> Error {
        let (group, element) = tag;
        let place = format!("{}: {name} ({group:04X},{element:04X})", self.place);
        Error::input(place, found, allowed)
    }
}

fn needs(count: usize) -> String {
    match count {
        1 => "a number".to_owned(),
        n => format!("{n} numbers with \\ between them"),
    }
}

/// Cursor over the bytes of a file.
struct Walk<'a, 'p> {
    bytes: &'a [u8],
    at: usize,
    place: &'p str,
}

impl<'a> Walk<'a, '_> {
    fn take(&mut self, count: usize) -> Result<&'a [u8]> {
        let rest = &self.bytes[self.at..];
        let Some(taken) = rest.get(..count) else {
            let found = format!("{} bytes left", rest.len());
            return Err(self.wrong(self.at, found, format!("{count}, as declared")));
        };
        self.at += count;
        Ok(taken)
    }

    fn u16(&mut self) -> Result<u16> {
        let taken = self.take(2)?;
        Ok(u16::from_le_bytes([taken[0], taken[1]]))
    }

    fn u32(&mut self) -> Result<u32> {
        let (low, high) = (self.u16()?, self.u16()?);
        Ok(u32::from(high) << 16 | u32::from(low))
    }

    fn tag(&mut self) -> Result<Tag> {
        Ok((self.u16()?, self.u16()?))
    }

    /// Reads whether the value representation is `UN`, and the length of the value (PS3.5 7.1).
    fn length(&mut self, no_vr: bool) -> Result<(bool, u32)> {
        if no_vr {
            return Ok((false, self.u32()?));
        }
        let from = self.at;
        let vr = self.take(2)?;
        match vr {
            b"OB" | b"OD" | b"OF" | b"OL" | b"OV" | b"OW" | b"SQ" | b"SV" | b"UC" | b"UN"
            | b"UR" | b"UT" | b"UV" => {
                self.take(2)?;
                Ok((vr == b"UN", self.u32()?))
            }
            [a, b] if a.is_ascii_uppercase() && b.is_ascii_uppercase() => {
                Ok((false, u32::from(self.u16()?)))
            }
            _ => {
                let found = phasmid_geometry::file::quoted(vr);
                Err(self.wrong(from, found, "a value representation, two capitals"))
            }
        }
    }

    /// Reads the file meta elements, which are always explicit; returns whether the rest is
    /// implicit.
    fn meta(&mut self) -> Result<bool> {
        let mut syntax: Option<&[u8]> = None;
        while self.bytes.get(self.at..self.at + 2) == Some(&[2, 0]) {
            let tag = self.tag()?;
            let (_, length) = self.length(false)?;
            let value = self.take(length as usize)?;
            if tag == TRANSFER_SYNTAX {
                syntax = Some(value);
            }
        }
        let syntax = String::from_utf8_lossy(syntax.unwrap_or_default());
        let syntax = syntax.trim_end_matches(['\0', ' ']);
        match SYNTAXES.iter().position(|(uid, _)| *uid == syntax) {
            Some(0) => Ok(true),
            Some(1) => Ok(false),
            other => {
                let name = other.map_or("", |at| SYNTAXES[at].1);
                Err(Error::input(
                    format!("{}: TransferSyntaxUID (0002,0010)", self.place),
                    format!("`{}` {name}", syntax.escape_debug()).trim_end(),
                    "implicit or explicit VR little endian, uncompressed (`gdcmconv --raw` makes it \
                     so)",
                ))
            }
        }
    }

    fn wrong(&self, at: usize, found: impl Display, allowed: impl Display) -> Error {
        Error::input(format!("{}: byte {at}", self.place), found, allowed)
    }
}
