//! Cosine-distributed directions over a hemisphere, each with the patch of the hemisphere that it
//! represents.

use glam::{DVec2, DVec3};
use phasmid_geometry::raycast::LANES;
use std::f64::consts::PI;

/// Golden angle between consecutive points of a Vogel spiral on the disc (Vogel: "A better way to
/// construct the sunflower head", Mathematical Biosciences 44, 1979): pi (3 - sqrt 5).
const GOLDEN: f64 = 2.399_963_229_728_653;

/// Points evenly distributed over a unit disc, grouped by proximity. Projected up onto the
/// hemisphere they are cosine-distributed (Malley's method).
pub(crate) struct Hemisphere {
    groups: Vec<[DVec2; LANES]>,
    /// Side of the square on the disc that each point represents.
    side: f64,
}

/// A direction, and the sides of its patch of the unit sphere, in a surface's own frame.
pub(crate) struct Ray {
    pub(crate) direction: DVec3,
    pub(crate) sides: [DVec3; 2],
}

impl Hemisphere {
    /// Creates `count` directions; `count` is a multiple of sixteen.
    pub(crate) fn new(count: usize) -> Self {
        let mut points: Vec<DVec2> = (0..count)
            .map(|i| {
                let radius = ((i as f64 + 0.5) / count as f64).sqrt();
                DVec2::from_angle(i as f64 * GOLDEN) * radius
            })
            .collect();
        // Divide the disc into strips, and each strip into groups.
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        let strip = (count / LANES).isqrt().max(1) * LANES;
        for strip in points.chunks_mut(strip) {
            strip.sort_by(|a, b| a.y.total_cmp(&b.y));
        }
        let group = |chunk: &[DVec2]| std::array::from_fn(|lane| chunk[lane]);
        Self {
            groups: points.chunks_exact(LANES).map(group).collect(),
            side: (PI / count as f64).sqrt(),
        }
    }

    /// Returns the points on the disc, group by group.
    pub(crate) fn points(&self) -> impl Iterator<Item = DVec2> {
        self.groups.iter().flatten().copied()
    }

    /// Returns the lower limit of the height above the disc with which the sides of a patch are
    /// computed. For a patch on the rim, it corresponds to the part of the patch inside the disc.
    pub(crate) fn lowest(&self) -> f64 {
        (self.side / 2.0).sqrt()
    }

    /// Returns the directions about a unit normal, in groups of sixteen, rotated by `turn` about the
    /// normal.
    pub(crate) fn above(
        &self,
        normal: DVec3,
        turn: f64,
    ) -> impl Iterator<Item = [Ray; LANES]> + use<'_> {
        let (t, b) = normal.any_orthonormal_pair();
        let turn = DVec2::from_angle(turn);
        let (t, b) = (t * turn.x + b * turn.y, b * turn.x - t * turn.y);
        let lowest = self.lowest();
        self.groups.iter().map(move |group| {
            group.map(|p| {
                let height = (1.0 - p.length_squared()).max(0.0).sqrt();
                let fall = normal / height.max(lowest);
                Ray {
                    direction: t * p.x + b * p.y + normal * height,
                    sides: [t - fall * p.x, b - fall * p.y].map(|side| side * self.side),
                }
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_are_spread_by_the_cosine_and_their_patches_cover_the_hemisphere() {
        for count in [16, 64, 240, 1024] {
            let normal = DVec3::new(0.3, -0.5, 0.8).normalize();
            let rays: Vec<Ray> = Hemisphere::new(count)
                .above(normal, 1.1)
                .flatten()
                .collect();
            assert_eq!(rays.len(), count);
            let n = count as f64;
            // Means of the cosine and of its square under the density cos / pi, which are 2/3 and
            // 1/2.
            let mean = |f: &dyn Fn(&Ray) -> f64| rays.iter().map(f).sum::<f64>() / n;
            let cos = mean(&|ray| ray.direction.dot(normal));
            let squares = mean(&|ray| ray.direction.dot(normal).powi(2));
            assert!((cos - 2.0 / 3.0).abs() < 0.03 / n, "{cos}");
            assert!((squares - 0.5).abs() < 1e-12, "{squares}");
            let aside = rays.iter().map(|r| r.direction).sum::<DVec3>() / n - normal * cos;
            assert!(aside.length() < 0.6 / n, "{aside}");
            for ray in &rays {
                assert!((ray.direction.length() - 1.0).abs() < 1e-12);
            }
            // Projected along the normal, the patches are squares that together cover the disc.
            let covered: f64 = rays
                .iter()
                .map(|r| r.sides[0].cross(r.sides[1]).dot(normal))
                .sum();
            assert!((covered - PI).abs() < 1e-9, "{covered}");
        }
    }

    #[test]
    fn groups_are_narrow() {
        let hemisphere = Hemisphere::new(256);
        for group in hemisphere.above(DVec3::Z, 0.0) {
            let mean = group.iter().map(|r| r.direction).sum::<DVec3>() / LANES as f64;
            assert!(mean.length() > 0.9, "{mean}");
        }
    }
}
