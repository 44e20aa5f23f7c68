//! Mean reprojection error of each pose: bars for the camera above those for the projector, with
//! separate scales.

use crate::solve::{Errors, Solution, SolvedPose};
use glam::DVec2;
use phasmid_report::plot::{Axis, Panel, ROOM, Sheet, bars, figures, room_for_names};

const SIZE: DVec2 = DVec2::new(880.0, 130.0);
const HEADING: f64 = 30.0;

pub(super) fn errors(solution: &Solution) -> String {
    if solution.poses.is_empty() {
        return String::new();
    }
    let names = solution.poses.iter().map(|pose| pose.name.as_str());
    let pitch = HEADING + SIZE.y + room_for_names(names);
    let height = 2.0 * pitch;
    let mut sheet = Sheet::new(ROOM.x + SIZE.x + 10.0, height);
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
            corner: DVec2::new(ROOM.x, HEADING + i as f64 * pitch),
            size: SIZE,
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
