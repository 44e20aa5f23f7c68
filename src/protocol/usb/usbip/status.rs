//! Transfer status: negated Linux error numbers.

/// Success.
pub const OK: i32 = 0;
/// EPIPE: the endpoint is halted, or the request is unsupported.
pub const STALL: i32 = -32;
/// ECONNRESET: cancelled before it completed.
pub const UNLINKED: i32 = -104;
/// EOVERFLOW: more bytes than the host has room for.
pub const OVERFLOW: i32 = -75;
