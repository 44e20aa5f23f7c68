//! Finds all errors of a document. serde stops at the first, so each is mended in a copy of the
//! document, by removing what is wrong or adding a placeholder for what is missing, until it reads.

use crate::layers::shifted;
use serde::de::DeserializeOwned;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Deserializer, Error};

/// Maximum number of errors that are listed.
const MAX_ERRORS: usize = 20;
/// Maximum number of times that a document is read.
const MAX_READS: usize = 1000;
/// Length in bytes above which only a document's first error is listed, because finding the others
/// takes many reads.
const MAX_LENGTH: usize = 1 << 18;
/// Start of the positions of placeholders, beyond that of any document.
const PLACEHOLDERS: usize = usize::MAX / 2;
/// Values that are tried for a missing field: one for each type, and lists of the usual lengths.
const VALUES: [&str; 8] = [
    "'x'",
    "8",
    "true",
    "[]",
    "[8,8]",
    "[8,8,8]",
    "[8,8,8,8,8]",
    "{}",
];
/// Length of the longest of [`VALUES`].
const LONGEST: usize = 16;

/// Deserialises a document of `length` bytes.
///
/// # Errors
/// Returns up to [`MAX_ERRORS`] errors in the order of their positions.
pub(crate) fn deserialize<T: DeserializeOwned>(
    table: Spanned<DeTable<'_>>,
    length: usize,
) -> Result<T, Vec<Error>> {
    let mut error = match read(&table) {
        Ok(value) => return Ok(value),
        Err(error) => error,
    };
    let mut errors = Vec::new();
    let mut document = Document { table, reads: 0 };
    // A field is missing once its value was removed, and a table of unknown kind lacks fields: neither is
    // a second error.
    let mut removed: Vec<(Range<usize>, String)> = Vec::new();
    loop {
        let span = error.span().unwrap_or_default();
        let missing = missing_field(&error);
        let known = removed.iter().any(|(table, key)| {
            *table == span
                && missing
                    .as_ref()
                    .is_some_and(|name| name == key || key == "kind")
        });
        // An error in a list of enumerations has the position of the list, which no repair reaches.
        let again = |earlier: &Error| {
            earlier.span() == error.span() && earlier.message() == error.message()
        };
        if errors.iter().any(again) {
            break;
        }
        if span.start < PLACEHOLDERS && !known {
            errors.push(error);
        }
        let is_placeholder = span.start >= PLACEHOLDERS && missing.is_none();
        if length > MAX_LENGTH || errors.len() == MAX_ERRORS || is_placeholder {
            break;
        }
        let next = match missing {
            Some(name) => document.add::<T>(&span, &name),
            None => document.remove(&span).and_then(|entry| {
                removed.push(entry);
                document.next_error::<T>()
            }),
        };
        match next {
            Some(next) => error = next,
            None => break,
        }
    }
    errors.sort_by_key(|error| error.span().map_or(0, |span| span.start));
    Err(errors)
}

fn read<T: DeserializeOwned>(table: &Spanned<DeTable<'_>>) -> Result<T, Error> {
    T::deserialize(Deserializer::from(table.clone()))
}

fn missing_field(error: &Error) -> Option<String> {
    let name = error.message().trim_end().strip_prefix("missing field `")?;
    Some(name.strip_suffix('`')?.to_owned())
}

struct Document<'a> {
    table: Spanned<DeTable<'a>>,
    reads: usize,
}

impl Document<'_> {
    /// Returns the next error; `None` if there is none or it takes too long to find it.
    fn next_error<T: DeserializeOwned>(&mut self) -> Option<Error> {
        self.reads += 1;
        if self.reads > MAX_READS {
            return None;
        }
        read::<T>(&self.table).err()
    }

    fn remove(&mut self, span: &Range<usize>) -> Option<(Range<usize>, String)> {
        let outer = self.table.span();
        remove(self.table.get_mut(), outer, span)
    }

    /// Adds a placeholder for a missing field of the table at a position, and returns the next error.
    fn add<T: DeserializeOwned>(&mut self, span: &Range<usize>, name: &str) -> Option<Error> {
        let mut values: Vec<DeValue<'static>> = Vec::new();
        for text in VALUES.iter().rev() {
            values.push(DeValue::parse(text).ok()?.into_inner());
        }
        loop {
            let value = values.pop()?;
            let is_table = matches!(value, DeValue::Table(_));
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
            let error = self.next_error::<T>()?;
            let is_missing = missing_field(&error).is_some();
            let is_unknown = error.message().starts_with("unknown field");
            let refused = match error.span() {
                Some(at) if mark.contains(&at.start) => !(is_table && is_missing),
                // Inside an enumeration of tables an error has the position of the whole table. The
                // other fields were read before this one was missed.
                at => at.as_ref() == Some(span) && !is_missing && !is_unknown,
            };
            if !refused {
                return Some(error);
            }
            // An enumeration lists its names.
            if let Some(names) = error
                .message()
                .strip_prefix("unknown variant `x`, expected ")
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

/// Removes what is at a position: an entry of a table, or an element of a list of tables. Returns the
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
        assert_eq!(errors(&text).len(), super::MAX_ERRORS);
    }
}
