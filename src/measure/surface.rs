//! Surfaces that a distance can be measured to: a mesh exactly, a cloud by the discs that it is
//! taken to sample.

use crate::error::{Error, Result};
use crate::geometry::{Cloud, Mesh, MeshTree, Neighbours, ply};
use glam::DVec3;
use nalgebra::Matrix3;
use rayon::prelude::*;
use std::path::Path;

/// Discs looked at around a point.
const DISCS: usize = 8;
/// A disc reaches as far as the centre of its own fourth neighbour, which on a square grid is the
/// nearest ring: discs overlap, and do not close holes of the scan.
const REACH: usize = 4;
/// No disc is wider than this many times the median: a point alone has its neighbours far away, and
/// its disc would pass for surface where there is none.
const WIDEST: f64 = 3.0;

/// What a cloud is held against, as a file gave it.
#[derive(Debug, Clone, PartialEq)]
pub enum Truth {
    /// A surface known everywhere, in millimetres in the rig's frame.
    Mesh(Mesh),
    /// Points that are all lit and seen, in the rig's frame.
    Cloud(Cloud),
}

impl Truth {
    /// Reads `.stl`, `.obj` or `.ply`; a PLY file without faces is a cloud.
    ///
    /// # Errors
    /// As [`Mesh::read`] and [`ply::read_cloud`].
    pub fn read(path: &Path) -> Result<Self> {
        if path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("ply"))
        {
            return Ok(match ply::read(path)? {
                ply::Ply::Mesh(mesh) => Self::Mesh(mesh),
                ply::Ply::Cloud(cloud) => Self::Cloud(cloud),
            });
        }
        Mesh::read(path).map(Self::Mesh)
    }
}

/// A surface ready for queries.
pub enum Surface {
    /// Triangles.
    Mesh(MeshTree),
    /// Discs around points.
    Cloud(Surfels),
}

/// Where a surface is nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Foot {
    /// The nearest point of the surface, in millimetres.
    pub point: DVec3,
    /// Distance to it in millimetres.
    pub distance_mm: f64,
    /// Unit normal there, its sign as the file or the winding has it; zero where there is none.
    pub normal: DVec3,
}

impl Surface {
    /// Makes a truth ready for queries.
    ///
    /// # Errors
    /// A cloud without a finite point.
    pub fn new(truth: &Truth) -> Result<Self> {
        Ok(match truth {
            Truth::Mesh(mesh) => Self::Mesh(MeshTree::new(mesh)),
            Truth::Cloud(cloud) => Self::Cloud(Surfels::new(cloud)?),
        })
    }

    /// The nearest point of the surface; `None` for a `p` that is not finite.
    pub fn closest(&self, p: DVec3) -> Option<Foot> {
        match self {
            Self::Mesh(tree) => tree.closest(p).map(|c| Foot {
                point: c.point,
                distance_mm: c.distance_mm,
                normal: c.normal,
            }),
            Self::Cloud(surfels) => surfels.closest(p),
        }
    }

    /// [`Self::closest`] of many points, over all cores.
    pub fn closest_batch(&self, points: &[DVec3]) -> Vec<Option<Foot>> {
        points
            .par_iter()
            .with_min_len(256)
            .map(|&p| self.closest(p))
            .collect()
    }
}

/// A cloud as discs (H. Pfister et al., "Surfels: Surface Elements as Rendering Primitives", 2000):
/// one a point, perpendicular to its normal, as wide as the distance to its fourth neighbour, but no
/// wider than three times the median width.
///
/// Normals are the cloud's own; where it has none, each is the direction in which the point and its
/// eight neighbours vary least (H. Hoppe et al., "Surface Reconstruction from Unorganized Points",
/// 1992).
///
/// Of the eight points nearest to p, the nearest whose disc p lies over tells the distance: along
/// its normal. Where p lies over none of them (beside the scan or over a hole), it is the distance
/// to the nearest rim. The least distance to any of the eight would be too kind: discs overlap, and
/// the best of several noisy ones says 0.3 sigma where a point is 0.8 sigma off in the mean. A
/// tangent disc stands off a surface of radius R by t^2 / 2R at t from its centre: at a spacing of
/// 1 mm on R = 100 mm by 3 um at most.
pub struct Surfels {
    tree: Neighbours,
    /// Centre, unit normal (or zero) and radius by the index of the point.
    discs: Vec<Disc>,
}

#[derive(Clone, Copy)]
struct Disc {
    centre: DVec3,
    normal: DVec3,
    radius: f64,
}

impl Surfels {
    /// Makes the discs, over all cores. Points that are not finite are left out.
    ///
    /// # Errors
    /// A cloud without a finite point.
    pub fn new(cloud: &Cloud) -> Result<Self> {
        let tree = Neighbours::new(&cloud.points);
        if tree.is_empty() {
            return Err(Error::input(
                "cloud",
                format!("{} points, none of them finite", cloud.points.len()),
                "at least one finite point",
            ));
        }
        let given = cloud.normals.as_deref();
        let mut discs: Vec<Disc> = (0..cloud.points.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|i| {
                let centre = widened(cloud.points[i]);
                let around = tree.nearest::<{ DISCS + 1 }>(centre);
                let around = around.as_slice();
                // The first is the point itself.
                let fourth = around.get(REACH).or(around.last());
                let normal = given
                    .and_then(|n| n.get(i))
                    .and_then(|&n| widened(n).try_normalize())
                    .or_else(|| least_spread(around.iter().map(|n| cloud.points[n.1 as usize])))
                    .unwrap_or(DVec3::ZERO);
                Disc {
                    centre,
                    normal,
                    radius: fourth.map_or(0.0, |n| n.0.sqrt()),
                }
            })
            .collect();
        let mut radii: Vec<f64> = discs.iter().map(|d| d.radius).collect();
        let middle = radii.len() / 2;
        let (_, median, _) = radii.select_nth_unstable_by(middle, f64::total_cmp);
        let widest = WIDEST * *median;
        for disc in &mut discs {
            // Without a normal there is no disc, only the point.
            let most = if disc.normal == DVec3::ZERO {
                0.0
            } else {
                widest
            };
            disc.radius = disc.radius.min(most);
        }
        Ok(Self { tree, discs })
    }

    /// The nearest point of the discs; `None` for a `p` that is not finite.
    pub fn closest(&self, p: DVec3) -> Option<Foot> {
        let found = self.tree.nearest::<DISCS>(p);
        let near = || found.as_slice().iter().map(|n| &self.discs[n.1 as usize]);
        near().find_map(|disc| disc.below(p)).or_else(|| {
            near()
                .map(|disc| disc.closest(p))
                .min_by(|a, b| a.distance_mm.total_cmp(&b.distance_mm))
        })
    }
}

impl Disc {
    /// The foot of the perpendicular, if it is on the disc.
    fn below(&self, p: DVec3) -> Option<Foot> {
        let height = (p - self.centre).dot(self.normal);
        let point = p - self.normal * height;
        let over = (point - self.centre).length_squared() <= self.radius * self.radius;
        (over && self.radius > 0.0).then_some(Foot {
            point,
            distance_mm: height.abs(),
            normal: self.normal,
        })
    }

    fn closest(&self, p: DVec3) -> Foot {
        let offset = p - self.centre;
        let in_plane = offset - self.normal * offset.dot(self.normal);
        let point = self.centre + in_plane.clamp_length_max(self.radius);
        Foot {
            point,
            distance_mm: (p - point).length(),
            normal: self.normal,
        }
    }
}

/// The unit direction in which points vary least; `None` if they do not span a plane.
fn least_spread(points: impl Iterator<Item = [f32; 3]> + Clone) -> Option<DVec3> {
    let count = points.clone().count() as f64;
    let mean = points.clone().map(widened).sum::<DVec3>() / count;
    let mut spread = Matrix3::zeros();
    for p in points {
        let d = widened(p) - mean;
        let d = nalgebra::Vector3::new(d.x, d.y, d.z);
        spread += d * d.transpose();
    }
    let eigen = spread.symmetric_eigen();
    let values = eigen.eigenvalues;
    let (least, most) = (values.imin(), values.imax());
    if least == most {
        return None;
    }
    let middle = values[3 - least - most];
    // Points on a line, or all in one place, have no plane.
    if middle.is_nan() || middle <= 1e-6 * values[most] {
        return None;
    }
    let v = eigen.eigenvectors.column(least);
    DVec3::new(v[0], v[1], v[2]).try_normalize()
}

pub(super) fn widened(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square grid on z = 0.1 x, 1 mm apart in x and y.
    fn slope(normals: bool) -> Cloud {
        let points: Vec<[f32; 3]> = (-20..=20)
            .flat_map(|x| (-20..=20).map(move |y| [x as f32, y as f32, 0.1 * x as f32]))
            .collect();
        let n = (DVec3::new(0.1, 0.0, -1.0))
            .normalize()
            .as_vec3()
            .to_array();
        Cloud {
            normals: normals.then(|| vec![n; points.len()]),
            points,
            intensity: None,
        }
    }

    #[test]
    fn distance_to_a_sampled_plane() {
        let n = DVec3::new(0.1, 0.0, -1.0).normalize();
        for normals in [true, false] {
            let surfels = Surfels::new(&slope(normals)).unwrap();
            // Between the samples, 0.3 mm off along the normal.
            for (x, y) in [(0.0, 0.0), (0.5, 0.5), (3.2, -7.7), (-12.4, 5.1)] {
                let on = DVec3::new(x, y, 0.1 * x);
                for side in [-0.3, 0.3] {
                    let foot = surfels.closest(on + n * side).unwrap();
                    assert!((foot.distance_mm - 0.3).abs() < 1e-6, "{foot:?}");
                    assert!((foot.point - on).length() < 1e-6);
                    assert!(foot.normal.dot(n).abs() > 1.0 - 1e-9);
                }
            }
            // Beyond the border a disc ends: not a plane without end.
            let foot = surfels.closest(DVec3::new(0.0, 26.0, 0.0)).unwrap();
            assert!((4.0..6.0).contains(&foot.distance_mm), "{foot:?}");
        }
    }

    #[test]
    fn a_cloud_samples_a_sphere() {
        let radius = 100.0;
        let points: Vec<[f32; 3]> = (0..20_000)
            .map(|i| {
                // Fibonacci's spiral, some 2.5 mm apart.
                let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 20_000.0;
                let (sin, cos) = (2.399_963_229_728_653 * f64::from(i)).sin_cos();
                let r = (1.0 - z * z).sqrt();
                (DVec3::new(r * cos, r * sin, z) * radius)
                    .as_vec3()
                    .to_array()
            })
            .collect();
        let surfels = Surfels::new(&Cloud {
            points,
            ..Cloud::default()
        })
        .unwrap();
        for i in 0..500 {
            let t = f64::from(i) * 0.7;
            let out = DVec3::new(t.sin(), t.cos(), (0.3 * t).sin()).normalize();
            let d = surfels.closest(out * (radius + 0.5)).unwrap().distance_mm;
            // t^2 / 2R with t up to 0.7 of the spacing is 0.016; normals by neighbours do the rest.
            assert!((d - 0.5).abs() < 0.02, "{d}");
        }
    }

    #[test]
    fn noise_is_neither_hidden_nor_doubled() {
        // A grid 1 mm apart with noise of 0.05 mm RMS, uniform: |d| is 0.866 of that in the mean.
        let noise = |i: i32, j: i32| {
            let hash = (i.wrapping_mul(73_856_093) ^ j.wrapping_mul(19_349_663)) as u32;
            let mixed = hash
                .wrapping_mul(2_654_435_769)
                .rotate_left(13)
                .wrapping_mul(0x85eb_ca6b);
            (f64::from(mixed >> 8) / f64::from(1 << 24) - 0.5) * 12_f64.sqrt() * 0.05
        };
        let points = (-40..=40)
            .flat_map(|i| (-40..=40).map(move |j| [i as f32, j as f32, noise(i, j) as f32]))
            .collect();
        let surfels = Surfels::new(&Cloud {
            points,
            ..Cloud::default()
        })
        .unwrap();
        let mean = (0..3000)
            .map(|k| {
                let (u, v) = (f64::from(k) * 0.754_877_67, f64::from(k) * 0.569_840_29);
                let p = DVec3::new(70.0 * u.fract() - 35.0, 70.0 * v.fract() - 35.0, 0.0);
                surfels.closest(p).unwrap().distance_mm
            })
            .sum::<f64>()
            / 3000.0;
        assert!((mean / (0.866 * 0.05) - 1.0).abs() < 0.1, "{mean}");
    }

    #[test]
    fn a_point_alone_does_not_cover_a_hole() {
        let mut cloud = slope(false);
        cloud.points.retain(|p| p[0].hypot(p[1]) > 10.0);
        cloud.points.push([0.0, 0.0, 5.0]);
        let surfels = Surfels::new(&cloud).unwrap();
        let d = surfels.closest(DVec3::ZERO).unwrap().distance_mm;
        assert!(d > 3.0, "{d}");
    }

    #[test]
    fn coincident_and_collinear_points_do_no_harm() {
        for points in [
            vec![[1.0, 2.0, 3.0]],
            vec![[1.0, 2.0, 3.0]; 50],
            (0..50).map(|i| [i as f32, 2.0, 3.0]).collect(),
        ] {
            let surfels = Surfels::new(&Cloud {
                points,
                ..Cloud::default()
            })
            .unwrap();
            let d = surfels
                .closest(DVec3::new(1.0, 2.0, 5.0))
                .unwrap()
                .distance_mm;
            assert_eq!(d, 2.0);
        }
        let none = Cloud {
            points: vec![[f32::NAN; 3]; 3],
            ..Cloud::default()
        };
        assert!(Surfels::new(&none).is_err());
    }
}
