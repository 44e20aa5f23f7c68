//! Smooth normals of a mesh, their uncertainty and their change over a triangle: the curvature, which
//! gives noisy points a bias.
//!
//! On a surface z = 0 with the derivative S of the outward normal, a tangential error e places a
//! point e^T S e / 2 above the surface, which curves away. Noise of covariance C thus shifts points
//! by trace(S C) / 2 off a convex surface on average: s^2 / R on a sphere. The bias is small but the
//! same in every scan, and it adds up to shifts in directions that the surface constrains weakly.

use super::Facet;
use glam::{DVec3, Vec3};
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

/// Maximum bias as a fraction of the standard deviation. Beyond it, at an edge sharper than the noise
/// is wide, the quadratic model of the surface is invalid.
const MOST: f64 = 0.25;

/// The derivative of the normal over a triangle, a symmetric matrix: xx, yy, zz, xy, xz, yz, in 1/mm.
pub(super) struct Bend([f32; 6]);

impl Bend {
    pub(super) fn of(facet: &Facet) -> Self {
        let [a, b, c] = facet.corners;
        let (ab, ac) = (b - a, c - a);
        let normal = ab.cross(ac);
        let squared = normal.length_squared();
        // Gradients of the weights of corners b and c.
        let gradients = [ac.cross(normal) / squared, normal.cross(ab) / squared];
        let [na, nb, nc] = facet.normals.map(Vec3::as_dvec3);
        let mut sums = [0.0; 6];
        let flat = normal / squared.sqrt();
        for (change, gradient) in [nb - na, nc - na].into_iter().zip(gradients) {
            // Keep the part within the plane; the change of a normal along itself is rounding and
            // second order.
            let d = change - flat * flat.dot(change);
            let g = gradient;
            sums[0] += d.x * g.x;
            sums[1] += d.y * g.y;
            sums[2] += d.z * g.z;
            sums[3] += (d.x * g.y + d.y * g.x) / 2.0;
            sums[4] += (d.x * g.z + d.z * g.x) / 2.0;
            sums[5] += (d.y * g.z + d.z * g.y) / 2.0;
        }
        Self(sums.map(|s| s as f32))
    }

    #[inline]
    pub(super) fn isotropic(&self, sigma: f64) -> f64 {
        let [xx, yy, zz, ..] = self.0.map(f64::from);
        bounded(sigma, (xx + yy + zz) * sigma * sigma / 2.0)
    }

    #[inline]
    pub(super) fn along(&self, sigma: f64, d: DVec3) -> f64 {
        let [xx, yy, zz, xy, xz, yz] = self.0.map(f64::from);
        let diagonal = xx * d.x * d.x + yy * d.y * d.y + zz * d.z * d.z;
        let rest = xy * d.x * d.y + xz * d.x * d.z + yz * d.y * d.z;
        bounded(sigma, (diagonal + 2.0 * rest) * sigma * sigma / 2.0)
    }
}

fn bounded(sigma: f64, lift: f64) -> f64 {
    lift.clamp(-MOST * sigma, MOST * sigma)
}
