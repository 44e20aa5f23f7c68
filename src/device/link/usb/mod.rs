//! The device as one USB device, served over USB/IP from user space: a UVC camera and a CDC-ACM
//! port that stock drivers take for hardware.
//!
//! `session::Session` is the device as a state machine: commands and frames in, replies and
//! events out. `connection` carries it over a socket, `server` listens, `attach` hands a
//! socket to this machine's own kernel.

mod attach;
mod attached;
mod binding;
mod connection;
mod descriptors;
mod device;
mod events;
mod fault;
mod function;
mod outgoing;
mod serial;
mod server;
mod session;
mod vhci;
mod video;

pub use attach::{Attachment, attach};
pub use binding::Binding;
pub(super) use binding::PortEvent;
pub use device::UsbDevice;
pub use fault::Fault;
pub use server::UsbServer;
pub use vhci::{Nodes, Port};

use phasmid_protocol::usb::cdc::{HostLines, LineCoding};
use phasmid_protocol::usb::uvc::Negotiation;

/// What the firmware says of its camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraState {
    /// Exposure in nanoseconds.
    pub exposure_ns: u64,
    /// Gain in decibels.
    pub gain_db: f64,
    /// Longest exposure in nanoseconds that would be taken now, to which a longer one is held;
    /// `None` while nothing can be set, as in the middle of a sequence.
    pub settable_ns: Option<u64>,
}

/// What the camera can be set to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraLimits {
    /// Shortest and longest exposure in nanoseconds.
    pub exposure_ns: (u64, u64),
    /// Exposure at power-on.
    pub default_exposure_ns: u64,
    /// Largest gain in decibels.
    pub max_gain_db: f64,
}

/// What a host did that the firmware has to know.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// A host has the device.
    Attached,
    /// No host has it any more.
    Detached,
    /// The camera is to expose for so long, in nanoseconds.
    Exposure(u64),
    /// The camera is to amplify by so much, in decibels.
    Gain(f64),
    /// Format and interval of the stream that comes next.
    Committed(Negotiation),
    /// The host reads frames.
    Started,
    /// The host reads frames no longer.
    Stopped,
    /// Bytes from the serial port.
    Received(Vec<u8>),
    /// The host's lines of the serial port have changed.
    Lines(HostLines),
    /// How the serial line is driven.
    LineCoding(LineCoding),
    /// A break begins or ends.
    Break(bool),
}
