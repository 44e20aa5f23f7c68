//! Host side of a dialect: builds requests and interprets replies.

use super::command::Framing;
use super::device::{Unfit, values_of_line, whole};
use super::field::{Field, Kind};
use super::{Dialect, Direction, Event, Reply, Value};
use crate::scpi::{DeviceError, ErrorCode};
use phasmid_core::error::Result;

impl Dialect {
    /// Returns the bytes of a command as the host sends it, including the message end.
    ///
    /// # Errors
    /// Returns an error if the command is unknown, or an argument is missing, of the wrong type or
    /// out of range.
    pub fn request(
        &self,
        command: &str,
        args: &[(&str, Value)],
        sequence: u8,
    ) -> Result<Vec<u8>, DeviceError> {
        let Some(command) = self.command(command) else {
            return Err(ErrorCode::UndefinedHeader.with(command));
        };
        if let Some((name, _)) = args.iter().find(|(name, _)| command.arg(name).is_none()) {
            let what = format!("{}: {name}", command.name);
            return Err(ErrorCode::ParameterNotAllowed.with(what));
        }
        let given = |field: &Field| {
            let given = args.iter().find(|(name, _)| *name == field.name);
            match (&field.constant, given) {
                (Some(constant), _) => Ok(constant.clone()),
                (None, Some((_, value))) => Ok(value.clone()),
                (None, None) => {
                    let what = format!("{}: {}", command.name, field.name);
                    Err(ErrorCode::MissingParameter.with(what))
                }
            }
        };
        match &self.framing {
            Framing::Scpi(ends) | Framing::Line(ends) => {
                let filled = command.line.fill(|name| match command.arg(name) {
                    // A word supplied by the caller must not be able to add further words to the
                    // message.
                    Some(field) if self.is_scpi() && field.kind == Kind::Word => {
                        Ok(field.to_scpi(&given(field)?)?.into_bytes())
                    }
                    Some(field) => Ok(field.to_line(&given(field)?)?),
                    None => Err(Unfit::from(format!("no argument {name}"))),
                });
                let mut line = whole(filled.map_err(|unfit| unfit.0)?, ends)?;
                line.extend_from_slice(ends.to_device.as_bytes());
                Ok(line)
            }
            Framing::Packet(layout) => {
                let mut data = Vec::new();
                for field in &command.args {
                    field.to_packet(&given(field)?, &mut data)?;
                }
                let flags = layout.flags(command.read, true, false);
                let head = (flags, sequence, command.code);
                let packet = layout.seal(Direction::ToDevice, head, &data);
                packet.ok_or_else(|| ErrorCode::TooMuchData.with("more than a packet holds"))
            }
        }
    }

    /// Interprets a received message for a host that has sent `command` with `sequence`.
    pub fn reply(&self, command: &str, message: &[u8], sequence: u8) -> Reply {
        match &self.framing {
            Framing::Scpi(_) | Framing::Line(_) => self.reply_line(command, message),
            Framing::Packet(_) => self.reply_packet(command, message, sequence),
        }
    }

    fn reply_line(&self, command: &str, message: &[u8]) -> Reply {
        let (Framing::Scpi(ends) | Framing::Line(ends)) = &self.framing else {
            return Reply::Other;
        };
        // A SCPI reply may end with a block, whose bytes must not be trimmed.
        let line = match &self.framing {
            Framing::Line(_) => message.trim_ascii(),
            _ => message,
        };
        if let Some(event) = self.event_of(line, ends.any_case) {
            return Reply::Event(event);
        }
        if let Some(errors) = &self.errors
            && let Some(template) = &errors.line
            && let Some(parts) = template.split(line, ends.any_case)
        {
            let part = |name: &str| {
                let bytes = parts.iter().find(|(n, _)| *n == name).map(|(_, v)| *v);
                bytes.map(|bytes| String::from_utf8_lossy(bytes).into_owned())
            };
            let number = part("number").map_or(Some(0), |digits| digits.parse().ok());
            if let Some(number) = number {
                let own = || errors.text(number).to_owned();
                let text = part("text").or(part("detail")).unwrap_or_else(own);
                return Reply::Refused { number, text };
            }
        }
        let mut wrong = None;
        if let Some(command) = self.command(command) {
            for (at, template) in command.reply.iter().enumerate() {
                let Some(parts) = template.split(line, ends.any_case) else {
                    continue;
                };
                match values_of_line(&command.values, &parts) {
                    Ok(values) if at + 1 < command.reply.len() => return Reply::More(values),
                    Ok(values) => return Reply::Done(values),
                    Err(error) => wrong = wrong.or(Some(error)),
                }
            }
        }
        if let Some(error) = wrong {
            return Reply::Bad(error.detail);
        }
        let fits_another = self.commands.iter().any(|command| {
            let fits = |template: &super::template::Template, fields: &[Field]| {
                let parts = template.split(line, ends.any_case);
                parts.is_some_and(|parts| values_of_line(fields, &parts).is_ok())
            };
            let mut replies = command.reply.iter();
            replies.any(|template| fits(template, &command.values))
                || self.echo && fits(&command.line, &command.args)
        });
        if fits_another {
            return Reply::Other;
        }
        let start = &line[..line.len().min(40)];
        Reply::Bad(format!("\"{}\"", start.escape_ascii()))
    }

    fn event_of(&self, line: &[u8], any_case: bool) -> Option<Event> {
        let booted = self.boot.iter().any(|boot| {
            let own = boot.bytes.trim_ascii();
            !own.is_empty() && own == line
        });
        if booted {
            return Some(Event::Booted);
        }
        self.events.iter().find_map(|(event, template)| {
            let parts = template.split(line, any_case)?;
            let number = |name: &str| {
                let digits = parts.iter().find(|(n, _)| *n == name).map(|(_, v)| *v);
                let digits = std::str::from_utf8(digits.unwrap_or(b"0")).ok()?;
                digits.parse::<u64>().ok()
            };
            let (index, id) = (number("index")?, number("id")?);
            Some(match event {
                Event::Exposed { .. } => Event::Exposed { index, id },
                other => *other,
            })
        })
    }

    fn reply_packet(&self, command: &str, message: &[u8], sequence: u8) -> Reply {
        let (Framing::Packet(layout), Some(command)) = (&self.framing, self.command(command))
        else {
            return Reply::Other;
        };
        let packet = match layout.open(message, Direction::ToHost) {
            Ok(packet) => packet,
            Err(wrong) => return Reply::Bad(wrong),
        };
        let set = |bit: u8| packet.flags >> bit & 1 == 1;
        let refused = layout.flags.and_then(|f| f.error).is_some_and(set);
        let foreign = packet.code.is_some_and(|code| code != command.code) && !refused;
        if layout.sequence.is_some() && packet.sequence != sequence || foreign {
            return Reply::Other;
        }
        let mut data = packet.data;
        if refused {
            let errors = self.errors.as_ref();
            let kind = errors.and_then(|errors| errors.number);
            let number = kind.and_then(|kind| {
                let field = Field {
                    kind,
                    range: kind.range(),
                    big: layout.big,
                    ..Field::int("number")
                };
                field.read_packet(&mut data).ok()?.number()
            });
            let number = number.unwrap_or(0.0) as i64;
            let text = errors.map_or("", |errors| errors.text(number)).to_owned();
            return Reply::Refused { number, text };
        }
        let mut values = Vec::with_capacity(command.values.len());
        for field in &command.values {
            match field.read_packet(&mut data) {
                Ok(value) => values.push((field.name.clone(), value)),
                Err(error) => return Reply::Bad(error.detail),
            }
        }
        if layout.length.is_some() && !data.is_empty() {
            return Reply::Bad(format!("{} bytes too many", data.len()));
        }
        Reply::Done(values)
    }
}
