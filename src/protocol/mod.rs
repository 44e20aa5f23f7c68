//! What both halves speak: commands, replies, device errors, and every wire format.

mod frame;

pub use frame::{Frame, PixelFormat};
