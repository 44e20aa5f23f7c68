//! What a patient's file says: `device-profiles/patients/*.toml`.

use super::{catalogue, checks};
use crate::tissue::Skin;
use phasmid_core::check::Check;
use phasmid_core::error::Result;
use phasmid_core::numbers::exactly;
use phasmid_core::source::{self, TomlSource};
use serde::{Deserialize, Serialize};

/// A generated patient: body, tumour, breathing, and the day of the treatment. Every body of the
/// same values is the same.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Patient {
    /// Name by which it is chosen.
    pub name: String,
    /// One line for listings.
    pub description: String,
    /// Which outlines the body has.
    pub sex: Sex,
    /// Age in years, 5 to 100; what follows from it is the reader's to judge.
    pub age_years: u32,
    /// Height standing, 1000 to 2100 mm.
    pub stature_mm: f64,
    /// Body mass, 14 to 200 kg; it decides how thick what lies over bone and muscle is.
    pub mass_kg: f64,
    /// Which of many bodies of these measures, tumours of this size, and days.
    pub seed: u64,
    /// What the skin is made of, as for any object of a scene.
    pub skin: Skin,
    /// What stands out of the chest and cuts into the abdomen.
    #[serde(default)]
    pub chest: Chest,
    /// Where skin has been cut; none when absent.
    #[serde(default)]
    pub scar: Option<Scar>,
    /// The target.
    pub tumour: Tumour,
    /// How the patient breathes when the treatment is planned.
    pub breathing: Breathing,
    /// How the day of the treatment differs.
    #[serde(default)]
    pub treatment: Treatment,
}

/// Outlines of the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sex {
    /// Narrower waist and chest, wider hips.
    Female,
    /// Wider chest, narrower hips.
    Male,
}

/// Breasts and folds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Chest {
    /// Volume of the right and the left breast in millilitres, 0 to 1500.
    #[serde(default, deserialize_with = "exactly")]
    pub breast_ml: [f64; 2],
    /// Depth of the skin folds across the abdomen and the flanks, 0 to 16 mm; 0.8 mm for each
    /// kg/m2 of body mass index above 27 when absent.
    #[serde(default)]
    pub fold_mm: Option<f64>,
}

/// A scar on the front or a side: a line along the skin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scar {
    /// Where it begins: along the skin from the middle of the front to the patient's left, and
    /// from the tip of the breastbone to the head, in millimetres; within 300.
    #[serde(deserialize_with = "exactly")]
    pub from_mm: [f64; 2],
    /// Where it ends, by the same measures.
    #[serde(deserialize_with = "exactly")]
    pub to_mm: [f64; 2],
    /// Half its width, to where its height is 0.6 of the whole: 2 to 40 mm.
    pub half_width_mm: f64,
    /// How far it stands out, -8 to 6 mm; below 0 it is sunk.
    pub height_mm: f64,
}

/// A part of a lung.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Lobe {
    /// Of the right lung, above both fissures.
    RightUpper,
    /// Of the right lung, between its fissures.
    RightMiddle,
    /// Of the right lung, below the oblique fissure.
    RightLower,
    /// Of the left lung, above its fissure.
    LeftUpper,
    /// Of the left lung, below it.
    LeftLower,
}

/// A tumour in a lung.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tumour {
    /// Where it has grown.
    pub lobe: Lobe,
    /// Of the ball of its volume, 5 to 70 mm.
    pub diameter_mm: f64,
    /// How far its surface is from that ball at most, as a share of its radius, 0 to 0.35.
    #[serde(default)]
    pub roughness: f64,
    /// Its place in the lobe, from where the lobe's tumours stand otherwise, along the patient's
    /// axes (left, posterior, head), within 60 mm; it has to stay inside the lobe.
    #[serde(default, deserialize_with = "exactly")]
    pub offset_mm: [f64; 3],
}

/// Breathing at planning: the mean cycle, and how cycles vary on the day of the treatment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Breathing {
    /// Mean length of a cycle, 1.5 to 12 s.
    pub period_s: f64,
    /// n of the course cos^2n, 1 to 6: from a sine to breath held at the end of exhaling.
    #[serde(default = "exponent")]
    pub exponent: u32,
    /// How far the breastbone rises from end-exhale to end-inhale, 0 to 15 mm.
    pub thorax_mm: f64,
    /// How far the abdomen rises, 0 to 25 mm.
    pub abdomen_mm: f64,
    /// How far the diaphragm's dome goes down, 0 to 35 mm.
    pub diaphragm_mm: f64,
    /// How far the middle of the lungs goes to the front of itself, 0 to 8 mm.
    #[serde(default)]
    pub lung_mm: f64,
    /// How long the thorax is behind the abdomen, as a share of a cycle, -0.2 to 0.2.
    #[serde(default)]
    pub thorax_lag: f64,
    /// How long the diaphragm is behind it.
    #[serde(default)]
    pub diaphragm_lag: f64,
    /// How long the lungs' way to the front is behind it.
    #[serde(default)]
    pub lung_lag: f64,
    /// Standard deviation of the length of cycles over the mean, 0 to 0.2.
    #[serde(default)]
    pub period_sd: f64,
    /// Standard deviation of the depth of cycles over the mean, 0 to 0.3.
    #[serde(default)]
    pub amplitude_sd: f64,
    /// The same of thorax, abdomen, diaphragm and lungs each by itself, 0 to 0.1: what no surface
    /// tells of the inside.
    #[serde(default)]
    pub decoupling_sd: f64,
}

fn exponent() -> u32 {
    2
}

/// What is different on the day of the treatment. Set-up is a rigid motion of the whole patient
/// about the isocentre, along and about the patient's axes (left, posterior, head).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Treatment {
    /// Depth of breathing over that at planning, 0.3 to 2.
    #[serde(default = "one")]
    pub amplitude: f64,
    /// Length of cycles over that at planning, 0.5 to 2.
    #[serde(default = "one")]
    pub period: f64,
    /// How far the abdomen's baseline goes in the end, up being positive, -10 to 10 mm; the thorax
    /// goes 0.4 of it.
    #[serde(default)]
    pub drift_mm: f64,
    /// How far the diaphragm's baseline goes in the end, to the feet being positive, -10 to 10 mm.
    #[serde(default)]
    pub diaphragm_drift_mm: f64,
    /// After how long 0.7 of a drift is done, 10 to 3600 s.
    #[serde(default = "drift_time")]
    pub drift_time_s: f64,
    /// Standard deviation of a baseline that wanders within half a minute, 0 to 2 mm, of the
    /// abdomen and the diaphragm alike.
    #[serde(default)]
    pub wander_mm: f64,
    /// Coughs at random, 0 to 6 a minute.
    #[serde(default)]
    pub coughs_per_min: f64,
    /// Device times at which the patient coughs for certain, in seconds, at most 64.
    #[serde(default)]
    pub coughs_at_s: Vec<f64>,
    /// How far the abdomen is drawn in at most by a cough, 0 to 12 mm.
    #[serde(default = "cough")]
    pub cough_mm: f64,
    /// How far the posture (chest up, abdomen in) differs from that at planning, -5 to 5 mm.
    #[serde(default)]
    pub posture_mm: f64,
    /// Set-up error, within 50 mm.
    #[serde(default, deserialize_with = "exactly")]
    pub setup_mm: [f64; 3],
    /// Set-up error about the isocentre, within 10 degrees, about the fixed x, then y, then z axis.
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
    /// Loads a patient that ships by its name, or else a file by its path.
    ///
    /// # Errors
    /// A name that is neither, unreadable files, and all that [`Self::parse`] refuses.
    pub fn load(name_or_path: &str) -> Result<Self> {
        let (source, _) = source::load(name_or_path, &catalogue::PATIENTS, "patient")?;
        Self::from_source(&source)
    }

    /// Reads and checks a patient from text; `place` stands for the file in messages.
    ///
    /// # Errors
    /// Syntax, unknown fields, wrong types, values out of their ranges and measures that make no
    /// body, each with its line.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        Self::from_source(&TomlSource::new(text, place))
    }

    fn from_source(source: &TomlSource) -> Result<Self> {
        let patient: Self = source.deserialize()?;
        checks::check(&patient, &Check::new(source))?;
        Ok(patient)
    }

    /// Body mass index in kg/m2.
    pub fn body_mass_index(&self) -> f64 {
        self.mass_kg / (self.stature_mm * 1e-3).powi(2)
    }

    /// Depth of its folds in millimetres.
    pub fn fold_mm(&self) -> f64 {
        let by_mass = (0.8 * (self.body_mass_index() - 27.0)).clamp(0.0, 16.0);
        self.chest.fold_mm.unwrap_or(by_mass)
    }
}
