//! The triangles of a cell for each of the 256 ways in which its corners can be inside.
//!
//! Corner c stands at (bit 0, bit 1, bit 2 of c) along i, j, k. Edge `4 axis + b + 2 c` runs along
//! an axis where the two axes after it in the order i j k without itself are b and c.
//!
//! On each face of the cell, seen from outside, the corners' cycle has runs of inside corners, and
//! a segment cuts off each run, from the edge where it begins to that where it ends. The cell on
//! the other side of the face sees the same runs and the same segments, the other way round. An
//! edge that the surface crosses ends one segment of one of its faces and begins one of the other:
//! the segments close to loops. Loops become triangles by diagonals none of which lies in a face. So
//! two triangles meet at every side of a triangle, over the whole grid, and the triangles at a
//! vertex make one fan through the four cells of its edge: the mesh is closed and manifold whatever
//! the bits are. A table that lets a diagonal lie in a face is not, where two neighbours do so.

use std::sync::LazyLock;

/// Corners of an edge: the lower one, and the axis it runs along.
pub(super) fn edge(corner: usize, axis: usize) -> usize {
    let (b, c) = [(1, 2), (0, 2), (0, 1)][axis];
    4 * axis + (corner >> b & 1) + 2 * (corner >> c & 1)
}

/// Triangles of edges for each set of corners that are inside (bit c for corner c). Their corners
/// run anticlockwise seen from outside.
pub(super) static TRIANGLES: LazyLock<Vec<Vec<[u8; 3]>>> =
    LazyLock::new(|| (0..256).map(triangles).collect());

/// The six faces, each with its corners anticlockwise seen from outside the cell.
fn faces() -> [[usize; 4]; 6] {
    let mut faces = [[0; 4]; 6];
    for axis in 0..3 {
        let (b, c) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        faces[2 * axis] = [0, c, b | c, b];
        faces[2 * axis + 1] = [0, b, b | c, c].map(|corner| corner | 1 << axis);
    }
    faces
}

/// The edge between two neighbouring corners.
fn between(a: usize, b: usize) -> usize {
    edge(a.min(b), (a ^ b).trailing_zeros() as usize)
}

/// The loops of a cell, each a list of edges.
fn loops(inside: usize) -> Vec<Vec<usize>> {
    let is_in = |corner: usize| inside >> corner & 1 == 1;
    let mut next = [None; 12];
    for face in faces() {
        for begin in 0..4 {
            let before = face[(begin + 3) % 4];
            if is_in(before) || !is_in(face[begin]) {
                continue;
            }
            // The corner before the run is outside, so that it ends.
            let mut end = begin;
            while is_in(face[(end + 1) % 4]) {
                end += 1;
            }
            next[between(before, face[begin])] = Some(between(face[end % 4], face[(end + 1) % 4]));
        }
    }
    let mut loops = Vec::new();
    for first in 0..12 {
        let mut list = Vec::new();
        let mut at = first;
        while let Some(to) = next[at].take() {
            list.push(at);
            at = to;
        }
        if !list.is_empty() {
            loops.push(list);
        }
    }
    loops
}

/// Whether two edges of the cell lie in one face.
fn share_a_face(a: usize, b: usize) -> bool {
    let on = |edge: usize, face: &[usize; 4]| {
        (0..4).any(|i| between(face[i], face[(i + 1) % 4]) == edge)
    };
    faces().iter().any(|face| on(a, face) && on(b, face))
}

fn triangles(inside: usize) -> Vec<[u8; 3]> {
    let mut triangles = Vec::new();
    for list in loops(inside) {
        let found = cut(&list, 0, list.len() - 1, &mut triangles);
        debug_assert!(
            found,
            "every loop has a triangulation without diagonals in faces"
        );
    }
    triangles
}

/// Cuts the part of a loop from one place to another into triangles, if diagonals outside of the
/// faces can do it. There are at most seven corners: trying is cheap.
fn cut(list: &[usize], from: usize, to: usize, triangles: &mut Vec<[u8; 3]>) -> bool {
    if to - from < 2 {
        return true;
    }
    let side = |a: usize, b: usize| b - a == 1 || b - a == list.len() - 1;
    let may = |a: usize, b: usize| side(a, b) || !share_a_face(list[a], list[b]);
    for middle in from + 1..to {
        if !may(from, middle) || !may(middle, to) {
            continue;
        }
        let before = triangles.len();
        triangles.push([from, middle, to].map(|at| list[at] as u8));
        if cut(list, from, middle, triangles) && cut(list, middle, to, triangles) {
            return true;
        }
        triangles.truncate(before);
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    #[test]
    fn each_cell_is_cut_whole_and_its_inner_sides_lie_in_no_face() {
        for inside in 0..256_usize {
            let crossed = (0..8).flat_map(|corner| (0..3).map(move |axis| (corner, axis)));
            let crossed: Vec<usize> = crossed
                .filter(|(corner, axis)| corner >> axis & 1 == 0)
                .filter(|(corner, axis)| {
                    (inside >> corner ^ inside >> (corner | 1 << axis)) & 1 == 1
                })
                .map(|(corner, axis)| edge(corner, axis))
                .collect();
            let loops = loops(inside);
            let mut in_loops = loops.concat();
            in_loops.sort_unstable();
            let mut sorted = crossed.clone();
            sorted.sort_unstable();
            assert_eq!(in_loops, sorted, "each crossed edge in one loop");
            let count: usize = loops.iter().map(|list| list.len() - 2).sum();
            assert_eq!(TRIANGLES[inside].len(), count, "{inside}");

            let mut sides: HashMap<(u8, u8), i32> = HashMap::new();
            for [a, b, c] in &TRIANGLES[inside] {
                for (p, q) in [(a, b), (b, c), (c, a)] {
                    *sides.entry((*p, *q)).or_default() += 1;
                }
            }
            for (&(p, q), &times) in &sides {
                assert_eq!(times, 1, "each side once in each direction");
                if sides.contains_key(&(q, p)) {
                    assert!(!share_a_face(p.into(), q.into()), "{inside}: {p} {q}");
                } else {
                    assert!(share_a_face(p.into(), q.into()), "{inside}: {p} {q}");
                }
            }
        }
    }

    #[test]
    fn a_lone_corner_is_cut_off_with_the_normal_away_from_it() {
        // Edges along i, j, k at corner 0.
        assert_eq!(TRIANGLES[1], [[0, 4, 8]]);
        assert_eq!(TRIANGLES[254], [[0, 8, 4]]);
    }
}
