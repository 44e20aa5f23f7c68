//! Error messages of serde and TOML reworded as `found; expected`, and suggestions for misspelt names.

/// Minimum Jaro-Winkler similarity of a name that is suggested. clap uses 0.7 for misspelt options; this
/// threshold is higher because unrelated field names have more letters in common.
const SIMILAR: f64 = 0.8;

/// Splits a message of a serde deserialiser into what was found and what was expected. A misspelt
/// field or variant comes with the nearest valid name. If the message does not state what was
/// expected, `otherwise` is returned in its place.
pub fn found_and_expected(message: &str, otherwise: &str) -> (String, String) {
    let message = message.trim_end().replace('\n', " ");
    if let Some(found) = message.strip_suffix(", there are no fields") {
        return (found.to_owned(), "no fields".to_owned());
    }
    let Some((found, expected)) = message
        .split_once("; expected ")
        .or_else(|| message.split_once(", expected one of "))
        .or_else(|| message.split_once(", expected "))
    else {
        return (message, otherwise.to_owned());
    };
    let expected = match expected {
        "f64" => "a number".to_owned(),
        "a sequence" => "a list: [[...]] for tables, [...] for values".to_owned(),
        "a map" | "map" => "a table".to_owned(),
        "path string" => "a path".to_owned(),
        "usize" => "a whole number of 0 or more".to_owned(),
        "variant identifier" => "a name in quotes".to_owned(),
        other if other.starts_with("struct ") || other.contains("tagged enum ") => {
            "a table".to_owned()
        }
        other => whole_numbers(other).unwrap_or_else(|| other.to_owned()),
    };
    let found = match found.strip_prefix("invalid type: ") {
        Some("map") => "invalid type: table",
        Some("sequence") => "invalid type: list",
        _ => found,
    };
    let suggestion = unknown_name(found).map_or_else(String::new, |name| {
        did_you_mean(name, expected.split('`').skip(1).step_by(2))
    });
    (format!("{found}{suggestion}"), expected)
}

/// Returns the range of the integer type with this name, such as `u16`, for messages.
fn whole_numbers(name: &str) -> Option<String> {
    let bits: u32 = name.strip_prefix(['u', 'i'])?.parse().ok()?;
    let range = match (name.as_bytes().first()?, bits) {
        (b'u', 8 | 16 | 32) => format!("from 0 to {}", (1u64 << bits) - 1),
        (b'u', 64) => "of 0 or more".to_owned(),
        (b'i', 8 | 16 | 32) => {
            let half = 1i64 << (bits - 1);
            format!("from {} to {}", -half, half - 1)
        }
        _ => return Some("a whole number".to_owned()),
    };
    Some(format!("a whole number {range}"))
}

/// Returns a hint such as `` (did you mean `width_px`?)`` for a misspelt name; empty if no name is
/// similar.
pub fn did_you_mean<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, names).map_or_else(String::new, |name| format!(" (did you mean `{name}`?)"))
}

/// Returns the misspelt name that a message such as "unknown field `x`" contains.
fn unknown_name(found: &str) -> Option<&str> {
    let rest = found
        .strip_prefix("unknown field `")
        .or_else(|| found.strip_prefix("unknown variant `"))?;
    rest.strip_suffix('`')
}

/// Returns the name most similar to a misspelt one, ignoring case, or `None` if none is similar.
///
/// ```
/// # use phasmid_core::wording::nearest;
/// assert_eq!(nearest("wdith_px", ["height_px", "width_px"]), Some("width_px"));
/// assert_eq!(nearest("grey", ["GREY", "Y16"]), Some("GREY"));
/// assert_eq!(nearest("colour", ["height_px", "width_px"]), None);
/// ```
pub fn nearest<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    names
        .into_iter()
        .map(|valid| {
            let (name, lower) = (name.to_lowercase(), valid.to_lowercase());
            (strsim::jaro_winkler(&name, &lower), valid)
        })
        .filter(|(similarity, _)| *similarity >= SIMILAR)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, valid)| valid)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splits_messages_and_suggests_the_nearest_name() {
        for (message, found, expected) in [
            (
                "unknown field `wdith_px`, expected one of `height_px`, `width_px`\n",
                "unknown field `wdith_px` (did you mean `width_px`?)",
                "`height_px`, `width_px`",
            ),
            (
                "unknown variant `moon`, expected `plane` or `sphere`",
                "unknown variant `moon`",
                "`plane` or `sphere`",
            ),
            (
                "invalid type: string \"x\", expected f64",
                "invalid type: string \"x\"",
                "a number",
            ),
            (
                "invalid type: integer `3`, expected struct Camera",
                "invalid type: integer `3`",
                "a table",
            ),
            (
                "invalid value: integer `-1`, expected u16",
                "invalid value: integer `-1`",
                "a whole number from 0 to 65535",
            ),
            (
                "invalid type: map, expected i8",
                "invalid type: table",
                "a whole number from -128 to 127",
            ),
            ("7; expected 1 to 3", "7", "1 to 3"),
            ("missing field `name`", "missing field `name`", "valid TOML"),
        ] {
            let split = found_and_expected(message, "valid TOML");
            assert_eq!(split, (found.to_owned(), expected.to_owned()));
        }
    }
}
