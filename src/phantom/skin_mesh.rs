//! The skin as triangles of nearly equal size: rings at equal distances along the body, each with a
//! number of points proportional to its length, zipped together; one point closes each end.

use super::skin::Skin;
use glam::DVec3;
use phasmid_geometry::Mesh;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Number of heights at which the body is measured to place the rings.
const HEIGHTS: usize = 900;
/// Number of angles measured at each height.
const ANGLES: usize = 64;
/// Number of steps in which a ring's length is measured.
const FINE: usize = 360;

/// Returns a closed mesh of the skin with about `triangles` triangles, in the body frame,
/// counter-clockwise seen from outside.
pub(super) fn mesh(skin: &Skin, triangles: u32) -> Mesh {
    let measure = Measure::new(skin);
    let mut edge = (4.0 * measure.area() / (3f64.sqrt() * f64::from(triangles))).sqrt();
    let mut rings = measure.rings(edge);
    for _ in 0..4 {
        let count: usize = rings.iter().map(|(_, points)| 2 * points).sum();
        edge *= (count as f64 / f64::from(triangles)).sqrt();
        rings = measure.rings(edge);
    }
    let [lower, upper] = skin.ends();
    let mut vertices = vec![DVec3::new(0.0, 0.0, lower)];
    let mut made = Vec::new();
    let mut before: Option<Ring> = None;
    for (i, &(z, points)) in rings.iter().enumerate() {
        let ring = Ring {
            first: vertices.len() as u32,
            count: points,
            // Every other ring is rotated by half a step.
            turn: 0.5 * (i % 2) as f64,
        };
        vertices.extend(around(skin, z, &ring));
        match before {
            None => made.extend((0..points).map(|k| [0, ring.index(k + 1), ring.index(k)])),
            Some(before) => zip(&before, &ring, &mut made),
        }
        before = Some(ring);
    }
    let top = vertices.len() as u32;
    vertices.push(DVec3::new(0.0, 0.0, upper));
    if let Some(ring) = before {
        made.extend((0..ring.count).map(|k| [ring.index(k), ring.index(k + 1), top]));
    }
    Mesh {
        vertices,
        triangles: made,
        ..Mesh::default()
    }
}

/// Lengths along and around the body, at heights that are denser at both ends.
struct Measure {
    z: Vec<f64>,
    /// Mean length of the meridians from the lower end.
    along: Vec<f64>,
    /// Circumference.
    around: Vec<f64>,
}

impl Measure {
    fn new(skin: &Skin) -> Self {
        let [lower, upper] = skin.ends();
        let angles = |k: usize| TAU * k as f64 / ANGLES as f64;
        let mut measure = Self {
            z: Vec::new(),
            along: Vec::new(),
            around: Vec::new(),
        };
        let mut before: Vec<DVec3> = Vec::new();
        for i in 0..=HEIGHTS {
            let z = lower + (upper - lower) * 0.5 * (1.0 - (PI * i as f64 / HEIGHTS as f64).cos());
            let points: Vec<_> = (0..ANGLES).map(|k| skin.point(angles(k), z)).collect();
            let next = |k: usize| points[(k + 1) % ANGLES];
            let ring = (0..ANGLES).map(|k| (next(k) - points[k]).length()).sum();
            let step: f64 = points
                .iter()
                .zip(&before)
                .map(|(a, b)| (*a - *b).length())
                .sum();
            let last = measure.along.last().copied().unwrap_or(0.0);
            measure.z.push(z);
            measure.along.push(last + step / ANGLES as f64);
            measure.around.push(ring);
            before = points;
        }
        measure
    }

    fn area(&self) -> f64 {
        (1..self.z.len())
            .map(|i| {
                let step = self.along[i] - self.along[i - 1];
                0.5 * step * (self.around[i] + self.around[i - 1])
            })
            .sum()
    }

    /// Returns height and number of points of each ring, for triangles with this edge length.
    fn rings(&self, edge: f64) -> Vec<(f64, usize)> {
        let length = self.along[self.along.len() - 1];
        let count = (length / (edge * 0.75f64.sqrt())).round().max(4.0) as usize;
        let mut at = 0;
        (1..count)
            .map(|i| {
                let wanted = length * i as f64 / count as f64;
                while self.along[at + 1] < wanted {
                    at += 1;
                }
                let share = (wanted - self.along[at]) / (self.along[at + 1] - self.along[at]);
                let mix = |v: &[f64]| v[at] + share * (v[at + 1] - v[at]);
                let points = (mix(&self.around) / edge).round().max(5.0) as usize;
                (mix(&self.z), points)
            })
            .collect()
    }
}

/// The range of a ring's points in the list of vertices.
struct Ring {
    first: u32,
    count: usize,
    turn: f64,
}

impl Ring {
    fn index(&self, k: usize) -> u32 {
        self.first + (k % self.count) as u32
    }

    /// Position of a point along the ring, in turns from the middle of the back.
    fn share(&self, k: usize) -> f64 {
        (k as f64 + self.turn) / self.count as f64
    }
}

/// Returns the points of a ring at equal distances, starting at the middle of the back.
fn around(skin: &Skin, z: f64, ring: &Ring) -> Vec<DVec3> {
    let angle = |i: usize| FRAC_PI_2 + TAU * i as f64 / FINE as f64;
    let mut length = vec![0.0];
    let mut last = skin.point(angle(0), z);
    for i in 1..=FINE {
        let point = skin.point(angle(i), z);
        length.push(length[i - 1] + (point - last).length());
        last = point;
    }
    let mut at = 0;
    (0..ring.count)
        .map(|k| {
            let wanted = length[FINE] * ring.share(k);
            while at + 1 < FINE && length[at + 1] < wanted {
                at += 1;
            }
            let share = (wanted - length[at]) / (length[at + 1] - length[at]);
            let turn = TAU * (at as f64 + share.clamp(0.0, 1.0)) / FINE as f64;
            skin.point(FRAC_PI_2 + turn, z)
        })
        .collect()
}

/// Adds the triangles between a ring and the next one towards the head.
fn zip(low: &Ring, high: &Ring, triangles: &mut Vec<[u32; 3]>) {
    let (mut i, mut j) = (0, 0);
    while i < low.count || j < high.count {
        let ahead = i < low.count && (j == high.count || low.share(i + 1) <= high.share(j + 1));
        if ahead {
            triangles.push([low.index(i), low.index(i + 1), high.index(j)]);
            i += 1;
        } else {
            triangles.push([low.index(i), high.index(j + 1), high.index(j)]);
            j += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::parameters::Patient;
    use super::*;
    use phasmid_geometry::shapes::check::closed;

    #[test]
    fn mesh_is_closed_and_even_with_the_requested_triangles() {
        let mut p = Patient::load("p01-woman-mean").unwrap();
        p.chest.fold_mm = Some(8.0);
        let skin = Skin::new(&p);
        let mut volumes = Vec::new();
        for count in [6_000, 60_000] {
            let mesh = mesh(&skin, count);
            volumes.push(closed(&mesh));
            let found = mesh.triangles.len() as f64;
            assert!((found / f64::from(count) - 1.0).abs() < 0.03, "{found}");
            let angle = |i| {
                let [a, b, c] = mesh.corners(i);
                [(a, b, c), (b, c, a), (c, a, b)]
                    .map(|(a, b, c)| (b - a).angle_between(c - a).to_degrees())
                    .into_iter()
                    .fold(f64::MAX, f64::min)
            };
            let mut angles: Vec<f64> = (0..mesh.triangles.len()).map(angle).collect();
            angles.sort_by(f64::total_cmp);
            let (least, hundredth) = (angles[0], angles[angles.len() / 100]);
            assert!(
                least > 8.0 && hundredth > 22.0,
                "{least} {hundredth} degrees"
            );
        }
        // Reference: the volume by integration of the radius.
        let [lower, upper] = skin.ends();
        const N: usize = 700;
        let mut volume = 0.0;
        for i in 0..N {
            let z = lower + (upper - lower) * (i as f64 + 0.5) / N as f64;
            for k in 0..N {
                let radius = skin.radius(TAU * k as f64 / N as f64, z);
                volume += 0.5 * radius * radius * TAU / N as f64 * (upper - lower) / N as f64;
            }
        }
        let off: Vec<f64> = volumes.iter().map(|v| (v / volume - 1.0).abs()).collect();
        assert!(off[1] < 1e-3 && off[0] < 1e-2, "{off:?}");
    }

    #[test]
    fn distance_is_zero_on_the_skin_and_exact_beside_it() {
        let skin = Skin::new(&Patient::load("p01-woman-mean").unwrap());
        let mesh = mesh(&skin, 20_000);
        for (i, &[a, b, c]) in mesh.triangles.iter().enumerate().step_by(37) {
            let [p, q, r] = [a, b, c].map(|v| mesh.vertices[v as usize]);
            assert!(skin.outside(p).abs() < 1e-9, "{i}: {}", skin.outside(p));
            let normal = (q - p).cross(r - p).normalize();
            if p.z.abs() < 250.0 {
                for off in [-1.5, 1.5] {
                    let found = skin.outside(p + off * normal);
                    assert!((found / off - 1.0).abs() < 0.25, "{p}: {found} for {off}");
                }
            }
        }
    }
}
