//! Checks whether a board in a given pose is visible to the camera and illuminated by the
//! projector.

use crate::{Board, MARKERS, Pose, Rig, View};
use glam::{DMat2, DVec2, DVec3};

/// Minimum fraction of a dot board's dots that must be in the camera's and in the projector's
/// image.
const LEAST_SHARE: f64 = 0.6;
/// Minimum distance in pixels from the image's border.
const MARGIN_PX: f64 = 2.0;
/// Maximum angle between line of sight and board normal, in degrees.
const MOST_OBLIQUE_DEG: f64 = 70.0;
/// Minimum side of a chessboard square in pixels.
const LEAST_SQUARE_PX: f64 = 8.0;

/// The reason why a pose is unsuitable: the value found, and the allowed values.
pub(super) struct Flaw {
    pub(super) found: String,
    pub(super) allowed: String,
}

fn flaw<T>(found: String, allowed: impl Into<String>) -> Result<T, Flaw> {
    Err(Flaw {
        found,
        allowed: allowed.into(),
    })
}

/// A board in a pose relative to a rig.
pub(super) struct Fit<'a> {
    pub(super) board: &'a Board,
    pub(super) rig: &'a Rig,
    pub(super) rig_from_board: Pose,
}

impl Fit<'_> {
    /// Runs all checks. `least_dot_px` is the minimum length of the minor axis of a dot's image in
    /// pixels.
    pub(super) fn check(&self, least_dot_px: f64) -> Result<(), Flaw> {
        for (name, view) in [
            ("camera", &self.rig.camera),
            ("projector", &self.rig.projector),
        ] {
            self.check_turned(name, view)?;
        }
        // The size is checked before the visibility because its check needs fewer points.
        self.check_size(least_dot_px)?;
        self.check_whole()
    }

    fn point(&self, at: DVec2) -> DVec3 {
        self.rig_from_board.point(at.extend(0.0))
    }

    fn check_turned(&self, name: &str, view: &View) -> Result<(), Flaw> {
        let towards = (self.rig_from_board.translation_mm - view.center()).normalize_or_zero();
        let normal = self.rig_from_board.direction(DVec3::Z);
        let oblique = towards.dot(normal).clamp(-1.0, 1.0).acos().to_degrees();
        if oblique <= MOST_OBLIQUE_DEG {
            return Ok(());
        }
        flaw(
            format!("a board that the {name} sees {oblique:.0} degrees from its normal"),
            format!("{MOST_OBLIQUE_DEG} degrees at most: less tilt"),
        )
    }

    /// Whether a disc about a point of the board is inside a view's image.
    fn is_inside(&self, view: &View, at: DVec2, radius_mm: f64) -> bool {
        let size = DVec2::new(view.lens.width_px.into(), view.lens.height_px.into());
        let most = size - 1.0 - MARGIN_PX;
        let ends = [DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y];
        ends.into_iter().all(|end| {
            let px = view.project(self.point(at + end * radius_mm));
            px.is_some_and(|px| px.cmpge(DVec2::splat(MARGIN_PX)).all() && px.cmple(most).all())
        })
    }

    /// Checks that the board is in both images: the whole of a chessboard; all markers and at least
    /// `LEAST_SHARE` of the dots of a dot board.
    fn check_whole(&self) -> Result<(), Flaw> {
        let views = [
            ("the camera's image", &self.rig.camera),
            ("the projector's light", &self.rig.projector),
        ];
        for (name, view) in views {
            let count = |of: &dyn Fn([u32; 2]) -> bool| {
                let inside = |index: &[u32; 2]| {
                    let radius = match self.board {
                        Board::Dots { .. } => self.board.radius_mm(*index),
                        Board::Chess { pitch_mm, .. } => 1.5 * pitch_mm,
                    };
                    self.is_inside(view, self.board.point(*index), radius)
                };
                let all: Vec<_> = self.board.indices().filter(|&index| of(index)).collect();
                let inside = all.iter().filter(|index| inside(index)).count();
                (inside, all.len())
            };
            let (least, what) = match self.board {
                Board::Dots { .. } => {
                    let (inside, all) = count(&|index| self.board.is_marker(index));
                    if inside < all || all < MARKERS.len() {
                        return flaw(
                            format!("a board with {inside} of its {all} markers in {name}"),
                            format!("all {}: another distance or scale", MARKERS.len()),
                        );
                    }
                    (LEAST_SHARE, "dots")
                }
                Board::Chess { .. } => (1.0, "corners"),
            };
            let (inside, all) = count(&|_| true);
            if (inside as f64) < least * all as f64 {
                return flaw(
                    format!("a board with {inside} of its {all} {what} in {name}"),
                    format!(
                        "{:.0} % or more: a smaller board, or a greater distance",
                        100.0 * least
                    ),
                );
            }
        }
        Ok(())
    }

    /// Smallest scale of the camera's image at a point of the board, over all directions, in pixels
    /// per mm.
    fn least_scale(&self, at: DVec2) -> Option<f64> {
        let step = 1e-3 * self.board.pitch_mm();
        let px = |offset: DVec2| self.rig.camera.project(self.point(at + offset));
        let across = (px(DVec2::X * step)? - px(DVec2::NEG_X * step)?) / (2.0 * step);
        let down = (px(DVec2::Y * step)? - px(DVec2::NEG_Y * step)?) / (2.0 * step);
        let m = DMat2::from_cols(across, down);
        // Smaller singular value of a 2 x 2 matrix, from its squared norm and its determinant.
        let (sum, product) = (
            across.length_squared() + down.length_squared(),
            m.determinant(),
        );
        let root = (sum * sum - 4.0 * product * product).max(0.0).sqrt();
        Some(((sum - root) / 2.0).max(0.0).sqrt())
    }

    /// Checks that dots or squares are large enough in the camera's image.
    fn check_size(&self, least_dot_px: f64) -> Result<(), Flaw> {
        let [columns, rows] = self.board.grid();
        let middle_and_ends = |of: u32| [0, of / 2, of - 1];
        let places = middle_and_ends(rows)
            .into_iter()
            .flat_map(|row| middle_and_ends(columns).map(|column| [column, row]));
        let scale = places
            .map(|index| self.board.point(index))
            .filter(|&at| self.is_inside(&self.rig.camera, at, 0.0))
            .filter_map(|at| self.least_scale(at))
            .fold(f64::INFINITY, f64::min);
        let (what, side_mm, least) = match *self.board {
            Board::Dots { dot_mm, .. } => ("dots", dot_mm, least_dot_px),
            Board::Chess { pitch_mm, .. } => ("squares", pitch_mm, LEAST_SQUARE_PX),
        };
        let px = scale * side_mm;
        if px >= least {
            return Ok(());
        }
        let distance = self
            .rig_from_board
            .translation_mm
            .distance(self.rig.camera.center());
        let tilt = self.rig_from_board.direction(DVec3::Z).z.clamp(-1.0, 1.0);
        flaw(
            format!(
                "{what} of {side_mm} mm whose images are {px:.2} px in their shorter direction, \
                 {distance:.0} mm away and tilted {:.0} degrees",
                tilt.acos().to_degrees()
            ),
            format!("{least} px or more: a larger board, a shorter distance or less tilt"),
        )
    }
}
