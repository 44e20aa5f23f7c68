//! Reads the body of a PLY file as a stream of numbers in any encoding, element by element.

use super::header::{Element, Encoding, Header, Kind, Scalar};
use crate::colour;
use crate::file::{number, quoted};
use crate::mesh::check_corners;
use glam::DVec3;
use phasmid_core::error::{Error, Result};

/// The data used from a PLY file: vertices with their attributes, and triangles.
#[derive(Debug, Default)]
pub(super) struct Content {
    pub(super) vertices: Vec<DVec3>,
    pub(super) normals: Option<Vec<[f32; 3]>>,
    pub(super) intensity: Option<Vec<f32>>,
    pub(super) sigma_mm: Option<Vec<f32>>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Reflectance at each vertex; empty without colours.
    pub(super) colours: Vec<f32>,
    /// Texture coordinates at each vertex; empty if there are none.
    pub(super) uv: Vec<[f32; 2]>,
}

/// Reads all elements of a body.
pub(super) fn read(header: &Header, body: &[u8], place: &str) -> Result<Content> {
    let mut numbers = Numbers {
        rest: body,
        encoding: header.encoding,
    };
    let mut content = Content::default();
    let mut found = false;
    for element in &header.elements {
        let name = String::from_utf8_lossy(&element.name);
        let at = format!("{place}: element {name}");
        // Check before memory is allocated for the rows or time spent on them.
        let least = element.least_row_bytes(header.encoding);
        // In a text body, the last number needs no separator after it.
        let left = numbers.rest.len() as u64 + u64::from(header.encoding == Encoding::Ascii);
        if element.rows.saturating_mul(least) > left {
            return Err(Error::input(
                at,
                format!("{} rows declared, {left} bytes left", element.rows),
                format!("as many rows as the file holds, {least} bytes or more each"),
            ));
        }
        if least == 0 {
            continue;
        }
        match element.name.as_slice() {
            b"vertex" if !found => {
                found = true;
                vertices(element, &mut numbers, &mut content, &at)?;
            }
            b"face" => faces(element, &mut numbers, &mut content.triangles, &at)?,
            _ => numbers.skip(element, &at)?,
        }
    }
    if !found {
        return Err(Error::input(
            place,
            "no vertices",
            "an element vertex with properties x, y and z",
        ));
    }
    Ok(content)
}

fn vertices(
    element: &Element,
    numbers: &mut Numbers<'_>,
    content: &mut Content,
    at: &str,
) -> Result<()> {
    let [Some(x), Some(y), Some(z)] = ["x", "y", "z"].map(|name| element.scalar(name)) else {
        return Err(Error::input(
            at,
            "no x, y and z",
            "properties x, y and z, one number each",
        ));
    };
    let normal = match ["nx", "ny", "nz"].map(|name| element.scalar(name)) {
        [Some(x), Some(y), Some(z)] => Some([x, y, z]),
        _ => None,
    };
    let intensity = ["intensity", "scalar_intensity", "scalar_Intensity"]
        .iter()
        .find_map(|name| element.scalar(name));
    let sigma = element.scalar("sigma");
    let rgb = match ["red", "green", "blue"].map(|name| element.scalar(name)) {
        [Some(r), Some(g), Some(b)] => Some([r, g, b]),
        _ => None,
    };
    let st = [
        ["s", "t"],
        ["u", "v"],
        ["texture_u", "texture_v"],
        ["texture_s", "texture_t"],
    ]
    .iter()
    .find_map(|names| match names.map(|name| element.scalar(name)) {
        [Some(s), Some(t)] => Some([s, t]),
        _ => None,
    });
    let scale = |column: usize| match element.properties[column].kind {
        Kind::One(scalar) => scalar.full_scale().unwrap_or(1.0),
        Kind::List { .. } => 1.0,
    };
    let rows = element.rows as usize;
    content.vertices = Vec::with_capacity(rows);
    content.normals = normal.map(|_| Vec::with_capacity(rows));
    content.intensity = intensity.map(|_| Vec::with_capacity(rows));
    content.sigma_mm = sigma.map(|_| Vec::with_capacity(rows));
    let full_scale = intensity.and_then(|i| match element.properties[i].kind {
        Kind::One(scalar) => scalar.full_scale(),
        Kind::List { .. } => None,
    });
    let mut row = vec![0.0; element.properties.len()];
    for index in 0..rows {
        let at = || format!("{at}: row {index}");
        for (value, property) in row.iter_mut().zip(&element.properties) {
            match property.kind {
                Kind::One(scalar) => *value = numbers.next(scalar, at)?,
                Kind::List { count, item } => numbers.skip_list(count, item, at)?,
            }
        }
        content.vertices.push(DVec3::new(row[x], row[y], row[z]));
        if let Some(columns) = rgb {
            let srgb = columns.map(|c| row[c] / scale(c));
            if let Some(bad) = srgb.iter().find(|c| !(0.0..=1.0).contains(*c)) {
                return Err(Error::input(
                    at(),
                    format!("a colour of {bad}"),
                    "red, green and blue from 0 to 1, or unsigned whole numbers of 8 or 16 bits",
                ));
            }
            content.colours.push(colour::reflectance(srgb));
        }
        if let Some(columns) = st {
            content.uv.push(columns.map(|c| row[c] as f32));
        }
        if let (Some(all), Some(columns)) = (&mut content.normals, normal) {
            all.push(columns.map(|c| row[c] as f32));
        }
        if let (Some(all), Some(column)) = (&mut content.intensity, intensity) {
            all.push((row[column] / full_scale.unwrap_or(1.0)) as f32);
        }
        if let (Some(all), Some(column)) = (&mut content.sigma_mm, sigma) {
            all.push(row[column] as f32);
        }
    }
    Ok(())
}

fn faces(
    element: &Element,
    numbers: &mut Numbers<'_>,
    triangles: &mut Vec<[u32; 3]>,
    at: &str,
) -> Result<()> {
    let wanted = element.properties.iter().position(|p| {
        matches!(p.name.as_slice(), b"vertex_indices" | b"vertex_index")
            && matches!(p.kind, Kind::List { .. })
    });
    let Some(wanted) = wanted else {
        return numbers.skip(element, at);
    };
    for index in 0..element.rows {
        let at = || format!("{at}: row {index}");
        for (column, property) in element.properties.iter().enumerate() {
            match property.kind {
                Kind::One(scalar) => {
                    numbers.next(scalar, at)?;
                }
                Kind::List { count, item } if column == wanted => {
                    let mut fan = [0_u32; 2];
                    let corners = numbers.length(count, item, at)?;
                    check_corners(corners as usize, at)?;
                    for corner in 0..corners {
                        let value = numbers.next(item, at)?;
                        if !(value >= 0.0 && value < f64::from(u32::MAX) && value.fract() == 0.0) {
                            return Err(Error::input(
                                at(),
                                format!("vertex {value}"),
                                "whole numbers from 0",
                            ));
                        }
                        let vertex = value as u32;
                        if corner >= 2 {
                            triangles.push([fan[0], fan[1], vertex]);
                        }
                        fan[usize::from(corner > 0)] = vertex;
                    }
                }
                Kind::List { count, item } => numbers.skip_list(count, item, at)?,
            }
        }
    }
    Ok(())
}

/// Stream of the numbers of a body.
struct Numbers<'a> {
    rest: &'a [u8],
    encoding: Encoding,
}

impl Numbers<'_> {
    fn next(&mut self, scalar: Scalar, at: impl Fn() -> String) -> Result<f64> {
        if self.encoding == Encoding::Ascii {
            return self.next_word(at);
        }
        let Some((bytes, rest)) = self.rest.split_at_checked(scalar.size()) else {
            return Err(truncated(at()));
        };
        self.rest = rest;
        let mut raw = [0_u8; 8];
        raw[..bytes.len()].copy_from_slice(bytes);
        if self.encoding == Encoding::BigEndian {
            raw[..bytes.len()].reverse();
        }
        let [a, b, c, d, ..] = raw;
        Ok(match scalar {
            Scalar::I8 => f64::from(a as i8),
            Scalar::U8 => f64::from(a),
            Scalar::I16 => f64::from(i16::from_le_bytes([a, b])),
            Scalar::U16 => f64::from(u16::from_le_bytes([a, b])),
            Scalar::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Scalar::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Scalar::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Scalar::F64 => f64::from_le_bytes(raw),
        })
    }

    fn next_word(&mut self, at: impl Fn() -> String) -> Result<f64> {
        let text = self.rest.trim_ascii_start();
        let end = text
            .iter()
            .position(u8::is_ascii_whitespace)
            .unwrap_or(text.len());
        let (word, rest) = text.split_at(end);
        self.rest = rest;
        if word.is_empty() {
            return Err(truncated(at()));
        }
        number(word).ok_or_else(|| Error::input(at(), quoted(word), "a number"))
    }

    /// Reads the length of a list; fails if the rest of the file cannot hold it.
    fn length(&mut self, count: Scalar, item: Scalar, at: impl Fn() -> String) -> Result<u64> {
        let value = self.next(count, &at)?;
        let least = match self.encoding {
            Encoding::Ascii => 1,
            _ => item.size(),
        };
        let most = (self.rest.len() / least) as f64;
        if value >= 0.0 && value <= most && value.fract() == 0.0 {
            return Ok(value as u64);
        }
        Err(Error::input(
            at(),
            format!("a list of {value} items, {} bytes left", self.rest.len()),
            "a whole number of items that the file holds",
        ))
    }

    fn skip_list(&mut self, count: Scalar, item: Scalar, at: impl Fn() -> String) -> Result<()> {
        let length = self.length(count, item, &at)?;
        if self.encoding == Encoding::Ascii {
            for _ in 0..length {
                self.next_word(&at)?;
            }
        } else {
            self.rest = &self.rest[length as usize * item.size()..];
        }
        Ok(())
    }

    fn skip(&mut self, element: &Element, at: &str) -> Result<()> {
        if self.encoding != Encoding::Ascii && element.is_fixed() {
            // The caller has checked that the rows fit.
            let bytes = element.rows * element.least_row_bytes(self.encoding);
            self.rest = &self.rest[bytes as usize..];
            return Ok(());
        }
        for index in 0..element.rows {
            let at = || format!("{at}: row {index}");
            for property in &element.properties {
                match property.kind {
                    Kind::One(scalar) => {
                        self.next(scalar, at)?;
                    }
                    Kind::List { count, item } => self.skip_list(count, item, at)?,
                }
            }
        }
        Ok(())
    }
}

fn truncated(at: String) -> Error {
    Error::input(
        at,
        "the end of the file",
        "all the rows that the header declares",
    )
}
