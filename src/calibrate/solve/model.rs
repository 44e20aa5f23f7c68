//! Predicted image points of a board point, and their derivatives with respect to all unknowns.
//!
//! Order of the unknowns: the rig's, as in `phasmid_geometry::parameters`, then rotation and
//! translation of a board.

use super::observation::Observation;
use glam::{DVec2, DVec3};
use phasmid_geometry::parameters::{LENS, RIG, by_motion};
use phasmid_geometry::rotation::nudge;
use phasmid_geometry::{Lens, Pose};

/// Number of unknowns that one point depends on: the rig and one board.
pub(super) const ALL: usize = RIG + 6;

/// Values of all unknowns. The rig's frame is the camera's frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct State {
    pub camera: Lens,
    pub projector: Lens,
    pub rig_from_projector: Pose,
    pub boards: Vec<Pose>,
}

impl State {
    /// Returns the state after a step in the order given above; `boards` has six numbers per board.
    pub fn stepped(&self, rig: &[f64; RIG], boards: &[[f64; 6]]) -> Self {
        Self {
            camera: self.camera.stepped(&rig[..LENS]),
            projector: self.projector.stepped(&rig[LENS..2 * LENS]),
            rig_from_projector: step_pose(&self.rig_from_projector, &rig[2 * LENS..]),
            boards: self
                .boards
                .iter()
                .zip(boards)
                .map(|(pose, step)| step_pose(pose, step))
                .collect(),
        }
    }

    /// Whether both lenses have finite, positive focal lengths and finite principal points.
    pub fn is_proper(&self) -> bool {
        [&self.camera, &self.projector].iter().all(|l| {
            l.focal_px.is_finite() && l.focal_px.min_element() > 0.0 && l.principal_px.is_finite()
        })
    }
}

fn step_pose(pose: &Pose, step: &[f64]) -> Pose {
    nudge(
        pose,
        DVec3::new(step[0], step[1], step[2]),
        DVec3::new(step[3], step[4], step[5]),
    )
}

/// Residuals of a point, observed minus predicted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Residual {
    /// In camera pixels.
    pub camera: DVec2,
    /// Projector residual in pixels; `None` if the point has no projector coordinate.
    pub projector: Option<DVec2>,
}

/// Whitened residuals of a point; see `observation`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Whitened {
    pub camera: DVec2,
    pub projector: Option<DVec2>,
}

/// Computes the residuals of a point on board `board`. Returns `None` if it is behind a lens.
pub(super) fn residual(o: &Observation, state: &State, board: usize) -> Option<Residual> {
    let x = state.boards[board].point(o.board.extend(0.0));
    let expected = project(&state.camera, x)?;
    let projector = match &o.lit {
        None => None,
        Some(lit) => {
            let rig = &state.rig_from_projector;
            let y = rig.rotation.transpose() * (x - rig.translation_mm);
            Some(lit.px - project(&state.projector, y)?)
        }
    };
    Some(Residual {
        camera: o.camera - expected,
        projector,
    })
}

fn project(lens: &Lens, p: DVec3) -> Option<DVec2> {
    (p.z > 0.0).then(|| lens.distort_to_px(p.truncate() / p.z))
}

impl Residual {
    /// Whitens the residuals: scales them to unit variance and removes their correlation.
    pub fn whitened(&self, o: &Observation) -> Whitened {
        Whitened {
            camera: o.camera_whitener * self.camera,
            projector: self
                .projector
                .zip(o.lit.as_ref())
                .map(|(r, lit)| lit.whitener * (r - lit.slope * self.camera)),
        }
    }
}

/// Derivatives of the whitened predictions: rows u and v, one column per unknown.
pub(super) struct Slopes {
    /// The camera's rows; zero for the projector's unknowns.
    pub camera: [[f64; ALL]; 2],
    /// The projector's rows.
    pub projector: [[f64; ALL]; 2],
}

/// Computes the whitened residuals and the derivatives of the predictions (the residuals'
/// derivatives have the opposite sign). Returns `None` if the point is behind a lens.
pub(super) fn linearise(
    o: &Observation,
    state: &State,
    board: usize,
) -> Option<(Whitened, Slopes)> {
    let pose = &state.boards[board];
    let arm = pose.rotation * o.board.extend(0.0);
    let x = arm + pose.translation_mm;
    let seen = state.camera.sight(x)?;
    // Derivatives of the camera's pixel with respect to its lens and the board's pose.
    let mut camera = [DVec2::ZERO; ALL];
    camera[..LENS].copy_from_slice(&seen.by_lens);
    by_motion(&seen.by_point, arm, &mut camera[RIG..]);

    let mut whitened = Whitened {
        camera: o.camera_whitener * (o.camera - seen.px),
        projector: None,
    };
    let mut slopes = Slopes {
        camera: rows(&camera.map(|c| o.camera_whitener * c)),
        projector: [[0.0; ALL]; 2],
    };
    if let Some(lit) = &o.lit {
        let rig = &state.rig_from_projector;
        let from_rig = rig.rotation.transpose();
        let arm_of_rig = x - rig.translation_mm;
        let lights = state.projector.sight(from_rig * arm_of_rig)?;
        let by_point = lights.by_point.map(|row| rig.rotation * row);
        let mut projector = [DVec2::ZERO; ALL];
        projector[LENS..2 * LENS].copy_from_slice(&lights.by_lens);
        // The projector moves and the point stays, hence the opposite sign.
        by_motion(&by_point, arm_of_rig, &mut projector[2 * LENS..RIG]);
        for c in &mut projector[2 * LENS..RIG] {
            *c = -*c;
        }
        by_motion(&by_point, arm, &mut projector[RIG..]);
        let r = lit.px - lights.px - lit.slope * (o.camera - seen.px);
        whitened.projector = Some(lit.whitener * r);
        for (p, c) in projector.iter_mut().zip(&camera) {
            *p = lit.whitener * (*p - lit.slope * *c);
        }
        slopes.projector = rows(&projector);
    }
    Some((whitened, slopes))
}

fn rows(columns: &[DVec2; ALL]) -> [[f64; ALL]; 2] {
    [columns.map(|c| c.x), columns.map(|c| c.y)]
}
