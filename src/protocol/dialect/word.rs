//! Diagnoses lines that match no command, by the commands that share their first word.

use super::command::Command;
use super::template::{Part, Template};
use crate::scpi::{DeviceError, ErrorCode};
use std::cmp::Ordering;

/// Returns the first word of a template; `None` if the template starts with an argument or an
/// argument is part of the word.
fn word(template: &Template) -> Option<&str> {
    let [Part::Text(text), behind @ ..] = &template.parts[..] else {
        return None;
    };
    match text.split_once(' ') {
        Some((word, _)) => Some(word),
        None => behind.is_empty().then_some(text),
    }
}

/// Returns the number of words of a line that fits a template; each argument counts as one.
fn words(template: &Template) -> usize {
    let text = |part: &Part| match part {
        Part::Text(text) => text.clone(),
        Part::Field(_) => "x".to_owned(),
    };
    let line: String = template.parts.iter().map(text).collect();
    line.split_whitespace().count()
}

/// Returns the error for a line that matches no command. If its first word is that of a command,
/// the error is a missing, an extra or a wrong argument.
pub(super) fn unmatched(commands: &[Command], line: &[u8], any_case: bool) -> DeviceError {
    let mut parts = line.split(|b| b.is_ascii_whitespace());
    let first = parts.next().unwrap_or_default();
    let known = |command: &&Command| {
        word(&command.line).is_some_and(|word| match any_case {
            true => first.eq_ignore_ascii_case(word.as_bytes()),
            false => first == word.as_bytes(),
        })
    };
    let lengths = commands.iter().filter(known).map(|c| words(&c.line));
    let found = 1 + parts.filter(|part| !part.is_empty()).count();
    let order = |length: usize| found.cmp(&length);
    let code = match (lengths.clone().min().map(order), lengths.max().map(order)) {
        (None, _) | (_, None) => ErrorCode::UndefinedHeader,
        (Some(Ordering::Less), _) => ErrorCode::MissingParameter,
        (_, Some(Ordering::Greater)) => ErrorCode::ParameterNotAllowed,
        _ => ErrorCode::DataTypeError,
    };
    code.with(line[..line.len().min(40)].escape_ascii())
}
