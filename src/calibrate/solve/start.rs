//! Closed-form initial state, and exclusion of poses that cannot contribute to that state.

use super::bundle::Bundle;
use super::coefficients::{Model, free};
use super::fit::{Effort, minimise};
use super::homography::{FEWEST_POINTS, Homography, apply};
use super::model::State;
use super::observation::PoseObservations;
use super::refusal::{TILTS_WANTED, Why, largest_angle_deg};
use super::resection::resect;
use super::robust::{self, Loss};
use super::{Choice, Unfit, Unsolved, zhang};
use glam::{DMat3, DVec2, DVec3};
use phasmid_core::statistics::median;
use phasmid_geometry::{Lens, Pose};

/// Boards count as parallel if the largest angle between their normals is below this. The angle is
/// estimated with a guessed lens, whose focal length is the larger side of the image.
const PARALLEL_DEG: f64 = 0.5;
/// Homographies of the usable poses, in the order of the poses.
pub(super) struct Maps {
    pub camera: Vec<Homography>,
    /// Homographies to the projector's image and the indices of their inliers; `None` if too few
    /// points are illuminated.
    pub projector: Vec<Option<(Homography, Vec<usize>)>>,
}

/// Fits the homographies and excludes poses without a homography or with a mirrored one.
pub(super) fn maps(bundle: &mut Bundle, robust: bool) -> Result<Maps, Unsolved> {
    let mut maps = Maps {
        camera: Vec::new(),
        projector: Vec::new(),
    };
    let (mut mirrored, mut crossed, mut at) = (0, 0, 0);
    while at < bundle.poses.len() {
        match of_pose(bundle, at, robust) {
            Ok((camera, projector)) => {
                maps.camera.push(camera);
                maps.projector.push(projector);
                at += 1;
            }
            Err(why) => {
                mirrored += usize::from(why == Unfit::MirroredCamera);
                crossed += usize::from(why == Unfit::MirroredProjector);
                bundle.leave_out(at, why);
            }
        }
    }
    let total = bundle.left_out.len() + bundle.poses.len();
    if mirrored > 0 && mirrored + 1 >= total && bundle.poses.len() < 2 {
        return Err(Unsolved::Mirrored {
            found: format!("the camera shows the board mirrored in {mirrored} of {total} poses"),
            wanted: "images of the board's front that are not flipped".to_owned(),
        });
    }
    if crossed > 0 && crossed + 1 >= total && bundle.poses.len() < 2 {
        return Err(Unsolved::Mirrored {
            found: format!(
                "the projector's columns and rows lie mirrored on the board in {crossed} of {total} poses"
            ),
            wanted: "columns that count to the right and rows that count down, as the projector \
                     sees the board"
                .to_owned(),
        });
    }
    bundle.enough_poses()?;
    Ok(maps)
}

type OfPose = (Homography, Option<(Homography, Vec<usize>)>);

fn of_pose(bundle: &Bundle, at: usize, robust: bool) -> Result<OfPose, Unfit> {
    let pose = &bundle.poses[at];
    let few = |points, on_a_line| Unfit::TooFewPoints {
        points,
        improper: pose.improper,
        on_a_line,
    };
    if pose.points.len() < FEWEST_POINTS {
        return Err(few(pose.points.len(), false));
    }
    let pairs: Vec<_> = pose.points.iter().map(|o| (o.board, o.camera)).collect();
    let camera = Homography::fit(&pairs, robust).ok_or_else(|| few(pairs.len(), true))?;
    let agree = camera.fits.iter().filter(|f| **f).count();
    if agree < FEWEST_POINTS || 2 * agree < pairs.len() {
        let points = pairs.len();
        return Err(Unfit::Disagreeing { agree, points });
    }
    if !camera.keeps_sense() {
        return Err(Unfit::MirroredCamera);
    }
    let lit: Vec<usize> = (0..pose.points.len())
        .filter(|i| pose.points[*i].lit.is_some())
        .collect();
    if lit.len() < FEWEST_POINTS {
        return Ok((camera, None));
    }
    let pairs: Vec<_> = lit
        .iter()
        .filter_map(|&i| {
            let o = &pose.points[i];
            o.lit.as_ref().map(|l| (o.board, l.px))
        })
        .collect();
    let Some(map) = Homography::fit(&pairs, robust) else {
        return Ok((camera, None));
    };
    if !map.keeps_sense() {
        return Err(Unfit::MirroredProjector);
    }
    let lit = lit
        .into_iter()
        .zip(&map.fits)
        .filter(|(_, f)| **f)
        .map(|(i, _)| i);
    let lit = lit.collect();
    Ok((camera, Some((map, lit))))
}

/// Initial state: estimates the camera's intrinsics and the board poses, refines them with the
/// camera's observations alone, then estimates the projector.
pub(super) fn state(
    bundle: &Bundle,
    maps: &Maps,
    sizes: [[u32; 2]; 2],
    model: &Model,
    choice: &Choice,
) -> Result<State, Unsolved> {
    let homographies: Vec<DMat3> = maps.camera.iter().map(|m| m.matrix).collect();
    refuse_parallel(&homographies, sizes[0])?;
    let points: Vec<Vec<DVec2>> = bundle.poses.iter().map(some_points).collect();
    let no_lens = || Unsolved::Undetermined {
        found: format!(
            "no camera model explains the {} images of the board",
            homographies.len()
        ),
        wanted: TILTS_WANTED.to_owned(),
    };
    let (camera, _) = zhang::best(&homographies, &points, sizes[0]).ok_or_else(no_lens)?;
    let boards: Vec<Pose> = homographies
        .iter()
        .map(|h| zhang::pose(&camera, h))
        .collect::<Option<_>>()
        .ok_or_else(no_lens)?;
    let guess = State {
        camera,
        projector: camera,
        rig_from_projector: Pose::IDENTITY,
        boards,
    };
    let state = camera_alone(bundle, guess, model, choice)?;
    let (projector, rig_from_projector) = projector(bundle, maps, &state, &points, sizes[1])?;
    Ok(State {
        projector,
        rig_from_projector,
        ..state
    })
}

fn refuse_parallel(homographies: &[DMat3], size: [u32; 2]) -> Result<(), Unsolved> {
    let [w, h] = size.map(f64::from);
    let guess = Lens {
        width_px: size[0],
        height_px: size[1],
        focal_px: DVec2::splat(w.max(h)),
        principal_px: (DVec2::new(w, h) - 1.0) / 2.0,
        distortion: [0.0; 5],
    };
    let normals: Vec<DVec3> = homographies
        .iter()
        .filter_map(|m| zhang::pose(&guess, m))
        .map(|p| p.rotation.z_axis)
        .collect();
    let angle = largest_angle_deg(&normals);
    if normals.len() == homographies.len() && angle < PARALLEL_DEG {
        return Err(Unsolved::Parallel {
            found: format!(
                "the largest angle between two of {} boards is {angle:.2} degrees",
                normals.len()
            ),
            wanted: TILTS_WANTED.to_owned(),
        });
    }
    Ok(())
}

/// A subset of the observed board points (up to 40), evenly spaced in the list.
fn some_points(pose: &PoseObservations) -> Vec<DVec2> {
    let stride = pose.points.len().div_ceil(40).max(1);
    pose.points
        .iter()
        .step_by(stride)
        .map(|o| o.board)
        .collect()
}

fn camera_alone(
    bundle: &Bundle,
    guess: State,
    model: &Model,
    choice: &Choice,
) -> Result<State, Unsolved> {
    let mut poses = bundle.poses.clone();
    for o in poses.iter_mut().flat_map(|p| &mut p.points) {
        (o.lit, o.projector_counts) = (None, false);
    }
    let mut free = free(model);
    free[phasmid_geometry::parameters::LENS..].fill(false);
    let mut state = guess;
    for _ in 0..2 {
        let loss = if choice.robust {
            Loss::huber(robust::scales(&poses, &state))
        } else {
            Loss::Square([1.0; 2])
        };
        match minimise(&poses, &state, &free, &loss, Effort::ROUGH, &bundle.stop) {
            Ok(fit) => state = fit.state,
            Err(Why::Stopped) => return Err(Unsolved::Interrupted),
            Err(_) => break,
        }
    }
    Ok(state)
}

/// Estimates the projector by resection from the illuminated points in space and from the
/// homographies of the projector's image, and returns whichever estimate fits better.
fn projector(
    bundle: &Bundle,
    maps: &Maps,
    state: &State,
    points: &[Vec<DVec2>],
    size: [u32; 2],
) -> Result<(Lens, Pose), Unsolved> {
    let lit: Vec<usize> = (0..maps.projector.len())
        .filter(|i| maps.projector[*i].is_some())
        .collect();
    if lit.len() < 2 {
        let count: usize = bundle.poses.iter().map(|p| p.lit()).sum();
        return Err(Unsolved::Unlit {
            found: format!(
                "{count} points; {FEWEST_POINTS} or more in {} of {} poses",
                lit.len(),
                bundle.poses.len()
            ),
            wanted: format!("{FEWEST_POINTS} or more, not on a line, in 2 poses or more"),
        });
    }
    let misfits = |lens: &Lens, place: &Pose| -> Vec<f64> {
        let from_camera = place.inverse();
        lit.iter()
            .map(|&i| {
                let Some((map, _)) = &maps.projector[i] else {
                    return f64::INFINITY;
                };
                let from_board = from_camera * state.boards[i];
                let sum: f64 = points[i]
                    .iter()
                    .map(|p| {
                        let px = lens.project(from_board.point(p.extend(0.0)));
                        px.map_or(f64::INFINITY, |px| {
                            (px - apply(&map.matrix, *p)).length_squared()
                        })
                    })
                    .sum();
                (sum / points[i].len() as f64).sqrt()
            })
            .collect()
    };
    let mut found: Vec<(Lens, Pose)> = Vec::new();
    // First resect from all poses. Then repeat with the poses whose misfit is at most four times
    // the median misfit.
    let mut used = lit.clone();
    for _ in 0..4 {
        let Some((lens, place)) = resect(&pairs(bundle, maps, state, &used), size) else {
            break;
        };
        found.push((lens, place));
        let left = misfits(&lens, &place);
        let limit = 4.0 * median(&mut left.clone()).unwrap_or(f64::INFINITY);
        let fitting = lit.iter().zip(&left).filter(|(_, m)| !(**m > limit));
        let fitting: Vec<usize> = fitting.map(|(i, _)| *i).collect();
        if fitting == used || fitting.len() < 2 {
            break;
        }
        used = fitting;
    }
    found.extend(from_homographies(maps, state, &lit, points, size));
    found
        .into_iter()
        .filter_map(|(lens, place)| Some((median(&mut misfits(&lens, &place))?, lens, place)))
        .filter(|(misfit, ..)| misfit.is_finite())
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, lens, place)| (lens, place))
        .ok_or_else(|| Unsolved::Undetermined {
            found: format!(
                "no projector model explains the boards of {} poses",
                lit.len()
            ),
            wanted: TILTS_WANTED.to_owned(),
        })
}

fn pairs(bundle: &Bundle, maps: &Maps, state: &State, used: &[usize]) -> Vec<(DVec3, DVec2)> {
    let mut pairs = Vec::new();
    for &i in used {
        for &p in maps.projector[i].iter().flat_map(|(_, points)| points) {
            let o = &bundle.poses[i].points[p];
            let x = state.boards[i].point(o.board.extend(0.0));
            pairs.extend(o.lit.as_ref().map(|l| (x, l.px)));
        }
    }
    pairs
}

/// Estimates the projector by Zhang's method. Each board gives one pose of the projector. Returns
/// the pose with the smallest sum of distances to the other poses.
fn from_homographies(
    maps: &Maps,
    state: &State,
    lit: &[usize],
    points: &[Vec<DVec2>],
    size: [u32; 2],
) -> Option<(Lens, Pose)> {
    let (mut homographies, mut theirs) = (Vec::new(), Vec::new());
    for &i in lit {
        homographies.extend(maps.projector[i].as_ref().map(|(h, _)| h.matrix));
        theirs.push(points[i].clone());
    }
    let (lens, _) = zhang::best(&homographies, &theirs, size)?;
    let places: Vec<Pose> = lit
        .iter()
        .zip(&homographies)
        .filter_map(|(&i, h)| Some(state.boards[i] * zhang::pose(&lens, h)?.inverse()))
        .collect();
    let distance = |a: &Pose, b: &Pose| (a.translation_mm - b.translation_mm).length();
    let sum = |a: &Pose| places.iter().map(|b| distance(a, b)).sum::<f64>();
    let nearest = places.iter().min_by(|a, b| sum(a).total_cmp(&sum(b)))?;
    Some((lens, *nearest))
}
