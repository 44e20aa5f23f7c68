//! State and result of a fit.

use super::super::model::MotionModel;
use super::super::warning::Warning;
use glam::{DMat3, DVec3};
use nalgebra::DMatrix;
use phasmid_geometry::{Mesh, Pose};

/// A state of the patient: the start and the result of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionState {
    /// Maps reference coordinates to room coordinates.
    pub room_from_reference: Pose,
    /// Coefficients of the components, in standard deviations of planning.
    pub coefficients: Vec<f64>,
}

impl MotionState {
    /// Returns the mean of planning, with the patient set up as planned.
    pub fn mean(model: &MotionModel) -> Self {
        Self {
            room_from_reference: Pose::IDENTITY,
            coefficients: vec![0.0; model.components()],
        }
    }
}

/// A fitted motion with its uncertainty.
#[derive(Debug, Clone)]
pub struct MotionFit {
    /// The state; also the start for the next scan.
    pub state: MotionState,
    /// Covariance of the coefficients, followed, if the pose was fitted, by shift (mm) and rotation
    /// vector (rad) along the room's axes.
    pub covariance: DMatrix<f64>,
    /// The tumour's centroid in the room frame, in millimetres.
    pub tumour_mm: DVec3,
    /// Covariance of the tumour's centroid, in square millimetres.
    pub tumour_covariance: DMat3,
    /// Reasons to doubt the result; empty if there are none.
    pub warnings: Vec<Warning>,
    /// Number of points with non-zero weight.
    pub points: usize,
    /// Fraction of the region's area that is measured.
    pub coverage: f64,
    /// RMS distance of the points with non-zero weight to their tangent planes, in millimetres.
    pub rms_mm: f64,
    /// Scale of the residuals in units of their standard deviations.
    pub spread: f64,
    /// Number of steps taken.
    pub iterations: usize,
}

impl MotionFit {
    /// Computes the tumour's closed mesh in the room frame, in millimetres.
    pub fn tumour(&self, model: &MotionModel) -> Mesh {
        let mut mesh = model.tumour(&self.state.coefficients);
        for v in &mut mesh.vertices {
            *v = self.state.room_from_reference.point(*v);
        }
        mesh
    }
}
