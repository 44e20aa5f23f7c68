//! Device side of a dialect: parses requests and builds replies. A line that matches no command is
//! compared with the commands that have the same first word, so that the error is specific.

use super::command::{Command, Framing, LineEnds};
use super::field::Field;
use super::template::{Part, Template};
use super::{Asked, Dialect, Direction, Event, Head, Value, WireError};
use crate::scpi::{DeviceError, ErrorCode};
use phasmid_core::error::Result;
use std::cmp::Ordering;

/// The error of a template, converted to a firmware error.
pub(super) struct Unfit(pub(super) DeviceError);

impl From<String> for Unfit {
    fn from(words: String) -> Self {
        Self(ErrorCode::IllegalParameterValue.with(words))
    }
}

impl From<DeviceError> for Unfit {
    fn from(error: DeviceError) -> Self {
        Self(error)
    }
}

impl Dialect {
    /// Parses a request to the device.
    ///
    /// # Errors
    /// Returns an error if the message is damaged, its command is unknown or its arguments are
    /// invalid; [`Self::nack`] builds the reply to it.
    pub fn asked(&self, message: &[u8]) -> Result<Asked, WireError> {
        match &self.framing {
            Framing::Scpi(ends) | Framing::Line(ends) => {
                self.asked_line(message, ends).map_err(WireError::line)
            }
            Framing::Packet(_) => self.asked_packet(message),
        }
    }

    fn asked_line(&self, message: &[u8], ends: &LineEnds) -> Result<Asked, DeviceError> {
        let line = ends.content(message);
        let mut wrong = None;
        for command in &self.commands {
            let Some(parts) = command.line.split(line, ends.any_case) else {
                continue;
            };
            let args = values_of_line(&command.args, &parts);
            match args.and_then(|args| filled(command, &args).map(|_| args)) {
                Ok(args) => {
                    return Ok(Asked {
                        command: command.name.clone(),
                        args,
                        sequence: 0,
                        wants_reply: !command.reply.is_empty(),
                    });
                }
                Err(error) => wrong = wrong.or(Some(error)),
            }
        }
        Err(wrong.unwrap_or_else(|| unmatched(&self.commands, line, ends.any_case)))
    }

    fn asked_packet(&self, message: &[u8]) -> Result<Asked, WireError> {
        let Framing::Packet(layout) = &self.framing else {
            return Err(WireError::damaged("not a packet"));
        };
        let packet = layout
            .open(message, Direction::ToDevice)
            .map_err(WireError::damaged)?;
        let (read_bit, reply_bit) = layout
            .flags
            .map_or((None, None), |flags| (flags.read, flags.reply));
        let set = |bit: u8| packet.flags >> bit & 1 == 1;
        let wants_reply = reply_bit.is_none_or(set);
        let read = read_bit.is_some_and(set);
        let code = packet.code.unwrap_or_default();
        let head = Head {
            sequence: packet.sequence,
            code,
            read,
        };
        let failed = |error: DeviceError| WireError {
            error,
            head,
            wants_reply,
        };
        let command = self
            .commands
            .iter()
            .find(|command| command.code == code && (read_bit.is_none() || command.read == read));
        let Some(command) = command else {
            let what = if read { "read" } else { "write" };
            let unknown = ErrorCode::UndefinedHeader.with(format!("{what} {code:#06x}"));
            return Err(failed(unknown));
        };
        let mut data = packet.data;
        let mut args = Vec::with_capacity(command.args.len());
        for field in &command.args {
            let value = field.read_packet(&mut data).map_err(failed)?;
            args.push((field.name.clone(), value));
        }
        if layout.length.is_some() && !data.is_empty() {
            let what = format!("{} bytes too many", data.len());
            return Err(failed(ErrorCode::ParameterNotAllowed.with(what)));
        }
        filled(command, &args).map_err(failed)?;
        Ok(Asked {
            command: command.name.clone(),
            args,
            sequence: packet.sequence,
            wants_reply,
        })
    }

    /// Returns the firmware (SCPI) messages of a command, in order.
    pub fn runs(&self, asked: &Asked) -> Vec<String> {
        let command = self.command(&asked.command);
        // `asked` has already refused requests whose messages cannot be formatted.
        command.map_or_else(Vec::new, |command| {
            filled(command, &asked.args).unwrap_or_default()
        })
    }

    /// Builds the reply, including its end, from the firmware's answers. `answers` holds one answer
    /// per message of [`Self::runs`], without newline, and empty if the message has no answer. The
    /// reply is empty if the client wants none.
    ///
    /// # Errors
    /// Returns an error if the answers do not match the file.
    pub fn answer(&self, asked: &Asked, answers: &[Vec<u8>]) -> Result<Vec<u8>, DeviceError> {
        let command = self.command(&asked.command);
        let Some(command) = command.filter(|_| asked.wants_reply) else {
            return Ok(Vec::new());
        };
        let mut values = taken(command, answers)?;
        cut(command, asked, &mut values)?;
        for field in &command.values {
            if let Some(constant) = &field.constant {
                values.push((field.name.clone(), constant.clone()));
            }
        }
        let find = |name: &str| {
            let found = values.iter().find(|(n, _)| n == name).map(|(_, v)| v);
            found.ok_or_else(|| ErrorCode::SystemError.with(format!("no value {name}")))
        };
        match &self.framing {
            Framing::Scpi(ends) | Framing::Line(ends) => {
                let mut lines = Vec::new();
                for template in &command.reply {
                    let filled = template.fill(|name| match command.value(name) {
                        Some(field) => Ok(field.to_line(find(name)?)?),
                        None => Err(Unfit::from(format!("no value {name}"))),
                    });
                    lines.extend(whole(filled.map_err(|unfit| unfit.0)?, ends)?);
                    lines.extend_from_slice(ends.to_host.as_bytes());
                }
                Ok(lines)
            }
            Framing::Packet(layout) => {
                let mut data = Vec::new();
                for field in &command.values {
                    field.to_packet(find(&field.name)?, &mut data)?;
                }
                let flags = layout.flags(command.read, true, false);
                let head = (flags, asked.sequence, command.code);
                let packet = layout.seal(Direction::ToHost, head, &data);
                packet.ok_or_else(|| ErrorCode::TooMuchData.with("a reply longer than a packet"))
            }
        }
    }

    /// Returns the unsolicited message for an event; `None` if the dialect does not report it.
    pub fn event(&self, event: Event) -> Option<Vec<u8>> {
        let (Framing::Scpi(ends) | Framing::Line(ends)) = &self.framing else {
            return None;
        };
        let same = |told: &Event| std::mem::discriminant(told) == std::mem::discriminant(&event);
        let (_, template) = self.events.iter().find(|(told, _)| same(told))?;
        let (index, id) = match event {
            Event::Exposed { index, id } => (index, id),
            _ => (0, 0),
        };
        let line = template.fill(|name| {
            let number = if name == "index" { index } else { id };
            Ok::<_, Unfit>(number.to_string().into_bytes())
        });
        Some([&line.ok()?[..], ends.to_host.as_bytes()].concat())
    }
}

/// Formats a command's messages for the firmware.
fn filled(command: &Command, args: &[(String, Value)]) -> Result<Vec<String>, DeviceError> {
    let run = |run: &Template| {
        let message = run.fill(|name| {
            let value = args.iter().find(|(arg, _)| arg == name);
            let (Some((_, value)), Some(field)) = (value, command.arg(name)) else {
                return Err(Unfit::from(format!("no {name}")));
            };
            Ok(field.to_scpi(value)?.into_bytes())
        });
        let message = message.map_err(|unfit| unfit.0)?;
        String::from_utf8(message).map_err(|error| ErrorCode::SystemError.with(error))
    };
    command.runs.iter().map(run).collect()
}

/// Parses the field values of a line.
pub(super) fn values_of_line(
    fields: &[Field],
    parts: &[(&str, &[u8])],
) -> Result<Vec<(String, Value)>, DeviceError> {
    let value = |(name, wire): &(&str, &[u8])| {
        let field = fields.iter().find(|field| field.name == *name);
        let field = field.ok_or_else(|| ErrorCode::SystemError.with(name))?;
        Ok((field.name.clone(), field.read_line(wire)?))
    };
    parts.iter().map(value).collect()
}

/// Returns the line if it is neither too long nor looks like a comment, else an error.
pub(super) fn whole(line: Vec<u8>, ends: &LineEnds) -> Result<Vec<u8>, DeviceError> {
    if line.len() > ends.max {
        let what = format!("{} bytes in a line, at most {}", line.len(), ends.max);
        return Err(ErrorCode::TooMuchData.with(what));
    }
    let holds = |text: &str| line.windows(text.len()).any(|part| part == text.as_bytes());
    if let Some(comment) = ends.comment.as_deref().filter(|comment| holds(comment)) {
        let what = format!("{comment:?} is not allowed in a line");
        return Err(ErrorCode::IllegalParameterValue.with(what));
    }
    Ok(line)
}

/// Parses the values in the firmware's answers.
fn taken(command: &Command, answers: &[Vec<u8>]) -> Result<Vec<(String, Value)>, DeviceError> {
    let mut values = Vec::new();
    for (at, template) in command.answers.iter().enumerate() {
        let Some(template) = template else { continue };
        let answer = answers.get(at).map_or(&[][..], Vec::as_slice);
        let wrong = || {
            let start = &answer[..answer.len().min(40)];
            let what = format!(
                "{}: unexpected answer \"{}\"",
                command.name,
                start.escape_ascii()
            );
            ErrorCode::SystemError.with(what)
        };
        for (name, raw) in Template::split(template, answer, true).ok_or_else(wrong)? {
            let field = command.value(name).ok_or_else(wrong)?;
            values.push((name.to_owned(), field.read_scpi(raw)?));
        }
    }
    Ok(values)
}

/// Replaces a long answer by the piece that the client requested.
fn cut(
    command: &Command,
    asked: &Asked,
    values: &mut Vec<(String, Value)>,
) -> Result<(), DeviceError> {
    let Some(chunk) = &command.chunk else {
        return Ok(());
    };
    let offset = asked.args.iter().find(|(name, _)| *name == chunk.offset);
    let offset = offset.and_then(|(_, value)| value.number()).unwrap_or(0.0) as usize;
    let Some((_, Value::Bytes(bytes))) = values.iter_mut().find(|(name, _)| *name == chunk.data)
    else {
        return Err(ErrorCode::SystemError.with("a chunked answer that is not bytes"));
    };
    let (total, sum) = (bytes.len(), crc32fast::hash(bytes));
    if offset > total {
        let what = format!("{}: {offset}, allowed 0 to {total}", chunk.offset);
        return Err(ErrorCode::DataOutOfRange.with(what));
    }
    bytes.drain(..offset);
    bytes.truncate(command.chunk_bytes);
    values.push((chunk.total.clone(), Value::Number(total as f64)));
    if let Some(check) = &chunk.check {
        values.push((check.clone(), Value::Number(sum.into())));
    }
    Ok(())
}

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

/// Returns the number of words in lines that match a template; each argument counts as one word.
fn words(template: &Template) -> usize {
    let text = |part: &Part| match part {
        Part::Text(text) => text.clone(),
        Part::Field(_) => "x".to_owned(),
    };
    let line: String = template.parts.iter().map(text).collect();
    line.split_whitespace().count()
}

/// Returns the error for a line that matches no command. If some command has the line's first word,
/// the error is a missing, extra or wrong argument.
fn unmatched(commands: &[Command], line: &[u8], any_case: bool) -> DeviceError {
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
