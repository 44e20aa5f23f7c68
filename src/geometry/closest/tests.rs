//! Closest-point and line-of-sight queries against brute force, and degenerate shapes.

use super::MeshTree;
use super::triangle::closest_on_triangle;
use crate::Mesh;
use glam::DVec3;

/// Pseudo-random numbers in [0, 1).
fn noise(count: usize, seed: u64) -> Vec<f64> {
    let mut state = seed;
    (0..count)
        .map(|_| {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        })
        .collect()
}

fn soup(triangles: usize, seed: u64) -> Mesh {
    let raw = noise(triangles * 9, seed);
    let mut vertices = Vec::new();
    for t in raw.chunks_exact(9) {
        let base = DVec3::new(t[0], t[1], t[2]) * 1000.0;
        vertices.extend([
            base,
            base + DVec3::new(t[3], t[4], t[5]) * 40.0,
            base + DVec3::new(t[6], t[7], t[8]) * 40.0,
        ]);
    }
    Mesh {
        triangles: (0..triangles as u32)
            .map(|i| match i % 7 {
                // Degenerate triangles (a needle and a point), and duplicates.
                0 => [3 * i, 3 * i + 1, 3 * i],
                1 => [3 * i; 3],
                2 => [3 * i - 3, 3 * i - 3, 3 * i - 3],
                _ => [3 * i, 3 * i + 1, 3 * i + 2],
            })
            .collect(),
        vertices,
        ..Mesh::default()
    }
}

#[test]
fn tree_agrees_with_brute_force() {
    let mesh = soup(600, 3);
    let tree = MeshTree::new(&mesh);
    let points: Vec<DVec3> = noise(900, 9)
        .chunks_exact(3)
        .map(|c| (DVec3::new(c[0], c[1], c[2]) * 1.4 - 0.2) * 1000.0)
        .collect();
    for (p, found) in points.iter().zip(tree.closest_batch(&points)) {
        let found = found.unwrap();
        let brute = (0..mesh.triangles.len())
            .map(|i| (closest_on_triangle(*p, &mesh.corners(i)) - *p).length())
            .fold(f64::INFINITY, f64::min);
        assert_eq!(found.distance_mm, brute);
        let own = closest_on_triangle(*p, &mesh.corners(found.triangle as usize));
        assert_eq!(own, found.point);
    }
}

#[test]
fn finds_nearest_of_ten_thousand_coincident_triangles() {
    let mesh = Mesh {
        vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
        triangles: vec![[0, 1, 2]; 10_000],
        ..Mesh::default()
    };
    let found = MeshTree::new(&mesh)
        .closest(DVec3::new(0.2, 0.2, 3.0))
        .unwrap();
    assert_eq!(found.distance_mm, 3.0);
    assert_eq!(found.normal, DVec3::Z);
}

#[test]
fn far_from_the_origin_the_boxes_still_hold() {
    // At 1e8 mm the f32 spacing is 8 mm, wider than the triangles.
    let shift = DVec3::new(1e8, -1e8, 1e8);
    let mut mesh = soup(200, 5);
    mesh.vertices.iter_mut().for_each(|v| *v += shift);
    let tree = MeshTree::new(&mesh);
    for c in noise(300, 2).chunks_exact(3) {
        let p = shift + DVec3::new(c[0], c[1], c[2]) * 1000.0;
        let brute = (0..mesh.triangles.len())
            .map(|i| (closest_on_triangle(p, &mesh.corners(i)) - p).length())
            .fold(f64::INFINITY, f64::min);
        assert_eq!(tree.closest(p).unwrap().distance_mm, brute);
    }
}

#[test]
fn empty_mesh_or_invalid_point_has_no_closest_point() {
    let tree = MeshTree::new(&Mesh::default());
    assert_eq!(tree.closest(DVec3::ZERO), None);
    assert!(!tree.blocks(DVec3::ZERO, DVec3::X, 0.0));
    let tree = MeshTree::new(&soup(10, 1));
    assert_eq!(tree.closest(DVec3::NAN), None);
}

#[test]
fn a_wall_blocks_what_crosses_it() {
    let mesh = Mesh {
        vertices: vec![
            DVec3::new(-1.0, -1.0, 5.0),
            DVec3::new(1.0, -1.0, 5.0),
            DVec3::new(1.0, 1.0, 5.0),
            DVec3::new(-1.0, 1.0, 5.0),
        ],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let tree = MeshTree::new(&mesh);
    let blocks = |x, y, z| tree.blocks(DVec3::ZERO, DVec3::new(x, y, z), 1e-6);
    // A segment through the shared diagonal, one along an axis, and one that passes beside the wall.
    assert!(blocks(0.0, 0.0, 10.0));
    assert!(blocks(1.0, 1.0, 10.0));
    assert!(blocks(0.5, -0.2, 6.0));
    assert!(!blocks(0.0, 0.0, 4.0));
    assert!(!blocks(0.0, 0.0, 5.0));
    assert!(!blocks(2.2, 0.0, 10.0));
    assert!(!blocks(0.0, 0.0, -10.0));
}

#[test]
fn rays_do_not_pass_between_triangles() {
    let mesh = crate::shapes::torso(&crate::shapes::Torso {
        triangles: 4000,
        ..Default::default()
    });
    let (lo, hi) = mesh.bounds().unwrap();
    let tree = MeshTree::new(&mesh);
    let middle = (lo + hi) / 2.0;
    for (a, b) in noise(4000, 8).chunks_exact(2).map(|c| (c[0], c[1])) {
        let (sin, cos) = (std::f64::consts::TAU * a).sin_cos();
        let up = 2.0 * b - 1.0;
        let out = DVec3::new(cos, sin, 0.0) * (1.0 - up * up).sqrt() + DVec3::Z * up;
        assert!(tree.blocks(middle, middle + out * 2000.0, 1e-6));
    }
    // Also aim exactly at vertices and edge midpoints.
    for i in (0..mesh.triangles.len()).step_by(7) {
        let [a, b, _] = mesh.corners(i);
        for at in [a, (a + b) / 2.0] {
            assert!(tree.blocks(middle, middle + (at - middle) * 1.5, 1e-6));
        }
    }
}
