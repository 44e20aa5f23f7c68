//! The watertight ray/triangle test over the lanes of a packet.
//!
//! Woop, Benthin, Wald: "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013. Vertices are taken
//! relative to the origin and sheared so that the ray runs along +z; the signs of the three edge
//! functions at the origin then decide. Two triangles that share an edge compute the function of this
//! edge from the same numbers with opposite signs, so no ray passes between them.

use super::bvh::Corners;
use super::packet::{LANES, Packet, max, min};
use glam::{DVec3, Vec3};

/// An intersection of a ray and a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    /// Ray parameter.
    pub(super) t: f32,
    /// Error bound of `t` relative to the unrounded triangle and ray.
    pub(super) error: f32,
}

/// Tests one triangle against all lanes. Calls `accept(packet, lane, hit)` for each lane hit at a
/// positive t, if t less its error is below the lane's reach.
#[inline(always)]
pub(super) fn intersect(
    packet: &mut Packet,
    corners: &Corners,
    mut accept: impl FnMut(&mut Packet, usize, Hit),
) {
    // Closures of `map` and `fold` would not be inlined here.
    let a = permuted(packet, corners.v[0]);
    let b = permuted(packet, corners.v[1]);
    let c = permuted(packet, corners.v[2]);
    let (mut u, mut v, mut w) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    let mut candidates = 0u32;
    for lane in 0..LANES {
        let (sx, sy) = (packet.axes.shear[0][lane], packet.axes.shear[1][lane]);
        let (ax, ay) = (a.x - sx * a.z, a.y - sy * a.z);
        let (bx, by) = (b.x - sx * b.z, b.y - sy * b.z);
        let (cx, cy) = (c.x - sx * c.z, c.y - sy * c.z);
        u[lane] = cx * by - cy * bx;
        v[lane] = ax * cy - ay * cx;
        w[lane] = bx * ay - by * ax;
        let low = min(min(u[lane], v[lane]), w[lane]);
        let high = max(max(u[lane], v[lane]), w[lane]);
        // All edge functions have one sign or are zero: this is a hit, or a zero must be decided in f64.
        candidates |= u32::from((low >= 0.0) | (high <= 0.0)) << lane;
    }
    if candidates == 0 {
        return;
    }
    let bound = ErrorBound::new(packet, [a, b, c]);
    while candidates != 0 {
        let lane = candidates.trailing_zeros() as usize;
        candidates &= candidates - 1;
        let (mut e0, mut e1, mut e2) = (u[lane], v[lane], w[lane]);
        let scaled_t = packet.axes.shear[2][lane] * (e0 * a.z + e1 * b.z + e2 * c.z);
        if e0 == 0.0 || e1 == 0.0 || e2 == 0.0 {
            let s = [packet.axes.shear[0][lane], packet.axes.shear[1][lane]];
            [e0, e1, e2] = exact_edges([a, b, c], s);
        }
        if (e0 < 0.0 || e1 < 0.0 || e2 < 0.0) && (e0 > 0.0 || e1 > 0.0 || e2 > 0.0) {
            continue;
        }
        let det = e0 + e1 + e2;
        if det == 0.0 {
            continue;
        }
        let t = scaled_t / det;
        if t > 0.0 {
            let error = bound.of(packet, lane, det);
            if t - error < packet.reach[lane] {
                accept(packet, lane, Hit { t, error });
            }
        }
    }
}

/// Returns a vertex relative to the packet's origin, with the packet's dominant axis as z.
#[inline(always)]
fn permuted(packet: &Packet, vertex: Vec3) -> Vec3 {
    let [kx, ky, kz] = packet.axes.k;
    let v = (vertex - packet.origin).to_array();
    Vec3::new(v[kx], v[ky], v[kz])
}

/// Bound on the difference between the ray parameter of a hit and its value for the unrounded
/// triangle and ray.
///
/// Forward error analysis to first order (Higham: "Accuracy and Stability of Numerical Algorithms",
/// 2nd ed., chapter 3). Vertices, origin and shear are rounded, so sheared coordinates are off by a
/// few epsilons of the distances. These errors and the products give the error of an edge function.
/// The parameter, a mean of the corners' depths weighted by the edge functions, is off by the
/// weights' errors times the spread of the depths, and never leaves that spread.
struct ErrorBound {
    corners: [Vec3; 3],
    /// Rounding error of a coordinate.
    rounding: f32,
    /// Extent of the triangle along the dominant axis.
    spread: f32,
}

impl ErrorBound {
    #[inline(always)]
    fn new(packet: &Packet, corners: [Vec3; 3]) -> Self {
        let (mut far, mut low, mut high) = (packet.farthest, f32::INFINITY, f32::NEG_INFINITY);
        for p in corners {
            far = max(far, p.abs().max_element());
            (low, high) = (min(low, p.z), max(high, p.z));
        }
        Self {
            corners,
            rounding: 2.0 * f32::EPSILON * far,
            spread: high - low,
        }
    }

    /// Returns the bound for a lane with the sum `det` of edge functions.
    #[inline(always)]
    fn of(&self, packet: &Packet, lane: usize, det: f32) -> f32 {
        let shear = &packet.axes.shear;
        let shear = [shear[0][lane], shear[1][lane], shear[2][lane]];
        let (rounding, spread) = (self.rounding, self.spread);
        let mut size = 0.0f32;
        for p in self.corners {
            let (x, y) = (p.x - shear[0] * p.z, p.y - shear[1] * p.z);
            size = max(size, max(x.abs(), y.abs()));
        }
        let sheared = rounding * (1.0 + 2.0 * (shear[0].abs() + shear[1].abs()));
        let edge = 4.0 * size * (sheared + f32::EPSILON * size);
        // In this order of operations, the quotient of an edge-on triangle is at worst infinite, and
        // `spread` replaces it.
        let weighed = 3.0 * edge / det.abs() * spread;
        let weighed = if weighed < spread { weighed } else { spread };
        shear[2].abs() * (weighed + 4.0 * rounding)
    }
}

/// Recomputes the edge functions with f64 products, which are exact for f32 factors, where f32 gave
/// a zero that may be underflow or cancellation.
#[cold]
fn exact_edges(v: [Vec3; 3], shear: [f32; 2]) -> [f32; 3] {
    let sheared = v.map(|p| {
        let x = p.x - shear[0] * p.z;
        let y = p.y - shear[1] * p.z;
        DVec3::new(f64::from(x), f64::from(y), 0.0)
    });
    let [a, b, c] = sheared;
    [
        (c.x * b.y - c.y * b.x) as f32,
        (a.x * c.y - a.y * c.x) as f32,
        (b.x * a.y - b.y * a.x) as f32,
    ]
}
