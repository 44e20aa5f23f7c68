//! The tumour's shape: star-shaped about its middle, its radius a sum of real spherical harmonics of
//! degrees 2 to 5 with random coefficients. Its volume is that of the ball of its diameter exactly.

use super::organs::Organs;
use super::parameters::Patient;
use super::random::Draws;
use crate::geometry::Mesh;
use glam::DVec3;
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

/// Degrees of the harmonics, and how much of the roughness each has.
const DEGREES: std::ops::RangeInclusive<usize> = 2..=5;
const SHARES: [f64; 4] = [0.4, 0.3, 0.18, 0.12];
const STREAM: u32 = 2;
/// Nodes of the quadratures over directions and along a radius: exact for polynomials of degree 31
/// over directions, which the fourth power of the radius (degree 20) and a smooth displacement are
/// within, and of degree 11 along it.
const NODES: usize = 16;
const RADIAL: usize = 6;

/// A tumour at the reference phase, in the body frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shape {
    centre: DVec3,
    radius_mm: f64,
    /// Coefficients of each degree, by order -l to l.
    coefficients: Vec<Vec<f64>>,
}

impl Shape {
    pub(super) fn new(p: &Patient) -> Self {
        let draws = Draws::new(p.seed, STREAM);
        let mut index = 0;
        let coefficients = DEGREES
            .zip(SHARES)
            .map(|(l, share)| {
                let drawn: Vec<f64> = (0..=2 * l)
                    .map(|_| {
                        index += 1;
                        draws.even(index)
                    })
                    .collect();
                // By the addition theorem sum_m Y_lm^2 is (2l + 1) / 4 pi everywhere, so that by
                // Cauchy and Schwarz the degree's sum stays within roughness * share.
                let length = drawn.iter().map(|c| c * c).sum::<f64>().sqrt();
                let most = ((2 * l + 1) as f64 / (4.0 * PI)).sqrt();
                let scale = p.tumour.roughness * share / (length * most);
                drawn.iter().map(|c| c * scale).collect()
            })
            .collect();
        let organs = Organs::new(p);
        let mut shape = Self {
            centre: organs.place(p.tumour.lobe) + DVec3::from_array(p.tumour.offset_mm),
            radius_mm: 1.0,
            coefficients,
        };
        let ball = PI / 6.0 * p.tumour.diameter_mm.powi(3);
        shape.radius_mm = (ball / shape.volume_mm3()).cbrt();
        shape
    }

    /// The point that radii are measured from.
    pub(super) fn centre(&self) -> DVec3 {
        self.centre
    }

    /// Distance from the middle to the surface in a direction of length 1, in millimetres.
    pub(super) fn radius(&self, direction: DVec3) -> f64 {
        let sum: f64 = (DEGREES.zip(&self.coefficients))
            .map(|(l, c)| {
                let values = harmonics(l, direction);
                c.iter().zip(values).map(|(c, y)| c * y).sum::<f64>()
            })
            .sum();
        self.radius_mm * (1.0 + sum)
    }

    /// Volume at the reference phase, in cubic millimetres.
    pub(super) fn volume_mm3(&self) -> f64 {
        let thirds = |(n, w)| w * self.radius(n).powi(3) / 3.0;
        directions().map(thirds).sum()
    }

    /// Centroid at the reference phase.
    pub(super) fn centroid(&self) -> DVec3 {
        let moment: DVec3 = directions()
            .map(|(n, w)| n * (w * self.radius(n).powi(4) / 4.0))
            .sum();
        self.centre + moment / self.volume_mm3()
    }

    /// Points of the surface.
    pub(super) fn surface(&self) -> impl Iterator<Item = DVec3> + '_ {
        directions().map(|(n, _)| self.centre + n * self.radius(n))
    }

    /// Places inside with the volume that each stands for, in cubic millimetres.
    pub(super) fn inside(&self) -> impl Iterator<Item = (DVec3, f64)> + '_ {
        let radial = gauss(RADIAL);
        directions().flat_map(move |(n, w)| {
            let radius = self.radius(n);
            radial.clone().into_iter().map(move |(u, v)| {
                let r = radius * 0.5 * (u + 1.0);
                (self.centre + n * r, w * v * 0.5 * radius * r * r)
            })
        })
    }

    /// Whether a place is inside, by its distance from the middle less the surface's that way.
    pub(super) fn outside(&self, x: DVec3) -> f64 {
        let off = x - self.centre;
        let length = off.length();
        if length > 2.0 * self.radius_mm {
            return length - 1.35 * self.radius_mm;
        }
        length - self.radius(if length > 0.0 { off / length } else { DVec3::Z })
    }

    /// The surface as a closed mesh with outward triangles: an icosahedron, each of its triangles
    /// parted into four `level` times, 20 * 4^level triangles.
    pub(super) fn mesh(&self, level: u32) -> Mesh {
        let (mut directions, mut triangles) = icosahedron();
        for _ in 0..level {
            let mut middles = HashMap::new();
            let mut finer = Vec::with_capacity(4 * triangles.len());
            for [a, b, c] in triangles {
                let mut middle = |a: u32, b: u32| {
                    *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                        let sum: DVec3 = directions[a as usize] + directions[b as usize];
                        directions.push(sum.normalize());
                        directions.len() as u32 - 1
                    })
                };
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
            }
            triangles = finer;
        }
        Mesh {
            vertices: (directions.iter())
                .map(|&n| self.centre + n * self.radius(n))
                .collect(),
            triangles,
            ..Mesh::default()
        }
    }
}

/// Real spherical harmonics of a degree, orthonormal over the sphere, by order -l to l.
fn harmonics(l: usize, n: DVec3) -> Vec<f64> {
    // Associated Legendre functions over sin^m, and (x + iy)^m, which has that sin^m: no pole.
    let mut values = vec![0.0; 2 * l + 1];
    let (mut cos, mut sin) = (1.0, 0.0);
    for m in 0..=l {
        let mut before = 0.0;
        let mut at: f64 = (1..=m).map(|i| (2 * i - 1) as f64).product();
        for k in m + 1..=l {
            let next =
                ((2 * k - 1) as f64 * n.z * at - (k + m - 1) as f64 * before) / (k - m) as f64;
            (before, at) = (at, next);
        }
        let ratio: f64 = (l - m + 1..=l + m).map(|i| i as f64).product();
        let norm = ((2 * l + 1) as f64 / (4.0 * PI) / ratio).sqrt();
        if m == 0 {
            values[l] = norm * at;
        } else {
            values[l + m] = 2f64.sqrt() * norm * at * cos;
            values[l - m] = 2f64.sqrt() * norm * at * sin;
        }
        (cos, sin) = (n.x * cos - n.y * sin, n.y * cos + n.x * sin);
    }
    values
}

/// Directions with the solid angle that each stands for: Gauss over z, even steps around it.
fn directions() -> impl Iterator<Item = (DVec3, f64)> {
    gauss(NODES).into_iter().flat_map(|(z, w)| {
        let ring = (1.0 - z * z).sqrt();
        (0..2 * NODES).map(move |k| {
            let (sin, cos) = (TAU * (k as f64 + 0.5) / (2 * NODES) as f64).sin_cos();
            (DVec3::new(ring * cos, ring * sin, z), w * PI / NODES as f64)
        })
    })
}

/// Nodes and weights of Gauss and Legendre on [-1, 1], by Newton's method on the polynomial.
fn gauss(count: usize) -> Vec<(f64, f64)> {
    let node = |i: usize| {
        let mut x = (PI * (i as f64 + 0.75) / (count as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..20 {
            let (mut before, mut at) = (1.0, x);
            for k in 2..=count {
                let k = k as f64;
                (before, at) = (at, ((2.0 * k - 1.0) * x * at - (k - 1.0) * before) / k);
            }
            slope = count as f64 * (before - x * at) / (1.0 - x * x);
            x -= at / slope;
        }
        (x, 2.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..count).map(node).collect()
}

fn icosahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let g = 0.5 * (1.0 + 5f64.sqrt());
    let corners = [
        (-1.0, g, 0.0),
        (1.0, g, 0.0),
        (-1.0, -g, 0.0),
        (1.0, -g, 0.0),
        (0.0, -1.0, g),
        (0.0, 1.0, g),
        (0.0, -1.0, -g),
        (0.0, 1.0, -g),
        (g, 0.0, -1.0),
        (g, 0.0, 1.0),
        (-g, 0.0, -1.0),
        (-g, 0.0, 1.0),
    ];
    let triangles = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    let unit = |(x, y, z)| DVec3::new(x, y, z).normalize();
    (corners.map(unit).to_vec(), triangles.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shapes::check::closed;

    fn rough() -> Shape {
        let mut p = Patient::load("p01-woman-mean").unwrap();
        p.tumour.roughness = 0.35;
        p.tumour.diameter_mm = 30.0;
        Shape::new(&p)
    }

    #[test]
    fn harmonics_are_orthonormal() {
        for (l, k) in [(2, 2), (3, 5), (5, 5), (4, 2)] {
            for i in 0..=2 * l {
                for j in 0..=2 * k {
                    let sum: f64 = directions()
                        .map(|(n, w)| w * harmonics(l, n)[i] * harmonics(k, n)[j])
                        .sum();
                    let wanted = f64::from(u8::from((l, i) == (k, j)));
                    assert!((sum - wanted).abs() < 1e-12, "{l} {i} {k} {j}: {sum}");
                }
            }
        }
    }

    #[test]
    fn volume_is_that_of_its_ball_and_of_its_mesh() {
        let shape = rough();
        let ball = PI / 6.0 * 27_000.0;
        assert!((shape.volume_mm3() / ball - 1.0).abs() < 1e-12);
        let quadrature: f64 = shape.inside().map(|(_, v)| v).sum();
        assert!((quadrature / ball - 1.0).abs() < 1e-12);
        // The divergence theorem over a mesh lacks what the chords cut off: a quarter at each level.
        let lacks = |level| 1.0 - closed(&shape.mesh(level)) / ball;
        let (coarse, fine) = (lacks(3), lacks(4));
        assert!(fine > 0.0 && fine < 0.004, "{fine}");
        assert!((coarse / fine - 4.0).abs() < 0.1, "{coarse} {fine}");
    }

    #[test]
    fn its_centroid_is_that_of_its_parts() {
        let shape = rough();
        let moment: DVec3 = shape.inside().map(|(x, v)| x * v).sum();
        let off = moment / shape.volume_mm3() - shape.centroid();
        assert!(off.length() < 1e-9, "{off}");
        assert!((shape.centroid() - shape.centre()).length() > 1e-3);
    }

    #[test]
    fn it_is_rough_and_not_more_than_allowed() {
        let shape = rough();
        let radii: Vec<f64> = directions().map(|(n, _)| shape.radius(n)).collect();
        let (least, most) = radii
            .iter()
            .fold((f64::MAX, 0.0f64), |(a, b), &r| (a.min(r), b.max(r)));
        let mean = shape.radius_mm;
        assert!(least >= 0.65 * mean && most <= 1.35 * mean);
        assert!(most - least > 0.15 * mean, "{least} {most}");
        assert!(shape.outside(shape.centre()) < -0.6 * mean);
        assert!(shape.outside(shape.centre() + DVec3::X * 3.0 * mean) > 0.0);
    }
}
