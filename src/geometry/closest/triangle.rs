//! Closest point on a triangle, and ray-triangle intersection.

use glam::DVec3;

/// Returns the closest point of a triangle: the foot of the perpendicular if it lies inside, else
/// the closest point of an edge whose outer side contains the foot (cf. C. Ericson, "Real-Time
/// Collision Detection", 2005, section 5.1.5; by edges instead of barycentric regions, which divide
/// by zero on a degenerate triangle).
#[inline]
pub(super) fn closest_on_triangle(p: DVec3, &[a, b, c]: &[DVec3; 3]) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(ac);
    let squared = normal.length_squared();
    // If the sine of the angle at `a` is below 1e-12, the direction of the normal is noise.
    let degenerate = squared <= 1e-24 * ab.length_squared() * ac.length_squared();
    let mut best = (f64::INFINITY, a);
    let mut inside = !degenerate;
    for (from, to) in [(a, b), (b, c), (c, a)] {
        let edge = to - from;
        if degenerate || edge.cross(normal).dot(p - from) > 0.0 {
            inside = false;
            let length = edge.length_squared();
            let along = if length > 0.0 {
                ((p - from).dot(edge) / length).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let q = from + edge * along;
            let d = (q - p).length_squared();
            if d < best.0 {
                best = (d, q);
            }
        }
    }
    if inside {
        p - normal * (normal.dot(p - a) / squared)
    } else {
        best.1
    }
}

/// Returns the distance along a ray to a triangle, which is hit from either side (T. Moller and B.
/// Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997). Edges count as hit, with a
/// slack so that no ray passes between two triangles.
#[inline]
pub(super) fn crossing(from: DVec3, direction: DVec3, &[a, b, c]: &[DVec3; 3]) -> Option<f64> {
    const SLACK: f64 = 1e-9;
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = (from - a) / determinant;
    let u = s.dot(p);
    let q = s.cross(ab);
    let v = direction.dot(q);
    (u >= -SLACK && v >= -SLACK && u + v <= 1.0 + SLACK).then(|| ac.dot(q))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Distance by minimising over a fine grid of barycentric coordinates: an upper bound, tight to
    /// the grid spacing.
    fn by_grid(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
        let n = 200;
        let mut best = f64::INFINITY;
        for i in 0..=n {
            for j in 0..=(n - i) {
                let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                best = best.min((a + (b - a) * u + (c - a) * v - p).length());
            }
        }
        best
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn nearest_point_of_a_triangle_agrees_with_grid_search(raw in proptest::collection::vec(-10.0_f64..10.0, 12),
            collapse in 0..5_u8)
        {
            let v: Vec<DVec3> = raw.chunks_exact(3).map(|c| DVec3::new(c[0], c[1], c[2])).collect();
            let mut t = [v[1], v[2], v[3]];
            match collapse {
                0 => t[2] = t[0],
                1 => t[2] = t[0] * 0.25 + t[1] * 0.75,
                2 => t[2] = t[1] + DVec3::X * 1e-7,
                _ => {}
            }
            let q = closest_on_triangle(v[0], &t);
            let d = (q - v[0]).length();
            let grid = by_grid(v[0], t);
            let step = (t[1] - t[0]).length().max((t[2] - t[0]).length()) / 200.0;
            prop_assert!(d <= grid + 1e-9, "{} above {}", d, grid);
            prop_assert!(d >= grid - 2.0 * step, "{} too near, {}", d, grid);
        }
    }
}
