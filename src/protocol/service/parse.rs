//! Parses requests. Errors state the text found and the texts allowed, for malformed JSON as well as
//! for JSON of the wrong shape. An object in which a name occurs twice has the wrong shape.

use super::about::ClockPace;
use super::request::{Action, Every, Item, Placement, Request, Step, TermChoice, Which};
use crate::faults::{Fault, When};
use phasmid_core::wording::found_and_expected;
use serde::Deserialize;
use serde::de::{DeserializeOwned, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value, json};
use std::fmt;

/// Names of requests.
const REQUESTS: &str = "get, objects_at_ns, truth_at_ns, truth_of_frame, do, place, set, term, clock, fault, clear_faults";
/// Maximum number of characters of a request that an error shows.
const SHOWN: usize = 60;

/// Reason why a line is not a valid request: the text found, and the text expected.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct InvalidRequest(String);

impl Request {
    /// Parses a request line.
    ///
    /// # Errors
    /// Returns an error, worded for the reply, if the line is not a valid request.
    pub fn parse(line: &[u8]) -> Result<Self, InvalidRequest> {
        request(line).map_err(InvalidRequest)
    }
}

/// Parses a line.
///
/// # Errors
/// Returns an error, worded for the reply, if the line is not a valid request.
fn request(line: &[u8]) -> Result<Request, String> {
    let Once(value) = serde_json::from_slice(line).map_err(|e| {
        let words = e.to_string();
        match words.contains("; expected ") {
            true => words,
            false => format!("{words}; expected a line of JSON, such as {{\"get\":\"clock\"}}"),
        }
    })?;
    let Value::Object(map) = value else {
        let found = found(&value);
        return Err(format!(
            "{found}; expected an object with one of {REQUESTS}"
        ));
    };
    let names: Vec<_> = map.keys().cloned().collect();
    let mut entries = map.into_iter();
    let (Some((name, value)), None) = (entries.next(), entries.next()) else {
        let found = match names.len() {
            0 => "no request".to_owned(),
            _ => format!("{} in one request", shortened(names.join(", "))),
        };
        return Err(format!("{found}; expected one of {REQUESTS}"));
    };
    Ok(match name.as_str() {
        "get" => Request::Get(one_of(&name, &value, &Item::ALL)?),
        "objects_at_ns" => Request::ObjectsAt(whole(&name, &value)?),
        "truth_at_ns" => Request::TruthAt(whole(&name, &value)?),
        "truth_of_frame" => Request::TruthOfFrame(whole(&name, &value)?),
        "do" => Request::Do(one_of(&name, &value, &[("trigger", Action::Trigger)])?),
        "place" => Request::Place(placement(&name, value)?),
        "set" => Request::Set(text(&name, &value)?),
        "term" => Request::Term(term(&name, value)?),
        "clock" => Request::Clock(step(&name, &value)?),
        "fault" => Request::Fault(Box::new(fault(&name, value)?)),
        "clear_faults" => Request::ClearFaults(which(&name, &value)?),
        _ => {
            let name = shortened(name);
            return Err(format!(
                "{name}: unknown request; expected one of {REQUESTS}"
            ));
        }
    })
}

fn refusal<T>(place: &str, value: &Value, allowed: &str) -> Result<T, String> {
    Err(format!("{place}: {}; expected {allowed}", found(value)))
}

fn one_of<T: Copy>(place: &str, value: &Value, all: &[(&str, T)]) -> Result<T, String> {
    let known = |&&(word, _): &&(&str, T)| value.as_str() == Some(word);
    if let Some((_, meaning)) = all.iter().find(known) {
        return Ok(*meaning);
    }
    let words: Vec<_> = all.iter().map(|(word, _)| format!("{word:?}")).collect();
    refusal(place, value, &words.join(", "))
}

fn whole(place: &str, value: &Value) -> Result<u64, String> {
    match value.as_u64() {
        Some(number) => Ok(number),
        None => refusal(place, value, &format!("a whole number, 0 to {}", u64::MAX)),
    }
}

fn text(place: &str, value: &Value) -> Result<String, String> {
    match value.as_str() {
        Some(text) => Ok(text.to_owned()),
        None => refusal(
            place,
            value,
            "FIELD=VALUE, such as \"object[0].albedo=0.4\"",
        ),
    }
}

fn term(place: &str, value: Value) -> Result<TermChoice, String> {
    let whole = json!({ "term": "", "included": true });
    fields(place, value, &whole, "term and included")
}

fn step(place: &str, value: &Value) -> Result<Step, String> {
    let entry = value.as_object().filter(|entries| entries.len() == 1);
    let entry = entry.and_then(|entries| entries.iter().next());
    match entry.map(|(name, number)| (name.as_str(), number)) {
        Some(("step_ns", number)) => Ok(Step::StepNs(whole("clock.step_ns", number)?)),
        Some(("run_until_ns", number)) => {
            Ok(Step::RunUntilNs(whole("clock.run_until_ns", number)?))
        }
        Some(("pace", pace)) => Ok(Step::Pace(one_of("clock.pace", pace, &ClockPace::ALL)?)),
        _ if value.as_str() == Some("stop") => Ok(Step::Stop),
        _ => {
            let allowed = "{\"step_ns\":N}, {\"run_until_ns\":N}, {\"pace\":NAME} or \"stop\"";
            refusal(place, value, allowed)
        }
    }
}

fn which(place: &str, value: &Value) -> Result<Which, String> {
    match (value.as_u64(), value.as_str()) {
        (Some(number), _) => Ok(Which::One(number)),
        (_, Some("all")) => Ok(Which::Every(Every::All)),
        _ => refusal(place, value, "the number of a fault, or \"all\""),
    }
}

fn placement(place: &str, value: Value) -> Result<Placement, String> {
    let zero = [0.0; 3];
    let whole = json!({ "object": 0, "position_mm": zero, "rotation_deg": zero });
    fields(place, value, &whole, "object, position_mm and rotation_deg")
}

fn fault(place: &str, value: Value) -> Result<Fault, String> {
    // Conditions are checked first, so that an error in one of them names that condition.
    if let Some(when) = value.get("when") {
        let place = format!("{place}.when");
        fields::<When>(&place, when.clone(), &json!({}), "an object of conditions")?;
    }
    let (whole, needed) = (json!({}), "what, and the fields of that kind");
    let written: Fault<toml::Table> = fields(place, value, &whole, needed)?;
    written.read().map_err(|flaw| {
        let found = shortened(flaw.found);
        format!("{place}.{}: {found}; expected {}", flaw.field, flaw.allowed)
    })
}

/// Parses an object. `whole` is a valid object into which each field is inserted alone, so that an
/// error names the invalid field.
fn fields<T: DeserializeOwned>(
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

/// Rewords an error of serde in the form of the other errors.
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

/// Formats a value as JSON, truncated if it is long.
fn found(value: &Value) -> String {
    shortened(value.to_string())
}

fn shortened(text: String) -> String {
    match text.char_indices().nth(SHOWN) {
        None => text,
        Some((at, _)) => format!("{}...", &text[..at]),
    }
}

/// A JSON value in which no object has duplicate names; serde_json alone would keep the last
/// duplicate.
struct Once(Value);

impl<'de> Deserialize<'de> for Once {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(OnceVisitor).map(Self)
    }
}

struct OnceVisitor;

impl<'de> Visitor<'de> for OnceVisitor {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Bool(value))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        while let Some(Once(value)) = list.next_element()? {
            values.push(value);
        }
        Ok(Value::Array(values))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut map = Map::new();
        while let Some(name) = entries.next_key::<String>()? {
            let Once(value) = entries.next_value()?;
            if map.contains_key(&name) {
                let name = shortened(name);
                return Err(A::Error::custom(format!("{name} twice; expected once")));
            }
            map.insert(name, value);
        }
        Ok(Value::Object(map))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_requests_are_refused_with_what_is_allowed() {
        let requests = format!("expected one of {REQUESTS}");
        for (line, words) in [
            ("{", vec!["EOF while parsing", "expected a line of JSON"]),
            ("{}", vec!["no request", &requests]),
            ("[]", vec!["[]; expected an object with one of get"]),
            ("7", vec!["7; expected an object"]),
            (
                "{\"get\":\"clock\",\"x\":1}",
                vec!["get, x in one request", &requests],
            ),
            (
                "{\"get\":\"clock\",\"get\":\"clock\"}",
                vec!["get twice; expected once"],
            ),
            ("{\"moon\":1}", vec!["moon: unknown request", &requests]),
            (
                "{\"get\":\"moon\"}",
                vec!["get: \"moon\"; expected \"truth\", \"clock\""],
            ),
            ("{\"get\":3}", vec!["get: 3; expected \"truth\""]),
            (
                "{\"truth_at_ns\":-1}",
                vec!["truth_at_ns: -1; expected a whole number, 0 to 1844"],
            ),
            ("{\"do\":{}}", vec!["do: {}; expected \"trigger\""]),
            (
                "{\"clock\":{}}",
                vec![
                    "clock: {}; expected {\"step_ns\":N}, {\"run_until_ns\":N}, {\"pace\":NAME} or \"stop\"",
                ],
            ),
            (
                "{\"clock\":{\"step_ns\":1.5}}",
                vec!["clock.step_ns: 1.5; expected a whole number"],
            ),
            (
                "{\"clear_faults\":\"some\"}",
                vec!["clear_faults: \"some\"; expected the number of a fault, or \"all\""],
            ),
            (
                "{\"fault\":7}",
                vec!["fault: 7; expected an object with what"],
            ),
            (
                "{\"fault\":{}}",
                vec!["fault.what: missing; expected dropped"],
            ),
            (
                "{\"fault\":{\"what\":\"rain\"}}",
                vec!["fault.what: \"rain\"; expected dropped, repeated"],
            ),
            (
                "{\"fault\":{\"what\":\"dark\",\"nth\":1}}",
                vec!["fault.nth: not a parameter of dark; expected none"],
            ),
            (
                "{\"fault\":{\"what\":\"late\",\"by_ms\":\"x\"}}",
                vec!["fault.by_ms: \"x\"; expected 0 to 3600000 ms"],
            ),
            (
                "{\"fault\":{\"what\":\"dark\",\"when\":{\"nth\":\"x\"}}}",
                vec!["fault.when.nth: string \"x\"; expected a whole number"],
            ),
            (
                "{\"fault\":{\"what\":\"dark\",\"when\":{\"window_s\":[0,1,2]}}}",
                vec!["fault.when.window_s: a list of 3 numbers; expected 2"],
            ),
            (
                "{\"fault\":{\"what\":\"dark\",\"when\":{\"nth\":1,\"nth\":2}}}",
                vec!["nth twice; expected once"],
            ),
            (
                "{\"place\":{\"object\":0,\"position_mm\":[0,0,1,2],\"rotation_deg\":[0,0,0]}}",
                vec!["place.position_mm: a list of 4 numbers; expected 3"],
            ),
            (
                "{\"place\":{\"object\":0,\"position_mm\":[0,0,1]}}",
                vec!["place: missing field `rotation_deg`; expected object, position_mm"],
            ),
            (
                "{\"place\":{\"object\":-1,\"position_mm\":[0,0,1],\"rotation_deg\":[0,0,0]}}",
                vec!["place.object: integer `-1`; expected a whole number"],
            ),
        ] {
            let told = request(line.as_bytes()).unwrap_err();
            assert!(
                words.iter().all(|part| told.contains(part)),
                "{line}: {told}"
            );
        }
    }

    #[test]
    fn long_values_are_shortened_in_errors() {
        let name = "x".repeat(4000);
        for line in [
            format!("{{\"{name}\":1}}"),
            format!("{{\"{name}\":1,\"{name}\":1}}"),
            format!("{{\"get\":\"{name}\"}}"),
            format!("{{\"fault\":{{\"what\":\"late\",\"by_ms\":\"{name}\"}}}}"),
        ] {
            assert!(request(line.as_bytes()).unwrap_err().len() < 400, "{line}");
        }
    }
}
