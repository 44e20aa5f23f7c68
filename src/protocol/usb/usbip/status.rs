//! Status of a transfer: negative error numbers of Linux.

/// Done.
pub const OK: i32 = 0;
/// EPIPE: the endpoint is halted, or the request is not known.
pub const STALL: i32 = -32;
/// ECONNRESET: unlinked before it was done.
pub const UNLINKED: i32 = -104;
/// EOVERFLOW: more bytes than the host has room for.
pub const OVERFLOW: i32 = -75;
