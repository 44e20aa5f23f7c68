//! The watertight ray/triangle test over the lanes of a packet.
//!
//! Woop, Benthin, Wald: "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013. Vertices are taken
//! relative to the origin and sheared so that the ray runs along +z; the signs of the three edge
//! functions at the origin then decide. Two triangles that share an edge compute the function of this
//! edge from the same numbers with opposite signs, so no ray passes between them.

use super::bvh::Corners;
use super::packet::{LANES, Lanes, Packet, max, min};
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
    let [kx, ky, kz] = packet.axes.k;
    let [a, b, c] = corners.v.map(|v| {
        let v = v - packet.origin;
        Vec3::new(v[kx], v[ky], v[kz])
    });
    let (mut u, mut v, mut w) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    let mut scaled_t: Lanes = [0.0; LANES];
    let mut candidates = [0u32; LANES];
    for lane in 0..LANES {
        let (sx, sy, sz) = (
            packet.axes.shear[0][lane],
            packet.axes.shear[1][lane],
            packet.axes.shear[2][lane],
        );
        let (ax, ay) = (a.x - sx * a.z, a.y - sy * a.z);
        let (bx, by) = (b.x - sx * b.z, b.y - sy * b.z);
        let (cx, cy) = (c.x - sx * c.z, c.y - sy * c.z);
        u[lane] = cx * by - cy * bx;
        v[lane] = ax * cy - ay * cx;
        w[lane] = bx * ay - by * ax;
        scaled_t[lane] = sz * (u[lane] * a.z + v[lane] * b.z + w[lane] * c.z);
        let low = min(min(u[lane], v[lane]), w[lane]);
        let high = max(max(u[lane], v[lane]), w[lane]);
        // All edge functions have one sign or are zero: this is a hit, or a zero must be decided in f64.
        candidates[lane] = u32::from((low >= 0.0) | (high <= 0.0));
    }
    if candidates.iter().fold(0, |any, c| any | c) == 0 {
        return;
    }
    for lane in 0..LANES {
        if candidates[lane] == 0 {
            continue;
        }
        let (mut e0, mut e1, mut e2) = (u[lane], v[lane], w[lane]);
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
        let t = scaled_t[lane] / det;
        if t > 0.0 {
            let error = error_bound([a, b, c], packet, lane, det);
            if t - error < packet.reach[lane] {
                accept(packet, lane, Hit { t, error });
            }
        }
    }
}

/// Returns a bound on the difference between the ray parameter of a hit and its value for the
/// unrounded triangle and ray.
///
/// Forward error analysis to first order (Higham: "Accuracy and Stability of Numerical Algorithms",
/// 2nd ed., chapter 3). Vertices, origin and shear are rounded, so sheared coordinates are off by a
/// few epsilons of the distances. These errors and the products give the error of an edge function.
/// The parameter, a mean of the corners' depths weighted by the edge functions, is off by the
/// weights' errors times the spread of the depths, and never leaves that spread.
#[inline(always)]
fn error_bound(v: [Vec3; 3], packet: &Packet, lane: usize, det: f32) -> f32 {
    let shear = packet.axes.shear.map(|s| s[lane]);
    let (mut size, mut far) = (0.0f32, packet.farthest);
    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
    for p in v {
        let (x, y) = (p.x - shear[0] * p.z, p.y - shear[1] * p.z);
        size = max(size, max(x.abs(), y.abs()));
        far = max(far, p.abs().max_element());
        (low, high) = (min(low, p.z), max(high, p.z));
    }
    let rounding = 2.0 * f32::EPSILON * far;
    let sheared = rounding * (1.0 + 2.0 * (shear[0].abs() + shear[1].abs()));
    let edge = 4.0 * size * (sheared + f32::EPSILON * size);
    let spread = high - low;
    // In this order of operations, the quotient of an edge-on triangle is at worst infinite, and
    // `spread` replaces it.
    let weighed = 3.0 * edge / det.abs() * spread;
    let weighed = if weighed < spread { weighed } else { spread };
    shear[2].abs() * (weighed + 4.0 * rounding)
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
