#![doc = include_str!("requests.md")]

mod about;
mod maps;
mod parse;
mod reply;
mod request;

pub use about::{
    Clock, ClockPace, DeviceAbout, FaultsAbout, FrameAbout, Late, MAX_STRUCK, ObjectAbout, Objects,
    PatientAbout, PlaceAbout, Rendering, SequenceAbout, Shown, StandingFault, TermAbout,
};
pub use maps::{Maps, ask, call};
pub use parse::InvalidRequest;
pub use reply::Reply;
pub use request::{Action, Every, Item, Placement, Request, Step, TermChoice, Which};

/// Maximum request line length in bytes.
pub const MAX_LINE: usize = 4096;
/// Maximum reply line length in bytes.
pub const MAX_REPLY_LINE: usize = 4 << 20;
/// Maximum payload size in bytes.
pub const MAX_PAYLOAD: u64 = 4 << 30;
/// Maximum number of maps in a reply.
const MAX_MAPS: usize = 64;
