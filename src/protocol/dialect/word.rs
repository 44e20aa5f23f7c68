//! What is wrong with a line that fits no command: where its first word is a command's, the rest of it.

use super::command::Command;
use super::template::{Part, Template};
use crate::scpi::{DeviceError, ErrorCode};
use std::cmp::Ordering;

/// The first word of a template, where it is one and no argument begins in it.
fn word(template: &Template) -> Option<&str> {
    let [Part::Text(text), behind @ ..] = &template.parts[..] else {
        return None;
    };
    match text.split_once(' ') {
        Some((word, _)) => Some(word),
        None => behind.is_empty().then_some(text),
    }
}

/// Words of a line that fits a template, an argument being one.
fn words(template: &Template) -> usize {
    let text = |part: &Part| match part {
        Part::Text(text) => text.clone(),
        Part::Field(_) => "x".to_owned(),
    };
    let line: String = template.parts.iter().map(text).collect();
    line.split_whitespace().count()
}

/// The error of a line that fits none of the commands: an argument too few, one too many, or another
/// one than belongs there, where a command begins with its first word.
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
