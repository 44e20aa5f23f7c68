//! Parts of a validated dialect.

use super::field::{Field, Kind};
use super::file::ErrorFile;
use super::packet::Layout;
use super::template::Template;
use super::uses::Chunk;
use crate::scpi::DeviceError;
use std::sync::Arc;

/// Message framing.
#[derive(Debug, Clone)]
pub(super) enum Framing {
    /// IEEE 488.2: the device's native framing.
    Scpi(Arc<LineEnds>),
    Line(Arc<LineEnds>),
    Packet(Arc<Layout>),
}

/// Line ends and other line settings.
#[derive(Debug, Clone)]
pub(super) struct LineEnds {
    pub(super) to_device: String,
    pub(super) to_host: String,
    /// Prefix of a comment, which is ignored.
    pub(super) comment: Option<String>,
    pub(super) any_case: bool,
    /// Maximum line length, excluding the line end.
    pub(super) max: usize,
}

impl LineEnds {
    /// Strips the comment and surrounding spaces from a line.
    pub(super) fn content<'a>(&self, line: &'a [u8]) -> &'a [u8] {
        let end = self.comment.as_ref().and_then(|comment| {
            let comment = comment.as_bytes();
            line.windows(comment.len()).position(|part| part == comment)
        });
        line[..end.unwrap_or(line.len())].trim_ascii()
    }
}

/// A command.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Command {
    pub(super) name: String,
    /// Template of the line; empty in packet dialects.
    pub(super) line: Template,
    /// Command code in packet dialects.
    pub(super) code: u32,
    /// Whether the packet's read flag is set.
    pub(super) read: bool,
    pub(super) args: Vec<Field>,
    /// Messages to send to the firmware.
    pub(super) runs: Vec<Template>,
    /// Templates of the values in the firmware's answers, one per message.
    pub(super) answers: Vec<Option<Template>>,
    /// Values of the reply.
    pub(super) values: Vec<Field>,
    /// Lines of the reply; the last line ends the reply.
    pub(super) reply: Vec<Template>,
    pub(super) chunk: Option<Chunk>,
    /// Bytes per chunk of a long answer.
    pub(super) chunk_bytes: usize,
}

impl Command {
    pub(super) fn value(&self, name: &str) -> Option<&Field> {
        self.values.iter().find(|field| field.name == name)
    }

    pub(super) fn arg(&self, name: &str) -> Option<&Field> {
        self.args.iter().find(|field| field.name == name)
    }
}

/// Error replies of a device.
#[derive(Debug, Clone)]
pub(super) struct Errors {
    /// Template of the error line; `None` in packet dialects.
    pub(super) line: Option<Template>,
    /// Encoding of the error number in a packet's data.
    pub(super) number: Option<Kind>,
    pub(super) default: ErrorFile,
    pub(super) busy: ErrorFile,
    pub(super) map: Vec<(Vec<i16>, ErrorFile)>,
}

impl Errors {
    /// Maps a firmware error to an error of the dialect: by number if the dialect lists it, else by
    /// class (-200 for -222), else the default.
    pub(super) fn of(&self, error: &DeviceError) -> &ErrorFile {
        let number = error.code.number();
        [number, number / 100 * 100]
            .into_iter()
            .find_map(|number| {
                let mut map = self.map.iter();
                map.find(|(scpi, _)| scpi.contains(&number))
            })
            .map_or(&self.default, |(_, error)| error)
    }

    /// Returns the text of an error number.
    pub(super) fn text(&self, number: i64) -> &str {
        let all = self.map.iter().map(|(_, error)| error);
        all.chain([&self.busy, &self.default])
            .find(|error| i64::from(error.number) == number)
            .map_or("", |error| &error.text)
    }
}
