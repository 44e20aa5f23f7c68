//! SCPI over a serial line, as defined by IEEE 488.2-1992 and SCPI-1999: program messages,
//! parameters, blocks and device errors. Pure functions and values; the firmware and the host share
//! them.
//!
//! A message is a line. Its units are separated by `;`, a unit is a header and its parameters, and
//! a header without a leading colon continues at the node of the unit before it (SCPI-1999 vol 1,
//! 6.2.4). Blocks (`#<digits><length><bytes>`) are binary and may hold newlines, so the stream is
//! split into messages by [`Framer`], which recognises strings and blocks.

mod block;
mod error;
mod framing;
mod header;
mod param;
mod parse;

pub use block::{
    Prefix as BlockPrefix, encode as encode_block, header as block_header, split as split_block,
};
pub use error::{DeviceError, ErrorCode};
pub use framing::{Framer, Framing, MAX_BLOCK_BYTES, MAX_LINE_BYTES};
pub use header::{HeaderMatch, match_header};
pub use param::{Args, Number, Param, Quantity, keyword_matches, quote};
pub use parse::{Node, Program, Unit, parse};
