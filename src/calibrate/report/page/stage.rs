//! Drawing of camera, projector and boards from three directions.

use super::html::note;
use crate::rig::Calibration;
use glam::{DVec2, DVec3};
use phasmid_geometry::{Board, Pose, View};
use phasmid_report::plot::{Anchor, Axis, Panel, ROOM, Sheet, figures};

const WIDTH: f64 = 420.0;
const LEAST_HEIGHT: f64 = 120.0;
const MOST_HEIGHT: f64 = 420.0;
const HEADING: f64 = 30.0;
/// Maximum number of boards that are numbered.
const NUMBERED: usize = 60;

/// A shape to draw, with its CSS class and tooltip.
struct Outline {
    class: &'static str,
    points: Vec<DVec3>,
    closed: bool,
    tip: String,
    /// Text at the first point.
    label: Option<String>,
}

/// An orthographic view, given by its right and up directions.
struct Direction {
    name: &'static str,
    right: DVec3,
    up: DVec3,
    axes: [&'static str; 2],
}

fn directions() -> [Direction; 3] {
    // The viewpoint is behind the camera, to its left and above it.
    let (yaw, pitch) = (35f64.to_radians(), 25f64.to_radians());
    let forward = DVec3::new(
        yaw.sin() * pitch.cos(),
        pitch.sin(),
        yaw.cos() * pitch.cos(),
    );
    let right = DVec3::Y.cross(forward).normalize();
    [
        Direction {
            name: "From above",
            right: DVec3::X,
            up: DVec3::Z,
            axes: ["x, mm", "z, mm"],
        },
        Direction {
            name: "From the side",
            right: DVec3::Z,
            up: -DVec3::Y,
            axes: ["z, mm", "-y, mm"],
        },
        Direction {
            name: "From behind, left and above",
            right,
            up: -forward.cross(right),
            axes: ["to the right, mm", "upwards, mm"],
        },
    ]
}

impl Direction {
    fn at(&self, p: DVec3) -> DVec2 {
        DVec2::new(p.dot(self.right), p.dot(self.up))
    }
}

pub(super) fn stage(calibration: &Calibration) -> String {
    let outlines = outlines(calibration);
    let mut out = String::new();
    for direction in directions() {
        out.push_str(&view(&direction, &outlines));
    }
    let rig = &calibration.solution.rig;
    let baseline = (rig.projector.center() - rig.camera.center()).length();
    let cosine = rig
        .camera
        .rig_from_view
        .rotation
        .z_axis
        .dot(rig.projector.rig_from_view.rotation.z_axis);
    out.push_str(&note(&format!(
        "Blue: the camera and its field of view; orange: the projector's; grey: boards, numbered as \
         in the table of poses, a dot at their first point. The frame is the camera's: x right, y \
         down, z forward. Baseline {} mm, angle between the optical axes {} degrees.",
        figures(baseline, 6),
        figures(cosine.clamp(-1.0, 1.0).acos().to_degrees(), 4)
    )));
    out
}

fn outlines(calibration: &Calibration) -> Vec<Outline> {
    let solution = &calibration.solution;
    let mut distances: Vec<f64> = solution
        .poses
        .iter()
        .map(|pose| pose.camera_from_board.translation_mm.length())
        .filter(|d| d.is_finite())
        .collect();
    distances.sort_unstable_by(f64::total_cmp);
    let middle = distances.get(distances.len() / 2).copied();
    let reach = 0.3 * middle.unwrap_or(1000.0);
    let mut all = field(&solution.rig.camera, "area c0", "camera", reach);
    all.extend(field(
        &solution.rig.projector,
        "area c1",
        "projector",
        reach,
    ));
    for (i, pose) in solution.poses.iter().enumerate() {
        all.push(Outline {
            class: "veil c2",
            points: corners(&calibration.board, &pose.camera_from_board).to_vec(),
            closed: true,
            tip: format!("{}: {}", i + 1, pose.name),
            label: (i < NUMBERED).then(|| (i + 1).to_string()),
        });
    }
    all
}

/// Corners of a board, half a pitch outside its outermost points, starting near the first point.
fn corners(board: &Board, rig_from_board: &Pose) -> [DVec3; 4] {
    let [columns, rows] = board.grid().map(|n| 0.5 * f64::from(n) * board.pitch_mm());
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, y)| rig_from_board.point(DVec3::new(x * columns, y * rows, 0.0)))
}

/// The four sides of a view's pyramid, up to depth `reach`.
fn field(view: &View, class: &'static str, name: &str, reach: f64) -> Vec<Outline> {
    let lens = &view.lens;
    let (right, below) = (
        f64::from(lens.width_px) - 0.5,
        f64::from(lens.height_px) - 0.5,
    );
    let ends = [(-0.5, -0.5), (right, -0.5), (right, below), (-0.5, below)].map(|(u, v)| {
        // Distortion is neglected, as it would not be visible at this size.
        let ideal = (DVec2::new(u, v) - lens.principal_px) / lens.focal_px;
        view.rig_from_view.point(ideal.extend(1.0) * reach)
    });
    let side = |i: usize| Outline {
        class,
        points: vec![view.center(), ends[i], ends[(i + 1) % 4]],
        closed: true,
        tip: name.to_owned(),
        label: None,
    };
    (0..4).map(side).collect()
}

fn view(direction: &Direction, outlines: &[Outline]) -> String {
    let flat: Vec<DVec2> = outlines
        .iter()
        .flat_map(|o| &o.points)
        .map(|p| direction.at(*p))
        .filter(|p| p.is_finite())
        .collect();
    let low = flat
        .iter()
        .copied()
        .reduce(DVec2::min)
        .unwrap_or(DVec2::ZERO);
    let high = flat
        .iter()
        .copied()
        .reduce(DVec2::max)
        .unwrap_or(DVec2::ONE);
    let (middle, span) = (
        (low + high) / 2.0,
        (high - low).max(DVec2::splat(1e-6)) * 1.08,
    );
    let height = (WIDTH * span.y / span.x).clamp(LEAST_HEIGHT, MOST_HEIGHT);
    // Use the coarser of the two axes' scales for both axes.
    let unit = (span.x / WIDTH).max(span.y / height);
    let half = 0.5 * unit * DVec2::new(WIDTH, height);
    let panel = Panel {
        corner: DVec2::new(ROOM.x, HEADING),
        size: DVec2::new(WIDTH, height),
        x: Axis::between(direction.axes[0], middle.x - half.x, middle.x + half.x),
        y: Axis::between(direction.axes[1], middle.y - half.y, middle.y + half.y),
    };
    let mut sheet = Sheet::new(ROOM.x + WIDTH + 12.0, HEADING + height + ROOM.y);
    panel.draw(&mut sheet);
    panel.head(&mut sheet, direction.name);
    for outline in outlines {
        let points: Option<Vec<DVec2>> = outline
            .points
            .iter()
            .map(|p| panel.at(direction.at(*p)))
            .collect();
        let Some(points) = points else { continue };
        sheet.polyline(outline.class, &points, outline.closed, Some(&outline.tip));
        if let (Some(label), Some(first)) = (&outline.label, points.first()) {
            sheet.disc("fill c2", *first, 2.0, None);
            let beside = *first + DVec2::new(-4.0, -3.0);
            sheet.text("", beside, Anchor::End, label);
        }
    }
    sheet.into_element(&format!("Camera, projector and boards. {}", direction.name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_look_is_a_pair_of_unit_directions() {
        for direction in directions() {
            assert!((direction.right.length() - 1.0).abs() < 1e-12);
            assert!((direction.up.length() - 1.0).abs() < 1e-12);
            assert!(direction.right.dot(direction.up).abs() < 1e-12);
            // Up in the scene (-y) must not point down in the drawing.
            assert!(direction.up.dot(-DVec3::Y) > -1e-12, "{}", direction.name);
        }
    }

    #[test]
    fn a_boards_corners_are_half_a_pitch_around_its_points() {
        let [a, b, c, d] = corners(&Board::CHESS, &Pose::IDENTITY);
        assert_eq!(a, DVec3::new(-112.5, -75.0, 0.0));
        assert_eq!((b - a).x, 225.0);
        assert_eq!((d - a).y, 150.0);
        assert_eq!(c, -a);
    }
}
