//! Finds all errors of a document. serde stops at the first error. So each error is repaired in a
//! copy of the document, by removing the wrong value or adding a placeholder for the missing one,
//! until the copy can be deserialised.

use crate::deserializer::{Fault, Value};
use crate::layers::shifted;
use serde::de::DeserializeOwned;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Maximum number of errors that are counted; the search for errors then ends.
pub(crate) const MAX_COUNTED: usize = 200;
/// Limits of deserialising a document repeatedly: number of times, and total number of bytes.
const MAX_READS: usize = 1000;
const MAX_BYTES: usize = 1 << 26;
/// If a document is longer than this many bytes, only its first error is listed, because finding
/// the others requires deserialising it many times.
const MAX_LENGTH: usize = 1 << 18;
/// Positions of placeholders begin here, beyond the positions in any document.
const PLACEHOLDERS: usize = usize::MAX / 2;
/// Placeholders that are tried for a missing field after a text was tried: a value of each type, and
/// lists of usual lengths.
const VALUES: [&str; 7] = ["8", "true", "[]", "[8,8]", "[8,8,8]", "[8,8,8,8,8]", "{}"];
/// Length of the longest of [`VALUES`].
const LONGEST: usize = 16;

/// The errors of a document.
pub(crate) struct Faults<T> {
    /// Up to [`MAX_COUNTED`] errors.
    pub list: Vec<Fault>,
    /// Whether `list` contains all errors of the document.
    pub is_complete: bool,
    /// The deserialised document with placeholders for missing text fields, if it has no other error.
    pub mended: Option<T>,
}

/// Deserialises a document of `length` bytes.
///
/// # Errors
/// Returns all errors of the document, or only the first ones if there are many.
pub(crate) fn deserialize<T: DeserializeOwned>(
    table: Spanned<DeTable<'_>>,
    length: usize,
) -> Result<T, Faults<T>> {
    let mut fault = match read(&table) {
        Ok(value) => return Ok(value),
        Err(fault) => fault,
    };
    let mut faults = Faults {
        list: Vec::new(),
        is_complete: false,
        mended: None,
    };
    let mut document = Document {
        table,
        reads: MAX_READS.min(MAX_BYTES / length.max(1)),
        lacks_only_texts: true,
    };
    // After the removal of a wrong value its field is missing, and a table of unknown kind lacks fields.
    // Neither counts as a second error.
    let mut removed: Vec<(Range<usize>, String)> = Vec::new();
    loop {
        let span = fault.span();
        let missing = missing_field(&fault);
        let known = removed.iter().any(|(table, key)| {
            *table == span
                && missing
                    .as_ref()
                    .is_some_and(|name| name == key || key == "kind")
        });
        // Give up if an error remains after its repair.
        if faults.list.contains(&fault) {
            break;
        }
        if span.start < PLACEHOLDERS && !known {
            faults.list.push(fault);
        }
        let is_placeholder = span.start >= PLACEHOLDERS && missing.is_none();
        if length > MAX_LENGTH || faults.list.len() == MAX_COUNTED || is_placeholder {
            break;
        }
        let next = match missing {
            Some(name) => document.add::<T>(&span, &name),
            None => document.remove(&span).and_then(|entry| {
                removed.push(entry);
                document.read::<T>()
            }),
        };
        match next {
            Some(Err(next)) => fault = next,
            Some(Ok(value)) => {
                faults.is_complete = true;
                faults.mended = document.lacks_only_texts.then_some(value);
                break;
            }
            None => break,
        }
    }
    Err(faults)
}

fn read<T: DeserializeOwned>(table: &Spanned<DeTable<'_>>) -> Result<T, Fault> {
    let root = DeValue::Table(table.get_ref().clone());
    T::deserialize(Value(Spanned::new(table.span(), root)))
}

fn missing_field(fault: &Fault) -> Option<String> {
    let name = fault.message.trim_end().strip_prefix("missing field `")?;
    Some(name.strip_suffix('`')?.to_owned())
}

struct Document<'a> {
    table: Spanned<DeTable<'a>>,
    /// Remaining number of times that the document may be deserialised.
    reads: usize,
    lacks_only_texts: bool,
}

impl Document<'_> {
    /// Deserialises the document; `None` if the limits are exhausted.
    fn read<T: DeserializeOwned>(&mut self) -> Option<Result<T, Fault>> {
        self.reads = self.reads.checked_sub(1)?;
        Some(read(&self.table))
    }

    fn remove(&mut self, span: &Range<usize>) -> Option<(Range<usize>, String)> {
        self.lacks_only_texts = false;
        let outer = self.table.span();
        remove(self.table.get_mut(), outer, span)
    }

    /// Adds a placeholder for a missing field of the table at a position, and reads the document.
    fn add<T: DeserializeOwned>(
        &mut self,
        span: &Range<usize>,
        name: &str,
    ) -> Option<Result<T, Fault>> {
        let mut values: Vec<DeValue<'static>> = Vec::new();
        for text in VALUES.iter().rev() {
            values.push(DeValue::parse(text).ok()?.into_inner());
        }
        // Make each placeholder text unique, because it may be a name, and names have to be unique.
        let text = format!("x{}", self.reads);
        values.push(DeValue::String(text.clone().into()));
        loop {
            let value = values.pop()?;
            let is_table = matches!(value, DeValue::Table(_));
            let is_text = value.as_str() == Some(&text);
            let start = PLACEHOLDERS + LONGEST * self.reads;
            let mark = start..start + LONGEST;
            let outer = self.table.span();
            let here = table_at(self.table.get_mut(), &outer, span)?;
            here.remove(name);
            here.insert(
                Spanned::new(mark.clone(), name.to_owned().into()),
                Spanned::new(
                    mark.clone(),
                    shifted(Spanned::new(0..0, value), start).into_inner(),
                ),
            );
            let read = self.read::<T>()?;
            let Err(fault) = &read else {
                self.lacks_only_texts &= is_text;
                return Some(read);
            };
            let is_missing = missing_field(fault).is_some();
            let is_unknown = fault.message.starts_with("unknown field");
            let refused = match fault.span() {
                at if mark.contains(&at.start) => !(is_table && is_missing),
                // Inside an enumeration of tables, an error has the position of the whole table. A
                // missing field is reported only after all other fields have been read.
                at => at == *span && !is_missing && !is_unknown,
            };
            if !refused {
                self.lacks_only_texts &= is_text;
                return Some(read);
            }
            // The message about an enumeration lists its valid names: use one of these.
            if let Some((_, names)) = fault
                .message
                .strip_prefix("unknown variant `x")
                .and_then(|rest| rest.split_once("`, expected "))
            {
                let name = names.split('`').nth(1)?.to_owned();
                values.push(DeValue::String(name.into()));
            }
        }
    }
}

/// Returns the table at a position; `outer` is the position of `table`.
fn table_at<'t, 'a>(
    table: &'t mut DeTable<'a>,
    outer: &Range<usize>,
    span: &Range<usize>,
) -> Option<&'t mut DeTable<'a>> {
    if outer == span {
        return Some(table);
    }
    table
        .into_iter()
        .find_map(|(_, value)| table_in(value, span))
}

fn table_in<'t, 'a>(
    value: &'t mut Spanned<DeValue<'a>>,
    span: &Range<usize>,
) -> Option<&'t mut DeTable<'a>> {
    let outer = value.span();
    match value.get_mut() {
        DeValue::Table(table) => table_at(table, &outer, span),
        DeValue::Array(array) => array.iter_mut().find_map(|value| table_in(value, span)),
        _ => None,
    }
}

/// Removes the value at a position: an entry of a table, or an element of a list of tables. Returns the
/// position of the table and the key.
fn remove(
    table: &mut DeTable<'_>,
    outer: Range<usize>,
    span: &Range<usize>,
) -> Option<(Range<usize>, String)> {
    let mut found = None;
    for (key, value) in &mut *table {
        let name = key.get_ref().to_string();
        if key.span() == *span || value.span() == *span {
            found = Some(name);
            break;
        }
        let inner = value.span();
        match value.get_mut() {
            DeValue::Table(table) => {
                if let Some(entry) = remove(table, inner, span) {
                    return Some(entry);
                }
            }
            DeValue::Array(array) => {
                if let Some(at) = array.iter().position(|value| value.span() == *span) {
                    if !array.iter().all(|value| value.get_ref().is_table()) {
                        found = Some(name);
                        break;
                    }
                    let elements = std::mem::replace(array, std::iter::empty().collect());
                    let elements = elements.into_iter().enumerate();
                    let kept = elements.filter(|(i, _)| *i != at);
                    *array = kept.map(|(_, value)| value).collect();
                    return Some((outer, name));
                }
                for value in array.iter_mut() {
                    let inner = value.span();
                    if let DeValue::Table(table) = value.get_mut()
                        && let Some(entry) = remove(table, inner, span)
                    {
                        return Some(entry);
                    }
                }
            }
            _ => {}
        }
    }
    let key = found?;
    table.remove(key.as_str());
    Some((outer, key))
}

#[cfg(test)]
mod tests {
    use crate::source::TomlSource;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only read")]
    struct Device {
        name: String,
        camera: Camera,
        lamp: Option<Camera>,
        #[serde(default)]
        frame: Vec<Frame>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only read")]
    struct Camera {
        width_px: u32,
        format: Format,
        #[serde(deserialize_with = "crate::numbers::exactly")]
        range_us: [f64; 2],
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "UPPERCASE")]
    enum Format {
        Grey,
        Y16,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only read")]
    struct Frame {
        pattern: Pattern,
    }

    #[derive(Debug, Deserialize)]
    #[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
    #[expect(dead_code, reason = "only read")]
    enum Pattern {
        Fringe { period_px: f64 },
        White {},
    }

    fn errors(text: &str) -> Vec<String> {
        let error = TomlSource::new(text, "m.toml").deserialize::<Device>();
        error
            .unwrap_err()
            .to_string()
            .lines()
            .map(str::to_owned)
            .collect()
    }

    #[test]
    fn all_errors_of_a_document_are_found_with_their_lines() {
        let text = "colour = 3
[camera]
widht_px = 8
format = \"GREEN\"
[[frame]]
pattern = { kind = \"fringe\", period_px = 16 }
[[frame]]
pattern = { kind = \"fringe\" }
[[frame]]
pattern = { kind = \"stripes\" }
";
        let found = errors(text);
        for (line, part) in [
            ("m.toml:1", "unknown field `colour`"),
            ("m.toml:1", "the required field `name`"),
            ("m.toml:2", "the required field `width_px`"),
            ("m.toml:2", "the required field `range_us`"),
            ("m.toml:3", "did you mean `width_px`"),
            ("m.toml:4", "GREEN"),
            ("m.toml:8", "the required field `period_px`"),
            ("m.toml:10", "stripes"),
        ] {
            let lines: Vec<_> = found.iter().filter(|error| error.contains(part)).collect();
            assert_eq!(lines.len(), 1, "{part} in {found:#?}");
            assert!(lines[0].starts_with(&format!("{line}: ")), "{lines:?}");
        }
        assert_eq!(found.len(), 8, "{found:#?}");
    }

    #[test]
    fn errors_name_the_field() {
        let found = errors(
            "name = 'a'
frame = [{ pattern = ['white'] }, { pattern = { kind = 'white', grey = 3 } }]
[camera]
width_px = 'wide'
format = 'grey'
range_us = [1]
lamp = [1]
[lamp]
width_px = -1
format = 'Y17'
range_us = { from = 1, to = 2 }
",
        );
        let expected = [
            "m.toml:2: frame[0].pattern: invalid type: list; expected a table",
            "m.toml:2: frame[1].pattern: unknown field `grey`; expected no fields",
            "m.toml:4: camera.width_px: invalid type: string \"wide\"; expected a whole number from 0 to 4294967295",
            "m.toml:5: camera.format: unknown variant `grey` (did you mean `GREY`?); expected `GREY` or `Y16`",
            "m.toml:6: camera.range_us: a list of 1 number; expected 2",
            "m.toml:7: camera: unknown field `lamp`; expected `width_px`, `format`, `range_us`",
            "m.toml:9: lamp.width_px: invalid value: integer `-1`; expected a whole number from 0 to 4294967295",
            "m.toml:10: lamp.format: unknown variant `Y17` (did you mean `Y16`?); expected `GREY` or `Y16`",
            "m.toml:11: lamp.range_us: invalid type: table; expected a list of 2 numbers",
        ];
        assert_eq!(found, expected);
        assert_eq!(
            errors("name = 'a'\ncamera = ['a', 1]\n"),
            ["m.toml:2: camera: invalid type: list; expected a table"]
        );
        assert_eq!(
            errors("name = 'a'\n[[camera]]\nwidth_px = 8\n"),
            ["m.toml:2: camera: invalid type: list; expected a table"]
        );
    }

    #[test]
    fn a_missing_table_is_one_error() {
        let found = errors("");
        assert_eq!(found.len(), 2, "{found:#?}");
        assert!(found[0].contains("`name`") && found[1].contains("`camera`"));
        let found = errors("name = 'a'\ncamera = 3\n");
        assert_eq!(found.len(), 1, "{found:#?}");
        let found = errors("name = 'a'\nlamp = 'on'\n[camera]\nwidth_px = 'wide'\n");
        assert_eq!(found.len(), 4, "{found:#?}");
    }

    #[test]
    fn the_number_of_listed_errors_is_limited() {
        let text: String = (0..100).map(|i| format!("wrong{i} = {i}\n")).collect();
        let found = errors(&text);
        assert_eq!(found.len(), 21);
        assert_eq!(found[20], "and 82 further errors");
        let text: String = (0..1000).map(|i| format!("wrong{i} = {i}\n")).collect();
        assert_eq!(errors(&text)[20], "and at least 180 further errors");
    }
}
