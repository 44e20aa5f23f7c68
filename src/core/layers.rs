//! TOML documents in layers: a document, the ones that it extends, and single settings above it.
//! Positions count over the texts of all layers, so that each value keeps its file and line.

use crate::error::{Error, Result};
use crate::wording::found_and_expected;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Key with the name or path of the document that a document extends.
pub(crate) const EXTENDS: &str = "extends";

/// Maximum number of steps of a setting's path. Values are dropped and written recursively.
const MAX_STEPS: usize = 64;

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
    /// Folder to which paths of files in the text are relative, seen from the last document's folder.
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

    /// Puts an extended document below; `folder` is its folder, seen from this document's.
    pub fn extend(&mut self, base: Self, folder: &str) {
        let layers = base.0.into_iter().map(|layer| Layer {
            folder: folder.to_owned(),
            ..layer
        });
        self.0.splice(0..0, layers);
    }

    /// Puts a value on top; a text that is no TOML value counts as a string.
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

    /// Returns the document that the lowest layer extends, and its place in messages.
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
                format!("{} {}", article(other), other.type_str()),
                "the name of a built-in document or the path of a file, in quotes",
            )),
        }
    }

    /// Merges the layers. Tables are merged key by key, unless they differ in their `kind`; any other
    /// value replaces the one below it, lists included.
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
                    .map_err(|error| self.error(&error, start))
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
        let table = DeTable::parse(&layer.text).map_err(|error| self.error(&error, start))?;
        let span = table.span();
        Ok(Spanned::new(
            moved(span, start),
            shifted_table(table.into_inner(), start),
        ))
    }

    /// Rewords an error of the TOML parser; `start` is added to its position.
    pub fn error(&self, error: &toml::de::Error, start: usize) -> Error {
        let at = start + error.span().map_or(0, |span| span.start);
        let message = error.message();
        let missing = message.strip_prefix("missing field ");
        let otherwise = missing.map_or_else(
            || "valid TOML".to_owned(),
            |name| format!("the required field {}", name.trim_end()),
        );
        let (found, expected) = found_and_expected(message, &otherwise);
        Error::input(self.place_at(at), found, expected)
    }

    /// Returns `FILE:LINE` of a position, or the setting that it is in.
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

    /// Returns the position of the value at a path such as `frame[3].pattern`, or of the closest table
    /// around it.
    pub fn position_of(&self, path: &str) -> Option<usize> {
        let root = self.merged().ok()?;
        let start = root.span().start;
        let mut table = root.get_ref();
        let mut position = start;
        for step in path.split('.') {
            let (key, indices) = step.split_once('[').unwrap_or((step, ""));
            let Some((name, mut value)) = table.get_key_value(key) else {
                break;
            };
            position = name.span().start;
            for index in indices.split(']').filter(|s| !s.is_empty()) {
                let index: usize = index.trim_start_matches('[').parse().ok()?;
                let DeValue::Array(array) = value.get_ref() else {
                    break;
                };
                value = array.get(index)?;
                position = value.span().start;
            }
            match value.get_ref() {
                DeValue::Table(inner) => table = inner,
                _ => break,
            }
        }
        Some(position)
    }
}

/// Returns the indefinite article of a type's name.
fn article(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::Integer(_) | DeValue::Array(_) => "an",
        _ => "a",
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

/// Merges a table into the one below it.
fn merge<'a>(below: &mut DeTable<'a>, above: DeTable<'a>) {
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

/// Prepends a folder to relative paths: all under the keys `file` and `texture`; patients, dialects,
/// scenes and profiles if they end with `.toml`, because the others are built in.
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

/// Puts a value at a path, in tables that are made where they are missing.
fn put<'a>(
    table: &mut Spanned<DeTable<'a>>,
    path: &'a str,
    value: Spanned<DeValue<'a>>,
) -> Result<(), (String, String)> {
    if path.split('.').count() > MAX_STEPS {
        let found = format!("a path of more than {MAX_STEPS} steps");
        return Err((found, "the path of a field".to_owned()));
    }
    let span = value.span();
    let mut steps = path.split('.').peekable();
    let mut here = table.get_mut();
    while let Some(step) = steps.next() {
        let (key, indices) = step.split_once('[').unwrap_or((step, ""));
        let last = steps.peek().is_none();
        let name = || Spanned::new(span.clone(), key.into());
        if last && indices.is_empty() {
            here.remove(key);
            here.insert(name(), value);
            return Ok(());
        }
        if !here.contains_key(key) && indices.is_empty() {
            let inner = DeValue::Table(DeTable::new());
            here.insert(name(), Spanned::new(span.clone(), inner));
        }
        let Some(mut inner) = here.get_mut(key) else {
            return Err((
                format!("no list {key}"),
                "an index of an existing list".to_owned(),
            ));
        };
        for index in indices.split(']').filter(|s| !s.is_empty()) {
            let DeValue::Array(array) = inner.get_mut() else {
                return Err((
                    format!("{key}, which is no list"),
                    "the path of a field".to_owned(),
                ));
            };
            let count = array.len();
            let entry = index
                .trim_start_matches('[')
                .parse()
                .ok()
                .and_then(|i: usize| array.get_mut(i));
            inner = entry.ok_or_else(|| {
                (
                    format!(
                        "element {:?} of {key}, which has {count}",
                        index.trim_start_matches('[')
                    ),
                    format!("0 to {}", count.saturating_sub(1)),
                )
            })?;
        }
        if last {
            *inner = value;
            return Ok(());
        }
        here = match inner.get_mut() {
            DeValue::Table(table) => table,
            other => {
                let found = format!("{step}, which is {} {}", article(other), other.type_str());
                return Err((found, "the path of a field".to_owned()));
            }
        };
    }
    Ok(())
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
                "--set camera.sensor.gain=-1: camera.sensor.gain",
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
            &["--set list[3]=1", "which has 3", "0 to 2"],
        );
        refused(
            base,
            "name.first=1",
            &["name, which is a string", "the path of a field"],
        );
        refused(base, "camera[0]=1", &["camera, which is no list"]);
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
        assert!("camera".parse::<Setting>().is_err());
        let deep = format!("camera{}=1", ".a".repeat(60_000));
        refused(base, &deep, &["a path of more than 64 steps"]);
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
