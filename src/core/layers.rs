//! TOML documents in layers: from the bottom, the documents that a document extends, the document
//! itself, and settings of single fields. Positions count over the texts of all layers, so that
//! each value keeps its file and line.

use crate::deserializer::{article, type_name};
use crate::error::{Error, Result};
use crate::setting::{Step, steps};
use crate::wording::found_and_expected;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

/// Key with the name or path of the document that a document extends.
pub(crate) const EXTENDS: &str = "extends";

/// Pairs of groups of fields that exclude each other. If a document has a field of one group, the fields
/// of the other group in the document that it extends are dropped.
const ALTERNATIVES: [[&[&str]; 2]; 2] = [
    [&["gamma"], &["table"]],
    [
        &["fitzpatrick"],
        &["absorption_per_mm", "reduced_scattering_per_mm"],
    ],
];

/// Texts in ascending precedence.
#[derive(Clone)]
pub(crate) struct Layers(Vec<Layer>);

#[derive(Clone)]
struct Layer {
    /// A document, or the value of a setting.
    text: String,
    /// File name, or the setting as it was given.
    place: String,
    /// Path of the value that a setting sets; empty for a document.
    path: String,
    /// Folder to which file paths in the text are relative. It is itself relative to the folder of the
    /// document that extends all others.
    folder: String,
}

impl Layers {
    pub fn of_document(text: String, place: String) -> Self {
        Self(vec![Layer {
            text,
            place,
            path: String::new(),
            folder: String::new(),
        }])
    }

    /// Adds the layers of an extended document below all layers; `folder` is the extended
    /// document's folder, relative to this document's folder.
    pub fn extend(&mut self, base: Self, folder: &str) {
        let layers = base.0.into_iter().map(|layer| Layer {
            folder: folder.to_owned(),
            ..layer
        });
        self.0.splice(0..0, layers);
    }

    /// Adds the value of a single field as the highest layer. A text that is not valid TOML counts
    /// as a string.
    pub fn set(&mut self, path: &str, value: &str, place: String) {
        let text = match DeValue::parse(value) {
            Ok(_) => value.to_owned(),
            Err(_) => toml::Value::String(value.to_owned()).to_string(),
        };
        self.0.push(Layer {
            text,
            place,
            path: path.to_owned(),
            folder: String::new(),
        });
    }

    /// Returns the file name of the document itself.
    pub fn place(&self) -> &str {
        self.document().map_or("", |layer| &layer.place)
    }

    /// Returns the name of the document that the lowest layer extends, and the place of that name
    /// for messages.
    pub fn extends(&self) -> Result<Option<(String, String)>> {
        let Some(layer) = self.0.first() else {
            return Ok(None);
        };
        let table = self.parse(layer, 0)?;
        let Some((key, value)) = table.get_ref().get_key_value(EXTENDS) else {
            return Ok(None);
        };
        let place = format!("{}: {EXTENDS}", self.place_at(key.span().start));
        match value.get_ref() {
            DeValue::String(name) => Ok(Some((name.to_string(), place))),
            other => Err(Error::input(
                place,
                format!("{} {}", article(other), type_name(other)),
                "the name of a built-in document or the path of a file, in quotes",
            )),
        }
    }

    /// Merges the layers. Tables are merged key by key, unless their values of `kind` differ. Any other
    /// value, including a list, replaces the value below it.
    pub fn merged(&self) -> Result<Spanned<DeTable<'_>>> {
        let mut merged: Option<Spanned<DeTable<'_>>> = None;
        let mut start = 0;
        for layer in &self.0 {
            if layer.path.is_empty() {
                let mut table = self.parse(layer, start)?;
                if merged.is_some() {
                    table.get_mut().remove(EXTENDS);
                }
                if !layer.folder.is_empty() {
                    relocate(table.get_mut(), &layer.folder);
                }
                merged = Some(match merged {
                    Some(below) => Spanned::new(table.span(), {
                        let mut below = below.into_inner();
                        merge(&mut below, table.into_inner());
                        below
                    }),
                    None => table,
                });
            } else if let Some(table) = &mut merged {
                let value = DeValue::parse(&layer.text)
                    .map_err(|error| self.syntax_error(&error, &layer.text, start))
                    .map(|value| shifted(value, start))?;
                put(table, &layer.path, value)
                    .map_err(|(found, expected)| Error::input(&layer.place, found, expected))?;
            }
            start += layer.text.len() + 1;
        }
        Ok(merged.unwrap_or_else(|| Spanned::new(0..0, DeTable::new())))
    }

    /// Returns the text of the document itself.
    pub fn text(&self) -> &str {
        self.document().map_or("", |layer| &layer.text)
    }

    fn document(&self) -> Option<&Layer> {
        self.0.iter().rev().find(|layer| layer.path.is_empty())
    }

    /// Returns the number of bytes of all layers.
    pub fn length(&self) -> usize {
        self.0.iter().map(|layer| layer.text.len() + 1).sum()
    }

    fn parse<'a>(&self, layer: &'a Layer, start: usize) -> Result<Spanned<DeTable<'a>>> {
        let table = DeTable::parse(&layer.text)
            .map_err(|error| self.syntax_error(&error, &layer.text, start))?;
        let span = table.span();
        Ok(Spanned::new(
            moved(span, start),
            shifted_table(table.into_inner(), start),
        ))
    }

    /// Rewords an error of the TOML parser in the text of a layer; `start` is the position at which
    /// that text begins.
    fn syntax_error(&self, error: &toml::de::Error, text: &str, start: usize) -> Error {
        let span = error.span().unwrap_or_default();
        let place = self.place_at(start + span.start);
        let message = error.message().trim_end();
        if message == "duplicate key" {
            let key = text.get(span).unwrap_or_default().trim();
            return Error::input(place, format!("duplicate key `{key}`"), "each key once");
        }
        let (found, expected) = found_and_expected(message, "valid TOML");
        Error::input(place, found, expected)
    }

    /// Returns `FILE:LINE` of a position, or, if the position is in the value of a setting, that
    /// setting.
    pub fn place_at(&self, position: usize) -> String {
        let mut start = 0;
        for layer in &self.0 {
            let end = start + layer.text.len();
            if position <= end {
                if !layer.path.is_empty() {
                    return layer.place.clone();
                }
                let before = &layer.text.as_bytes()[..position - start];
                let line = 1 + before.iter().filter(|&&b| b == b'\n').count();
                return format!("{}:{line}", layer.place);
            }
            start = end + 1;
        }
        format!("{}:1", self.place())
    }

    /// Returns a key by which places are sorted: settings first, then the document, then the
    /// documents that it extends, each by line.
    pub fn rank(&self, place: &str) -> (usize, usize) {
        for (i, layer) in self.0.iter().rev().enumerate() {
            let Some(rest) = place.strip_prefix(&layer.place) else {
                continue;
            };
            let line = rest.strip_prefix(':').and_then(|rest| {
                let digits = rest.split(':').next()?;
                digits.parse().ok()
            });
            if let Some(line) = line {
                return (i, line);
            }
            if !layer.path.is_empty() {
                return (i, 0);
            }
        }
        (self.0.len(), 0)
    }
}

fn moved(span: Range<usize>, by: usize) -> Range<usize> {
    span.start + by..span.end + by
}

pub(crate) fn shifted(value: Spanned<DeValue<'_>>, by: usize) -> Spanned<DeValue<'_>> {
    let span = moved(value.span(), by);
    let value = match value.into_inner() {
        DeValue::Array(array) => {
            DeValue::Array(array.into_iter().map(|value| shifted(value, by)).collect())
        }
        DeValue::Table(table) => DeValue::Table(shifted_table(table, by)),
        other => other,
    };
    Spanned::new(span, value)
}

fn shifted_table(table: DeTable<'_>, by: usize) -> DeTable<'_> {
    let entries = table.into_iter().map(|(key, value)| {
        let key = Spanned::new(moved(key.span(), by), key.into_inner());
        (key, shifted(value, by))
    });
    entries.collect()
}

/// Removes fields of a table that are replaced by fields with other names in the table above it.
fn drop_replaced(below: &mut DeTable<'_>, above: &DeTable<'_>) {
    for [one, other] in ALTERNATIVES {
        for (given, replaced) in [(one, other), (other, one)] {
            let has = |names: &[&str]| names.iter().any(|name| above.contains_key(*name));
            if has(given) && !has(replaced) {
                for name in replaced {
                    below.remove(*name);
                }
            }
        }
    }
    // If the table above replaces the sequences and lacks the sequence that `calibration.sequence`
    // names, remove that field.
    let Some(DeValue::Array(sequences)) = above.get("sequence").map(Spanned::get_ref) else {
        return;
    };
    if let Some(calibration) = below.get_mut("calibration")
        && let DeValue::Table(calibration) = calibration.get_mut()
        && let Some(DeValue::String(named)) = calibration.get("sequence").map(Spanned::get_ref)
    {
        let is_named = |sequence: &Spanned<DeValue<'_>>| {
            let name = sequence.get_ref().get("name");
            name.is_some_and(|name| name.get_ref().as_str() == Some(named.as_ref()))
        };
        if !sequences.iter().any(is_named) {
            calibration.remove("sequence");
        }
    }
}

/// Merges a table into the table of the layer below it.
fn merge<'a>(below: &mut DeTable<'a>, above: DeTable<'a>) {
    drop_replaced(below, &above);
    for (key, value) in above {
        let span = value.span();
        let value = match (
            below
                .remove(key.get_ref().as_ref())
                .map(Spanned::into_inner),
            value.into_inner(),
        ) {
            (Some(DeValue::Table(mut lower)), DeValue::Table(upper))
                if !differ_in_kind(&lower, &upper) =>
            {
                merge(&mut lower, upper);
                DeValue::Table(lower)
            }
            (_, value) => value,
        };
        below.insert(key, Spanned::new(span, value));
    }
}

fn differ_in_kind(lower: &DeTable<'_>, upper: &DeTable<'_>) -> bool {
    let kind = |table: &DeTable<'_>| Some(table.get("kind")?.get_ref().as_str()?.to_owned());
    kind(upper).is_some_and(|upper| kind(lower) != Some(upper))
}

/// Prepends a folder to relative paths: to every value of the keys `file` and `texture`, and to the
/// names of patients, dialects, scenes and profiles that end with `.toml`. Any other name denotes a
/// built-in document.
fn relocate(table: &mut DeTable<'_>, folder: &str) {
    for (key, value) in table {
        let is_file = matches!(key.get_ref().as_ref(), "file" | "texture");
        let is_named = matches!(
            key.get_ref().as_ref(),
            "patient" | "dialect" | "scene" | "profile"
        );
        relocate_value(value.get_mut(), folder, is_file, is_named);
    }
}

fn relocate_value(value: &mut DeValue<'_>, folder: &str, is_file: bool, is_named: bool) {
    match value {
        DeValue::String(path)
            if (is_file || is_named && path.ends_with(".toml"))
                && Path::new(path.as_ref()).is_relative() =>
        {
            *path = format!("{folder}/{path}").into();
        }
        DeValue::Array(array) => {
            for value in array.iter_mut() {
                relocate_value(value.get_mut(), folder, false, false);
            }
        }
        DeValue::Table(table) => relocate(table, folder),
        _ => {}
    }
}

/// Puts a value at a path; creates missing tables on the way.
fn put<'a>(
    table: &mut Spanned<DeTable<'a>>,
    path: &'a str,
    value: Spanned<DeValue<'a>>,
) -> Result<(), (String, String)> {
    let span = value.span();
    let mut steps = steps(path)?.into_iter().peekable();
    let mut value = Some(value);
    let mut here = Place::Table(table.get_mut());
    let mut before = "";
    while let Some(step) = steps.next() {
        // At the last step of the path put the value, at earlier steps a table.
        let last = match steps.peek() {
            None => value.take(),
            Some(_) => None,
        };
        let inner = match (step, here) {
            (Step::Key(key), Place::Table(table)) => {
                let name = Spanned::new(span.clone(), key.into());
                if let Some(value) = last {
                    let above = DeTable::from_iter([(name, value)]);
                    drop_replaced(table, &above);
                    for (name, value) in above {
                        table.remove(key);
                        table.insert(name, value);
                    }
                    return Ok(());
                }
                if matches!(steps.peek(), Some(Step::Index(_))) && !table.contains_key(key) {
                    return Err((
                        format!("an element of {key}, which is absent"),
                        "an element of a list that the document has".to_owned(),
                    ));
                }
                table
                    .entry(name)
                    .or_insert_with(|| Spanned::new(span.clone(), DeValue::Table(DeTable::new())))
            }
            (Step::Index(index), Place::List(list)) => {
                let count = list.len();
                let element = list.get_mut(index).ok_or_else(|| {
                    let allowed = match count {
                        0 => "a list with elements".to_owned(),
                        _ => format!("0 to {}", count - 1),
                    };
                    (
                        format!("element {index} of {before}, which has {count}"),
                        allowed,
                    )
                })?;
                if let Some(value) = last {
                    *element = value;
                    return Ok(());
                }
                element
            }
            (_, here) => {
                let found = format!("{before}, which is {}", here.kind());
                let expected = match step {
                    Step::Key(_) => "the path of a field: only tables have fields",
                    Step::Index(_) => "the path of a field: only lists have elements",
                };
                return Err((found, expected.to_owned()));
            }
        };
        if let Step::Key(key) = step {
            before = key;
        }
        here = match inner.get_mut() {
            DeValue::Table(table) => Place::Table(table),
            DeValue::Array(list) => Place::List(list),
            other => Place::Value(format!("{} {}", article(other), type_name(other))),
        };
    }
    Ok(())
}

enum Place<'t, 'a> {
    Table(&'t mut DeTable<'a>),
    List(&'t mut DeArray<'a>),
    /// The type of a value.
    Value(String),
}

impl Place<'_, '_> {
    fn kind(&self) -> &str {
        match self {
            Self::Table(_) => "a table",
            Self::List(_) => "a list",
            Self::Value(kind) => kind,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::source::{Setting, TomlSource};

    const BASE: &str = "name = 'base'
list = [1, 2, 3]
[camera]
width_px = 640
shape = { kind = 'sphere', radius_mm = 3 }
[camera.sensor]
bits = 8
";

    fn merged(text: &str, settings: &[&str]) -> toml::Table {
        let settings: Vec<Setting> = settings.iter().map(|text| text.parse().unwrap()).collect();
        let source = TomlSource::new(text, "own.toml");
        let source = source
            .extended("".as_ref(), &[("base", BASE)], "test")
            .unwrap();
        source.with(&settings).to_toml().unwrap().parse().unwrap()
    }

    #[test]
    fn a_document_overrides_the_one_that_it_extends_and_settings_override_both() {
        let table = merged(
            "extends = 'base'\nlist = [4]\n[camera]\nshape = { kind = 'plane' }\nsensor.gain = 2\n",
            &[
                "camera.width_px=8",
                "camera.format=GREY",
                "list[0]=5",
                "usb.speed='high'",
            ],
        );
        let expected = "name = 'base'\nlist = [5]
[camera]\nwidth_px = 8\nformat = 'GREY'\nshape = { kind = 'plane' }
[camera.sensor]\nbits = 8\ngain = 2\n[usb]\nspeed = 'high'\n";
        assert_eq!(table, expected.parse().unwrap());
    }

    #[test]
    fn errors_name_the_layer_of_the_value() {
        let source = TomlSource::new("extends = 'base'\n[camera]\nheight_px = 4\n", "own.toml");
        let source = source
            .extended("".as_ref(), &[("base", BASE)], "test")
            .unwrap();
        let source = source.with(&["camera.sensor.gain=-1".parse().unwrap()]);
        for (path, place) in [
            ("camera.height_px", "own.toml:3: camera.height_px"),
            (
                "camera.sensor.bits",
                "built-in test base:7: camera.sensor.bits",
            ),
            (
                "camera.sensor.gain",
                "setting camera.sensor.gain=-1: camera.sensor.gain",
            ),
            ("list[2]", "built-in test base:2: list[2]"),
        ] {
            assert_eq!(source.place_of(path), place);
        }
    }

    #[test]
    fn what_cannot_be_set_or_extended_is_named() {
        let refused = |text: &str, setting: &str, parts: &[&str]| {
            let source =
                TomlSource::new(text, "own.toml").extended("".as_ref(), &[("base", BASE)], "test");
            let read = source.and_then(|source| source.with(&[setting.parse().unwrap()]).to_toml());
            let message = read.unwrap_err().to_string();
            for part in parts {
                assert!(message.contains(part), "{part} not in: {message}");
            }
        };
        let base = "extends = 'base'";
        refused(
            base,
            "list[3]=1",
            &["setting list[3]=1", "which has 3", "0 to 2"],
        );
        refused(
            base,
            "name.first=1",
            &["name, which is a string", "only tables have fields"],
        );
        refused(
            base,
            "camera[0]=1",
            &["camera, which is a table", "only lists have elements"],
        );
        refused(base, "moon[0]=1", &["an element of moon, which is absent"]);
        refused(
            "extends = 'bsae'",
            "name=1",
            &["own.toml:1: extends", "did you mean base?"],
        );
        refused(
            "name = 1\nextends = 4",
            "name=1",
            &["own.toml:2: extends", "an integer"],
        );
    }

    #[test]
    fn one_alternative_replaces_the_other() {
        let base = "sequence = [{ name = 'a' }, { name = 'b' }]
[calibration]
sequence = 'b'
board_scale = 2
[response]
gamma = 2.2
[skin]
fitzpatrick = 3
";
        let merged = |text: &str, settings: &[&str]| -> toml::Table {
            let settings: Vec<Setting> = settings.iter().map(|s| s.parse().unwrap()).collect();
            let text = format!("extends = 'base'\n{text}");
            let source = TomlSource::new(&text, "own.toml");
            let source = source.extended("".as_ref(), &[("base", base)], "test");
            let text = source.unwrap().with(&settings).to_toml().unwrap();
            text.parse().unwrap()
        };
        let table: toml::Table = merged(
            "response.table = [0, 1]\nskin.absorption_per_mm = 0.1\nsequence = [{ name = 'c' }]\n",
            &[],
        );
        assert_eq!(table["response"].as_table().unwrap().len(), 1);
        assert_eq!(table["skin"].as_table().unwrap().len(), 1);
        assert_eq!(table["calibration"].as_table().unwrap().len(), 1);
        let table = merged("", &["response.table=[0, 1]", "skin.refractive_index=1.3"]);
        assert_eq!(table["response"].as_table().unwrap().len(), 1);
        assert_eq!(table["skin"].as_table().unwrap().len(), 2);
        let table = merged("sequence = [{ name = 'b' }]\n", &[]);
        assert_eq!(table["calibration"]["sequence"].as_str(), Some("b"));
    }

    #[test]
    fn a_duplicate_key_is_named() {
        for (text, message) in [
            (
                "a = 1\nb = 2\na = 3\n",
                "m.toml:3: duplicate key `a`; expected each key once",
            ),
            (
                "[a]\nb = 1\n[a]\nb = 2\n",
                "m.toml:3: duplicate key `a`; expected each key once",
            ),
            (
                "a = { b = 1, b = 2 }\n",
                "m.toml:1: duplicate key `b`; expected each key once",
            ),
        ] {
            let read = TomlSource::new(text, "m.toml").to_toml();
            assert_eq!(read.unwrap_err().to_string(), message);
        }
    }

    #[test]
    fn files_are_relative_to_the_document_that_names_them_and_a_circle_ends() {
        let folder = tempfile::tempdir().unwrap();
        let write =
            |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        std::fs::create_dir(folder.path().join("lib")).unwrap();
        write("own.toml", "extends = 'lib/middle.toml'\nname = 'own'\n");
        write(
            "lib/middle.toml",
            "extends = 'low.toml'\nshape = { file = 'a.ply' }\n",
        );
        write(
            "lib/low.toml",
            "patient = 'p.toml'\nscene = 'torso'\nprofile = 'pod.toml'\nlist = [{ file = '/b.ply' }]\n",
        );
        let load = |name: &str| {
            let path = folder.path().join(name).display().to_string();
            crate::source::load(&path, &[], "test")
        };
        let (source, _) = load("own.toml").unwrap();
        let table: toml::Table = source.to_toml().unwrap().parse().unwrap();
        let expected = "name = 'own'\nshape = { file = 'lib/a.ply' }\npatient = 'lib/p.toml'\nscene = 'torso'\nprofile = 'lib/pod.toml'\nlist = [{ file = '/b.ply' }]\n";
        assert_eq!(table, expected.parse().unwrap());
        write("lib/low.toml", "extends = 'middle.toml'\n");
        let message = load("own.toml").err().unwrap().to_string();
        let circle = "middle.toml, which extends";
        assert!(message.contains(circle), "{message}");
    }
}
