//! Plausibility checks of a solution: an error if it is unusable, warnings if it is doubtful.

use super::refusal::{LITTLE_TILT_DEG, TILTS_WANTED, largest_angle_deg};
use super::{Choice, Coefficients, Parameter, PoseSightings, Solution, Unsolved};
use glam::{DVec2, DVec3};
use std::collections::HashSet;

/// Maximum relative standard deviation of a focal length. Above it the solution is rejected: the
/// covariance is a first-order approximation, and the terms it neglects are quadratic.
const WORST_FOCAL: f64 = 0.03;
/// Maximum RMS residual as a fraction of the image's diagonal. The solution is rejected if
/// residuals exceed it and are also more than ten times as large as their covariances predict.
const WORST_FIT: f64 = 0.01;
/// Fewer poses than this cause a warning.
const FEW_POSES: usize = 5;
/// Columns and rows of the grid on which image coverage is measured.
const CELLS: [u32; 2] = [8, 6];
/// If points cover a smaller fraction of the grid's cells than this, a warning is issued.
const LITTLE_COVERAGE: f64 = 0.5;
/// Maximum relative standard deviation of focal lengths and baseline without a warning. The
/// standard deviation of a principal point is taken relative to the image's width.
const VAGUE: f64 = 0.01;
/// Correlations between the rig's parameters above this magnitude cause a warning.
const CORRELATED: f64 = 0.999;
/// Variance inflation above this causes a warning.
const INFLATED: f64 = 1.5;
/// Fraction of outliers above which a warning is issued.
const OUTLIERS: f64 = 0.01;
/// A pose causes a warning if its whitened RMS residual exceeds that of all poses together by this
/// factor.
const UNEVEN: f64 = 2.0;

/// Returns an error if the solution is too uncertain, folds an image over, or does not fit the
/// data.
pub(super) fn refuse(solution: &Solution) -> Result<(), Unsolved> {
    let angle = largest_angle(solution);
    let vague = focal_lengths(solution).find(|p| !(p.sigma <= WORST_FOCAL * p.value));
    if let Some(p) = vague {
        let found = format!(
            "{} = {:.4} with a standard deviation of {:.2} {} from {} poses; the largest angle between two boards is {angle:.1} degrees",
            p.name,
            p.value,
            p.sigma,
            p.unit,
            solution.poses.len(),
        );
        let wanted = TILTS_WANTED.to_owned();
        return Err(if angle < LITTLE_TILT_DEG {
            Unsolved::Parallel { found, wanted }
        } else {
            Unsolved::Undetermined { found, wanted }
        });
    }
    let rig = &solution.rig;
    for (name, errors, lens) in [
        ("camera", &solution.camera_errors, &rig.camera.lens),
        ("projector", &solution.projector_errors, &rig.projector.lens),
    ] {
        if let Some(corner) = lens.folds_before() {
            return Err(Unsolved::Undetermined {
                found: format!(
                    "the {name}'s coefficients fold the image over before pixel ({:.0}, {:.0})",
                    corner.x, corner.y
                ),
                wanted: "fewer coefficients, or points nearer to the image's corners".to_owned(),
            });
        }
        let diagonal = f64::from(lens.width_px).hypot(f64::from(lens.height_px));
        if errors.rms_px > WORST_FIT * diagonal && errors.whitened_rms > 10.0 {
            return Err(Unsolved::Undetermined {
                found: format!(
                    "{name} points lie {:.1} px (RMS) from where the best rig expects them",
                    errors.rms_px
                ),
                wanted: format!(
                    "sightings of one rigid rig and one flat board, within {:.1} px",
                    WORST_FIT * diagonal
                ),
            });
        }
    }
    Ok(())
}

/// Warnings about a solution that is usable but doubtful.
pub(super) fn warnings(
    solution: &Solution,
    given: &[PoseSightings],
    choice: &Choice,
) -> Vec<String> {
    let mut all = Vec::new();
    poses(solution, &mut all);
    coverage(solution, given, &mut all);
    fit(solution, &mut all);
    parameters(solution, choice, &mut all);
    all
}

fn poses(solution: &Solution, all: &mut Vec<String>) {
    let count = solution.poses.len();
    if count < FEW_POSES {
        all.push(format!(
            "{count} poses are used; expected {FEW_POSES} or more"
        ));
    }
    let angle = largest_angle(solution);
    if angle < LITTLE_TILT_DEG {
        all.push(format!(
            "the largest angle between two boards is {angle:.1} degrees; expected {LITTLE_TILT_DEG} or more"
        ));
    }
}

fn coverage(solution: &Solution, given: &[PoseSightings], all: &mut Vec<String>) {
    let used = || solution.poses.iter().filter_map(|p| given.get(p.given));
    let points = || used().flat_map(|p| &p.sightings);
    let camera: Vec<DVec2> = points().map(|s| s.camera_px).collect();
    let projector: Vec<DVec2> = points().filter_map(|s| s.projector).map(|l| l.px).collect();
    let rig = &solution.rig;
    for (name, points, lens) in [
        ("camera", camera, &rig.camera.lens),
        ("projector", projector, &rig.projector.lens),
    ] {
        let cells: HashSet<[u32; 2]> = points
            .into_iter()
            .filter(|p| lens.contains(*p))
            .map(|p| {
                let [width, height] = [lens.width_px, lens.height_px].map(f64::from);
                let cell = |p: f64, size: f64, count: u32| {
                    (((p + 0.5) / size * f64::from(count)) as u32).min(count - 1)
                };
                [cell(p.x, width, CELLS[0]), cell(p.y, height, CELLS[1])]
            })
            .collect();
        let total = CELLS[0] * CELLS[1];
        let share = cells.len() as f64 / f64::from(total);
        if share < LITTLE_COVERAGE {
            all.push(format!(
                "points cover {} of {total} cells of the {name}'s image ({:.0} %); expected {:.0} % or more",
                cells.len(),
                100.0 * share,
                100.0 * LITTLE_COVERAGE
            ));
        }
    }
}

fn fit(solution: &Solution, all: &mut Vec<String>) {
    for (name, factor) in ["camera points", "projector coordinates"]
        .iter()
        .zip(solution.inflation)
    {
        if factor > INFLATED {
            all.push(format!(
                "{name} scatter {:.2} times as much as their covariances predict; standard \
                 deviations are scaled up accordingly, which covers only errors that are \
                 independent from point to point",
                factor.sqrt()
            ));
        }
    }
    let points = || solution.poses.iter().flat_map(|p| &p.points);
    let camera = (
        points().filter(|p| p.camera_weight == 0.0).count(),
        points().count(),
    );
    let lit = || points().filter_map(|p| p.projector);
    let projector = (lit().filter(|p| p.weight == 0.0).count(), lit().count());
    for (name, (out, total)) in [
        ("camera points", camera),
        ("projector coordinates", projector),
    ] {
        if out as f64 > OUTLIERS * total as f64 {
            all.push(format!(
                "{out} of {total} {name} are outliers and do not count"
            ));
        }
    }
    for pose in &solution.poses {
        for (name, own, usual) in [
            (
                "camera points",
                &pose.camera_errors,
                &solution.camera_errors,
            ),
            (
                "projector coordinates",
                &pose.projector_errors,
                &solution.projector_errors,
            ),
        ] {
            let usual = usual.whitened_rms.max(1.0);
            if own.whitened_rms > UNEVEN * usual {
                all.push(format!(
                    "{}: its {name} scatter {:.1} times as much as those of all poses",
                    pose.name,
                    own.whitened_rms / usual
                ));
            }
        }
    }
}

fn parameters(solution: &Solution, choice: &Choice, all: &mut Vec<String>) {
    let baseline = baseline(solution);
    let vague = focal_lengths(solution)
        .chain(baseline.as_ref())
        .filter(|p| p.sigma > VAGUE * p.value)
        .map(|p| {
            format!(
                "{} = {:.4} {} is known to {:.1} % only (standard deviation {:.4})",
                p.name,
                p.value,
                p.unit,
                100.0 * p.sigma / p.value,
                p.sigma
            )
        });
    all.extend(vague);
    for (p, at) in of_rig(solution) {
        let (lens, coefficients) = if p.name.starts_with("camera.") {
            (&solution.rig.camera.lens, choice.camera)
        } else {
            (&solution.rig.projector.lens, choice.projector)
        };
        let enough = VAGUE * f64::from(lens.width_px);
        // Automatically chosen coefficients are selected as a group, so they are not judged
        // individually.
        let chosen = coefficients != Coefficients::Auto;
        if p.name.ends_with(".cx") || p.name.ends_with(".cy") {
            if p.sigma > enough {
                all.push(format!(
                    "{} = {:.2} px is known to {:.2} px only; expected {:.2}",
                    p.name, p.value, p.sigma, enough
                ));
            }
        } else if chosen && p.unit.is_empty() && p.sigma > p.value.abs() {
            all.push(format!(
                "{} = {:.2e} cannot be distinguished from 0: its standard deviation is {:.2e}",
                p.name, p.value, p.sigma
            ));
        }
        for (q, other) in of_rig(solution).take(at) {
            let c = solution.covariance[(at, other)] / (p.sigma * q.sigma);
            if c.abs() > CORRELATED {
                all.push(format!(
                    "{} and {} can hardly be distinguished: their correlation is {c:.5}",
                    q.name, p.name
                ));
            }
        }
    }
}

fn largest_angle(solution: &Solution) -> f64 {
    let normals: Vec<DVec3> = solution
        .poses
        .iter()
        .map(|p| p.camera_from_board.rotation.z_axis)
        .collect();
    largest_angle_deg(&normals)
}

/// Parameters that belong to the rig (not to a board pose), with their indices.
fn of_rig(solution: &Solution) -> impl Iterator<Item = (&Parameter, usize)> {
    let count = solution.parameters.len() - 6 * solution.poses.len();
    solution.parameters[..count].iter().zip(0..)
}

fn focal_lengths(solution: &Solution) -> impl Iterator<Item = &Parameter> {
    of_rig(solution)
        .map(|(p, _)| p)
        .filter(|p| p.name.ends_with(".fx") || p.name.ends_with(".fy"))
}

/// Distance between camera and projector, with its standard deviation.
fn baseline(solution: &Solution) -> Option<Parameter> {
    let place = solution.rig.projector.center();
    let (value, at) = (place.length(), of_rig(solution).count() - 3);
    let along = nalgebra::Vector3::from_column_slice(&(place / value).to_array());
    let block = solution.covariance.fixed_view::<3, 3>(at, at);
    let variance = (along.transpose() * block * along)[(0, 0)];
    (value > 0.0).then(|| Parameter {
        name: "the baseline".to_owned(),
        unit: "mm",
        value,
        sigma: variance.sqrt(),
    })
}
