//! JSON Schemas of the files that users write, with which editors complete and check them.

use super::{Profile, Scene, Station};
use phasmid_pattern::Manifest;
use phasmid_phantom::Patient;
use phasmid_protocol::dialect::Dialect;
use phasmid_protocol::faults::Schedule;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};
use serde_json::{Map, Value, json};

/// A kind of file that users write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Document {
    /// A scanner: [`Profile`].
    Profile,
    /// Objects and light in front of a scanner: [`Scene`].
    Scene,
    /// Several scanners in front of one scene: [`Station`].
    Station,
    /// A generated patient: [`Patient`].
    Patient,
    /// A sequence of patterns: [`Manifest`].
    Manifest,
    /// Faults and when they occur: [`Schedule`].
    Faults,
    /// The commands of a control port: [`Dialect`].
    Dialect,
}

impl Document {
    /// All kinds.
    pub const ALL: [Self; 7] = [
        Self::Profile,
        Self::Scene,
        Self::Station,
        Self::Patient,
        Self::Manifest,
        Self::Faults,
        Self::Dialect,
    ];

    /// Returns the name, in lower case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Profile => "profile",
            Self::Scene => "scene",
            Self::Station => "station",
            Self::Patient => "patient",
            Self::Manifest => "manifest",
            Self::Faults => "faults",
            Self::Dialect => "dialect",
        }
    }

    /// Returns the JSON Schema, draft 7, of files of this kind. The schema states fields, types and
    /// names, but not the ranges of numbers. For kinds of files that may extend another file, it
    /// requires no fields.
    pub fn schema(self) -> String {
        let schema = match self {
            Self::Profile => of::<Profile>(),
            Self::Scene => of::<Scene>(),
            Self::Station => of::<Station>(),
            Self::Patient => of::<Patient>(),
            Self::Manifest => of::<Manifest>(),
            Self::Faults => of::<Schedule>(),
            Self::Dialect => Dialect::schema(draft7()),
        };
        let mut schema = schema.to_value();
        tidy(&mut schema);
        let extends = matches!(
            self,
            Self::Profile | Self::Scene | Self::Station | Self::Patient
        );
        if let Value::Object(root) = &mut schema {
            if extends {
                extend(root, self.name());
            }
            root.insert(
                "title".to_owned(),
                json!(format!("Phasmid {}", self.name())),
            );
        }
        let mut text = serde_json::to_string_pretty(&schema).expect("a schema is JSON");
        text.push('\n');
        text
    }
}

fn draft7() -> SchemaSettings {
    SchemaSettings::draft07()
}

fn of<T: JsonSchema>() -> Schema {
    draft7().into_generator().into_root_schema_for::<T>()
}

/// Adds the key `extends` to a schema, and makes all fields optional except the tags of
/// enumerations.
fn extend(root: &mut Map<String, Value>, kind: &str) {
    for part in root.values_mut() {
        relax(part);
    }
    root.remove("required");
    let extends = json!({
        "description": format!("The {kind} that this one extends: a built-in name or a file"),
        "type": "string",
    });
    if let Some(Value::Object(properties)) = root.get_mut("properties") {
        properties.insert("extends".to_owned(), extends);
    }
}

/// Fields whose default follows from other fields.
const COMPUTED: [&str; 1] = ["gain_dn_per_e"];

/// Removes stated defaults from a schema that follow from other fields or cannot be written in
/// TOML.
fn tidy(part: &mut Value) {
    match part {
        Value::Object(part) => {
            match part.get_mut("default") {
                Some(Value::Null) => drop(part.remove("default")),
                Some(Value::Object(fields)) => fields
                    .retain(|name, value| !value.is_null() && !COMPUTED.contains(&name.as_str())),
                _ => {}
            }
            if let Some(Value::Object(fields)) = part.get_mut("properties") {
                for name in COMPUTED {
                    if let Some(Value::Object(field)) = fields.get_mut(name) {
                        field.remove("default");
                    }
                }
            }
            part.values_mut().for_each(tidy);
        }
        Value::Array(parts) => parts.iter_mut().for_each(tidy),
        _ => {}
    }
}

fn relax(part: &mut Value) {
    match part {
        Value::Object(part) => {
            let is_tagged = part
                .get("properties")
                .and_then(Value::as_object)
                .is_some_and(|properties| properties.contains_key("kind"));
            if part.get("type").is_some_and(|kind| kind == "object") && !is_tagged {
                part.remove("required");
            }
            part.values_mut().for_each(relax);
        }
        Value::Array(parts) => parts.iter_mut().for_each(relax),
        _ => {}
    }
}
