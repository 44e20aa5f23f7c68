//! Smooth normals of a mesh, and their uncertainty.

use glam::DVec3;
use phasmid_core::statistics::median;

/// Typical number of triangles at a vertex.
const MEETING: f64 = 6.0;

/// Unit normals at the vertices: the mean of the triangles' normals, weighted by their angles at the
/// vertex (G. Thurmer and C. Wuthrich, "Computing vertex normals from polygonal facets", 1998), so
/// that they do not depend on the triangulation. Zero at a vertex without triangles.
pub(super) fn vertex_normals(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; vertices.len()];
    for t in triangles {
        let corners = t.map(|i| vertices[i as usize]);
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        for k in 0..3 {
            let (u, v) = (
                corners[(k + 1) % 3] - corners[k],
                corners[(k + 2) % 3] - corners[k],
            );
            let angle = u.cross(v).length().atan2(u.dot(v));
            normals[t[k] as usize] += normal * angle;
        }
    }
    for n in &mut normals {
        *n = n.normalize_or_zero();
    }
    normals
}

/// Standard deviation of the smooth normals of some triangles, in radians per axis, estimated from
/// the triangles. If the normals of k facets scatter independently by s and their mean is the smooth
/// normal, a facet's normal differs from the mean by s sqrt(1 - 1/k) and the mean from the truth by s
/// / sqrt(k). Curvature adds to the scatter, so the estimate is too large, never too small. The
/// median ignores a few sharp edges.
pub(super) fn deviation_rad(
    vertices: &[DVec3],
    triangles: impl Iterator<Item = [u32; 3]>,
    normals: &[DVec3],
) -> f64 {
    let mut squares: Vec<f64> = triangles
        .flat_map(|t| {
            let [a, b, c] = t.map(|i| vertices[i as usize]);
            let facet = (b - a).cross(c - a).normalize_or_zero();
            t.map(|i| facet.cross(normals[i as usize]).length_squared())
        })
        .collect();
    let Some(median) = median(&mut squares) else {
        return 0.0;
    };
    // The sum of the squares of two normal components has the median 2 ln 2 times their variance.
    (median / (2.0 * std::f64::consts::LN_2) / (MEETING - 1.0)).sqrt()
}
