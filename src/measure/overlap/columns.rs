//! Intersects columns along z with a solid.

use glam::{DVec2, DVec3};
use phasmid_geometry::Mesh;

/// A square grid of columns over a rectangle of the x-y plane.
pub(super) struct Columns {
    lo: DVec2,
    width: f64,
    count: [usize; 2],
}

impl Columns {
    /// Creates a grid with `columns` columns along the longer side.
    pub(super) fn over(lo: DVec2, hi: DVec2, columns: usize) -> Self {
        let sides = hi - lo;
        let width = sides.max_element() / columns as f64;
        Self {
            lo,
            width,
            count: (sides / width)
                .ceil()
                .to_array()
                .map(|n| (n as usize).max(1)),
        }
    }

    /// Cross-section area of a column.
    pub(super) fn area_mm2(&self) -> f64 {
        self.width * self.width
    }

    /// Returns the z intervals inside a closed mesh, column by column, lowest first.
    pub(super) fn spans(&self, mesh: &Mesh) -> Vec<Vec<[f64; 2]>> {
        let mut crossings: Vec<Vec<(f64, i32)>> = vec![Vec::new(); self.count[0] * self.count[1]];
        for i in 0..mesh.triangles.len() {
            self.cross(mesh.corners(i), &mut crossings);
        }
        crossings.into_iter().map(inside).collect()
    }

    /// Adds the heights at which a triangle crosses columns: +1 where the column leaves the solid
    /// going upwards, -1 where it enters.
    fn cross(&self, corners: [DVec3; 3], crossings: &mut [Vec<(f64, i32)>]) {
        let flat = corners.map(|c| c.truncate());
        let doubled = (flat[1] - flat[0]).perp_dot(flat[2] - flat[0]);
        if doubled == 0.0 {
            return;
        }
        let (lo, hi) = flat
            .iter()
            .fold((flat[0], flat[0]), |(lo, hi), &p| (lo.min(p), hi.max(p)));
        let range = |axis: usize| {
            let at = |x: f64| ((x - self.lo[axis]) / self.width - 0.5).max(0.0);
            (at(lo[axis]) as usize)..((at(hi[axis]) as usize + 2).min(self.count[axis]))
        };
        for y in range(1) {
            for x in range(0) {
                let p = self.lo + (DVec2::new(x as f64, y as f64) + 0.5) * self.width;
                let sides: [bool; 3] =
                    std::array::from_fn(|k| is_left(flat[k], flat[(k + 1) % 3], p));
                if sides == [doubled > 0.0; 3] {
                    let weights: [f64; 3] = std::array::from_fn(|k| {
                        let (from, to) = (flat[(k + 1) % 3], flat[(k + 2) % 3]);
                        (to - from).perp_dot(p - from) / doubled
                    });
                    let z = (0..3).map(|k| weights[k] * corners[k].z).sum();
                    let sign = if doubled > 0.0 { 1 } else { -1 };
                    crossings[y * self.count[0] + x].push((z, sign));
                }
            }
        }
    }
}

/// Returns whether `p` lies left of the edge from `from` to `to`. It is computed from the same end
/// for both directions of an edge, and points on the edge are left of it in one direction only, so
/// a column always hits exactly one of two triangles that share an edge.
fn is_left(from: DVec2, to: DVec2, p: DVec2) -> bool {
    let forwards = (from.x, from.y) <= (to.x, to.y);
    let (a, b) = if forwards { (from, to) } else { (to, from) };
    ((b - a).perp_dot(p - a) >= 0.0) == forwards
}

/// Intervals between crossings where a column is inside the solid, i.e. entered more often than
/// left.
fn inside(mut crossings: Vec<(f64, i32)>) -> Vec<[f64; 2]> {
    crossings.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let (mut depth, mut from) = (0, 0.0);
    let mut spans = Vec::new();
    for (z, sign) in crossings {
        let before = depth;
        depth -= sign;
        if before <= 0 && depth > 0 {
            from = z;
        } else if before > 0 && depth <= 0 {
            spans.push([from, z]);
        }
    }
    spans
}
