//! Properties of every dialect: requests and answers arrive unchanged at the other side.

mod damage;
mod files;
mod guide;
mod round_trip;
mod shipped;
mod words;

use super::{Cut, Dialect, Direction};
use std::sync::LazyLock;

/// The shipped dialects, and two dialects of packets with checksums.
static DIALECTS: LazyLock<Vec<Dialect>> = LazyLock::new(|| {
    let shipped = Dialect::names().map(|name| Dialect::load(name).unwrap());
    shipped
        .chain(["sum8", "crc16-ccitt"].map(checked))
        .collect()
});

/// Returns a dialect of variable-length packets with start bytes and a checksum.
fn checked(checksum: &str) -> Dialect {
    let text = format!(
        r#"
name = "checked"
description = "packets that differ in length"
framing = "packet"
[packet]
max_bytes = 48
start = [0xAA, 0x55]
flags = {{ at = 2, read = 0, error = 7 }}
sequence = {{ at = 3 }}
length = {{ at = 4, bytes = 2, from = 6 }}
code = {{ at = 6, bytes = 1 }}
data_at = 7
endian = "big"
checksum = "{checksum}"
[errors]
number = "i16"
default = {{ number = -1, text = "failed" }}
busy = {{ number = -2, text = "busy" }}
[[command]]
name = "set"
code = 1
args = [
    {{ name = "a", type = "u16", unit = "ms" }},
    {{ name = "b", type = "i32" }},
    {{ name = "word", type = "text", bytes = 4, choices = {{ on = "1", off = "0" }} }},
    {{ name = "name", type = "text" }},
]
runs = ["CAM:EXP {{a}}", "SEQ:SEL {{name}};:PROJ:POW {{word}}"]
[[command]]
name = "get"
code = 1
read = true
args = [{{ name = "pad", type = "u8", constant = 7 }}]
values = [
    {{ name = "f", type = "f32" }},
    {{ name = "i", type = "i16" }},
    {{ name = "rest", type = "bytes" }},
]
runs = ["CAM:EXP?", "A:B?;C?"]
answers = ["{{f}}", "{{i}};{{rest}}"]
"#
    );
    Dialect::parse(&text, "checked").unwrap()
}

/// Returns all messages of a stream that arrives in pieces of `step` bytes.
fn messages(dialect: &Dialect, direction: Direction, bytes: &[u8], step: usize) -> Vec<Vec<u8>> {
    let mut cutter = dialect.cutter(direction);
    let mut messages = Vec::new();
    for piece in bytes.chunks(step) {
        cutter.push(piece, &mut |cut| {
            if let Cut::Message(message) = cut {
                messages.push(message);
            }
        });
    }
    messages
}

/// Returns the message of a stream that must hold exactly one.
fn only(dialect: &Dialect, direction: Direction, bytes: &[u8]) -> Vec<u8> {
    let mut messages = messages(dialect, direction, bytes, 7);
    assert_eq!(messages.len(), 1, "{}", bytes.escape_ascii());
    messages.remove(0)
}
