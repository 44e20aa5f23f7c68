//! A cloud as discs.

use super::disc::{Disc, least_spread};
use super::{Foot, widened};
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Cloud, Neighbours};
use rayon::prelude::*;

/// Discs looked at around a point.
const DISCS: usize = 8;
/// A disc reaches as far as the centre of its own fourth neighbour, which on a square grid is the
/// nearest ring: discs overlap, and do not close holes of the scan.
const REACH: usize = 4;
/// No disc is wider than this many times the median: a point alone has its neighbours far away, and
/// its disc would pass for surface where there is none.
const WIDEST: f64 = 3.0;

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
