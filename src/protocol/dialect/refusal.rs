//! Refusals: maps firmware errors to the dialect's own numbers and texts.

use super::command::Framing;
use super::device::Unfit;
use super::field::Field;
use super::file::ErrorFile;
use super::{Asked, Dialect, Direction, Head, Value, WireError};
use crate::scpi::DeviceError;

impl Dialect {
    /// Returns the reply to a command that the firmware has refused, with the dialect's error
    /// number; empty if the client wants no reply.
    pub fn refusal(&self, asked: &Asked, error: &DeviceError) -> Vec<u8> {
        let own = self.errors.as_ref().map(|errors| errors.of(error));
        self.refuse(self.head(asked), asked.wants_reply, own, &error.detail)
    }

    /// Returns the reply to an invalid message; empty if the device does not reply to it.
    pub fn nack(&self, error: &WireError) -> Vec<u8> {
        let own = self.errors.as_ref().map(|errors| errors.of(&error.error));
        self.refuse(error.head, error.wants_reply, own, &error.error.detail)
    }

    /// Returns the reply of a busy device (the file's `busy` error).
    pub fn busy(&self, asked: &Asked) -> Vec<u8> {
        let own = self.errors.as_ref().map(|errors| &errors.busy);
        self.refuse(self.head(asked), asked.wants_reply, own, "")
    }

    /// Returns the header fields of a valid packet, for use in the reply.
    fn head(&self, asked: &Asked) -> Head {
        let command = self.command(&asked.command);
        let (read, code) = command.map_or((false, 0), |c| (c.read, c.code));
        Head {
            sequence: asked.sequence,
            code,
            read,
        }
    }

    /// Builds the reply that refuses a request; in packet dialects it repeats the request's header
    /// with the error flag set.
    fn refuse(
        &self,
        head: Head,
        wants_reply: bool,
        own: Option<&ErrorFile>,
        detail: &str,
    ) -> Vec<u8> {
        let (Some(errors), Some(own)) = (&self.errors, own.filter(|_| wants_reply)) else {
            return Vec::new();
        };
        match (&self.framing, &errors.line) {
            (Framing::Scpi(ends) | Framing::Line(ends), Some(template)) => {
                let printable = |c: char| if c.is_control() { ' ' } else { c };
                let detail: String = detail.chars().map(printable).take(200).collect();
                let filled = template.fill(|name| {
                    Ok::<_, Unfit>(match name {
                        "number" => own.number.to_string().into_bytes(),
                        "detail" => detail.trim().as_bytes().to_vec(),
                        _ => own.text.clone().into_bytes(),
                    })
                });
                let line = filled.unwrap_or_default();
                [line.trim_ascii(), ends.to_host.as_bytes()].concat()
            }
            (Framing::Packet(layout), _) => {
                let mut data = Vec::new();
                if let Some(kind) = errors.number {
                    let number = Field {
                        kind,
                        range: kind.range(),
                        big: layout.big,
                        ..Field::int("number")
                    };
                    // The check of the dialect file ensures that its error numbers fit.
                    let _ = number.to_packet(&Value::Number(own.number.into()), &mut data);
                }
                let flags = layout.flags(head.read, true, true);
                let head = (flags, head.sequence, head.code);
                layout
                    .seal(Direction::ToHost, head, &data)
                    .unwrap_or_default()
            }
            _ => Vec::new(),
        }
    }
}
