//! Wavefront OBJ: vertices with optional colours (`v x y z r g b`, sRGB, 0 to 1), texture
//! coordinates and faces. Everything else in the file is ignored.

use super::Mesh;
use super::colour;
use super::file::{next_line, number, quoted, words};
use super::mesh::check_corners;
use glam::DVec3;
use phasmid_core::error::{Error, Result};

/// Parses an OBJ file. Faces of more than three corners become fans around their first corner,
/// which is exact for convex faces; more than 1000 corners are refused.
pub(super) fn parse(bytes: &[u8], place: &str) -> Result<Mesh> {
    let mut mesh = Mesh::default();
    let mut rest = bytes;
    let mut line_number = 0_usize;
    // A face may refer to a later vertex, so the range is checked at the end.
    let mut highest = (0_u32, 0_usize);
    let mut coordinates = Coordinates::default();
    let mut joined = Vec::new();
    while let Some(first) = next_line(&mut rest) {
        line_number += 1;
        let start = line_number;
        // A backslash at the end continues the line.
        let mut line = first;
        if first.ends_with(b"\\") {
            joined.clear();
            while let Some(head) = line.strip_suffix(b"\\") {
                joined.extend_from_slice(head);
                joined.push(b' ');
                line = next_line(&mut rest).unwrap_or_default();
                line_number += 1;
            }
            joined.extend_from_slice(line);
            line = &joined;
        }
        let mut words = words(line);
        match words.next() {
            Some(b"v") => {
                let mut xyz = [0.0; 3];
                for value in &mut xyz {
                    let word = words.next().unwrap_or_default();
                    *value = number(word).ok_or_else(|| {
                        Error::input(
                            format!("{place}:{start}"),
                            quoted(word),
                            "v and at least three numbers",
                        )
                    })?;
                }
                let found = vertex_colour(words).map_err(|word| {
                    Error::input(
                        format!("{place}:{start}"),
                        format!("a colour of {}", quoted(&word)),
                        "red, green and blue from 0 to 1",
                    )
                })?;
                if found.is_some() || !mesh.colours.is_empty() {
                    // Vertices without a colour are white.
                    mesh.colours.resize(mesh.vertices.len(), 1.0);
                    mesh.colours.push(found.unwrap_or(1.0));
                }
                mesh.vertices.push(DVec3::from_array(xyz));
            }
            Some(b"vt") => {
                // The second coordinate is optional and defaults to 0.
                let mut uv = [0.0; 2];
                for (i, value) in uv.iter_mut().enumerate() {
                    let word = match words.next() {
                        None if i == 1 => break,
                        word => word.unwrap_or_default(),
                    };
                    *value = number(word).ok_or_else(|| {
                        Error::input(
                            format!("{place}:{start}"),
                            quoted(word),
                            "vt and one or two numbers",
                        )
                    })?;
                }
                coordinates.of.push(uv);
            }
            Some(b"f") => face(
                &mut mesh,
                &mut coordinates,
                words,
                &mut highest,
                start,
                place,
            )?,
            _ => {}
        }
    }
    let (index, line) = highest;
    if index as usize > mesh.vertices.len() {
        return Err(Error::input(
            format!("{place}:{line}"),
            format!("vertex {index}"),
            format!("vertices 1 to {}", mesh.vertices.len()),
        ));
    }
    mesh.uv = coordinates.of_triangles(place)?;
    mesh.checked(place)
}

/// Returns the reflectance of the three numbers that may follow a vertex; `None` for other words,
/// such as a weight or a comment. `Err` holds a number outside 0 to 1.
fn vertex_colour<'a>(words: impl Iterator<Item = &'a [u8]>) -> Result<Option<f32>, Vec<u8>> {
    let mut rgb = [0.0; 3];
    let mut count = 0;
    let mut outside = None;
    for (value, word) in rgb.iter_mut().zip(words) {
        let Some(component) = number::<f64>(word) else {
            break;
        };
        if !(0.0..=1.0).contains(&component) {
            outside = outside.or(Some(word.to_vec()));
        }
        *value = component;
        count += 1;
    }
    match (count, outside) {
        (3, Some(word)) => Err(word),
        (3, None) => Ok(Some(colour::reflectance(rgb))),
        _ => Ok(None),
    }
}

/// Texture coordinates and the indices that the faces use.
#[derive(Default)]
struct Coordinates {
    of: Vec<[f32; 2]>,
    /// Indices, counted from 1, at the corners of each triangle; 0 for a corner without texture
    /// coordinates.
    corners: Vec<[u32; 3]>,
    /// Highest index that a face uses, and the line of the file that uses it.
    highest: (u32, usize),
}

impl Coordinates {
    /// Returns a corner's texture index, counted from 1, which is the second of its slash-separated
    /// words; 0 if that word is missing or invalid.
    fn index(&mut self, corner: &[u8], line: usize) -> u32 {
        let word = corner.split(|&b| b == b'/').nth(1).unwrap_or_default();
        let count = self.of.len() as i64;
        let index = match number::<i64>(word) {
            Some(i @ 1..=0x7fff_ffff) => i as u32,
            Some(i) if i < 0 && i.checked_add(count).is_some_and(|at| at >= 0) => {
                (i + count + 1) as u32
            }
            _ => 0,
        };
        if index > self.highest.0 {
            self.highest = (index, line);
        }
        index
    }

    /// Returns the texture coordinates of all triangles; corners without an index get (0, 0). Empty
    /// if the file has no `vt`, even if its faces have texture indices.
    fn of_triangles(self, place: &str) -> Result<Vec<[[f32; 2]; 3]>> {
        let (highest, line) = self.highest;
        if self.of.is_empty() || highest == 0 {
            return Ok(Vec::new());
        }
        if highest as usize > self.of.len() {
            return Err(Error::input(
                format!("{place}:{line}"),
                format!("texture coordinate {highest}"),
                format!("texture coordinates 1 to {}", self.of.len()),
            ));
        }
        let at = |i: u32| match i {
            0 => [0.0; 2],
            i => self.of[i as usize - 1],
        };
        Ok(self.corners.iter().map(|c| c.map(at)).collect())
    }
}

fn face<'a>(
    mesh: &mut Mesh,
    coordinates: &mut Coordinates,
    corners: impl Iterator<Item = &'a [u8]>,
    highest: &mut (u32, usize),
    line: usize,
    place: &str,
) -> Result<()> {
    let count = mesh.vertices.len() as i64;
    let (mut first, mut last) = (None, None);
    let mut seen = 0_usize;
    for corner in corners {
        if corner.starts_with(b"#") {
            break;
        }
        // The corner is position/texture/normal; only the position is used here.
        let word = corner.split(|&b| b == b'/').next().unwrap_or_default();
        let index = match number::<i64>(word) {
            Some(i @ 1..=0x7fff_ffff) => i,
            // Index -1 is the last vertex so far.
            Some(i) if i < 0 && i.checked_add(count).is_some_and(|at| at >= 0) => i + count + 1,
            _ => {
                return Err(Error::input(
                    format!("{place}:{line}"),
                    quoted(corner),
                    format!("vertices 1 and up, or -1 to -{count}"),
                ));
            }
        } as u32;
        if index > highest.0 {
            *highest = (index, line);
        }
        let index = (index - 1, coordinates.index(corner, line));
        seen += 1;
        check_corners(seen, || format!("{place}:{line}"))?;
        match (first, last) {
            (None, _) => first = Some(index),
            (Some(_), None) => last = Some(index),
            (Some(a), Some(b)) => {
                mesh.triangles.push([a.0, b.0, index.0]);
                coordinates.corners.push([a.1, b.1, index.1]);
                last = Some(index);
            }
        }
    }
    if seen < 3 {
        return Err(Error::input(
            format!("{place}:{line}"),
            format!("a face of {seen} corners"),
            "3 or more",
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SQUARE: &str = "# a square\nmtllib x.mtl\nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0\nvn 0 0 1\n\
                          v 0 1 0 0.5 0.5 0.5\nf 1/1/1 2//1 3/2 4\nf -4 -3 \\\n -2 # last\n";

    #[test]
    fn reads_polygons_negative_indices_and_continued_lines() {
        let mesh = parse(SQUARE.as_bytes(), "m.obj").unwrap();
        assert_eq!(mesh.vertices.len(), 4);
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
    }

    #[test]
    fn reads_optional_colours_and_texture_coordinates() {
        let plain = parse(SQUARE.as_bytes(), "m.obj").unwrap();
        assert_eq!(plain.colours.len(), 4, "one vertex has a colour");
        assert_eq!(plain.colours[..3], [1.0; 3]);
        assert!((plain.colours[3] - 0.2140).abs() < 1e-4, "sRGB 0.5");
        assert!(plain.uv.is_empty(), "no vt");
        let text = format!("vt 0.25 0.75\nvt 1\n{SQUARE}").replace("-4 -3", "-4/-1 -3/-2");
        let mesh = parse(text.as_bytes(), "m.obj").unwrap();
        let (first, second) = ([0.25, 0.75], [1.0, 0.0]);
        assert_eq!(mesh.uv[0], [first, [0.0; 2], second]);
        assert_eq!(mesh.uv[1], [first, second, [0.0; 2]]);
        assert_eq!(mesh.uv[2], [second, first, [0.0; 2]]);
        for (from, to, says) in [
            (
                "3/2",
                "3/3",
                "m.obj:10: texture coordinate 3; expected texture coordinates 1 to 2",
            ),
            ("vt 1\n", "vt one\n", "m.obj:2: `one`"),
            (
                "0.5 0.5 0.5",
                "0.5 1.5 0.5",
                "m.obj:9: a colour of `1.5`; expected red",
            ),
        ] {
            let error = parse(text.replace(from, to).as_bytes(), "m.obj").unwrap_err();
            assert!(error.to_string().contains(says), "{error}");
        }
    }

    #[test]
    fn complaints_name_the_line() {
        for (from, to, says) in [
            ("3/2", "0", "m.obj:8: `0`"),
            ("3/2", "5", "m.obj:8: vertex 5; expected vertices 1 to 4"),
            ("3/2", "x", "m.obj:8: `x`"),
            ("-4", "-5", "m.obj:9: `-5`"),
            ("-4", "-9223372036854775808", "m.obj:9"),
            ("1 1 0", "1 one 0", "m.obj:5: `one`"),
            ("1 1 0", "1 nan 0", "m.obj: vertex 2: (1, NaN, 0)"),
            (" 3/2 4", "", "m.obj:8: a face of 2 corners"),
        ] {
            let error = parse(SQUARE.replace(from, to).as_bytes(), "m.obj").unwrap_err();
            assert!(error.to_string().contains(says), "{error}");
        }
        let face = |n: usize| "v 0 0 0\nv 1 0 0\nv 0 1 0\nf".to_owned() + &" 1 2 3".repeat(n);
        let error = parse(face(334).as_bytes(), "m.obj")
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("m.obj:4: a face of more than 1000 corners; expected 3 to 1000"),
            "{error}"
        );
        assert_eq!(
            parse(face(333).as_bytes(), "m.obj")
                .unwrap()
                .triangles
                .len(),
            997
        );
        assert!(parse(b"v 0 0 0\n", "m.obj").is_err());
        assert!(parse(b"v 0 0 0\nf 1 1 \\", "m.obj").is_err());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(256))]

        #[test]
        fn any_text_never_panics(text in "[vft0-9 /.\\-\\\\\n#e]{0,200}") {
            let _ = parse(text.as_bytes(), "m.obj");
        }

        #[test]
        fn a_mutated_file_never_panics(
            edits in proptest::collection::vec((0..SQUARE.len(), any::<u8>()), 0..8),
            cut in 0..SQUARE.len(),
        ) {
            let mut bytes = SQUARE.as_bytes().to_vec();
            for (at, value) in edits {
                bytes[at] = value;
            }
            bytes.truncate(cut);
            if let Ok(mesh) = parse(&bytes, "m.obj") {
                prop_assert!(mesh.triangles.len() <= bytes.len());
            }
        }
    }
}
