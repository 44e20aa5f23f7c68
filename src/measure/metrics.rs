//! Distances between a measured cloud and the truth, in both directions.
//!
//! Let d(p, S) be the distance of a point to the nearest point of a surface S (the mesh itself, or
//! the discs of a cloud, see [`Surfels`]). For a direction X -> Y, take the values d(x, Y) over the
//! points x of X:
//!
//! - mean absolute error, MAE = mean d; it is that direction's mean distance to agreement;
//! - RMSE = sqrt(mean d^2);
//! - directed Hausdorff distance h = max d (D. Huttenlocher, G. Klanderman and W. Rucklidge,
//!   "Comparing Images Using the Hausdorff Distance", 1993, equations 1 and 2);
//! - 95th percentile of d, by the nearest rank;
//! - gross error rate: the fraction of d above [`GROSS_MM`].
//!
//! If the cloud states standard deviations s along the camera's rays, the values d / s show whether the
//! stated standard deviations are right ([`Stated`]). On a surface that the ray meets at an angle, d is
//! smaller than the error along the ray.
//!
//! Over both directions: the mean distance to agreement (MDTA) and the MAE are the mean of the two
//! directed means; RMSE is the root of the mean of the two mean squares; the Hausdorff distance and
//! the percentile are the larger of the two; the gross error rate is the mean of the two. Both
//! directions weigh the same, regardless of their number of points: the average symmetric surface
//! distance (T. Heimann et al., "Comparison and Evaluation of Methods for Liver Segmentation From
//! CT Datasets", 2009) pools the points instead, which would weight clouds by their density.

use super::surface::{Surface, Surfels, Truth};
use super::visible::{all_of, lit_and_seen};
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Cloud, Rig};
use serde::{Serialize, Serializer};
use std::fmt;

/// Distance above which an error counts as gross, in millimetres.
pub const GROSS_MM: f64 = 1.0;

/// Number of stated standard deviations above which an error counts as gross.
pub const GROSS_SIGMAS: f64 = 5.0;

/// Maximum number of points sampled on a true mesh, over its whole area.
const SAMPLES: usize = 200_000;

/// Distance statistics in one direction, or over both.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Directed {
    /// Number of distances.
    pub points: usize,
    /// Mean distance in millimetres: mean absolute error, mean distance to agreement.
    pub mae_mm: f64,
    /// Root of the mean squared distance, in millimetres.
    pub rmse_mm: f64,
    /// Largest distance in millimetres.
    pub hausdorff_mm: f64,
    /// 95th percentile in millimetres.
    pub p95_mm: f64,
    /// Fraction of distances above [`GROSS_MM`], 0 to 1.
    pub gross_error_rate: f64,
    /// RMS of the distances up to [`GROSS_MM`], in millimetres; 0 if there are none.
    pub inlier_rmse_mm: f64,
}

/// Errors in units of the standard deviations stated for them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Stated {
    /// RMS of error / standard deviation over the points up to [`GROSS_SIGMAS`]; NaN if there are none.
    pub error_over_sigma: f64,
    /// Fraction of points beyond [`GROSS_SIGMAS`], or without a standard deviation above 0; NaN if
    /// there are no points.
    pub beyond_5_sigma: f64,
}

impl Stated {
    /// Returns the statistics of errors and their standard deviations. A NaN counts as beyond
    /// [`GROSS_SIGMAS`].
    pub fn of(all: impl Iterator<Item = (f64, f64)>) -> Self {
        let (mut points, mut within, mut sum) = (0usize, 0usize, 0.0);
        for (error, sigma) in all {
            points += 1;
            let ratio = error.abs() / sigma;
            if sigma > 0.0 && ratio <= GROSS_SIGMAS {
                within += 1;
                sum += ratio * ratio;
            }
        }
        Self {
            error_over_sigma: (sum / within as f64).sqrt(),
            beyond_5_sigma: (points - within) as f64 / points as f64,
        }
    }
}

/// Why a cloud is compared with the truth in one direction only. It displays as a message for users.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum OneWay {
    /// The true surface is a mesh, without a calibration.
    NoRig,
    /// The calibrated rig sees and lights nothing of the mesh.
    NothingVisible,
}

impl fmt::Display for OneWay {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoRig => "a mesh needs a calibration to determine which parts are lit and seen",
            Self::NothingVisible => "the calibrated rig sees and lights nothing of the mesh",
        })
    }
}

impl Serialize for OneWay {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Comparison of a cloud with the truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Number of measured points used.
    pub points: usize,
    /// Number of measured points ignored because a coordinate is not finite.
    pub points_ignored: usize,
    /// Distances from each measured point to the true surface.
    pub cloud_to_truth: Directed,
    /// Distances from each measured point to the true surface in units of the point's standard
    /// deviation, if the cloud states any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stated: Option<Stated>,
    /// Distances from each lit and seen true point to the measured surface.
    pub truth_to_cloud: Option<Directed>,
    /// Reason if `truth_to_cloud` is absent. It is serialized as its message.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth_to_cloud_absent: Option<OneWay>,
    /// Statistics over both directions.
    pub both: Option<Directed>,
    /// Mean distance to agreement over both directions, in millimetres.
    pub mdta_mm: Option<f64>,
    /// Fraction of the lit and seen truth with measured surface within [`GROSS_MM`].
    pub coverage: Option<f64>,
}

impl Directed {
    /// Returns the statistics of a set of distances; `None` if it is empty.
    pub fn of(mut distances: Vec<f64>) -> Option<Self> {
        if distances.is_empty() {
            return None;
        }
        // Sum in order of size, so that the result does not depend on the order of the points.
        distances.sort_unstable_by(f64::total_cmp);
        let points = distances.len();
        let n = points as f64;
        let inliers = &distances[..distances.partition_point(|&d| d <= GROSS_MM)];
        let mean_square =
            |all: &[f64]| all.iter().map(|d| d * d).sum::<f64>() / all.len().max(1) as f64;
        Some(Self {
            points,
            mae_mm: distances.iter().sum::<f64>() / n,
            rmse_mm: mean_square(&distances).sqrt(),
            hausdorff_mm: distances[points - 1],
            p95_mm: distances[(0.95 * n).ceil() as usize - 1],
            gross_error_rate: (points - inliers.len()) as f64 / n,
            inlier_rmse_mm: mean_square(inliers).sqrt(),
        })
    }

    fn both(a: &Self, b: &Self) -> Self {
        let mean = |f: fn(&Self) -> f64| (f(a) + f(b)) / 2.0;
        Self {
            points: a.points + b.points,
            mae_mm: mean(|d| d.mae_mm),
            rmse_mm: mean(|d| d.rmse_mm * d.rmse_mm).sqrt(),
            hausdorff_mm: a.hausdorff_mm.max(b.hausdorff_mm),
            p95_mm: a.p95_mm.max(b.p95_mm),
            gross_error_rate: mean(|d| d.gross_error_rate),
            inlier_rmse_mm: mean(|d| d.inlier_rmse_mm * d.inlier_rmse_mm).sqrt(),
        }
    }
}

/// Compares a cloud with the truth, both in millimetres in the same frame. `surface` is
/// `Surface::new(truth)`; `rig`, in the same frame, determines which parts of a true mesh count.
///
/// # Errors
/// Returns an error if the cloud has no finite point.
pub fn compare(
    cloud: &Cloud,
    truth: &Truth,
    surface: &Surface,
    rig: Option<&Rig>,
) -> Result<Comparison> {
    let points = finite_points(cloud)?;
    let feet = surface.closest_batch(&points);
    let of_feet = || feet.iter().flatten().map(|foot| foot.distance_mm);
    let stated = cloud.sigma_mm.as_ref().map(|sigmas| {
        let is_finite = |(p, _): &(&[f32; 3], &f32)| p.iter().all(|x| x.is_finite());
        let sigmas = cloud.points.iter().zip(sigmas).filter(is_finite);
        let pairs = feet.iter().zip(sigmas);
        Stated::of(pairs.filter_map(|(foot, (_, s))| Some(((*foot)?.distance_mm, f64::from(*s)))))
    });
    let cloud_to_truth = Directed::of(of_feet().collect()).ok_or_else(|| {
        Error::input(
            "truth",
            "an empty surface",
            "a surface with triangles or points",
        )
    })?;
    let visible = match (truth, surface, rig) {
        (Truth::Cloud(cloud), ..) => Ok(all_of(cloud)),
        (Truth::Mesh(mesh), Surface::Mesh(tree), Some(rig)) => {
            let visible = lit_and_seen(mesh, tree, rig, SAMPLES);
            if visible.is_empty() {
                Err(OneWay::NothingVisible)
            } else {
                Ok(visible)
            }
        }
        _ => Err(OneWay::NoRig),
    };
    let (truth_to_cloud, absent) = match visible {
        Ok(visible) => {
            let measured = Surface::Cloud(Surfels::new(cloud)?);
            (distances(&measured, &visible), None)
        }
        Err(why) => (None, Some(why)),
    };
    let both = truth_to_cloud.map(|back| Directed::both(&cloud_to_truth, &back));
    Ok(Comparison {
        points: points.len(),
        points_ignored: cloud.points.len() - points.len(),
        cloud_to_truth,
        stated,
        truth_to_cloud,
        truth_to_cloud_absent: absent,
        both,
        mdta_mm: both.map(|b| b.mae_mm),
        coverage: truth_to_cloud.map(|d| 1.0 - d.gross_error_rate),
    })
}

/// Returns the finite points of a cloud, or an error if there are none.
pub(super) fn finite_points(cloud: &Cloud) -> Result<Vec<DVec3>> {
    let points = all_of(cloud);
    if points.is_empty() {
        return Err(Error::input(
            "cloud",
            format!("{} points, none of them finite", cloud.points.len()),
            "at least one finite point",
        ));
    }
    Ok(points)
}

fn distances(surface: &Surface, points: &[DVec3]) -> Option<Directed> {
    let feet = surface.closest_batch(points);
    Directed::of(feet.iter().flatten().map(|f| f.distance_mm).collect())
}

#[cfg(test)]
mod tests {
    use super::super::visible::tests::rig;
    use super::*;
    use phasmid_geometry::Mesh;

    fn floor(z: f64) -> Mesh {
        Mesh {
            vertices: [
                (-200.0, -200.0),
                (200.0, -200.0),
                (200.0, 200.0),
                (-200.0, 200.0),
            ]
            .map(|(x, y)| DVec3::new(x, y, z))
            .to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        }
    }

    fn grid(half: i32, z: f32) -> Cloud {
        Cloud {
            points: (-half..=half)
                .flat_map(|x| (-half..=half).map(move |y| [2.0 * x as f32, 2.0 * y as f32, z]))
                .collect(),
            ..Cloud::default()
        }
    }

    fn against(cloud: &Cloud, truth: &Truth, rig: Option<&Rig>) -> Comparison {
        compare(cloud, truth, &Surface::new(truth).unwrap(), rig).unwrap()
    }

    #[test]
    fn figures_of_known_distances_match_closed_forms() {
        let d = Directed::of((1..=100).map(|i| f64::from(i) / 50.0).collect()).unwrap();
        assert_eq!(d.points, 100);
        assert!((d.mae_mm - 1.01).abs() < 1e-12);
        // The squares of 1 to n add up to n (n + 1) (2 n + 1) / 6.
        assert!((d.rmse_mm - (338_350.0_f64 / 100.0).sqrt() / 50.0).abs() < 1e-12);
        assert_eq!((d.hausdorff_mm, d.p95_mm), (2.0, 1.9));
        assert_eq!(d.gross_error_rate, 0.5);
        assert!((d.inlier_rmse_mm - (42_925.0_f64 / 50.0).sqrt() / 50.0).abs() < 1e-12);
        assert_eq!(Directed::of(vec![]), None);
    }

    #[test]
    fn figures_of_an_offset_plane_with_a_hole_are_exact() {
        // Offset by a quarter millimetre; the scan covers the left half of the floor.
        let truth = Truth::Mesh(floor(1000.0));
        let mut cloud = grid(100, 1000.25);
        cloud.points.retain(|p| p[0] <= 0.0);
        cloud.points.push([f32::NAN, 0.0, 0.0]);
        let found = against(&cloud, &truth, Some(&rig()));
        assert_eq!((found.points, found.points_ignored), (101 * 201, 1));
        let to = found.cloud_to_truth;
        for value in [to.mae_mm, to.rmse_mm, to.hausdorff_mm, to.p95_mm] {
            assert!((value - 0.25).abs() < 1e-12, "{value}");
        }
        let back = found.truth_to_cloud.unwrap();
        // At the border of a grid the fourth neighbour is the diagonal one, 2.83 mm away: discs
        // extend that far beyond x = 0, and the error becomes gross where the distance reaches 1 mm
        // at a height of 0.25 mm.
        let covered = 200.0 + 8_f64.sqrt() + (1.0_f64 - 0.0625).sqrt();
        let coverage = found.coverage.unwrap();
        assert!((coverage - covered / 400.0).abs() < 0.003, "{coverage}");
        let farthest = 200.0 - 8_f64.sqrt();
        assert!((back.hausdorff_mm - farthest).abs() < 0.3, "{back:?}");
        assert!((back.inlier_rmse_mm - 0.25).abs() < 0.01, "{back:?}");
        assert_eq!(found.mdta_mm.unwrap(), (to.mae_mm + back.mae_mm) / 2.0);
    }

    #[test]
    fn stated_deviations_are_compared_with_distances() {
        let truth = Truth::Mesh(floor(1000.0));
        let mut cloud = grid(4, 1000.5);
        // The first of 81 points is six standard deviations off, one is not finite.
        cloud.points[0][2] = 1001.5;
        cloud.points.push([f32::NAN; 3]);
        cloud.sigma_mm = Some(vec![0.25; 82]);
        let found = against(&cloud, &truth, None).stated.unwrap();
        assert_eq!(found.beyond_5_sigma, 1.0 / 81.0);
        assert_eq!(found.error_over_sigma, 2.0);
        cloud.sigma_mm = Some(vec![0.0; 82]);
        assert_eq!(
            against(&cloud, &truth, None).stated.unwrap().beyond_5_sigma,
            1.0
        );
        assert_eq!(against(&grid(4, 1000.0), &truth, None).stated, None);
    }

    #[test]
    fn without_a_rig_a_mesh_has_one_direction() {
        let found = against(&grid(50, 999.5), &Truth::Mesh(floor(1000.0)), None);
        assert_eq!(found.cloud_to_truth.mae_mm, 0.5);
        assert_eq!((found.truth_to_cloud, found.coverage), (None, None));
        assert_eq!(found.truth_to_cloud_absent, Some(OneWay::NoRig));
        // A rig that looks elsewhere sees nothing of the mesh.
        let behind = against(&grid(5, 1.0), &Truth::Mesh(floor(-1000.0)), Some(&rig()));
        let absent = behind.truth_to_cloud_absent;
        assert_eq!(absent, Some(OneWay::NothingVisible));
    }

    #[test]
    fn a_cloud_as_truth_goes_both_ways() {
        let truth = Truth::Cloud(grid(60, 1000.0));
        let found = against(&grid(50, 1000.125), &truth, None);
        assert_eq!(found.cloud_to_truth.hausdorff_mm, 0.125);
        let back = found.truth_to_cloud.unwrap();
        // The truth's corner is 20 mm from the cloud's along both axes. The disc of the cloud's
        // corner has a radius of 4 mm: its fourth neighbour is the point after next.
        let corner = (20.0 * 2_f64.sqrt() - 4.0).hypot(0.125);
        assert!((back.hausdorff_mm - corner).abs() < 1e-6, "{back:?}");
        let measured = 101.0 * 101.0 / (121.0 * 121.0);
        let coverage = found.coverage.unwrap();
        assert!(
            coverage >= measured && coverage < measured * 1.06,
            "{coverage}"
        );
    }

    #[test]
    fn refuses_cloud_without_finite_points() {
        let truth = Truth::Mesh(floor(0.0));
        let surface = Surface::new(&truth).unwrap();
        let empty = Cloud {
            points: vec![[f32::NAN; 3]; 7],
            ..Cloud::default()
        };
        let error = compare(&empty, &truth, &surface, None).unwrap_err();
        assert!(error.to_string().contains("7 points, none of them finite"));
    }
}
