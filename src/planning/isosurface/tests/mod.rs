//! Bodies of known surface, their partial volumes in a CT, and noise, whose surface must be closed
//! and manifold too.

mod bodies;
mod partial;
mod shapes;

use super::*;
use crate::volume::{Grid, Voxels};
use glam::{DMat3, DQuat, DVec3};
use std::collections::HashMap;
use std::f64::consts::PI;

/// Properties of a closed manifold mesh.
struct Facts {
    /// Vertices - edges + triangles.
    euler: i64,
    components: usize,
    volume: f64,
    area: f64,
}

/// Returns the properties of a mesh. Panics if it is not a closed manifold: every side of a triangle is
/// a side of another triangle in the opposite direction, and the triangles at every vertex form one fan.
fn closed_manifold(mesh: &Mesh) -> Facts {
    let mut sides = HashMap::new();
    for &[a, b, c] in &mesh.triangles {
        for (p, q, r) in [(a, b, c), (b, c, a), (c, a, b)] {
            assert_ne!(p, q);
            assert_eq!(sides.insert((p, q), r), None, "a side met twice");
        }
    }
    let mut fans = vec![0; mesh.vertices.len()];
    let mut first = vec![None; mesh.vertices.len()];
    for &(p, q) in sides.keys() {
        assert!(sides.contains_key(&(q, p)), "an open side");
        fans[p as usize] += 1;
        first[p as usize] = Some(q);
    }
    for (p, first) in first.iter().enumerate() {
        let p = p as u32;
        let begin = first.expect("a vertex of some triangle");
        let (mut at, mut steps) = (begin, 0);
        loop {
            at = sides[&(p, at)];
            steps += 1;
            if at == begin {
                break;
            }
        }
        assert_eq!(steps, fans[p as usize], "two fans at a vertex");
    }
    let mut parents: Vec<usize> = (0..mesh.vertices.len()).collect();
    fn root(parents: &mut [usize], mut at: usize) -> usize {
        while parents[at] != at {
            parents[at] = parents[parents[at]];
            at = parents[at];
        }
        at
    }
    for t in &mesh.triangles {
        for i in [1, 2] {
            let (a, b) = (
                root(&mut parents, t[0] as usize),
                root(&mut parents, t[i] as usize),
            );
            parents[a] = b;
        }
    }
    let components = (0..parents.len()).filter(|&v| parents[v] == v).count();
    let (mut volume, mut area) = (0.0, 0.0);
    for t in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(t);
        volume += a.dot(b.cross(c)) / 6.0;
        area += (b - a).cross(c - a).length() / 2.0;
    }
    let count = |n: usize| n as i64;
    Facts {
        euler: count(mesh.vertices.len()) - count(sides.len() / 2) + count(mesh.triangles.len()),
        components,
        volume,
        area,
    }
}

/// A rotated grid around a centre, with non-cubic voxels; left-handed if `mirrored`.
fn grid(reach_mm: f64, spacing_mm: DVec3, centre: DVec3, mirrored: bool) -> Grid {
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -0.3, 0.9));
    let hand = if mirrored { -1.0 } else { 1.0 };
    let direction = turn * DMat3::from_diagonal(DVec3::new(1.0, 1.0, hand));
    let size = spacing_mm
        .to_array()
        .map(|mm| (2.0 * reach_mm / mm).ceil() as usize + 2);
    let half = DVec3::from_array(size.map(|n| (n as f64 - 1.0) / 2.0)) * spacing_mm;
    Grid {
        size,
        spacing_mm,
        // Offset so that no voxel's centre is at a symmetric position.
        origin_mm: centre - direction * (half + 0.3 * spacing_mm),
        direction,
    }
}

fn surface(grid: Grid, value: impl Fn(DVec3) -> f64 + Sync) -> Mesh {
    let volume = Volume::of(grid, value, "test").unwrap();
    isosurface(&volume, 0.0, Parts::All, "test").unwrap()
}
