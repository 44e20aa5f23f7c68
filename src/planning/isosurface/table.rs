//! Triangles of a cell for each of the 256 combinations of inside corners.
//!
//! Corner c is at (bit 0, bit 1, bit 2 of c) along i, j, k. Edge `4 axis + b + 2 c` runs along
//! `axis`; b and c are its coordinates along the other two axes, in the order i j k.
//!
//! On each face of the cell, seen from outside, the cycle of corners contains runs of inside
//! corners. A segment cuts off each run, from the edge where it starts to the edge where it ends.
//! The adjacent cell sees the same runs and the same segments in the opposite direction. An edge
//! that crosses the surface ends a segment of one of its faces and starts one of the other, so the
//! segments form closed loops. Loops are cut into triangles by diagonals, none of which lies in a
//! face. So exactly two triangles meet at every triangle side over the whole grid, and the
//! triangles at a vertex form one fan through the four cells of its edge: the mesh is closed and
//! manifold for any bits. A table with diagonals in faces fails where two neighbours share such a
//! diagonal.

use std::sync::LazyLock;

/// Returns the index of an edge from its lower corner and its axis.
pub(super) fn edge(corner: usize, axis: usize) -> usize {
    let (b, c) = [(1, 2), (0, 2), (0, 1)][axis];
    4 * axis + (corner >> b & 1) + 2 * (corner >> c & 1)
}

/// Triangles, as edge indices, for each set of inside corners (bit c for corner c). Their corners
/// run counter-clockwise seen from outside.
pub(super) static TRIANGLES: LazyLock<Vec<Vec<[u8; 3]>>> =
    LazyLock::new(|| (0..256).map(triangles).collect());

/// The six faces, each with its corners counter-clockwise seen from outside the cell.
fn faces() -> [[usize; 4]; 6] {
    let mut faces = [[0; 4]; 6];
    for axis in 0..3 {
        let (b, c) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        faces[2 * axis] = [0, c, b | c, b];
        faces[2 * axis + 1] = [0, b, b | c, c].map(|corner| corner | 1 << axis);
    }
    faces
}

/// Returns the edge between two adjacent corners.
fn between(a: usize, b: usize) -> usize {
    edge(a.min(b), (a ^ b).trailing_zeros() as usize)
}

/// Returns the loops of a cell, each as a list of edges.
fn loops(inside: usize) -> Vec<Vec<usize>> {
    let is_in = |corner: usize| inside >> corner & 1 == 1;
    let mut next = [None; 12];
    for face in faces() {
        for begin in 0..4 {
            let before = face[(begin + 3) % 4];
            if is_in(before) || !is_in(face[begin]) {
                continue;
            }
            // The corner before the run is outside, so the loop terminates.
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

/// Returns whether two edges of the cell lie in one face.
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

/// Cuts the part of a loop between two positions into triangles; returns whether this is possible
/// with diagonals outside the faces. Loops have at most seven corners, so brute force is cheap.
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
    fn single_corner_is_cut_off_with_outward_normal() {
        // Edges along i, j, k at corner 0.
        assert_eq!(TRIANGLES[1], [[0, 4, 8]]);
        assert_eq!(TRIANGLES[254], [[0, 8, 4]]);
    }
}
