//! Reprojection errors: bars show the mean error of each pose, for the camera above and for the
//! projector below, with separate scales; arrows show the residuals in both images, individually
//! and as means over cells. A lens that the model does not fit shows as a pattern of the cell
//! means; noise averages out.

use super::html::note;
use super::spots::Spot;
use crate::solve::{Errors, Solution, SolvedPose};
use glam::DVec2;
use phasmid_geometry::Lens;
use phasmid_report::plot::{
    Arrow, Axis, Panel, ROOM, Sheet, bars, figures, quiver, room_for_names,
};
use std::collections::BTreeMap;

const BARS: DVec2 = DVec2::new(880.0, 130.0);
const BARS_HEADING: f64 = 30.0;

pub(super) fn errors(solution: &Solution) -> String {
    if solution.poses.is_empty() {
        return String::new();
    }
    let names = solution.poses.iter().map(|pose| pose.name.as_str());
    let pitch = BARS_HEADING + BARS.y + room_for_names(names);
    let height = 2.0 * pitch;
    let mut sheet = Sheet::new(ROOM.x + BARS.x + 10.0, height);
    let camera: fn(&SolvedPose) -> &Errors = |pose| &pose.camera_errors;
    let projector: fn(&SolvedPose) -> &Errors = |pose| &pose.projector_errors;
    let all = [
        ("Camera", "c0", camera, &solution.camera_errors),
        ("Projector", "c1", projector, &solution.projector_errors),
    ];
    for (i, (name, class, of, mean)) in all.into_iter().enumerate() {
        let values: Vec<(&str, f64)> = solution
            .poses
            .iter()
            .map(|pose| (pose.name.as_str(), of(pose)))
            // A pose without projector coordinates has an unknown error (NaN), not zero.
            .map(|(name, e)| (name, if e.count > 0 { e.mean_px } else { f64::NAN }))
            .collect();
        let panel = Panel {
            corner: DVec2::new(ROOM.x, BARS_HEADING + i as f64 * pitch),
            size: BARS,
            x: Axis::between("", 0.0, 1.0),
            y: Axis::from_zero("mean error, px", values.iter().map(|(_, v)| *v)),
        };
        let of_all = figures(mean.mean_px, 3);
        panel.head(&mut sheet, &format!("{name}; all poses: {of_all} px"));
        bars(&mut sheet, &panel, class, &values, "px");
        let level = [0.0, 1.0].map(|x| panel.inside(DVec2::new(x, mean.mean_px)));
        if let [Some(from), Some(to)] = level {
            sheet.lines("faint", [[from, to]]);
        }
    }
    sheet.into_element("Mean reprojection error of each pose")
}

/// Width and maximum height of a panel.
const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 700.0;
const HEADING: f64 = 34.0;
/// Number of cells along the longer side of the image.
const CELLS: f64 = 16.0;
/// Minimum number of points in a cell for its mean to be shown.
const ENOUGH: usize = 8;
/// Maximum number of outliers that are marked.
const MARKED: usize = 500;

pub(super) fn residuals(solution: &Solution, camera: &[Spot], projector: &[Spot]) -> String {
    let rig = &solution.rig;
    let mut out = String::new();
    let mut systematic = Vec::new();
    for (name, class, lens, spots) in [
        ("Camera", "c0", &rig.camera.lens, camera),
        ("Projector", "c1", &rig.projector.lens, projector),
    ] {
        let counted: Vec<&Spot> = spots.iter().filter(|s| s.counts).collect();
        let arrows = counted.iter().map(|s| Arrow {
            at: s.at,
            by: s.residual,
        });
        let arrows: Vec<Arrow> = arrows.collect();
        let outliers = spots.iter().filter(|s| !s.counts);
        let head = format!("{name}: {} points", arrows.len());
        out.push_str(&over_image(lens, class, &head, &arrows, outliers));
        let cells = means(lens, &counted);
        let arrows: Vec<Arrow> = cells.iter().map(|c| c.mean).collect();
        let head = format!("{name}: means of {} cells", arrows.len());
        out.push_str(&over_image(lens, class, &head, &arrows, std::iter::empty()));
        systematic.push(format!("{} ({name})", figures(over_noise(&cells), 3)));
    }
    out.push_str(&note(&format!(
        "Arrows show seen minus expected, enlarged as the sample arrow says; rings are outliers. \
         Root of the mean square of the cells' whitened means, times the root of their points: {}. \
         It is near 1 where residuals are noise, and larger where a lens deviates from its model.",
        systematic.join(", ")
    )));
    out
}

fn over_image<'a>(
    lens: &Lens,
    class: &str,
    head: &str,
    arrows: &[Arrow],
    outliers: impl Iterator<Item = &'a Spot>,
) -> String {
    let panel = image_panel(lens, DVec2::new(ROOM.x, HEADING), WIDTH);
    let mut sheet = Sheet::new(
        ROOM.x + panel.size.x + 20.0,
        HEADING + panel.size.y + ROOM.y,
    );
    panel.draw(&mut sheet);
    panel.head(&mut sheet, head);
    quiver(&mut sheet, &panel, class, arrows, "px");
    for spot in outliers.take(MARKED) {
        if let Some(at) = panel.inside(spot.at) {
            let size = figures(spot.residual.length(), 3);
            let tip = format!("outlier, {}: {size} px", spot.name);
            sheet.disc("ring", at, 4.0, Some(&tip));
        }
    }
    sheet.into_element(&format!("Residual vectors. {head}"))
}

/// A panel that spans a lens's image, with square pixels.
pub(super) fn image_panel(lens: &Lens, corner: DVec2, width: f64) -> Panel {
    let px = DVec2::new(f64::from(lens.width_px), f64::from(lens.height_px)).max(DVec2::ONE);
    let scale = (width / px.x).min(HEIGHT / px.y);
    Panel {
        corner,
        // Keep room for the frame even if the image is very narrow.
        size: (px * scale).max(DVec2::splat(40.0)),
        x: Axis::between("column, px", -0.5, px.x - 0.5),
        y: Axis::between("row, px", -0.5, px.y - 0.5).reversed(),
    }
}

/// Mean residuals of a cell of the image.
struct Cell {
    mean: Arrow,
    whitened: DVec2,
    count: usize,
}

fn means(lens: &Lens, spots: &[&Spot]) -> Vec<Cell> {
    let side = (f64::from(lens.width_px.max(lens.height_px)) / CELLS).max(1.0);
    let mut sums: BTreeMap<[i64; 2], (DVec2, DVec2, usize)> = BTreeMap::new();
    for spot in spots {
        let fits = spot.at.is_finite() && spot.residual.is_finite() && spot.whitened.is_finite();
        if fits && lens.contains(spot.at) {
            let cell = ((spot.at + 0.5) / side).floor();
            let sum = sums.entry([cell.x as i64, cell.y as i64]).or_default();
            *sum = (sum.0 + spot.residual, sum.1 + spot.whitened, sum.2 + 1);
        }
    }
    sums.into_iter()
        .filter(|(_, (_, _, count))| *count >= ENOUGH)
        .map(|([x, y], (residual, whitened, count))| {
            let n = count as f64;
            let middle = (DVec2::new(x as f64, y as f64) + 0.5) * side - 0.5;
            let last = DVec2::new(f64::from(lens.width_px), f64::from(lens.height_px)) - 0.5;
            Cell {
                mean: Arrow {
                    at: middle.min(last),
                    by: residual / n,
                },
                whitened: whitened / n,
                count,
            }
        })
        .collect()
}

/// Ratio of the RMS of the cells' mean residuals to the RMS expected from noise alone.
fn over_noise(cells: &[Cell]) -> f64 {
    let squares = cells
        .iter()
        .map(|c| c.whitened.length_squared() * c.count as f64);
    (squares.sum::<f64>() / (2 * cells.len()) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens() -> Lens {
        Lens {
            width_px: 160,
            height_px: 80,
            focal_px: DVec2::splat(100.0),
            principal_px: DVec2::new(79.5, 39.5),
            distortion: [0.0; 5],
        }
    }

    fn spot(at: DVec2, residual: DVec2) -> Spot {
        Spot {
            at,
            residual,
            whitened: residual * 10.0,
            counts: true,
            name: String::new(),
        }
    }

    #[test]
    fn means_are_of_the_points_in_a_cell() {
        let spots: Vec<Spot> = (0..8)
            .map(|i| {
                spot(
                    DVec2::new(10.0 + f64::from(i), 25.0),
                    DVec2::new(f64::from(i), 1.0),
                )
            })
            .chain([spot(DVec2::NAN, DVec2::ONE), spot(DVec2::ONE, DVec2::ONE)])
            .collect();
        let cells = means(&lens(), &spots.iter().collect::<Vec<_>>());
        assert_eq!(cells.len(), 1);
        assert_eq!(cells[0].count, 8);
        assert_eq!(cells[0].mean.at, DVec2::new(14.5, 24.5));
        assert_eq!(cells[0].mean.by, DVec2::new(3.5, 1.0));
        // One cell of 8 points with the mean (35, 10): (35^2 + 10^2) 8 / 2.
        let want = 1325.0_f64 * 4.0;
        assert!((over_noise(&cells) - want.sqrt()).abs() < 1e-9);
        assert!(over_noise(&[]).is_nan());
    }
}
