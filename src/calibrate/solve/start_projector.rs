//! Initial estimate of the projector, given the camera's intrinsics and the board poses.

use super::bundle::Bundle;
use super::homography::apply;
use super::model::State;
use super::resection::resect;
use super::start::{FEWEST_POINTS, Maps, TILTS_WANTED};
use super::{Unsolved, zhang};
use glam::{DVec2, DVec3};
use phasmid_core::statistics::median;
use phasmid_geometry::{Lens, Pose};

/// Estimates the projector by resection from the illuminated points in space and from its own
/// homographies, and returns whichever fits better.
pub(super) fn projector(
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
    // Resect from all poses, then repeatedly from those with a misfit of at most four times the
    // median.
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
