//! The file `planning.toml`.

use glam::DVec3;
use phasmid_core::error::Result;
use phasmid_core::new_file::replace;
use phasmid_core::numbers::exactly;
use phasmid_core::source::TomlSource;
use serde::de::{Error as _, SeqAccess, Visitor, value::SeqAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::io::Write;
use std::path::{Component, Path};

/// Maximum number of phases.
pub(crate) const MOST_PHASES: usize = 64;

/// Allowed voxel spacing of fields, in millimetres.
pub(crate) const SPACING_MM: std::ops::RangeInclusive<f64> = 0.1..=50.0;

/// Message text: allowed patient names.
pub(crate) const ALLOWED_NAME: &str = "1 to 64 letters, digits, '-', '_' or '.'";

/// Content of `planning.toml`.
///
/// ```toml
/// name = "p01"
/// reference_phase = 50
/// isocentre_mm = [12.5, -140.0, -812.0]   # in the files' LPS
/// spacing_mm = 3.0                        # of the fields; or a list of three
/// skin = "skin.ply"
/// tumour = "tumour.ply"
/// ct = "ct_50.mha"                        # may be absent
///
/// [[phase]]
/// percent = 0
/// field = "dvf_00.mha"
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanningFile {
    /// Patient name: 1 to 64 letters, digits, `-`, `_` or `.`.
    pub name: String,
    /// Phase of skin, tumour and CT, in per cent of the cycle; one of `phase`.
    pub reference_phase: f64,
    /// The isocentre in the files' LPS, in millimetres.
    #[serde(deserialize_with = "exactly")]
    pub isocentre_mm: DVec3,
    /// Voxel spacing of the fields, in millimetres.
    pub spacing_mm: Spacing,
    /// Name of the skin file, in the folder of this file.
    pub skin: String,
    /// Name of the tumour file, likewise.
    pub tumour: String,
    /// CT file of the reference phase, in the folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ct: Option<String>,
    /// The phases, ascending.
    pub phase: Vec<PhaseFile>,
}

/// A phase and its displacement field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhaseFile {
    /// Per cent of the cycle, 0 (end-inhale) or more, less than 100.
    pub percent: f64,
    /// File of the displacements from the reference phase to this one, in the folder.
    pub field: String,
}

/// Voxel spacing along i, j and k in millimetres; in a file, a single number if all are equal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spacing(pub DVec3);

impl PlanningFile {
    /// File name in the folder.
    pub const NAME: &str = "planning.toml";

    /// Creates the file of patient `patient` with the isocentre at the origin and the default file
    /// names: `skin.ply`, `tumour.ply`, `dvf_00.mha` with each phase's per cent, and `ct_50.mha` with
    /// the reference phase's per cent, if there is a CT.
    pub fn usual(
        percents: impl IntoIterator<Item = f64>,
        reference_percent: f64,
        spacing_mm: DVec3,
        ct: bool,
    ) -> Self {
        let phase = |percent| PhaseFile {
            percent,
            field: format!("dvf_{percent:02}.mha"),
        };
        Self {
            name: "patient".to_owned(),
            reference_phase: reference_percent,
            isocentre_mm: DVec3::ZERO,
            spacing_mm: Spacing(spacing_mm),
            skin: "skin.ply".to_owned(),
            tumour: "tumour.ply".to_owned(),
            ct: ct.then(|| format!("ct_{reference_percent:02}.mha")),
            phase: percents.into_iter().map(phase).collect(),
        }
    }

    /// Returns the names of all files of the planning.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let fields = self.phase.iter().map(|phase| phase.field.as_str());
        [Self::NAME, &self.skin, &self.tumour]
            .into_iter()
            .chain(self.ct.as_deref())
            .chain(fields)
    }

    /// Returns whether a patient name is valid: 1 to 64 letters, digits, `-`, `_` or `.`.
    pub fn is_name(text: &str) -> bool {
        let known = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
        (1..=64).contains(&text.len()) && text.chars().all(known)
    }

    /// Reads and checks the `planning.toml` of a folder.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or [`Self::parse`] rejects it.
    pub fn read(folder: &Path) -> Result<Self> {
        Self::from_source(&TomlSource::read(&folder.join(Self::NAME))?)
    }

    /// Parses and checks the text of a file; `place` is used as the file name in messages.
    ///
    /// # Errors
    /// Returns an error with the line for an unknown field, a wrong type or an invalid value.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        Self::from_source(&TomlSource::new(text, place))
    }

    pub(super) fn from_source(source: &TomlSource) -> Result<Self> {
        let file: Self = source.deserialize()?;
        file.check(source)?;
        Ok(file)
    }

    /// Returns the content as TOML.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("numbers, strings and tables always serialise")
    }

    /// Writes the file into a folder.
    ///
    /// # Errors
    /// Returns the system's error.
    pub fn write(&self, folder: &Path) -> Result<()> {
        replace(&folder.join(Self::NAME), |out| {
            out.write_all(self.to_toml().as_bytes())
        })
    }

    fn check(&self, source: &TomlSource) -> Result<()> {
        if !Self::is_name(&self.name) {
            return Err(source.violation("name", format!("{:?}", self.name), ALLOWED_NAME));
        }
        let at = self.isocentre_mm.to_array();
        if !at.iter().all(|mm| mm.abs() <= 1e5) {
            let found = format!("{at:?}");
            return Err(source.violation("isocentre_mm", found, "numbers within 1e5 mm"));
        }
        let spacing = self.spacing_mm.0.to_array();
        if !spacing.iter().all(|mm| SPACING_MM.contains(mm)) {
            let (least, most) = (SPACING_MM.start(), SPACING_MM.end());
            let allowed = format!("{least} to {most} mm");
            return Err(source.violation("spacing_mm", format!("{spacing:?}"), allowed));
        }
        let files = [("skin", &self.skin), ("tumour", &self.tumour)];
        for (field, name) in files.into_iter().chain(self.ct.iter().map(|ct| ("ct", ct))) {
            in_folder(name, field, source)?;
        }
        self.check_phases(source)
    }

    fn check_phases(&self, source: &TomlSource) -> Result<()> {
        let count = self.phase.len();
        if !(2..=MOST_PHASES).contains(&count) {
            let found = format!("{count} phases");
            return Err(source.violation("phase", found, format!("2 to {MOST_PHASES} phases")));
        }
        let mut before = None;
        for (n, phase) in self.phase.iter().enumerate() {
            let field = format!("phase[{n}].percent");
            if !(phase.percent >= 0.0 && phase.percent < 100.0) {
                let allowed = "0 or more, less than 100";
                return Err(source.violation(&field, phase.percent, allowed));
            }
            if let Some(before) = before
                && phase.percent <= before
            {
                let found = format!("{} after {before}", phase.percent);
                return Err(source.violation(&field, found, "phases that ascend"));
            }
            before = Some(phase.percent);
            in_folder(&phase.field, &format!("phase[{n}].field"), source)?;
        }
        let reference = self.reference_phase;
        if !self.phase.iter().any(|phase| phase.percent == reference) {
            let all: Vec<String> = self.phase.iter().map(|p| p.percent.to_string()).collect();
            let allowed = format!("one of the phases: {}", all.join(", "));
            return Err(source.violation("reference_phase", reference, allowed));
        }
        Ok(())
    }
}

/// Rejects names that lead out of the folder, which is moved and copied as a whole.
fn in_folder(name: &str, field: &str, source: &TomlSource) -> Result<()> {
    let mut parts = Path::new(name).components();
    if !name.is_empty() && parts.all(|part| matches!(part, Component::Normal(_))) {
        return Ok(());
    }
    Err(source.violation(
        field,
        format!("{name:?}"),
        "the name of a file in the folder",
    ))
}

impl Serialize for Spacing {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let DVec3 { x, y, z } = self.0;
        if x == y && y == z {
            to.serialize_f64(x)
        } else {
            [x, y, z].serialize(to)
        }
    }
}

impl<'de> Deserialize<'de> for Spacing {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct OneOrThree;
        impl<'de> Visitor<'de> for OneOrThree {
            type Value = Spacing;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number or a list of 3 numbers")
            }

            fn visit_f64<E: serde::de::Error>(self, mm: f64) -> Result<Spacing, E> {
                Ok(Spacing(DVec3::splat(mm)))
            }

            fn visit_i64<E: serde::de::Error>(self, mm: i64) -> Result<Spacing, E> {
                self.visit_f64(mm as f64)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Spacing, A::Error> {
                let three = exactly(SeqAccessDeserializer::new(list));
                three.map(Spacing).map_err(A::Error::custom)
            }
        }
        from.deserialize_any(OneOrThree)
    }
}
