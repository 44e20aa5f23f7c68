//! A breathing thorax with a tumour, generated: skin, lungs, tumour and motion in closed form.
//!
//! ```text
//!  patients/*.toml -> [ parameters, checks ] -> Phantom
//!                                                 |-- outline + relief -> skin -> skin_mesh
//!                                                 |-- organs, tumour -> hounsfield
//!                                                 |-- modes: where tissue goes, per millimetre
//!                                                 '-- breathing: how many millimetres, when
//! ```
//!
//! Displacement is u(x, t) = sum over k of w_k(t) m_k(x): five fields of the body (`modes.rs`) and their
//! weights over device time (`breathing.rs`). At the reference phase, the end of exhaling of the mean
//! cycle at planning, all weights are 0. Three fields move the skin, so that it is at any time a
//! blend of four key meshes; the others move lungs, diaphragm and tumour under it and lag behind,
//! which makes the hysteresis between skin and tumour.
//!
//! This is truth, for whoever plays the device. The host's half reads the planning folder
//! ([`Phantom::export_planning`]) and never this module.
//!
//! Places are in the patient frame: LPS in millimetres, the origin at the planning isocentre, which is
//! the tumour's centroid at the reference phase.

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

/// How many triangles a skin has unless asked otherwise.
pub const SKIN_TRIANGLES: u32 = 60_000;
/// How far a key mesh is from the one at rest, in millimetres of its mode.
pub const KEY_MM: f64 = 10.0;
/// Fewest and most triangles of a skin.
pub const TRIANGLES: std::ops::RangeInclusive<u32> = 1000..=4_000_000;
/// Finest tumour: 20 * 4^7 triangles.
const FINEST: u32 = 7;

/// A patient in motion.
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

/// Where a patient is at a moment: how much of each mode, and the set-up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Weights of the modes in millimetres, by [`THORAX`] and its like.
    pub weights_mm: [f64; MODES],
    /// Takes the planned place to the one on the couch, in the patient frame.
    pub setup: Pose,
    /// How far the cycle is, 0 to 1: 0 is the end of inhaling.
    pub phase: f64,
}

/// The truth about the tumour at a moment, set-up included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Centroid in the patient frame in millimetres.
    pub centroid_mm: DVec3,
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
    /// Makes a patient. Those that were loaded or parsed have been checked.
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

    /// What it was made of.
    pub fn patient(&self) -> &Patient {
        &self.patient
    }

    /// One of the ten phases of planning, in tenths of the mean cycle from the end of inhaling; tens
    /// are left out of what is larger.
    pub fn planning_phase(&self, tenth: usize) -> State {
        let phase = (tenth % PHASES) as f64 / PHASES as f64;
        State {
            weights_mm: self.course.mean(phase),
            setup: Pose::IDENTITY,
            phase,
        }
    }

    /// Where the patient is at a device time in seconds, of any sign. Nothing has to be computed
    /// before it.
    pub fn state(&self, day: Day, time_s: f64) -> State {
        State {
            weights_mm: self.course.weights(day, time_s),
            setup: self.setup(day),
            phase: self.course.cycles(day, time_s).rem_euclid(1.0),
        }
    }

    /// Breath held on a day, at a share of planning's mean cycle from the end of inhaling: 0.5 is the
    /// reference phase.
    pub fn held(&self, day: Day, phase: f64) -> State {
        State {
            weights_mm: self.course.mean(phase),
            setup: self.setup(day),
            phase,
        }
    }

    /// The set-up of a day.
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

    /// Ranges in millimetres that hold the weights of each mode at every moment of both days.
    pub fn weight_bounds_mm(&self) -> [[f64; 2]; MODES] {
        Course::bounds(&self.patient)
    }

    /// How far tissue that is at `x_mm` at the reference phase has gone, without set-up, in
    /// millimetres. It is twice continuously differentiable everywhere.
    pub fn displacement(&self, x_mm: DVec3, state: &State) -> DVec3 {
        let body = x_mm + self.isocentre;
        self.modes.displacement(body, &state.weights_mm)
    }

    /// The derivative of [`Self::displacement`]: column j is that by coordinate j.
    pub fn gradient(&self, x_mm: DVec3, state: &State) -> DMat3 {
        let body = x_mm + self.isocentre;
        self.modes.gradient(body, &state.weights_mm)
    }

    /// Where tissue that is at `x_mm` at the reference phase is now, set-up included.
    pub fn place(&self, x_mm: DVec3, state: &State) -> DVec3 {
        state.setup.point(x_mm + self.displacement(x_mm, state))
    }

    /// Where tissue that is now at `y_mm` is at the reference phase: [`Self::place`] takes it back to
    /// within 1e-9 mm.
    pub fn origin(&self, y_mm: DVec3, state: &State) -> DVec3 {
        let deformed = state.setup.inverse().point(y_mm) + self.isocentre;
        self.modes.inverse(deformed, &state.weights_mm) - self.isocentre
    }

    /// Hounsfield units at a place now, set-up included. The skin's border with air is at -500.
    pub fn hounsfield(&self, y_mm: DVec3, state: &State) -> f64 {
        self.hounsfield_of(y_mm, state, hounsfield::BORDER_MM)
    }

    /// [`Self::hounsfield`] where borders are `border_mm` wide to either side: what a voxel of twice
    /// that size measures.
    fn hounsfield_of(&self, y_mm: DVec3, state: &State, border_mm: f64) -> f64 {
        let x = self.origin(y_mm, state);
        let place = hounsfield::Place {
            x: x + self.isocentre,
            stretched: (DMat3::IDENTITY + self.gradient(x, state)).determinant(),
        };
        let parts = (&self.skin, self.modes.organs(), &self.tumour);
        hounsfield::value(parts, &place, border_mm)
    }

    /// How far a place of the reference phase is outside the skin, negative inside: exactly 0 on it
    /// and in millimetres near it.
    pub fn outside_skin(&self, x_mm: DVec3) -> f64 {
        self.skin.outside(x_mm + self.isocentre)
    }

    /// The lobe that a place of the reference phase is in; none outside the lungs.
    pub fn lobe(&self, x_mm: DVec3) -> Option<Lobe> {
        self.modes.organs().lobe(x_mm + self.isocentre)
    }

    /// The skin at the reference phase: closed, outward, of about so many triangles of even size.
    ///
    /// # Errors
    /// Fewer than 1000 triangles or more than 4 million.
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

    /// The meshes that the skin is a blend of, by [`Self::skin_weights`]: at rest, and at
    /// [`KEY_MM`] of each mode that moves it. All have the same triangles.
    ///
    /// # Errors
    /// As for [`Self::skin`].
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

    /// How much of each key mesh the skin has, without set-up; the sum is 1.
    pub fn skin_weights(&self, state: &State) -> [f64; 4] {
        let [a, b, c] = [THORAX, ABDOMEN, POSTURE].map(|mode| state.weights_mm[mode] / KEY_MM);
        [1.0 - a - b - c, a, b, c]
    }

    /// A mesh of the reference phase where its tissue is now, set-up included.
    pub fn deformed(&self, rest: &Mesh, state: &State) -> Mesh {
        let mut mesh = rest.clone();
        for v in &mut mesh.vertices {
            *v = self.place(*v, state);
        }
        mesh
    }

    /// The tumour's surface now, set-up included: closed, outward, 20 * 4^level triangles, at most
    /// those of level 7.
    pub fn tumour_mesh(&self, state: &State, level: u32) -> Mesh {
        let mut rest = self.tumour.mesh(level.min(FINEST));
        for v in &mut rest.vertices {
            *v -= self.isocentre;
        }
        self.deformed(&rest, state)
    }

    /// The tumour's centroid and volume now, by quadrature over the tissue.
    pub fn target(&self, state: &State) -> Target {
        let (mut volume_mm3, mut moment) = (0.0, DVec3::ZERO);
        for (body, volume) in self.tumour.inside() {
            let x = body - self.isocentre;
            let now = volume * (DMat3::IDENTITY + self.gradient(x, state)).determinant();
            volume_mm3 += now;
            moment += self.place(x, state) * now;
        }
        Target {
            centroid_mm: moment / volume_mm3,
            volume_mm3,
        }
    }
}
