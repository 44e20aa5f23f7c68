//! Checks of refusals and unsolicited messages.

use super::commands::is_error_number;
use super::reading::Check;
use crate::dialect::command::{Errors, Framing};
use crate::dialect::file::ErrorFile;
use crate::dialect::template::Template;
use crate::dialect::uses::EVENTS;
use crate::dialect::{Boot, Direction, Event};
use phasmid_core::error::Result;

/// Maximum size in bytes of the output at power-on, and maximum delay of a message at power-on.
const MAX_BOOT: usize = 4096;
const MAX_DELAY_MS: f64 = 600_000.0;

pub(super) fn errors(check: &Check<'_>, framing: &Framing) -> Result<Option<Errors>> {
    let file = check.file.errors.as_ref();
    let Some(file) = file else {
        check.that(
            matches!(framing, Framing::Scpi(_)),
            "errors",
            "none",
            "[errors]: the device's replies to refused commands",
        )?;
        return Ok(None);
    };
    let mut line = None;
    match framing {
        Framing::Scpi(_) => check.that(
            false,
            "errors",
            "[errors] with SCPI",
            "no [errors]: SCPI has an error queue",
        )?,
        Framing::Line(_) => {
            let text = file.line.as_deref().unwrap_or("");
            let template = check.template("errors.line", text)?;
            check.names("errors.line", &template, &["number", "text", "detail"])?;
            check.that(
                !text.is_empty() && text.trim() == text && file.number.is_none(),
                "errors",
                "no line, or a packet's number",
                "line = TEXT with {number}, {text}, {detail}",
            )?;
            line = Some(template);
        }
        Framing::Packet(layout) => {
            let flag = layout.flags.is_some_and(|flags| flags.error.is_some());
            check.that(
                flag && file.line.is_none(),
                "errors",
                "a line, or packets without an error flag",
                "packet.flags = { at, error }, and number = TYPE here",
            )?;
            let fits = file.number.is_none_or(|kind| {
                let room = layout.room(Direction::ToHost);
                is_error_number(kind) && kind.width().is_some_and(|width| width <= room)
            });
            check.that(
                fits,
                "errors.number",
                "another type",
                "u8, u16, u32, i16 or i32",
            )?;
        }
    }
    let one = |field: &str, error: &ErrorFile| {
        let (low, high) = file.number.map_or((-1e9, 1e9), |kind| kind.range());
        check.that(
            (low..=high).contains(&f64::from(error.number)),
            &format!("{field}.number"),
            error.number,
            format!("{low} to {high}"),
        )?;
        let text = &error.text;
        check.that(
            text.len() <= 100 && !text.contains(char::is_control) && text.trim() == text,
            &format!("{field}.text"),
            format!("{text:?}"),
            "up to 100 bytes without control characters",
        )
    };
    one("errors.default", &file.default)?;
    one("errors.busy", &file.busy)?;
    let mut map = Vec::with_capacity(file.map.len());
    for (at, entry) in file.map.iter().enumerate() {
        let path = format!("errors.map[{at}]");
        let error = ErrorFile {
            number: entry.number,
            text: entry.text.clone(),
        };
        one(&path, &error)?;
        for code in &entry.scpi {
            let taken = map
                .iter()
                .any(|(codes, _): &(Vec<i16>, _)| codes.contains(code));
            check.that(
                !taken && (-499..=-100).contains(code),
                &format!("{path}.scpi"),
                code,
                "SCPI error numbers, -499 to -100, each once",
            )?;
        }
        map.push((entry.scpi.clone(), error));
    }
    Ok(Some(Errors {
        line,
        number: file.number,
        default: file.default.clone(),
        busy: file.busy.clone(),
        map,
    }))
}

pub(super) fn events(check: &Check<'_>, framing: &Framing) -> Result<Vec<(Event, Template)>> {
    let mut events = Vec::new();
    for (name, text) in &check.file.events {
        let field = format!("events.{name}");
        let known = EVENTS.iter().find(|(known, _)| known == name);
        let Some((_, event)) = known.filter(|_| matches!(framing, Framing::Line(_))) else {
            let names: Vec<_> = EVENTS.iter().map(|(name, _)| *name).collect();
            let allowed = format!("in line framing: {}", names.join(", "));
            return Err(check.source.violation(&field, "an event", allowed));
        };
        let template = check.template(&field, text)?;
        let known: &[&str] = match event {
            Event::Exposed { .. } => &["index", "id"],
            _ => &[],
        };
        check.names(&field, &template, known)?;
        check.that(
            !text.is_empty() && text.trim() == text,
            &field,
            format!("{text:?}"),
            "a line without spaces at its ends",
        )?;
        events.push((*event, template));
    }
    Ok(events)
}

pub(super) fn boot(check: &Check<'_>, framing: &Framing) -> Result<Vec<Boot>> {
    let mut boot: Vec<Boot> = Vec::with_capacity(check.file.boot.len());
    for (at, file) in check.file.boot.iter().enumerate() {
        let path = format!("boot[{at}]");
        check.that(
            (0.0..=MAX_DELAY_MS).contains(&file.delay_ms),
            &format!("{path}.delay_ms"),
            file.delay_ms,
            format!("0 to {MAX_DELAY_MS}"),
        )?;
        let bytes = match (&file.line, &file.bytes, framing) {
            (Some(line), None, Framing::Line(ends) | Framing::Scpi(ends)) => {
                check.that(
                    !line.contains(char::is_control),
                    &format!("{path}.line"),
                    format!("{line:?}"),
                    "a line without control characters",
                )?;
                [line.as_bytes(), ends.to_host.as_bytes()].concat()
            }
            (None, Some(bytes), _) => bytes.clone(),
            _ => {
                let found = "a line and bytes, neither, or a line among packets";
                return Err(check.source.violation(&path, found, "either line or bytes"));
            }
        };
        check.that(
            bytes.len() <= MAX_BOOT,
            &path,
            format!("{} bytes", bytes.len()),
            format!("{MAX_BOOT} bytes"),
        )?;
        let delay_ns = (file.delay_ms * 1e6).round() as u64;
        check.that(
            boot.last().is_none_or(|before| before.delay_ns <= delay_ns),
            &format!("{path}.delay_ms"),
            file.delay_ms,
            "at least that of the previous entry",
        )?;
        boot.push(Boot { delay_ns, bytes });
    }
    Ok(boot)
}
