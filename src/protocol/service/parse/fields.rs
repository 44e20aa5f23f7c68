//! Objects of known fields: finds the invalid field and words its error like all others.

use super::{refusal, shortened};
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
        Err(error) => told(&error),
    };
    for (name, field) in given {
        let mut probe = whole.clone();
        probe[&name] = field;
        if let Err(error) = serde_json::from_value::<T>(probe) {
            let words = told(&error);
            return Err(match words.starts_with("unknown field") {
                true => format!("{place}: {words}"),
                false => format!("{place}.{name}: {words}"),
            });
        }
    }
    Err(format!("{place}: {error}; allowed: {needed}"))
}

/// Rewords an error of serde like all other errors.
fn told(error: &serde_json::Error) -> String {
    let words = error.to_string();
    let words = ["invalid type: ", "invalid value: ", "invalid length "]
        .iter()
        .find_map(|start| words.strip_prefix(start))
        .unwrap_or(&words);
    let split = words
        .split_once(", expected one of ")
        .or_else(|| words.split_once(", expected "));
    match split {
        None => words.to_owned(),
        Some((found, expected)) => {
            let allowed = match expected {
                "f64" => "a number",
                "u32" | "u64" => "a whole number, 0 or more",
                "i32" => "a whole number",
                other => other,
            };
            format!("{}; allowed: {allowed}", shortened(found.to_owned()))
        }
    }
}
