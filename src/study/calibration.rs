//! Compares a calibration of an emulated device with the truth, which is known only for emulated
//! devices.

use phasmid_calibrate::solve::{Solution, chi_square_bound};
use phasmid_geometry::{Pose, Rig, View};
use serde::Serialize;

/// Errors of a calibration, as in `truth.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Truth {
    /// Squared Mahalanobis distance between solution and truth, over lenses, rig and all poses together.
    pub mahalanobis_squared: f64,
    /// Number of parameters in this distance.
    pub degrees_of_freedom: usize,
    /// The 99 % quantile of the chi-square distribution with this number of degrees of freedom.
    pub bound_99: f64,
    /// Whether the distance is below the bound.
    pub within_bound: bool,
    /// The parameters of lenses and rig, one by one.
    pub parameters: Vec<Difference>,
    /// Largest distance, in millimetres, of a board's middle from its true position.
    pub largest_pose_error_mm: f64,
    /// Largest angle, in degrees, between the estimated and the true pose of a board.
    pub largest_pose_error_deg: f64,
}

/// An estimated number and its true value.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// Name of the parameter.
    pub name: String,
    /// `px`, `mm`, `deg`, or empty.
    pub unit: &'static str,
    /// True value.
    pub truth: f64,
    /// Estimated minus true.
    pub error: f64,
}

impl Truth {
    /// Compares a solution with the true rig and the true poses of the boards (`camera_from_board`, in
    /// the order of the solver's input).
    pub fn new(solution: &Solution, rig: &Rig, shown: &[Pose]) -> Self {
        let used: Vec<Pose> = solution
            .poses
            .iter()
            .filter_map(|pose| shown.get(pose.given).copied())
            .collect();
        let (mahalanobis_squared, degrees_of_freedom) = solution.mahalanobis(rig, Some(&used));
        let bound_99 = chi_square_bound(0.99, degrees_of_freedom);
        let off = |of: &dyn Fn(&Pose, &Pose) -> f64| {
            let pairs = solution.poses.iter().zip(&used);
            let errors = pairs.map(|(pose, shown)| of(&pose.camera_from_board, shown));
            errors.fold(0.0, f64::max)
        };
        Self {
            mahalanobis_squared,
            degrees_of_freedom,
            bound_99,
            within_bound: mahalanobis_squared <= bound_99,
            parameters: differences(&solution.rig, rig),
            largest_pose_error_mm: off(&|a, b| a.translation_mm.distance(b.translation_mm)),
            largest_pose_error_deg: off(&angle_deg),
        }
    }
}

/// Returns the angle of the rotation between two poses, from the sine of half the angle: precise for
/// small angles.
fn angle_deg(a: &Pose, b: &Pose) -> f64 {
    let off = a.rotation - b.rotation;
    // |A - B| (Frobenius) = 2 sqrt(2) sin(angle / 2).
    let square: f64 = off.to_cols_array().iter().map(|v| v * v).sum();
    let half = (square.sqrt() / 8.0_f64.sqrt()).min(1.0).asin();
    2.0 * half.to_degrees()
}

fn differences(found: &Rig, truth: &Rig) -> Vec<Difference> {
    let camera_from_projector =
        |rig: &Rig| rig.camera.rig_from_view.inverse() * rig.projector.rig_from_view;
    let [found_pose, true_pose] = [found, truth].map(camera_from_projector);
    let mut all = lens("camera", &found.camera, &truth.camera);
    all.extend(lens("projector", &found.projector, &truth.projector));
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let truth = true_pose.translation_mm[axis];
        all.push(Difference {
            name: format!("projector.{name}"),
            unit: "mm",
            truth,
            error: found_pose.translation_mm[axis] - truth,
        });
    }
    all.push(Difference {
        name: "projector.turn".to_owned(),
        unit: "deg",
        truth: 0.0,
        error: angle_deg(&found_pose, &true_pose),
    });
    all
}

fn lens(view: &str, found: &View, truth: &View) -> Vec<Difference> {
    let numbers = |view: &View| {
        let lens = &view.lens;
        let [k1, k2, p1, p2, k3] = lens.distortion;
        [
            ("fx", "px", lens.focal_px.x),
            ("fy", "px", lens.focal_px.y),
            ("cx", "px", lens.principal_px.x),
            ("cy", "px", lens.principal_px.y),
            ("k1", "", k1),
            ("k2", "", k2),
            ("p1", "", p1),
            ("p2", "", p2),
            ("k3", "", k3),
        ]
    };
    let pairs = numbers(found).into_iter().zip(numbers(truth));
    let difference =
        |((name, unit, found), (_, _, truth)): ((&str, _, f64), (_, _, f64))| Difference {
            name: format!("{view}.{name}"),
            unit,
            truth,
            error: found - truth,
        };
    pairs.map(difference).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn angles_are_exact_where_they_are_small_and_large() {
        let turned = |deg| Pose::from_xyz_deg(DVec3::ZERO, DVec3::new(0.0, deg, 0.0));
        for deg in [0.0, 1e-7, 1.0, 90.0, 179.0] {
            let found = angle_deg(&turned(deg), &turned(0.0));
            assert!((found - deg).abs() < 1e-6 * deg.max(1e-3), "{deg}: {found}");
        }
    }

    #[test]
    fn what_differs_is_named() {
        let rig = phasmid_profile::Profile::load("pmp-bench")
            .unwrap()
            .nominal_rig();
        assert!(differences(&rig, &rig).iter().all(|d| d.error == 0.0));
        let mut other = rig;
        other.camera.lens.distortion[1] = 0.5;
        other.projector.rig_from_view.translation_mm.z = -2.0;
        let off: Vec<_> = differences(&other, &rig)
            .into_iter()
            .filter(|d| d.error != 0.0)
            .map(|d| (d.name, d.error))
            .collect();
        let wanted = [
            ("camera.k2".to_owned(), 0.5),
            ("projector.z".to_owned(), -2.0),
        ];
        assert_eq!(off, wanted);
    }
}
