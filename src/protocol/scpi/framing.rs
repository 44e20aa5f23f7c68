//! Splits a byte stream into program messages. A newline ends a message, with or without a carriage
//! return, except inside a block. After any error the stream resynchronises at the next newline.

use super::block::{self, Prefix};
use super::error::{DeviceError, ErrorCode};

/// Maximum number of bytes of a message outside its blocks.
pub const MAX_LINE_BYTES: usize = 64 << 10;
/// Maximum number of bytes of a message including its blocks, which may hold pattern images.
pub const MAX_BLOCK_BYTES: usize = 64 << 20;

/// Output of the stream splitter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Framing {
    /// A message without its newline.
    Message(Vec<u8>),
    /// A discarded message, with the reason.
    Dropped(DeviceError),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mode {
    Plain,
    Quoted(u8),
    /// Inside the prefix of a block, which starts at this offset of the buffer.
    BlockPrefix(usize),
    /// Inside a block that has this many bytes of content left.
    Block(usize),
    /// Discards the rest of the line; holds the error to report.
    Skip(ErrorCode),
}

/// State of one byte stream. Its memory grows with the bytes received, up to [`MAX_BLOCK_BYTES`].
#[derive(Debug, Clone)]
pub struct Framer {
    buffer: Vec<u8>,
    /// Number of bytes of `buffer` that are block content.
    block_bytes: usize,
    /// Position in `buffer` after its last block. A carriage return before this position is content.
    block_end: usize,
    mode: Mode,
}

impl Default for Framer {
    fn default() -> Self {
        Self {
            buffer: Vec::new(),
            block_bytes: 0,
            block_end: 0,
            mode: Mode::Plain,
        }
    }
}

impl Framer {
    /// Processes received bytes and passes each complete message to `take`.
    pub fn push(&mut self, mut bytes: &[u8], take: &mut dyn FnMut(Framing)) {
        while let [byte, rest @ ..] = bytes {
            if let Mode::Block(left) = self.mode {
                let now = left.min(bytes.len());
                self.buffer.extend_from_slice(&bytes[..now]);
                self.block_bytes += now;
                self.block_end = self.buffer.len();
                self.mode = if now == left {
                    Mode::Plain
                } else {
                    Mode::Block(left - now)
                };
                bytes = &bytes[now..];
            } else {
                if let Some(framing) = self.step(*byte) {
                    take(framing);
                }
                bytes = rest;
            }
        }
    }

    /// Returns whether the stream is inside a block, where newlines do not resynchronise it.
    pub fn inside_block(&self) -> bool {
        matches!(self.mode, Mode::Block(_))
    }

    /// Discards a partial message.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    fn step(&mut self, byte: u8) -> Option<Framing> {
        if byte == b'\n' {
            return self.end();
        }
        if matches!(self.mode, Mode::Skip(_)) {
            return None;
        }
        if self.buffer.len() - self.block_bytes >= MAX_LINE_BYTES {
            self.skip(ErrorCode::InputBufferOverrun);
            return None;
        }
        self.buffer.push(byte);
        match self.mode {
            Mode::Plain => match byte {
                b'"' | b'\'' => self.mode = Mode::Quoted(byte),
                b'#' => self.mode = Mode::BlockPrefix(self.buffer.len() - 1),
                _ => {}
            },
            // A doubled quote ends the string and begins it again, which has the same effect as
            // staying inside it.
            Mode::Quoted(quote) if byte == quote => self.mode = Mode::Plain,
            Mode::BlockPrefix(start) => match block::header(&self.buffer[start..]) {
                Prefix::Incomplete => {}
                // Other uses of `#`, such as `#H1F`, are left to the parser.
                Prefix::Invalid => self.mode = Mode::Plain,
                Prefix::Block { len, .. } => {
                    if self.block_bytes + len > MAX_BLOCK_BYTES {
                        self.skip(ErrorCode::TooMuchData);
                    } else {
                        self.mode = if len == 0 {
                            Mode::Plain
                        } else {
                            Mode::Block(len)
                        };
                    }
                }
            },
            _ => {}
        }
        None
    }

    fn skip(&mut self, code: ErrorCode) {
        self.reset();
        self.mode = Mode::Skip(code);
    }

    fn end(&mut self) -> Option<Framing> {
        let Self {
            mut buffer,
            block_end,
            mode,
            ..
        } = std::mem::take(self);
        if let Mode::Skip(code) = mode {
            let limit = match code {
                ErrorCode::TooMuchData => format!("up to {MAX_BLOCK_BYTES} bytes of blocks"),
                _ => format!("up to {MAX_LINE_BYTES} bytes in a line"),
            };
            return Some(Framing::Dropped(code.with(limit)));
        }
        if buffer.len() > block_end && buffer.last() == Some(&b'\r') {
            buffer.pop();
        }
        let blank = buffer.iter().all(u8::is_ascii_whitespace);
        (!blank).then_some(Framing::Message(buffer))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn frame(chunks: &[&[u8]]) -> Vec<Framing> {
        let (mut framer, mut out) = (Framer::default(), Vec::new());
        for chunk in chunks {
            framer.push(chunk, &mut |f| out.push(f));
        }
        out
    }

    fn message(text: &[u8]) -> Framing {
        Framing::Message(text.to_vec())
    }

    #[test]
    fn lines_end_at_newlines_of_either_kind() {
        assert_eq!(
            frame(&[b"*IDN?\r\n\n \r\nA;B", b" 1\n", b"rest"]),
            [message(b"*IDN?"), message(b"A;B 1")]
        );
    }

    #[test]
    fn blocks_hold_newlines_and_strings_hold_hashes() {
        assert_eq!(
            frame(&[b"D 'a#15',#1", b"4x\n\n;,\"#9\"\n"]),
            [message(b"D 'a#15',#14x\n\n;,\"#9\"")]
        );
        assert_eq!(frame(&[b"D #11\r\n"]), [message(b"D #11\r")]);
        assert_eq!(frame(&[b"D #11\r\r\n"]), [message(b"D #11\r")]);
        assert_eq!(
            frame(&[b"A #H1F\nB #10\n"]),
            [message(b"A #H1F"), message(b"B #10")]
        );
    }

    #[test]
    fn too_long_is_dropped_and_the_next_line_is_read() {
        let mut bytes = vec![b'a'; MAX_LINE_BYTES + 100];
        bytes.extend_from_slice(b"\nD #9999999999abc\n*IDN?\n");
        let out = frame(&[&bytes]);
        let [Framing::Dropped(long), Framing::Dropped(block), last] = &out[..] else {
            panic!("{out:?}")
        };
        assert_eq!(long.code, ErrorCode::InputBufferOverrun);
        assert_eq!(block.code, ErrorCode::TooMuchData);
        assert_eq!(*last, message(b"*IDN?"));
    }

    proptest! {
        #[test]
        fn messages_do_not_depend_on_how_input_is_split(
            bytes in proptest::collection::vec(
                prop_oneof![any::<u8>(), Just(b'\n'), Just(b'#'), Just(b'1'), Just(b'"')], 0..200),
            cuts in proptest::collection::vec(0usize..200, 0..6),
        ) {
            let whole = frame(&[&bytes]);
            let mut cuts: Vec<_> = cuts.into_iter().map(|c| c.min(bytes.len())).collect();
            cuts.push(0);
            cuts.push(bytes.len());
            cuts.sort_unstable();
            let parts: Vec<_> = cuts.windows(2).map(|w| &bytes[w[0]..w[1]]).collect();
            prop_assert_eq!(frame(&parts), whole);
        }

        #[test]
        fn a_block_of_any_bytes_comes_through(content in proptest::collection::vec(any::<u8>(), 0..300)) {
            let mut bytes = b"A:B \"x\",".to_vec();
            bytes.extend(super::super::encode_block(&content));
            let expected = bytes.clone();
            bytes.extend_from_slice(b"\nC\n");
            prop_assert_eq!(frame(&[&bytes]), vec![message(&expected), message(b"C")]);
        }
    }
}
