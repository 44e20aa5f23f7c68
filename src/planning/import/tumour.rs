//! Reads the tumour from a mesh, or as the surface of a mask. Also tests which of its points lie inside
//! a closed surface, the skin.

use crate::isosurface::{Parts, isosurface};
use crate::metaimage;
use crate::planning::fit::{Moments, closed};
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Mesh, extension};
use std::path::Path;

/// Level of a mask's surface, half-way between outside (0) and tumour (1).
const MIDWAY: f64 = 0.5;

/// A tumour in the CT's LPS.
pub(super) struct Tumour {
    pub(super) mesh: Mesh,
    pub(super) moments: Moments,
}

impl Tumour {
    /// Reads a closed mesh, or a MetaImage whose voxels are 0 outside and 1 in the tumour.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let mesh = match extension(path).as_str() {
            "mha" | "mhd" => of_mask(path, &place)?,
            "stl" | "obj" | "ply" => Mesh::read(path)?,
            other => {
                let allowed = ".stl, .obj or .ply, or a mask as .mha or .mhd";
                return Err(Error::input(place, format!("extension `{other}`"), allowed));
            }
        };
        let moments = closed(&mesh, &place)?;
        // Drop colours and texture coordinates.
        let mesh = Mesh {
            vertices: mesh.vertices,
            triangles: mesh.triangles,
            ..Mesh::default()
        };
        Ok(Self { mesh, moments })
    }
}

/// Extracts the surface of all parts of a mask; separate parts belong to the target too.
fn of_mask(path: &Path, place: &str) -> Result<Mesh> {
    let mask = metaimage::read_volume(path)?;
    let numbers = (0..mask.voxels().len()).map(|n| f64::from(mask.voxels().get(n)));
    let (least, most) = numbers.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
    let allowed = "a mask: 0 outside and 1 in the tumour";
    if least < 0.0 || most > 1.0 {
        // With labels, or 255 instead of 1, the level would not be half-way.
        return Err(Error::input(
            place,
            format!("numbers from {least} to {most}"),
            allowed,
        ));
    }
    if most < MIDWAY {
        return Err(Error::input(place, "no voxel of the tumour", allowed));
    }
    isosurface(&mask, MIDWAY, Parts::All, place)
}

/// Returns the indices of the points outside a closed surface. A ray along x from a point outside
/// crosses the surface an even number of times. Points on the surface may count as inside or outside.
pub(super) fn outside(points: &[DVec3], surface: &Mesh) -> Vec<usize> {
    // Sort the points by z, so that each triangle is tested only against the few in its z range.
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[a].z.total_cmp(&points[b].z));
    let mut within = vec![false; points.len()];
    for (number, triangle) in surface.triangles.iter().enumerate() {
        let corners = surface.corners(number);
        let [a, b, c] = corners;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let first = order.partition_point(|&n| points[n].z < low.z);
        for &n in &order[first..] {
            let p = points[n];
            if p.z > high.z {
                break;
            }
            let beside = low.y <= p.y && p.y <= high.y && p.x < high.x;
            if beside && crosses(corners, *triangle, p) {
                within[n] ^= true;
            }
        }
    }
    (0..points.len()).filter(|&n| !within[n]).collect()
}

/// Returns whether the ray along x from a point crosses a triangle.
fn crosses(corners: [DVec3; 3], indices: [u32; 3], p: DVec3) -> bool {
    let mut inside = false;
    for side in 0..3 {
        let ends = [side, (side + 1) % 3];
        // Use the same edge direction for both triangles of an edge, so that a ray crosses exactly
        // one of them.
        let turned = indices[ends[0]] > indices[ends[1]];
        let [u, v] = [usize::from(turned), usize::from(!turned)].map(|end| corners[ends[end]]);
        if (u.z > p.z) != (v.z > p.z) {
            let y = u.y + (v.y - u.y) * (p.z - u.z) / (v.z - u.z);
            inside ^= p.y < y;
        }
    }
    if !inside {
        return false;
    }
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a);
    let along = normal.y * (p.y - a.y) + normal.z * (p.z - a.z);
    // For a triangle parallel to the ray, use its centroid.
    let x = if normal.x == 0.0 {
        (a.x + b.x + c.x) / 3.0
    } else {
        a.x - along / normal.x
    };
    p.x < x
}
