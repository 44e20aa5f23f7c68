//! Smooth normals of a mesh, which approximate the normals of the surface from which the mesh was
//! made. Highlights need them: with the normal of a flat facet, either the whole facet or none of it
//! would shine.

use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// Cosine of 15 degrees, the crease angle: triangles of a mesh whose normals differ by less form one
/// smooth surface.
pub(crate) const COS_CREASE: f32 = 0.965_925_8;

/// Adjacency of triangles at vertices.
pub(crate) struct Smoother {
    /// For the corners of each triangle, the indices of the merged vertices.
    places: Vec<[u32; 3]>,
    /// Triangles around each merged vertex.
    around: Vec<Vec<u32>>,
}

impl Smoother {
    /// Merges vertices at equal positions, for files without shared vertices.
    pub(crate) fn new(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let mut numbers = HashMap::new();
        let mut around: Vec<Vec<u32>> = Vec::new();
        let mut place_of = |i: u32| {
            // Adding zero maps -0 to +0.
            let bits = (vertices[i as usize] + 0.0).to_array().map(f64::to_bits);
            *numbers.entry(bits).or_insert_with(|| {
                around.push(Vec::new());
                around.len() as u32 - 1
            })
        };
        let places: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(&mut place_of)).collect();
        for (triangle, corners) in places.iter().enumerate() {
            for &place in corners {
                around[place as usize].push(triangle as u32);
            }
        }
        Self { places, around }
    }

    /// Returns unit normals at the corners of each triangle for the current vertex positions: the
    /// area-weighted mean of the normals of those adjacent triangles whose normals are within the
    /// crease angle of the triangle's own normal.
    pub(crate) fn normals(&self, vertices: &[DVec3], triangles: &[[u32; 3]]) -> Vec<[Vec3; 3]> {
        let cross = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| vertices[i as usize]);
            (b - a).cross(c - a)
        };
        let crosses: Vec<DVec3> = triangles.iter().map(cross).collect();
        let units: Vec<DVec3> = crosses.iter().map(|c| c.normalize_or_zero()).collect();
        let smooth = |own: DVec3, place: u32| {
            let near = self.around[place as usize].iter().map(|&t| t as usize);
            let sum: DVec3 = near
                .filter(|&t| units[t].dot(own) >= f64::from(COS_CREASE))
                .map(|t| crosses[t])
                .sum();
            sum.try_normalize().unwrap_or(own).as_vec3()
        };
        let of = |(corners, own): (&[u32; 3], &DVec3)| corners.map(|place| smooth(*own, place));
        self.places.iter().zip(&units).map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_mesh_is_smooth_and_a_box_keeps_its_edges() {
        // A roof of two faces that join along y, given without shared vertices.
        let roof = |rise: f64| {
            let ridge = [DVec3::new(0.0, 0.0, rise), DVec3::new(0.0, 1.0, rise)];
            let vertices = vec![
                ridge[0],
                ridge[1],
                DVec3::new(-1.0, 0.0, 0.0),
                ridge[1],
                ridge[0],
                DVec3::new(1.0, 1.0, 0.0),
            ];
            let triangles = [[0, 1, 2], [3, 4, 5]];
            Smoother::new(&vertices, &triangles).normals(&vertices, &triangles)
        };
        let flat = roof(0.1);
        assert!((flat[0][0] - Vec3::Z).length() < 1e-6, "{:?}", flat[0]);
        assert!((flat[1][0] - Vec3::Z).length() < 1e-6);
        assert!(flat[0][2].x < -0.05, "the eaves are the face's own");
        let steep = roof(1.0);
        assert!((steep[0][0] - steep[0][2]).length() < 1e-6, "{steep:?}");
    }
}
