//! Number of points in each cell of a grid over the images.

use super::residuals::image_panel;
use super::spots::Spot;
use crate::solve::Solution;
use glam::DVec2;
use phasmid_geometry::Lens;
use phasmid_report::plot::{ROOM, Sheet, cells};

const WIDTH: f64 = 400.0;
const HEADING: f64 = 30.0;
const COLUMNS: usize = 8;
const ROWS: usize = 6;

pub(super) fn coverage(solution: &Solution, camera: &[Spot], projector: &[Spot]) -> String {
    let rig = &solution.rig;
    [
        ("Camera", "c0", &rig.camera.lens, camera),
        ("Projector", "c1", &rig.projector.lens, projector),
    ]
    .map(|(name, class, lens, spots)| {
        let counts = counts(lens, spots);
        let filled = counts.iter().filter(|n| **n > 0).count();
        let panel = image_panel(lens, DVec2::new(ROOM.x, HEADING), WIDTH);
        let mut sheet = Sheet::new(
            ROOM.x + panel.size.x + 12.0,
            HEADING + panel.size.y + ROOM.y,
        );
        panel.draw(&mut sheet);
        let all = COLUMNS * ROWS;
        let head = format!("{name}: points in {filled} of {all} parts");
        panel.head(&mut sheet, &head);
        cells(&mut sheet, &panel, class, &counts, COLUMNS);
        sheet.into_element(&format!("Coverage of the image. {head}"))
    })
    .concat()
}

fn counts(lens: &Lens, spots: &[Spot]) -> Vec<usize> {
    let mut counts = vec![0; COLUMNS * ROWS];
    let size = DVec2::new(f64::from(lens.width_px), f64::from(lens.height_px));
    for spot in spots.iter().filter(|s| s.counts && lens.contains(s.at)) {
        let place = (spot.at + 0.5) / size * DVec2::new(COLUMNS as f64, ROWS as f64);
        // Because of rounding, a point on the right or bottom edge may get a cell past the last
        // one.
        let column = (place.x as usize).min(COLUMNS - 1);
        let row = (place.y as usize).min(ROWS - 1);
        counts[row * COLUMNS + column] += 1;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_counted_in_the_cell_that_contains_them() {
        let lens = Lens {
            width_px: 80,
            height_px: 60,
            focal_px: DVec2::ONE,
            principal_px: DVec2::ZERO,
            distortion: [0.0; 5],
        };
        let spot = |x: f64, y: f64| Spot {
            at: DVec2::new(x, y),
            residual: DVec2::ZERO,
            whitened: DVec2::ZERO,
            counts: true,
            name: String::new(),
        };
        let found = counts(
            &lens,
            &[
                spot(-0.5, -0.5),
                spot(79.49, 59.49),
                spot(79.49, 59.49),
                spot(80.0, 3.0),
                spot(f64::NAN, 3.0),
            ],
        );
        assert_eq!((found[0], found[47]), (1, 2));
        assert_eq!(found.iter().sum::<usize>(), 3);
    }
}
