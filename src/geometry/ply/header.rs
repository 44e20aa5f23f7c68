//! The header of a PLY file (G. Turk, "The PLY Polygon File Format", 1994): the elements that
//! follow, their number of rows and the properties of each row.

use crate::file::{next_line, number, quoted, words};
use phasmid_core::error::{Error, Result};

/// Encoding of the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// A scalar type, which has an old and a new name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn from_name(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// Size in bytes in a binary body.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Largest value of types that encode brightness as a fraction of full scale.
    pub(super) fn full_scale(self) -> Option<f64> {
        match self {
            Self::U8 => Some(255.0),
            Self::U16 => Some(65535.0),
            _ => None,
        }
    }
}

/// Type of a property.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    One(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Debug, Clone)]
pub(super) struct Property {
    pub(super) name: Vec<u8>,
    pub(super) kind: Kind,
}

#[derive(Debug, Clone)]
pub(super) struct Element {
    pub(super) name: Vec<u8>,
    pub(super) rows: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Minimum size of a row in bytes. A list may be empty; a number in text needs a digit and a
    /// separator.
    pub(super) fn least_row_bytes(&self, encoding: Encoding) -> u64 {
        let of = |property: &Property| match (encoding, property.kind) {
            (Encoding::Ascii, _) => 2,
            (_, Kind::One(scalar) | Kind::List { count: scalar, .. }) => scalar.size() as u64,
        };
        self.properties.iter().map(of).sum()
    }

    /// Whether each row of a binary body takes exactly [`Self::least_row_bytes`].
    pub(super) fn is_fixed(&self) -> bool {
        self.properties
            .iter()
            .all(|p| matches!(p.kind, Kind::One(_)))
    }

    /// Returns the index of a scalar property by name.
    pub(super) fn scalar(&self, name: &str) -> Option<usize> {
        self.properties
            .iter()
            .position(|p| p.name == name.as_bytes() && matches!(p.kind, Kind::One(_)))
    }
}

#[derive(Debug, Clone)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
}

/// Reads the header and advances `rest` to the body.
pub(super) fn read(rest: &mut &[u8], place: &str) -> Result<Header> {
    let wrong = |line: usize, found: String, allowed: &str| {
        Error::input(format!("{place}:{line}"), found, allowed)
    };
    // Detect CR line ends before reading lines. Without this, the first byte of the body could be taken
    // for the LF of a CR LF.
    let cr_only = rest.get(3) == Some(&b'\r') && rest.get(4) != Some(&b'\n');
    if next_line(rest) != Some(b"ply") {
        return Err(wrong(1, "no `ply`".into(), "a PLY file, starting with ply"));
    }
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    for line_number in 2.. {
        let before = *rest;
        let Some(line) = next_line(rest) else {
            return Err(wrong(
                line_number,
                "the end of the file".into(),
                "a header that ends with end_header",
            ));
        };
        let all: Vec<&[u8]> = words(line).take(6).collect();
        match all.as_slice() {
            [] | [b"comment" | b"obj_info", ..] => {}
            [b"format", name, b"1.0"] => {
                encoding = Some(match *name {
                    b"ascii" => Encoding::Ascii,
                    b"binary_little_endian" => Encoding::LittleEndian,
                    b"binary_big_endian" => Encoding::BigEndian,
                    other => {
                        return Err(wrong(
                            line_number,
                            quoted(other),
                            "ascii, binary_little_endian or binary_big_endian",
                        ));
                    }
                });
            }
            [b"element", name, rows] => elements.push(Element {
                name: name.to_vec(),
                rows: number(rows)
                    .ok_or_else(|| wrong(line_number, quoted(rows), "a count of 0 or more"))?,
                properties: Vec::new(),
            }),
            [b"property", kind @ .., name] => {
                let scalar = |word: &[u8]| {
                    Scalar::from_name(word).ok_or_else(|| {
                        wrong(
                            line_number,
                            quoted(word),
                            "char, uchar, short, ushort, int, uint, float or double",
                        )
                    })
                };
                let kind = match kind {
                    [one] => Kind::One(scalar(one)?),
                    [b"list", count, item] => Kind::List {
                        count: scalar(count)?,
                        item: scalar(item)?,
                    },
                    _ => {
                        return Err(wrong(
                            line_number,
                            quoted(line),
                            "property TYPE NAME or property list TYPE TYPE NAME",
                        ));
                    }
                };
                let Some(element) = elements.last_mut() else {
                    return Err(wrong(
                        line_number,
                        "a property without an element".into(),
                        "an element before the property",
                    ));
                };
                element.properties.push(Property {
                    name: name.to_vec(),
                    kind,
                });
            }
            [b"end_header"] => {
                if cr_only {
                    *rest = &before[line.len() + 1..];
                }
                break;
            }
            _ => {
                return Err(wrong(
                    line_number,
                    quoted(line),
                    "format, comment, obj_info, element, property or end_header",
                ));
            }
        }
    }
    let encoding = encoding.ok_or_else(|| wrong(2, "no format line".into(), "format NAME 1.0"))?;
    Ok(Header { encoding, elements })
}
