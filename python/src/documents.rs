//! Profiles, scenes, sequences and calibrations. In Python they are dicts, which come as JSON.

use crate::errors::raised;
use phasmid::geometry::Rig as Calibration;
use phasmid::pattern::Manifest as Sequence;
use phasmid::profile::{Profile as DeviceProfile, Scene as DeviceScene, Setting, Settings};
use phasmid::{Error, Result};
use pyo3::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::PathBuf;

/// Returns a value as JSON.
pub fn to_json(value: &impl Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|e| raised(Error::device(e)))
}

/// Reads a value from JSON; `place` names it in messages.
pub fn from_json<T: DeserializeOwned>(json: &str, place: &str, expected: &str) -> PyResult<T> {
    serde_json::from_str(json).map_err(|e| {
        // Remove the position in the JSON, because the user did not write the JSON.
        let message = e.to_string();
        let message = message.split(" at line ").next().unwrap_or_default();
        raised(Error::input(place, message, expected))
    })
}

/// Converts a document from JSON to TOML, in which it is checked; `place` names it in messages.
fn toml_of(json: &str, place: &str) -> Result<String> {
    let expected = "a dict of numbers, texts, booleans, lists and dicts";
    let value: ::toml::Value =
        serde_json::from_str(json).map_err(|e| Error::input(place, e, expected))?;
    ::toml::to_string(&value).map_err(|e| Error::input(place, e, expected))
}

/// Converts a document from JSON to TOML; `place` names it in messages.
#[pyfunction]
pub fn toml(json: &str, place: &str) -> PyResult<String> {
    toml_of(json, place).map_err(raised)
}

/// Converts a value of a field from JSON to TOML.
fn field_of(json: &str, field: &str) -> Result<String> {
    let value: ::toml::Value = serde_json::from_str(json)
        .map_err(|e| Error::input(field, e, "a number, text, boolean, list or dict"))?;
    Ok(value.to_string())
}

/// Fields with values as JSON.
type Changes = Vec<(String, String)>;

fn settings(changes: &Changes) -> Result<Settings> {
    let settings = changes
        .iter()
        .map(|(field, json)| Ok(Setting::new(field.as_str(), field_of(json, field)?)));
    Settings::new(settings.collect::<Result<Vec<_>>>()?)
}

/// Where a document comes from.
#[derive(Clone)]
enum Source {
    /// A built-in name or the path of a file.
    Named(String),
    /// TOML.
    Text(String),
}

/// Defines a class of documents that have a source and can be changed field by field.
macro_rules! document {
    ($class:ident, $document:ty, $kind:literal, $other:ident, $expected:literal) => {
        #[pyclass(frozen, module = "phasmid._phasmid")]
        pub struct $class {
            pub value: $document,
            source: Source,
            changes: Changes,
        }

        impl $class {
            fn new(source: Source, changes: Changes) -> PyResult<Self> {
                let value = Self::read(&source, &changes).map_err(raised)?;
                Ok(Self {
                    value,
                    source,
                    changes,
                })
            }

            fn read(source: &Source, changes: &Changes) -> Result<$document> {
                let settings = settings(changes)?;
                if let Some(setting) = settings.$other().first() {
                    return Err(Error::input(setting.place(), "no such field", $expected));
                }
                match source {
                    Source::Named(name) => <$document>::load_with(name, &settings),
                    Source::Text(text) => <$document>::parse_with(text, $kind, &settings),
                }
            }
        }

        #[pymethods]
        impl $class {
            #[staticmethod]
            fn load(name: PathBuf) -> PyResult<Self> {
                let name = name.to_string_lossy().into_owned();
                Self::new(Source::Named(name), Changes::new())
            }

            #[staticmethod]
            fn parse(json: &str) -> PyResult<Self> {
                let text = toml_of(json, $kind).map_err(raised)?;
                Self::new(Source::Text(text), Changes::new())
            }

            fn with_changes(&self, changes: Changes) -> PyResult<Self> {
                let changes = self.changes.iter().cloned().chain(changes).collect();
                Self::new(self.source.clone(), changes)
            }

            fn json(&self) -> PyResult<String> {
                to_json(&self.value)
            }

            #[getter]
            fn name(&self) -> &str {
                &self.value.name
            }

            /// Returns source and changes, from which `restored` creates an equal document.
            fn state(&self) -> (bool, &str, Changes) {
                match &self.source {
                    Source::Named(name) => (true, name, self.changes.clone()),
                    Source::Text(text) => (false, text, self.changes.clone()),
                }
            }

            #[staticmethod]
            fn restored(is_named: bool, source: String, changes: Changes) -> PyResult<Self> {
                let source = match is_named {
                    true => Source::Named(source),
                    false => Source::Text(source),
                };
                Self::new(source, changes)
            }
        }
    };
}

document!(
    Profile,
    DeviceProfile,
    "profile",
    scene,
    "a field of a profile"
);
document!(Scene, DeviceScene, "scene", profile, "a field of a scene");

/// A projected sequence.
#[pyclass(frozen, module = "phasmid._phasmid")]
pub struct Manifest(pub Sequence);

#[pymethods]
impl Manifest {
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Self> {
        Sequence::read(&path).map(Self).map_err(raised)
    }

    #[staticmethod]
    fn parse(toml: &str, place: &str) -> PyResult<Self> {
        Sequence::parse(toml, place).map(Self).map_err(raised)
    }

    #[staticmethod]
    fn parse_json(json: &str) -> PyResult<Self> {
        let toml = toml_of(json, "manifest").map_err(raised)?;
        Self::parse(&toml, "manifest")
    }

    fn toml(&self) -> String {
        self.0.to_toml()
    }

    fn json(&self) -> PyResult<String> {
        to_json(&self.0)
    }

    fn __len__(&self) -> usize {
        self.0.frame.len()
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.0 == other.0
    }
}

/// A calibration.
#[pyclass(frozen, module = "phasmid._phasmid")]
pub struct Rig(pub Calibration);

#[pymethods]
impl Rig {
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Self> {
        Calibration::read(&path).map(Self).map_err(raised)
    }

    #[staticmethod]
    fn parse(toml: &str, place: &str) -> PyResult<Self> {
        Calibration::from_toml(toml, place)
            .map(Self)
            .map_err(raised)
    }

    #[staticmethod]
    fn parse_json(json: &str) -> PyResult<Self> {
        let toml = toml_of(json, "rig").map_err(raised)?;
        Self::parse(&toml, "rig")
    }

    fn toml(&self) -> String {
        self.0.to_toml()
    }

    fn json(&self) -> PyResult<String> {
        to_json(&self.0)
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.0 == other.0
    }
}
