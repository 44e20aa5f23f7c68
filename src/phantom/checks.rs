//! Loads patients, and checks their values, one by one and in combination.

use super::breathing::Course;
use super::catalogue;
use super::modes::Modes;
use super::organs::Organs;
use super::outline::Outline;
use super::parameters::{Breathing, Patient, Scar, Treatment, Tumour};
use super::tumour::Shape;
use crate::tissue as skin;
use phasmid_core::check::{Check, name};
use phasmid_core::error::Result;
use phasmid_core::source::{self, TomlSource};

/// Maximum number of coughs at given times.
const MOST_COUGHS: usize = 64;
/// Maximum absolute coordinate of a scar's ends.
const SCAR_MM: f64 = 300.0;

impl Patient {
    /// Loads a built-in patient by name, or else a file by path.
    ///
    /// # Errors
    /// Returns an error if the name is neither, if the file cannot be read, or if [`Self::parse`]
    /// rejects it.
    pub fn load(name_or_path: &str) -> Result<Self> {
        let (source, _) = source::load(name_or_path, &catalogue::PATIENTS, "patient")?;
        Self::from_source(&source)
    }

    /// Returns the TOML of a patient as written.
    ///
    /// # Errors
    /// Returns an error as [`Self::load`] does.
    pub fn text(name_or_path: &str) -> Result<String> {
        let (source, _) = source::load(name_or_path, &catalogue::PATIENTS, "patient")?;
        Self::from_source(&source)?;
        Ok(source.text().to_owned())
    }

    /// Parses and checks a patient; `place` is used as the file name in messages.
    ///
    /// # Errors
    /// Returns an error with the line for a syntax error, an unknown field, a wrong type, a value
    /// out of range or dimensions that do not form a body.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        Self::from_source(&TomlSource::new(text, place))
    }

    fn from_source(source: &TomlSource) -> Result<Self> {
        Check::read(source, |patient: &mut Self, all| check(patient, all))
    }
}

fn check(p: &Patient, check: &Check<'_>) -> Result<()> {
    check.section(|check| name(&p.name, "name", check));
    check.within("age_years", p.age_years, 5..=100)?;
    check.within("stature_mm", p.stature_mm, 1000.0..=2100.0)?;
    check.within("mass_kg", p.mass_kg, 14.0..=200.0)?;
    skin::check(&p.skin, "skin", check)?;
    check.all_within("chest.breast_ml", &p.chest.breast_ml, 0.0..=1500.0)?;
    check.within("chest.fold_mm", p.fold_mm(), 0.0..=16.0)?;
    if let Some(scar) = &p.scar {
        check_scar(scar, check)?;
    }
    check_tumour(&p.tumour, check)?;
    check_breathing(&p.breathing, check)?;
    check_treatment(&p.treatment, check)?;
    together(p, check)
}

fn check_scar(s: &Scar, check: &Check<'_>) -> Result<()> {
    check.all_within("scar.from_mm", &s.from_mm, -SCAR_MM..=SCAR_MM)?;
    check.all_within("scar.to_mm", &s.to_mm, -SCAR_MM..=SCAR_MM)?;
    check.within("scar.half_width_mm", s.half_width_mm, 2.0..=40.0)?;
    check.within("scar.height_mm", s.height_mm, -8.0..=6.0)
}

fn check_tumour(t: &Tumour, check: &Check<'_>) -> Result<()> {
    check.within("tumour.diameter_mm", t.diameter_mm, 5.0..=70.0)?;
    check.within("tumour.roughness", t.roughness, 0.0..=0.35)?;
    check.all_within("tumour.offset_mm", &t.offset_mm, -60.0..=60.0)
}

fn check_breathing(b: &Breathing, check: &Check<'_>) -> Result<()> {
    let field = |name: &str| format!("breathing.{name}");
    check.within(&field("period_s"), b.period_s, 1.5..=12.0)?;
    check.within(&field("exponent"), b.exponent, 1..=6)?;
    check.within(&field("thorax_mm"), b.thorax_mm, 0.0..=15.0)?;
    check.within(&field("abdomen_mm"), b.abdomen_mm, 0.0..=25.0)?;
    check.within(&field("diaphragm_mm"), b.diaphragm_mm, 0.0..=35.0)?;
    check.within(&field("lung_mm"), b.lung_mm, 0.0..=8.0)?;
    check.within(&field("thorax_lag"), b.thorax_lag, -0.2..=0.2)?;
    check.within(&field("diaphragm_lag"), b.diaphragm_lag, -0.2..=0.2)?;
    check.within(&field("lung_lag"), b.lung_lag, -0.2..=0.2)?;
    check.within(&field("period_sd"), b.period_sd, 0.0..=0.2)?;
    check.within(&field("amplitude_sd"), b.amplitude_sd, 0.0..=0.3)?;
    check.within(&field("decoupling_sd"), b.decoupling_sd, 0.0..=0.1)
}

fn check_treatment(t: &Treatment, check: &Check<'_>) -> Result<()> {
    let field = |name: &str| format!("treatment.{name}");
    check.within(&field("amplitude"), t.amplitude, 0.3..=2.0)?;
    check.within(&field("period"), t.period, 0.5..=2.0)?;
    check.within(&field("drift_mm"), t.drift_mm, -10.0..=10.0)?;
    let diaphragm = t.diaphragm_drift_mm;
    check.within(&field("diaphragm_drift_mm"), diaphragm, -10.0..=10.0)?;
    check.within(&field("drift_time_s"), t.drift_time_s, 10.0..=3600.0)?;
    check.within(&field("wander_mm"), t.wander_mm, 0.0..=2.0)?;
    check.within(&field("coughs_per_min"), t.coughs_per_min, 0.0..=6.0)?;
    let count = t.coughs_at_s.len();
    let coughs = field("coughs_at_s");
    let most = format!("up to {MOST_COUGHS} coughs");
    check.that(
        count <= MOST_COUGHS,
        &coughs,
        format!("{count} coughs"),
        most,
    )?;
    check.all_within(&coughs, &t.coughs_at_s, 0.0..=1e6)?;
    check.within(&field("cough_mm"), t.cough_mm, 0.0..=12.0)?;
    check.within(&field("posture_mm"), t.posture_mm, -5.0..=5.0)?;
    check.all_within(&field("setup_mm"), &t.setup_mm, -50.0..=50.0)?;
    check.all_within(&field("setup_deg"), &t.setup_deg, -10.0..=10.0)
}

/// Checks combinations of values that are each valid on their own.
fn together(p: &Patient, check: &Check<'_>) -> Result<()> {
    check.in_range()?;
    let [least, most] = Outline::masses_kg(p);
    check.that(
        (least..=most).contains(&p.mass_kg),
        "mass_kg",
        format!("{} for {} mm", p.mass_kg, p.stature_mm),
        format!("{least:.1} to {most:.1} for that stature"),
    )?;
    let organs = Organs::new(p);
    let shape = Shape::new(p);
    let out = shape.out_of_lobe(p.tumour.lobe, &organs);
    check.that(
        out.is_none(),
        "tumour",
        out.unwrap_or_default(),
        "a tumour inside its lobe",
    )?;
    let least = Modes::new(p).least_determinant(&Course::bounds(p));
    check.that(
        least > LEAST_DETERMINANT,
        "breathing",
        format!("motion that squeezes tissue to {least:.3} of its volume"),
        format!("amplitudes and drifts that leave more than {LEAST_DETERMINANT}"),
    )
}

/// Minimum local volume ratio of tissue; above 0 the displacement never folds over.
pub(super) const LEAST_DETERMINANT: f64 = 0.1;
