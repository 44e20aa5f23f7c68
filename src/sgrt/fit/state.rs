//! What a fit starts from and what it gives.

use super::super::model::MotionModel;
use super::super::warning::Warning;
use glam::{DMat3, DVec3};
use nalgebra::DMatrix;
use phasmid_geometry::{Mesh, Pose};

/// A state of the patient: where a fit starts, and where it ends.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionState {
    /// Takes the reference's coordinates to the room's.
    pub room_from_reference: Pose,
    /// Coefficients of the components, in deviations of planning.
    pub coefficients: Vec<f64>,
}

impl MotionState {
    /// The mean of planning, the patient set up as planned.
    pub fn mean(model: &MotionModel) -> Self {
        Self {
            room_from_reference: Pose::IDENTITY,
            coefficients: vec![0.0; model.components()],
        }
    }
}

/// A fitted motion, and how far to trust it.
#[derive(Debug, Clone)]
pub struct MotionFit {
    /// The state; the start of the next scan's fit.
    pub state: MotionState,
    /// Covariance of the coefficients, then, where the pose was fitted, of shift (mm) and rotation
    /// vector (rad) along the room's axes.
    pub covariance: DMatrix<f64>,
    /// The tumour's centroid in the room frame, in millimetres.
    pub tumour_mm: DVec3,
    /// Its covariance in square millimetres.
    pub tumour_covariance: DMat3,
    /// Reasons to doubt the answer; empty for none.
    pub warnings: Vec<Warning>,
    /// Points that have had a say.
    pub points: usize,
    /// Share of the region's area that is measured.
    pub coverage: f64,
    /// RMS distance to the tangent planes of the points that have had a say, in millimetres.
    pub rms_mm: f64,
    /// Spread of the residuals in units of their deviations.
    pub spread: f64,
    /// Steps made.
    pub iterations: usize,
}

impl MotionFit {
    /// The tumour's closed mesh in the room frame, in millimetres.
    pub fn tumour(&self, model: &MotionModel) -> Mesh {
        let mut mesh = model.tumour(&self.state.coefficients);
        for v in &mut mesh.vertices {
            *v = self.state.room_from_reference.point(*v);
        }
        mesh
    }
}
