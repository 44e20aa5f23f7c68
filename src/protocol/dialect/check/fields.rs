//! Checks of arguments and values.

use super::reading::Check;
use crate::dialect::Value;
use crate::dialect::command::Framing;
use crate::dialect::field::{Field, Kind, Unit};
use crate::dialect::file::FieldFile;
use phasmid_core::error::Result;

/// Maximum number of arguments or values of a command.
const MAX_FIELDS: usize = 32;

pub(super) fn fields(
    check: &Check<'_>,
    framing: &Framing,
    path: &str,
    files: &[FieldFile],
) -> Result<Vec<Field>> {
    check.that(
        files.len() <= MAX_FIELDS,
        path,
        format!("{} fields", files.len()),
        format!("up to {MAX_FIELDS}"),
    )?;
    let mut fields: Vec<Field> = Vec::with_capacity(files.len());
    for (at, file) in files.iter().enumerate() {
        let path = format!("{path}[{at}]");
        let taken = fields.iter().any(|field| field.name == file.name);
        check.that(
            !taken,
            &format!("{path}.name"),
            format!("{:?}, which is already used", file.name),
            "a unique name",
        )?;
        let last = at + 1 == files.len();
        fields.push(field(check, framing, &path, file, last)?);
    }
    Ok(fields)
}

fn field(
    check: &Check<'_>,
    framing: &Framing,
    path: &str,
    file: &FieldFile,
    last: bool,
) -> Result<Field> {
    let at = |name: &str| format!("{path}.{name}");
    check.name(&at("name"), &file.name, &[])?;
    let kind = file.kind;
    let big = fits_framing(check, framing, path, file, last)?;
    let number = kind.is_number();
    let plain = file.unit == Unit::Plain && file.scale.is_none();
    let free = plain && file.min.is_none() && file.max.is_none();
    check.that(
        free || number && file.choices.is_none(),
        path,
        "unit, scale, min or max",
        "these for numbers without choices only",
    )?;
    let scale = file.scale.unwrap_or(1.0);
    check.that(
        (1e-12..=1e12).contains(&scale),
        &at("scale"),
        scale,
        "1e-12 to 1e12",
    )?;
    let (low, high) = kind.range();
    let range = (file.min.unwrap_or(low), file.max.unwrap_or(high));
    for (name, limit) in [("min", range.0), ("max", range.1)] {
        let allowed = format!("{low} to {high}");
        check.that((low..=high).contains(&limit), &at(name), limit, allowed)?;
    }
    check.that(
        range.0 <= range.1,
        &at("min"),
        range.0,
        format!("at most max, {}", range.1),
    )?;
    let mut field = Field {
        name: file.name.clone(),
        kind,
        divisor: file.unit.divisor() * scale,
        range,
        choices: choices(check, path, file)?,
        bytes: file.bytes,
        constant: None,
        big,
    };
    if let Some(value) = &file.constant {
        let value = literal(check, &at("constant"), value)?;
        let wrong = sendable(&field, &value);
        check.that(
            wrong.is_none(),
            &at("constant"),
            wrong.unwrap_or_default(),
            "a value of this type",
        )?;
        field.constant = Some(value);
    }
    Ok(field)
}

/// Checks that a type is allowed at its position; returns whether it is big-endian.
fn fits_framing(
    check: &Check<'_>,
    framing: &Framing,
    path: &str,
    file: &FieldFile,
    last: bool,
) -> Result<bool> {
    let (fits, allowed) = match framing {
        Framing::Packet(_) => (
            file.kind.in_packets(),
            "u8, u16, u32, i16, i32, f32, text or bytes in packets",
        ),
        Framing::Scpi(_) => (
            file.kind.in_lines(),
            "int, float, word, text, quoted, hex or block in SCPI",
        ),
        Framing::Line(_) => (
            file.kind.in_lines() && file.kind != Kind::Block,
            "int, float, word, text, quoted or hex in lines",
        ),
    };
    let kind = format!("{:?}", file.kind).to_lowercase();
    check.that(fits, &format!("{path}.type"), kind, allowed)?;
    let Framing::Packet(layout) = framing else {
        check.that(
            file.bytes.is_none(),
            &format!("{path}.bytes"),
            "a size in a text line",
            "sizes in packets only",
        )?;
        return Ok(false);
    };
    let sized = matches!(file.kind, Kind::Text | Kind::Bytes);
    check.that(
        file.bytes
            .is_none_or(|bytes| sized && (1..=layout.max).contains(&bytes)),
        &format!("{path}.bytes"),
        file.bytes.unwrap_or(0),
        format!("1 to {} for text and bytes", layout.max),
    )?;
    check.that(
        !sized || last || file.bytes.is_some(),
        path,
        "text or bytes of variable size before another field",
        "bytes = SIZE, or the last position",
    )?;
    Ok(layout.big)
}

fn choices(check: &Check<'_>, path: &str, file: &FieldFile) -> Result<Vec<(String, String)>> {
    let Some(choices) = &file.choices else {
        return Ok(Vec::new());
    };
    let path = format!("{path}.choices");
    check.that(
        (1..=64).contains(&choices.len()) && !file.kind.is_bytes(),
        &path,
        format!("{} choices", choices.len()),
        "1 to 64, of numbers or words",
    )?;
    for (wire, word) in choices {
        let (low, high) = file.kind.range();
        let whole = wire.parse::<i64>().ok();
        let plain = !wire.is_empty() && !wire.contains(|c: char| c.is_control() || c == ' ');
        let fits = match file.kind.is_number() {
            true => {
                whole.is_some_and(|n| (low..=high).contains(&(n as f64)) && n.to_string() == *wire)
            }
            false => plain,
        };
        let allowed = match file.kind.is_number() {
            true => format!("whole numbers from {low} to {high}"),
            false => "words without spaces".to_owned(),
        };
        check.that(fits, &path, format!("{wire:?}"), allowed)?;
        check.that(
            !word.is_empty() && !word.contains(char::is_control),
            &path,
            format!("{word:?}"),
            "a word without control characters",
        )?;
    }
    let pairs = choices.iter();
    Ok(pairs
        .map(|(wire, word)| (wire.clone(), word.clone()))
        .collect())
}

/// Converts a constant to a value; its field checks the type.
pub(super) fn number_or_text(value: &toml::Value) -> Option<Value> {
    match value {
        toml::Value::Integer(number) => Some(Value::Number(*number as f64)),
        toml::Value::Float(number) if number.is_finite() => Some(Value::Number(*number)),
        toml::Value::String(text) => Some(Value::Text(text.clone())),
        _ => None,
    }
}

pub(super) fn sendable(field: &Field, value: &Value) -> Option<String> {
    let sent = match field.kind.in_packets() && !field.kind.in_lines() {
        true => field.to_packet(value, &mut Vec::new()).err(),
        false => field.to_line(value).err(),
    };
    sent.map(|error| error.to_string())
}

/// Converts a number or a text to a value.
pub(super) fn literal(check: &Check<'_>, path: &str, value: &toml::Value) -> Result<Value> {
    number_or_text(value).ok_or_else(|| {
        let found = value.type_str();
        check.source.violation(path, found, "a number or a text")
    })
}
