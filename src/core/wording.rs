//! Error messages of serde and TOML reworded as `found; expected`, and suggestions for misspelt names.

/// Jaro-Winkler similarity from which a name is suggested. clap uses 0.7 for misspelt options; field
/// names share more of their letters, so the threshold is a little higher.
const SIMILAR: f64 = 0.8;

/// Splits a message of a serde deserialiser into what was found and what was expected. A misspelt
/// field or variant comes with the nearest valid name. `otherwise` is what was expected if the
/// message does not say.
pub fn found_and_expected(message: &str, otherwise: &str) -> (String, String) {
    let message = message.trim_end().replace('\n', " ");
    let Some((found, expected)) = message
        .split_once("; expected ")
        .or_else(|| message.split_once(", expected one of "))
        .or_else(|| message.split_once(", expected "))
    else {
        return (message, otherwise.to_owned());
    };
    let expected = match expected {
        "f64" => "a number",
        "u8" => "a whole number, 0 to 255",
        "u32" => "a whole number, 0 to 4294967295",
        "u64" => "a whole number, 0 or more",
        "a sequence" => "a list: [[...]] for tables, [...] for values",
        "i32" => "a whole number",
        other if other.starts_with("struct ") || other.contains("tagged enum ") => "a table",
        other => other,
    };
    let suggestion = unknown_name(found)
        .and_then(|name| nearest(name, expected.split('`').skip(1).step_by(2)))
        .map_or_else(String::new, |name| format!(" (did you mean `{name}`?)"));
    (format!("{found}{suggestion}"), expected.to_owned())
}

/// Returns the name in a message such as "unknown field `x`".
fn unknown_name(found: &str) -> Option<&str> {
    let rest = found
        .strip_prefix("unknown field `")
        .or_else(|| found.strip_prefix("unknown variant `"))?;
    rest.strip_suffix('`')
}

/// Returns the name most similar to a misspelt one, or `None` if none is similar.
///
/// ```
/// # use phasmid_core::wording::nearest;
/// assert_eq!(nearest("wdith_px", ["height_px", "width_px"]), Some("width_px"));
/// assert_eq!(nearest("colour", ["height_px", "width_px"]), None);
/// ```
pub fn nearest<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    names
        .into_iter()
        .map(|valid| (strsim::jaro_winkler(name, valid), valid))
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
            ("7; expected 1 to 3", "7", "1 to 3"),
            ("missing field `name`", "missing field `name`", "valid TOML"),
        ] {
            let split = found_and_expected(message, "valid TOML");
            assert_eq!(split, (found.to_owned(), expected.to_owned()));
        }
    }
}
