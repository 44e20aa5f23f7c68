//! STL files, binary and ASCII.
//!
//! Implemented here instead of with a crate so that messages name the line, ASCII coordinates keep
//! f64 precision, and a binary file that starts with `solid ` is recognised by its length of 84 +
//! 50 n bytes.

use super::Mesh;
use super::file::{next_line, number, quoted, words};
use super::mesh::check_vertex;
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use std::collections::HashMap;

const HEADER: usize = 84;
const RECORD: usize = 50;

/// Parses an STL file; corners with equal coordinates become one vertex.
pub(super) fn parse(bytes: &[u8], place: &str) -> Result<Mesh> {
    let count = bytes
        .get(80..HEADER)
        .map(|b| u64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])));
    let needs = |n: u64| HEADER as u64 + n * RECORD as u64;
    let fits = count.is_some_and(|n| needs(n) == bytes.len() as u64);
    let text = bytes.trim_ascii_start();
    // Text contains no NUL bytes; binary floats and their padding nearly always do.
    if !fits && text.starts_with(b"solid") && !bytes.contains(&0) {
        return ascii(bytes, place);
    }
    let Some(n) = count else {
        return Err(Error::input(
            place,
            format!("{} bytes", bytes.len()),
            "ASCII STL starting with `solid`, or binary STL of at least 84 bytes",
        ));
    };
    // Trailing data is allowed, since some programs append their own; missing data is not.
    if needs(n) > bytes.len() as u64 {
        return Err(Error::input(
            place,
            format!("{n} triangles declared in {} bytes", bytes.len()),
            format!("binary STL of 84 + 50 n = {} bytes", needs(n)),
        ));
    }
    binary(&bytes[HEADER..needs(n) as usize], place)
}

fn binary(records: &[u8], place: &str) -> Result<Mesh> {
    let mut welder = Welder::default();
    for (triangle, record) in records.chunks_exact(RECORD).enumerate() {
        // Skip the normal (12 bytes), because the winding determines it, and the 2 attribute bytes at
        // the end.
        for (corner, xyz) in record[12..48].chunks_exact(12).enumerate() {
            let [x, y, z] = [0, 4, 8].map(|i| {
                f64::from(f32::from_le_bytes([
                    xyz[i],
                    xyz[i + 1],
                    xyz[i + 2],
                    xyz[i + 3],
                ]))
            });
            let vertex = DVec3::new(x, y, z);
            check_vertex(vertex, 3 * triangle + corner, place)?;
            welder.corner(vertex);
        }
    }
    welder.finish().checked(place)
}

fn ascii(bytes: &[u8], place: &str) -> Result<Mesh> {
    let mut welder = Welder::default();
    let mut rest = bytes;
    let mut line_number = 0_usize;
    // Number of corners in the open facet, if any.
    let mut open: Option<usize> = None;
    let mut ended = false;
    while let Some(line) = next_line(&mut rest) {
        line_number += 1;
        let mut words = words(line);
        let Some(keyword) = words.next() else {
            continue;
        };
        let wrong = |found: String, allowed: &str| {
            Err(Error::input(
                format!("{place}:{line_number}"),
                found,
                allowed,
            ))
        };
        match (keyword.to_ascii_lowercase().as_slice(), open) {
            (b"solid", None) => ended = false,
            (b"endsolid", None) => ended = true,
            (b"facet", None) if !ended => open = Some(0),
            (b"outer", Some(0)) | (b"endloop", Some(3)) => {}
            (b"vertex", Some(n @ 0..3)) => {
                let mut xyz = [0.0; 3];
                for value in &mut xyz {
                    let word = words.next().unwrap_or_default();
                    let Some(parsed) = number(word) else {
                        return wrong(quoted(word), "vertex and three numbers");
                    };
                    *value = parsed;
                }
                let vertex = DVec3::from_array(xyz);
                check_vertex(vertex, welder.corners, &format!("{place}:{line_number}"))?;
                welder.corner(vertex);
                open = Some(n + 1);
            }
            (b"endfacet", Some(3)) => open = None,
            (b"endfacet" | b"endloop", Some(n)) => {
                return wrong(format!("a facet of {n} vertices"), "3 vertices");
            }
            _ => {
                return wrong(
                    quoted(keyword),
                    "solid, facet, outer loop, three vertex lines, endloop, endfacet, endsolid, \
                     in this order",
                );
            }
        }
    }
    if open.is_some() || !ended {
        return Err(Error::input(
            format!("{place}:{line_number}"),
            "the file ends inside a solid",
            "a file that ends with endsolid",
        ));
    }
    welder.finish().checked(place)
}

/// Collects corners three by three and merges those with equal coordinates.
#[derive(Default)]
struct Welder {
    mesh: Mesh,
    seen: HashMap<[u64; 3], u32>,
    pending: [u32; 3],
    corners: usize,
}

impl Welder {
    fn corner(&mut self, vertex: DVec3) {
        // Adding zero turns -0 into +0.
        let key = (vertex + DVec3::ZERO).to_array().map(f64::to_bits);
        let vertices = &mut self.mesh.vertices;
        let index = *self.seen.entry(key).or_insert_with(|| {
            vertices.push(vertex);
            // The file size limit keeps this far below 2^32.
            (vertices.len() - 1) as u32
        });
        self.pending[self.corners % 3] = index;
        self.corners += 1;
        if self.corners.is_multiple_of(3) {
            self.mesh.triangles.push(self.pending);
        }
    }

    fn finish(self) -> Mesh {
        self.mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn encode(header: &[u8], triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
        let mut out = header.to_vec();
        out.resize(80, b' ');
        out.extend((triangles.len() as u32).to_le_bytes());
        for triangle in triangles {
            out.extend([0; 12]);
            for value in triangle.iter().flatten() {
                out.extend(value.to_le_bytes());
            }
            out.extend([0; 2]);
        }
        out
    }

    const TRIANGLES: [[[f32; 3]; 3]; 2] = [
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]],
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.5], [1.0, 1.0, -0.0]],
    ];

    const ASCII: &str = "solid a name\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\r\n   \
                         vertex 1 0 0\n   vertex 0 1e0 0.5\n  endloop\n endfacet\nendsolid a name\n";

    #[test]
    fn binary_that_starts_with_solid_is_binary() {
        let mesh = parse(&encode(b"solid by some CAD", &TRIANGLES), "m.stl").unwrap();
        assert_eq!(mesh.vertices.len(), 4);
        assert_eq!(mesh.triangles, [[0, 1, 2], [1, 2, 3]]);
        assert_eq!(mesh.corners(0)[2], DVec3::new(0.0, 1.0, 0.5));
    }

    #[test]
    fn ascii_reads_and_names_lines() {
        assert_eq!(
            parse(ASCII.as_bytes(), "m.stl").unwrap().triangles,
            [[0, 1, 2]]
        );
        for (from, to, says) in [
            ("1e0", "1e0x", "m.stl:6: `1e0x`"),
            ("1e0", "nan", "m.stl:6: vertex 2: (0, NaN, 0.5)"),
            ("   vertex 1 0 0\n", "", "m.stl:6: a facet of 2 vertices"),
            ("endsolid a name\n", "", "the file ends inside a solid"),
            ("outer", "inner", "m.stl:3: `inner`"),
        ] {
            let error = parse(ASCII.replace(from, to).as_bytes(), "m.stl").unwrap_err();
            assert!(error.to_string().contains(says), "{error}");
        }
        assert!(parse(b"solid empty\nendsolid empty\n", "m.stl").is_err());
    }

    #[test]
    fn a_count_beyond_the_file_is_refused_unallocated() {
        let mut bytes = encode(b"", &TRIANGLES);
        bytes[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        let error = parse(&bytes, "m.stl").unwrap_err().to_string();
        assert!(error.contains("4294967295 triangles declared in 184 bytes"));
        let whole = encode(b"solid", &TRIANGLES);
        assert!(parse(&whole[..150], "m.stl").is_err());
        assert!(parse(&encode(b"", &[]), "m.stl").is_err());
        let mut nan = TRIANGLES;
        nan[1][0][2] = f32::INFINITY;
        let error = parse(&encode(b"", &nan), "m.stl").unwrap_err().to_string();
        assert!(error.contains("vertex 3: (1, 0, inf)"), "{error}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(256))]

        #[test]
        fn any_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            let _ = parse(&bytes, "m.stl");
        }

        #[test]
        fn a_mutated_file_never_panics(
            ascii in any::<bool>(),
            cut in 0_usize..300,
            edits in proptest::collection::vec((0_usize..300, any::<u8>()), 0..6),
        ) {
            let mut bytes = if ascii { ASCII.into() } else { encode(b"solid", &TRIANGLES) };
            for (at, value) in edits {
                let len = bytes.len();
                bytes[at % len] = value;
            }
            bytes.truncate(cut.max(1));
            if let Ok(mesh) = parse(&bytes, "m.stl") {
                prop_assert!(mesh.triangles.len() <= bytes.len() / 50);
            }
        }

        #[test]
        fn written_binary_reads_back_equal(raw in proptest::collection::vec(-1e6_f32..1e6, 9..90)) {
            let triangles: Vec<[[f32; 3]; 3]> = raw
                .chunks_exact(9)
                .map(|c| [[c[0], c[1], c[2]], [c[3], c[4], c[5]], [c[6], c[7], c[8]]])
                .collect();
            let mesh = parse(&encode(b"", &triangles), "m.stl").unwrap();
            for (i, triangle) in triangles.iter().enumerate() {
                let corners = mesh.corners(i).map(|v| v.as_vec3().to_array());
                prop_assert_eq!(&corners, triangle);
            }
        }
    }
}
