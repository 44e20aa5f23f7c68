//! Objects of known fields: finds the invalid field and words its error like all others.

use super::{refusal, shortened};
use phasmid_core::wording::found_and_expected;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// Parses an object. `whole` is a valid object: to find the invalid field, each field in turn is
/// inserted alone into it.
pub(super) fn fields<T: DeserializeOwned>(
    place: &str,
    value: Value,
    whole: &Value,
    needed: &str,
) -> Result<T, String> {
    let Value::Object(given) = &value else {
        return refusal(place, &value, &format!("an object with {needed}"));
    };
    let given = given.clone();
    let error = match serde_json::from_value(value) {
        Ok(read) => return Ok(read),
        Err(error) => reworded(&error),
    };
    for (name, field) in given {
        let mut probe = whole.clone();
        probe[&name] = field;
        if let Err(error) = serde_json::from_value::<T>(probe) {
            let words = reworded(&error);
            return Err(match words.starts_with("unknown field") {
                true => format!("{place}: {words}"),
                false => format!("{place}.{name}: {words}"),
            });
        }
    }
    Err(format!("{place}: {error}; expected {needed}"))
}

/// Rewords an error of serde like all other errors.
fn reworded(error: &serde_json::Error) -> String {
    let (found, expected) = found_and_expected(&error.to_string(), "");
    let found = ["invalid type: ", "invalid value: ", "invalid length "]
        .iter()
        .find_map(|start| found.strip_prefix(start))
        .unwrap_or(&found)
        .to_owned();
    match expected.as_str() {
        "" => found,
        _ => format!("{}; expected {expected}", shortened(found)),
    }
}
