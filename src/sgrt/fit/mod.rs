//! Fits the motion model's coefficients to a scan, which gives the tumour's position from the skin.
//!
//! Gauss-Newton minimises a sum of two parts. The first is a robust sum over points: the squared
//! distance of a point to the tangent plane at its foot (closest point) on the deformed surface, divided
//! by the variance. The second is the sum of the squared coefficients divided by their prior variance.
//! The sum is the negative log posterior under a Gaussian prior from planning, so its curvature is the
//! inverse covariance, and a component that the skin does not show keeps its prior.
//!
//! The tumour's covariance is the propagated covariance of the coefficients (and of the pose) plus
//! the covariance that planning gives for the components which the model [leaves
//! out](MotionModel::left_out): where the tumour lags behind the skin and no kept component describes
//! it, the lag adds to the uncertainty.
//!
//! | file | content |
//! | --- | --- |
//! | `moved` | the deformed surface and one equation per measured point |
//! | `system` | the normal equations |
//! | `state` | start and result |

mod moved;
mod state;
mod system;
#[cfg(test)]
mod tests;

pub use state::{MotionFit, MotionState};

use super::measured::Measured;
use super::model::MotionModel;
use super::robust::Spread;
use super::surface::Reference;
use super::warning::{Lost, Warning};
use glam::{DMat3, DVec3};
use moved::{Moved, Row};
use nalgebra::{DMatrix, DVector};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::Pose;
use phasmid_geometry::rotation::{exp, orthonormal};
use system::Sums;

/// Prior on the patient's set-up pose, if the pose is fitted together with the breathing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SetUp {
    /// Standard deviation of the patient's position along each axis, in millimetres.
    pub shift_sd_mm: f64,
    /// Standard deviation of the rotation vector along each axis, in degrees.
    pub turn_sd_deg: f64,
}

/// Settings of [`MotionTracker`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitOptions {
    /// Maximum number of steps.
    pub max_iterations: usize,
    /// Convergence threshold: maximum change in one step, in standard deviations for coefficients,
    /// millimetres for the shift and radians for the turn.
    pub step: f64,
    /// Points farther from the surface than this are ignored, in millimetres.
    pub capture_mm: f64,
    /// Prior standard deviation of the coefficients, in units of their standard deviation over
    /// planning: breathing depth varies from day to day.
    pub prior: f64,
    /// If set, the patient's pose is fitted too, with this prior; `None` keeps the start pose.
    pub set_up: Option<SetUp>,
    /// Correlation length of the points' errors in millimetres, as in
    /// [`RigidOptions`](super::RigidOptions).
    pub correlation_mm: f64,
    /// Minimum number of points over the region; with fewer, the fit fails.
    pub least_points: usize,
    /// Fraction of the region's area that a scan should cover; below it the result has a warning.
    pub least_coverage: f64,
    /// Scale of the residuals, in units of their standard deviations, above which a misfit is
    /// reported.
    pub misfit: f64,
    /// Coefficients above this many standard deviations of planning are reported as outside the
    /// model.
    pub outside: f64,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            max_iterations: 15,
            step: 2e-3,
            capture_mm: 40.0,
            prior: 2.0,
            set_up: None,
            correlation_mm: 1.0,
            least_points: 60,
            least_coverage: 0.3,
            misfit: 3.0,
            outside: 4.0,
        }
    }
}

/// Fits a motion model of a reference surface to scans.
pub struct MotionTracker<'a> {
    reference: &'a Reference,
    model: &'a MotionModel,
    options: FitOptions,
    /// Planned set-up pose; the prior [`SetUp`] is relative to it.
    set_up: Pose,
    /// Covariance over the phases of the tumour's centroid due to the components that the model
    /// leaves out, in square millimetres along the reference's axes.
    left_out: DMat3,
}

impl<'a> MotionTracker<'a> {
    /// Creates a tracker from a reference, a model of its vertices, and the patient's pose at set-up.
    ///
    /// # Errors
    /// Returns an error if the model and the reference have different numbers of vertices, or if an
    /// option is out of range.
    pub fn new(
        reference: &'a Reference,
        model: &'a MotionModel,
        set_up: Pose,
        options: &FitOptions,
    ) -> Result<Self> {
        let (found, wanted) = (model.skin_vertices(), reference.vertices().len());
        if found != wanted {
            return Err(Error::input(
                "motion model",
                format!("{found} vertices of the skin"),
                format!("{wanted}, those of the reference surface"),
            ));
        }
        let sds = options
            .set_up
            .map_or([1.0; 2], |s| [s.shift_sd_mm, s.turn_sd_deg]);
        for (place, value) in [
            ("prior", options.prior),
            ("step", options.step),
            ("capture_mm", options.capture_mm),
            ("set_up.shift_sd_mm", sds[0]),
            ("set_up.turn_sd_deg", sds[1]),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::input(place, value, "a positive number"));
            }
        }
        let left_out = model.left_out(&reference.region_normals());
        Ok(Self {
            reference,
            model,
            options: *options,
            set_up,
            left_out: left_out.into_iter().map(outer).sum(),
        })
    }

    /// Fits a scan, starting from the state of the previous scan or from [`MotionState::mean`].
    ///
    /// # Errors
    /// Returns an error if too few points lie over the region.
    pub fn fit(&self, measured: &Measured, start: &MotionState) -> Result<MotionFit, Lost> {
        let options = &self.options;
        let components = self.model.components();
        let mut state = start.clone();
        state.coefficients.resize(components, 0.0);
        let mut rows = Vec::new();
        let (mut iterations, mut size) = (0, f64::INFINITY);
        let mut spread = Spread::Wide;
        let mut inflation = 1.0;
        let some = measured.some();
        while iterations < options.max_iterations && (size > options.step || inflation == 1.0) {
            let looked_at = match (&some, spread) {
                (Some(some), Spread::Wide) => some,
                _ => measured,
            };
            let step = self.step(looked_at, &state, &mut rows, spread, inflation)?;
            self.apply(&mut state, &step.unknowns);
            size = step.size;
            iterations += 1;
            match spread {
                Spread::Wide if size < 0.1 => (spread, size) = (Spread::Narrow, f64::INFINITY),
                Spread::Wide => {}
                Spread::Narrow => inflation = step.inflation,
            }
        }
        let last = self.step(measured, &state, &mut rows, Spread::Narrow, inflation)?;
        let mut fit = self.judged(state, &last, &rows);
        fit.iterations = iterations;
        if size > options.step {
            fit.warnings.push(Warning::NotConverged { step_mm: size });
        }
        Ok(fit)
    }

    fn unknowns(&self) -> usize {
        self.model.components() + if self.options.set_up.is_some() { 6 } else { 0 }
    }

    /// Computes one step; the data's variance is multiplied by `inflation`.
    fn step(
        &self,
        measured: &Measured,
        state: &MotionState,
        rows: &mut Vec<Row>,
        spread: Spread,
        inflation: f64,
    ) -> Result<Step, Lost> {
        let moved = Moved::new(self.reference, self.model, &state.coefficients);
        let pose = &state.room_from_reference;
        let with_pose = self.options.set_up.is_some();
        moved.rows(rows, measured, pose, self.options.capture_mm, with_pose);
        let mut sizes: Vec<f64> = rows
            .iter()
            .filter(|r| r.counts())
            .map(|r| (r.residual_mm / r.sigma_mm).abs())
            .collect();
        if sizes.len() < self.options.least_points {
            return Err(Lost::Points {
                found: sizes.len(),
                wanted: self.options.least_points,
            });
        }
        let scale = spread.scale(&mut sizes).max(1.0);
        let n = self.unknowns();
        let sums = Sums::of(rows, scale, n);
        let mut system = DMatrix::from_fn(n, n, |a, b| sums.system[a.max(b)][a.min(b)] / inflation);
        let mut right = DVector::from_fn(n, |a, _| sums.right[a] / inflation);
        for (k, (value, deviation)) in self.prior(state).into_iter().enumerate() {
            let information = 1.0 / (deviation * deviation);
            system[(k, k)] += information;
            right[k] -= information * value;
        }
        // The prior makes the system positive definite for any points.
        let Some(factor) = system.cholesky() else {
            return Err(Lost::Line);
        };
        let unknowns = factor.solve(&right);
        let density = sums.count as f64 / self.covered(rows).max(1.0);
        let alike = 1.0 + std::f64::consts::TAU * self.options.correlation_mm.powi(2) * density;
        Ok(Step {
            size: unknowns.amax(),
            unknowns,
            covariance: factor.inverse(),
            inflation: sums.inflation.factor(n) * alike,
            scale,
            sums,
        })
    }

    /// For each unknown, its difference from the prior mean and its prior standard deviation.
    fn prior(&self, state: &MotionState) -> Vec<(f64, f64)> {
        let deviation = self.options.prior;
        let mut found: Vec<(f64, f64)> =
            state.coefficients.iter().map(|&c| (c, deviation)).collect();
        if let Some(set_up) = self.options.set_up {
            let pose = &state.room_from_reference;
            let shift = pose.translation_mm - self.set_up.translation_mm;
            let r = pose.rotation * self.set_up.rotation.transpose();
            // Set-up rotations are a few degrees: the sine equals the angle to about a thousandth.
            let turned = DVec3::new(
                r.y_axis.z - r.z_axis.y,
                r.z_axis.x - r.x_axis.z,
                r.x_axis.y - r.y_axis.x,
            ) / 2.0;
            found.extend(shift.to_array().map(|s| (s, set_up.shift_sd_mm)));
            let deviation = set_up.turn_sd_deg.to_radians();
            found.extend(turned.to_array().map(|t| (t, deviation)));
        }
        found
    }

    fn apply(&self, state: &mut MotionState, unknowns: &DVector<f64>) {
        let count = state.coefficients.len();
        for (c, u) in state.coefficients.iter_mut().zip(unknowns.iter()) {
            *c += u;
        }
        if self.options.set_up.is_some() {
            let at = |k: usize| DVec3::new(unknowns[k], unknowns[k + 1], unknowns[k + 2]);
            let pose = &mut state.room_from_reference;
            pose.translation_mm += at(count);
            pose.rotation = orthonormal(exp(at(count + 3)) * pose.rotation);
        }
    }

    fn covered(&self, rows: &[Row]) -> f64 {
        let used = rows.iter().filter(|r| r.counts()).map(|r| r.triangle);
        self.reference.covered_mm2(used)
    }

    fn judged(&self, state: MotionState, last: &Step, rows: &[Row]) -> MotionFit {
        let (options, pose) = (&self.options, &state.room_from_reference);
        let inside = self.model.centroid(&state.coefficients);
        let tumour_mm = pose.point(inside);
        let mut gains: Vec<DVec3> = self
            .model
            .centroid_modes()
            .iter()
            .map(|m| pose.direction(*m))
            .collect();
        if options.set_up.is_some() {
            gains.extend(DVec3::AXES);
            let lever = tumour_mm - pose.translation_mm;
            gains.extend(DVec3::AXES.map(|axis| axis.cross(lever)));
        }
        let scale = options.prior * options.prior;
        let turned = pose.rotation * self.left_out * pose.rotation.transpose();
        let mut tumour_covariance = turned * scale;
        for (a, ga) in gains.iter().enumerate() {
            for (b, gb) in gains.iter().enumerate() {
                let share = *ga * last.covariance[(a, b)];
                tumour_covariance += DMat3::from_cols(share * gb.x, share * gb.y, share * gb.z);
            }
        }
        let mut warnings = Vec::new();
        if last.scale > options.misfit {
            warnings.push(Warning::Misfit { factor: last.scale });
        }
        let coverage = self.covered(rows) / self.reference.area_mm2();
        if coverage < options.least_coverage {
            warnings.push(Warning::Coverage { share: coverage });
        }
        let farthest = state
            .coefficients
            .iter()
            .fold(0.0_f64, |m, c| m.max(c.abs()));
        if farthest > options.outside {
            warnings.push(Warning::OutsideModel {
                deviations: farthest,
            });
        }
        MotionFit {
            state,
            covariance: last.covariance.clone(),
            tumour_mm,
            tumour_covariance,
            warnings,
            points: last.sums.count,
            coverage,
            rms_mm: (last.sums.squares_mm2 / last.sums.shares.max(f64::MIN_POSITIVE)).sqrt(),
            spread: last.scale,
            iterations: 0,
        }
    }
}

fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

/// One step of the fit.
struct Step {
    unknowns: DVector<f64>,
    /// Largest absolute value of the unknowns.
    size: f64,
    covariance: DMatrix<f64>,
    inflation: f64,
    scale: f64,
    sums: Sums,
}
