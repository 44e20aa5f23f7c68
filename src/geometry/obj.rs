//! Wavefront OBJ: vertices and faces; everything else in the file is passed over.

use super::Mesh;
use super::file::{next_line, number, quoted, words};
use crate::error::{Error, Result};
use glam::DVec3;

/// Reads the bytes of an OBJ file. Faces of more than three corners become fans around their first
/// corner, which is exact for convex ones.
pub(super) fn parse(bytes: &[u8], place: &str) -> Result<Mesh> {
    let mut mesh = Mesh::default();
    let mut rest = bytes;
    let mut line_number = 0_usize;
    // A face may name a vertex that comes later, so range is judged at the end.
    let mut highest = (0_u32, 0_usize);
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
                mesh.vertices.push(DVec3::from_array(xyz));
            }
            Some(b"f") => face(&mut mesh, words, &mut highest, start, place)?,
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
    mesh.checked(place)
}

fn face<'a>(
    mesh: &mut Mesh,
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
        // position/texture/normal, of which the first counts.
        let word = corner.split(|&b| b == b'/').next().unwrap_or_default();
        let index = match number::<i64>(word) {
            Some(i @ 1..=0x7fff_ffff) => i,
            // -1 is the last vertex so far.
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
        let index = index - 1;
        seen += 1;
        match (first, last) {
            (None, _) => first = Some(index),
            (Some(_), None) => last = Some(index),
            (Some(a), Some(b)) => {
                mesh.triangles.push([a, b, index]);
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
    fn polygons_negative_indices_and_continued_lines() {
        let mesh = parse(SQUARE.as_bytes(), "m.obj").unwrap();
        assert_eq!(mesh.vertices.len(), 4);
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
    }

    #[test]
    fn complaints_name_the_line() {
        for (from, to, says) in [
            ("3/2", "0", "m.obj:8: `0`"),
            ("3/2", "5", "m.obj:8: vertex 5; allowed: vertices 1 to 4"),
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
        assert!(parse(b"v 0 0 0\n", "m.obj").is_err());
        assert!(parse(b"v 0 0 0\nf 1 1 \\", "m.obj").is_err());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(256))]

        #[test]
        fn any_text_never_panics(text in "[vf0-9 /.\\-\\\\\n#e]{0,200}") {
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
