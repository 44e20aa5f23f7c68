//! A generated, breathing thorax with a tumour: skin, lungs, tumour and motion in closed form. It
//! is ground truth for the device side; no host-side crate may depend on it, and the host reads
//! only the exported planning folder ([`Phantom::export_planning`]). Depends on `phasmid-core`,
//! `phasmid-geometry`, `phasmid-planning` and `phasmid-device-profiles`.
//!
//! | module | contents |
//! | --- | --- |
//! | `breathing` | weights of the motion modes over time |
//! | `catalogue` | the built-in patients |
//! | `checks`, `parameters` | the patient file, and its loading and validation |
//! | `export` | the planning folder |
//! | `hounsfield` | CT values |
//! | `modes` | displacement fields |
//! | `organs`, `tumour` | lungs, other organs and the tumour |
//! | `outline`, `relief`, `skin`, `skin_mesh` | the body's surface and its mesh |
//! | `random`, `real`, `spline` | random numbers, automatic differentiation, splines |
//! | [`tissue`] | optical properties of skin |
//!
//! ```text
//!  patients/*.toml -> [ parameters, checks ] -> Phantom
//!                                                 |-- outline + relief -> skin -> skin_mesh
//!                                                 |-- organs, tumour -> hounsfield
//!                                                 |-- modes: where tissue goes, per millimetre
//!                                                 '-- breathing: how many millimetres, when
//! ```
//!
//! Displacement is u(x, t) = sum over k of w_k(t) m_k(x): five fields of the body (`modes.rs`) with
//! weights over device time (`breathing`). At the reference phase, end-exhale of the mean cycle at
//! planning, all weights are 0. Three fields move the skin, which is therefore at any time a blend of
//! four key meshes. The other two fields move lungs, diaphragm and tumour; they lag behind the skin,
//! which causes the hysteresis between skin and tumour.
//!
//! Coordinates are in the patient frame: LPS in millimetres, with the origin at the planning
//! isocentre, which is the tumour's centroid at the reference phase.

mod breathing;
mod catalogue;
mod checks;
mod export;
mod hounsfield;
mod modes;
mod organs;
mod outline;
mod parameters;
mod random;
mod real;
mod relief;
mod skin;
mod skin_mesh;
mod spline;
#[cfg(test)]
mod tests;
pub mod tissue;
mod tumour;

pub use breathing::{Day, PHASES, REFERENCE_PHASE};
pub use catalogue::patient_names;
pub use modes::{ABDOMEN, DIAPHRAGM, LUNG, MODES, POSTURE, THORAX};
pub use parameters::{Breathing, Chest, Lobe, Patient, Scar, Sex, Treatment, Tumour};

use breathing::Course;
use glam::{DMat3, DVec3};
use modes::Modes;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Mesh, Pose};
use skin::Skin;
use tumour::Shape;

/// Default number of triangles of a skin.
pub const SKIN_TRIANGLES: u32 = 60_000;
/// Weight of a mode at which the mode's key mesh is computed, in millimetres.
pub const KEY_MM: f64 = 10.0;
/// Allowed number of triangles of a skin.
pub const TRIANGLES: std::ops::RangeInclusive<u32> = 1000..=4_000_000;
/// Maximum subdivision level of a tumour mesh: 20 * 4^7 triangles.
const FINEST: u32 = 7;

/// A generated patient that can be evaluated at any time.
#[derive(Debug, Clone, PartialEq)]
pub struct Phantom {
    patient: Patient,
    skin: Skin,
    tumour: Shape,
    modes: Modes,
    course: Course,
    /// Planning isocentre in the body frame.
    isocentre: DVec3,
}

/// A patient's state at a time: mode weights and set-up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Weights of the modes in millimetres, indexed by [`THORAX`] etc.
    pub weights_mm: [f64; MODES],
    /// Maps planned positions to the positions on the couch, in the patient frame.
    pub setup: Pose,
    /// Phase of the cycle, 0 to 1; 0 is end-inhale.
    pub phase: f64,
}

/// True position and volume of the tumour at a time, including set-up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Centroid in the patient frame in millimetres.
    pub centroid_mm: [f64; 3],
    /// Volume in cubic millimetres.
    pub volume_mm3: f64,
}

impl State {
    /// The reference phase at planning.
    pub const REFERENCE: Self = Self {
        weights_mm: [0.0; MODES],
        setup: Pose::IDENTITY,
        phase: 0.5,
    };
}

impl Phantom {
    /// Creates a patient. Loaded or parsed parameters have already been checked.
    pub fn new(patient: &Patient) -> Self {
        let tumour = Shape::new(patient);
        Self {
            skin: Skin::new(patient),
            modes: Modes::new(patient),
            course: Course::new(patient),
            isocentre: tumour.centroid(),
            tumour,
            patient: patient.clone(),
        }
    }

    /// Returns the patient's parameters.
    pub fn patient(&self) -> &Patient {
        &self.patient
    }

    /// Returns one of the ten planning phases, in tenths of the mean cycle from end-inhale; `tenth`
    /// wraps around.
    pub fn planning_phase(&self, tenth: usize) -> State {
        let phase = (tenth % PHASES) as f64 / PHASES as f64;
        State {
            weights_mm: self.course.mean(phase),
            setup: Pose::IDENTITY,
            phase,
        }
    }

    /// Returns the state at a device time in seconds, which may be negative. It is computed
    /// independently of other times.
    pub fn state(&self, day: Day, time_s: f64) -> State {
        State {
            weights_mm: self.course.weights(day, time_s),
            setup: self.setup(day),
            phase: self.course.cycles(day, time_s).rem_euclid(1.0),
        }
    }

    /// Returns the state with the breath held on a day, at a phase of planning's mean cycle: 0 is
    /// end-inhale, 0.5 the reference phase.
    pub fn held(&self, day: Day, phase: f64) -> State {
        State {
            weights_mm: self.course.mean(phase),
            setup: self.setup(day),
            phase,
        }
    }

    /// Returns the set-up error of a day.
    pub fn setup(&self, day: Day) -> Pose {
        let t = &self.patient.treatment;
        match day {
            Day::Planning => Pose::IDENTITY,
            Day::Treatment => Pose::from_xyz_deg(
                DVec3::from_array(t.setup_mm),
                DVec3::from_array(t.setup_deg),
            ),
        }
    }

    /// Returns bounds of each mode's weight over all times of both days, in millimetres.
    pub fn weight_bounds_mm(&self) -> [[f64; 2]; MODES] {
        Course::bounds(&self.patient)
    }

    /// Returns the displacement, without set-up, of tissue that is at `x_mm` at the reference
    /// phase, in millimetres. It is twice continuously differentiable everywhere.
    pub fn displacement(&self, x_mm: DVec3, state: &State) -> DVec3 {
        let body = x_mm + self.isocentre;
        self.modes.displacement(body, &state.weights_mm)
    }

    /// Returns the gradient of [`Self::displacement`]; column j is the derivative by coordinate j.
    pub fn gradient(&self, x_mm: DVec3, state: &State) -> DMat3 {
        let body = x_mm + self.isocentre;
        self.modes.gradient(body, &state.weights_mm)
    }

    /// Returns the current position, including set-up, of tissue that is at `x_mm` at the reference
    /// phase.
    pub fn place(&self, x_mm: DVec3, state: &State) -> DVec3 {
        state.setup.point(x_mm + self.displacement(x_mm, state))
    }

    /// Returns the position at the reference phase of tissue that is now at `y_mm`, such that
    /// [`Self::place`] maps it back to within 1e-9 mm.
    pub fn origin(&self, y_mm: DVec3, state: &State) -> DVec3 {
        let deformed = state.setup.inverse().point(y_mm) + self.isocentre;
        self.modes.inverse(deformed, &state.weights_mm) - self.isocentre
    }

    /// Returns the Hounsfield units at a current position, including set-up. The skin's border with
    /// air is at -500.
    pub fn hounsfield(&self, y_mm: DVec3, state: &State) -> f64 {
        self.hounsfield_of(y_mm, state, hounsfield::BORDER_MM)
    }

    /// Returns the value of [`Self::hounsfield`] with tissue borders that extend `border_mm` to either
    /// side, which is the value of a voxel of twice that size.
    fn hounsfield_of(&self, y_mm: DVec3, state: &State, border_mm: f64) -> f64 {
        let x = self.origin(y_mm, state);
        let place = hounsfield::Place {
            x: x + self.isocentre,
            stretched: (DMat3::IDENTITY + self.gradient(x, state)).determinant(),
        };
        let parts = (&self.skin, self.modes.organs(), &self.tumour);
        hounsfield::value(parts, &place, border_mm)
    }

    /// Returns the signed distance of a point of the reference phase from the skin, negative
    /// inside: exactly 0 on the skin and in millimetres near it.
    pub fn outside_skin(&self, x_mm: DVec3) -> f64 {
        self.skin.outside(x_mm + self.isocentre)
    }

    /// Returns the lobe that contains a point of the reference phase; `None` outside the lungs.
    pub fn lobe(&self, x_mm: DVec3) -> Option<Lobe> {
        self.modes.organs().lobe(x_mm + self.isocentre)
    }

    /// Returns the skin at the reference phase as a closed mesh with outward triangles of even
    /// size, about `triangles` in number.
    ///
    /// # Errors
    /// Returns an error for fewer than 1000 or more than 4 million triangles.
    pub fn skin(&self, triangles: u32) -> Result<Mesh> {
        if !TRIANGLES.contains(&triangles) {
            let (least, most) = (TRIANGLES.start(), TRIANGLES.end());
            return Err(Error::input(
                "triangles of a skin",
                triangles,
                format!("{least} to {most}"),
            ));
        }
        let mut mesh = skin_mesh::mesh(&self.skin, triangles);
        for v in &mut mesh.vertices {
            *v -= self.isocentre;
        }
        Ok(mesh)
    }

    /// Returns the meshes that [`Self::skin_weights`] blends: at rest, and at [`KEY_MM`] of each
    /// mode that moves the skin. All have the same triangles.
    ///
    /// # Errors
    /// Returns the errors of [`Self::skin`].
    pub fn skin_keys(&self, triangles: u32) -> Result<[Mesh; 4]> {
        let rest = self.skin(triangles)?;
        let key = |mode: usize| {
            let mut weights_mm = [0.0; MODES];
            weights_mm[mode] = KEY_MM;
            let state = State {
                weights_mm,
                ..State::REFERENCE
            };
            self.deformed(&rest, &state)
        };
        let [thorax, abdomen, posture] = [THORAX, ABDOMEN, POSTURE].map(key);
        Ok([rest, thorax, abdomen, posture])
    }

    /// Returns the weight of each key mesh in the skin, without set-up; the sum is 1.
    pub fn skin_weights(&self, state: &State) -> [f64; 4] {
        let [a, b, c] = [THORAX, ABDOMEN, POSTURE].map(|mode| state.weights_mm[mode] / KEY_MM);
        [1.0 - a - b - c, a, b, c]
    }

    /// Returns a mesh of the reference phase moved to the current state, including set-up.
    pub fn deformed(&self, rest: &Mesh, state: &State) -> Mesh {
        let mut mesh = rest.clone();
        for v in &mut mesh.vertices {
            *v = self.place(*v, state);
        }
        mesh
    }

    /// Returns the tumour's current surface, including set-up: closed, with 20 * 4^level outward
    /// triangles; `level` is limited to 7.
    pub fn tumour_mesh(&self, state: &State, level: u32) -> Mesh {
        let mut rest = self.tumour.mesh(level.min(FINEST));
        for v in &mut rest.vertices {
            *v -= self.isocentre;
        }
        self.deformed(&rest, state)
    }

    /// Returns the tumour's current centroid and volume, by quadrature over its tissue.
    pub fn target(&self, state: &State) -> Target {
        let (mut volume_mm3, mut moment) = (0.0, DVec3::ZERO);
        for (body, volume) in self.tumour.inside() {
            let x = body - self.isocentre;
            let now = volume * (DMat3::IDENTITY + self.gradient(x, state)).determinant();
            volume_mm3 += now;
            moment += self.place(x, state) * now;
        }
        Target {
            centroid_mm: (moment / volume_mm3).to_array(),
            volume_mm3,
        }
    }
}
