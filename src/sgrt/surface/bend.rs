//! Curvature of the smooth surface over a triangle, and the bias that it gives noisy points.
//!
//! On a surface z = 0 with the derivative S of the outward normal, a tangential error e places a
//! point e^T S e / 2 above the surface, which curves away. Noise of covariance C thus shifts points
//! by trace(S C) / 2 off a convex surface on average: s^2 / R on a sphere. The bias is small but the
//! same in every scan, and it adds up to shifts in directions that the surface constrains weakly.

use super::Facet;
use glam::{DVec3, Vec3};

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
