//! Patient parameters, read from `device-profiles/patients/*.toml`.

use crate::tissue::Skin;
use phasmid_core::numbers::exactly;
use serde::{Deserialize, Serialize};

/// Parameters of a generated patient: body, tumour, breathing, and the day of the treatment.
/// Generation is deterministic: equal parameters give identical patients.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Patient {
    /// Name for selection.
    pub name: String,
    /// One-line description for listings.
    pub description: String,
    /// Selects the outlines of the body.
    pub sex: Sex,
    /// Age in years, 5 to 100; informative, generation does not use it.
    pub age_years: u32,
    /// Standing height, 1000 to 2100 mm.
    pub stature_mm: f64,
    /// Body mass, 14 to 200 kg; determines the thickness of the layer over bone and muscle.
    pub mass_kg: f64,
    /// Seed of the variation of the body, the tumour and the treatment day.
    pub seed: u64,
    /// Optical properties of the skin, as for any object of a scene.
    pub skin: Skin,
    /// Breasts and skin folds.
    #[serde(default)]
    pub chest: Chest,
    /// A surgical scar, if any.
    #[serde(default)]
    pub scar: Option<Scar>,
    /// The target tumour.
    pub tumour: Tumour,
    /// Breathing at planning.
    pub breathing: Breathing,
    /// Differences on the day of the treatment.
    #[serde(default)]
    pub treatment: Treatment,
}

/// Sex, which selects the outlines of the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Sex {
    /// Narrower waist and chest, wider hips.
    Female,
    /// Wider chest, narrower hips.
    Male,
}

/// Breasts and skin folds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Chest {
    /// Volume of the right and the left breast in millilitres, 0 to 1500.
    #[serde(default, deserialize_with = "exactly")]
    pub breast_ml: [f64; 2],
    /// Depth of the skin folds across the abdomen and the flanks, 0 to 16 mm. Default: 0.8 mm for
    /// each kg/m2 of body mass index above 27.
    #[serde(default)]
    pub fold_mm: Option<f64>,
}

/// A scar on the front or a side: a line along the skin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Scar {
    /// Start: along the skin from the middle of the front to the patient's left, and from the tip
    /// of the breastbone towards the head, in millimetres; within 300.
    #[serde(deserialize_with = "exactly")]
    pub from_mm: [f64; 2],
    /// End, in the same coordinates.
    #[serde(deserialize_with = "exactly")]
    pub to_mm: [f64; 2],
    /// Half width, 2 to 40 mm, measured where the height is 0.6 of the maximum.
    pub half_width_mm: f64,
    /// Height above the skin, -8 to 6 mm; negative for a sunken scar.
    pub height_mm: f64,
}

/// A lobe of a lung.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Lobe {
    /// Right lung, above both fissures.
    RightUpper,
    /// Right lung, between its fissures.
    RightMiddle,
    /// Right lung, below the oblique fissure.
    RightLower,
    /// Left lung, above its fissure.
    LeftUpper,
    /// Left lung, below its fissure.
    LeftLower,
}

/// A tumour in a lung.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Tumour {
    /// The lobe that contains it.
    pub lobe: Lobe,
    /// Diameter of the ball of equal volume, 5 to 70 mm.
    pub diameter_mm: f64,
    /// Maximum deviation of the surface from that ball, as a fraction of its radius, 0 to 0.35.
    #[serde(default)]
    pub roughness: f64,
    /// Offset from the default position in the lobe, along the patient's axes (left, posterior,
    /// head), within 60 mm; the tumour must stay inside the lobe.
    #[serde(default, deserialize_with = "exactly")]
    pub offset_mm: [f64; 3],
}

/// Breathing at planning: the mean cycle, and the variation of cycles on the day of the treatment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Breathing {
    /// Mean period of a cycle, 1.5 to 12 s.
    pub period_s: f64,
    /// Exponent n of cos^2n, 1 to 6: from a sine to a long rest at end-exhale.
    #[serde(default = "exponent")]
    pub exponent: u32,
    /// Rise of the breastbone from end-exhale to end-inhale, 0 to 15 mm.
    pub thorax_mm: f64,
    /// Rise of the abdomen, 0 to 25 mm.
    pub abdomen_mm: f64,
    /// Descent of the diaphragm's dome, 0 to 35 mm.
    pub diaphragm_mm: f64,
    /// Forward motion of the middle of the lungs themselves, 0 to 8 mm.
    #[serde(default)]
    pub lung_mm: f64,
    /// Lag of the thorax behind the abdomen, as a fraction of a cycle, -0.2 to 0.2.
    #[serde(default)]
    pub thorax_lag: f64,
    /// Lag of the diaphragm behind the abdomen.
    #[serde(default)]
    pub diaphragm_lag: f64,
    /// Lag of the lungs' forward motion behind the abdomen.
    #[serde(default)]
    pub lung_lag: f64,
    /// Standard deviation of the cycle length relative to the mean, 0 to 0.2.
    #[serde(default)]
    pub period_sd: f64,
    /// Standard deviation of the cycle depth relative to the mean, 0 to 0.3.
    #[serde(default)]
    pub amplitude_sd: f64,
    /// Standard deviation of the depths of thorax, abdomen, diaphragm and lungs independently, 0 to
    /// 0.1: internal motion that cannot be inferred from the surface.
    #[serde(default)]
    pub decoupling_sd: f64,
}

fn exponent() -> u32 {
    2
}

/// Differences on the day of the treatment. Set-up is a rigid motion of the whole patient about the
/// isocentre, along and about the patient's axes (left, posterior, head).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Treatment {
    /// Depth of breathing relative to planning, 0.3 to 2.
    #[serde(default = "one")]
    pub amplitude: f64,
    /// Cycle length relative to planning, 0.5 to 2.
    #[serde(default = "one")]
    pub period: f64,
    /// Final drift of the abdomen's baseline, positive upwards, -10 to 10 mm; the thorax drifts by
    /// 0.4 of it.
    #[serde(default)]
    pub drift_mm: f64,
    /// Final drift of the diaphragm's baseline, positive towards the feet, -10 to 10 mm.
    #[serde(default)]
    pub diaphragm_drift_mm: f64,
    /// Time until 0.7 of a drift is reached, 10 to 3600 s.
    #[serde(default = "drift_time")]
    pub drift_time_s: f64,
    /// Standard deviation of the baseline's wander on a time scale of half a minute, 0 to 2 mm, for
    /// abdomen and diaphragm alike.
    #[serde(default)]
    pub wander_mm: f64,
    /// Rate of random coughs, 0 to 6 per minute.
    #[serde(default)]
    pub coughs_per_min: f64,
    /// Device times of additional coughs, in seconds, at most 64.
    #[serde(default)]
    pub coughs_at_s: Vec<f64>,
    /// Maximum inward motion of the abdomen during a cough, 0 to 12 mm.
    #[serde(default = "cough")]
    pub cough_mm: f64,
    /// Change of posture (chest up, abdomen in) relative to planning, -5 to 5 mm.
    #[serde(default)]
    pub posture_mm: f64,
    /// Translational set-up error, within 50 mm.
    #[serde(default, deserialize_with = "exactly")]
    pub setup_mm: [f64; 3],
    /// Rotational set-up error about the isocentre, within 10 degrees, about the fixed x, then y,
    /// then z axis.
    #[serde(default, deserialize_with = "exactly")]
    pub setup_deg: [f64; 3],
}

fn one() -> f64 {
    1.0
}
fn drift_time() -> f64 {
    300.0
}
fn cough() -> f64 {
    6.0
}

impl Default for Treatment {
    fn default() -> Self {
        Self {
            amplitude: one(),
            period: one(),
            drift_mm: 0.0,
            diaphragm_drift_mm: 0.0,
            drift_time_s: drift_time(),
            wander_mm: 0.0,
            coughs_per_min: 0.0,
            coughs_at_s: Vec::new(),
            cough_mm: cough(),
            posture_mm: 0.0,
            setup_mm: [0.0; 3],
            setup_deg: [0.0; 3],
        }
    }
}

impl Patient {
    /// Returns the body mass index in kg/m2.
    pub fn body_mass_index(&self) -> f64 {
        self.mass_kg / (self.stature_mm * 1e-3).powi(2)
    }

    /// Returns the depth of the skin folds in millimetres.
    pub fn fold_mm(&self) -> f64 {
        let by_mass = (0.8 * (self.body_mass_index() - 27.0)).clamp(0.0, 16.0);
        self.chest.fold_mm.unwrap_or(by_mass)
    }
}
