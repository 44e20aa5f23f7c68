//! Status of a transfer: negative error numbers of Linux.

/// Done.
pub const OK: i32 = 0;
/// EPIPE: the endpoint is halted, or the request is not known.
pub const STALL: i32 = -32;
/// ECONNRESET: unlinked before it was done.
pub const UNLINKED: i32 = -104;
/// ESHUTDOWN: the device goes.
pub const SHUTDOWN: i32 = -108;
/// EOVERFLOW: more bytes than the host has room for.
pub const OVERFLOW: i32 = -75;
/// ENODEV: no such device.
pub const NO_DEVICE: i32 = -19;
