//! A closed mesh of directions on the unit sphere.

use glam::DVec3;
use std::collections::HashMap;

/// Returns an icosahedron with each triangle divided into four `level` times: 20 * 4^level
/// triangles between unit directions, counter-clockwise seen from outside.
pub(super) fn icosphere(level: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut directions, mut triangles) = icosahedron();
    for _ in 0..level {
        let mut middles = HashMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let sum: DVec3 = directions[a as usize] + directions[b as usize];
                    directions.push(sum.normalize());
                    directions.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    (directions, triangles)
}

/// Corners and triangles of the regular icosahedron.
fn icosahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let g = 0.5 * (1.0 + 5f64.sqrt());
    let corners = [
        (-1.0, g, 0.0),
        (1.0, g, 0.0),
        (-1.0, -g, 0.0),
        (1.0, -g, 0.0),
        (0.0, -1.0, g),
        (0.0, 1.0, g),
        (0.0, -1.0, -g),
        (0.0, 1.0, -g),
        (g, 0.0, -1.0),
        (g, 0.0, 1.0),
        (-g, 0.0, -1.0),
        (-g, 0.0, 1.0),
    ];
    let triangles = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    let unit = |(x, y, z)| DVec3::new(x, y, z).normalize();
    (corners.map(unit).to_vec(), triangles.to_vec())
}
