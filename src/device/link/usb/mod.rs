//! Serves the device as one USB device over USB/IP from user space: a UVC camera and a CDC-ACM port
//! that standard drivers treat as hardware.
//!
//! | file | content |
//! | --- | --- |
//! | `session` | the device as a state machine: commands and frames in, replies and events out |
//! | `function` | requests on the control endpoint |
//! | `descriptors` | the USB descriptors |
//! | `video`, `serial` | the endpoints of camera and serial port; injected faults of frames |
//! | `outgoing`, `events` | queues to the host and to the firmware |
//! | `connection`, `server` | a session over a socket; the USB/IP listener |
//! | `export` | serves devices over USB/IP, attached to the local kernel if wanted |
//! | `attach`, `vhci` | attachment to the local kernel |
//! | `device` | the shared handle; exclusive use by a host |
//! | `binding` | the connection between firmware and USB device |

mod attach;
mod binding;
mod connection;
mod descriptors;
mod device;
mod events;
pub(super) mod export;
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
pub use export::export;
pub use server::UsbServer;
pub use vhci::{Nodes, Port};
pub use video::Fault;

use phasmid_protocol::usb::cdc::{HostLines, LineCoding};
use phasmid_protocol::usb::uvc::Negotiation;

/// Camera state reported by the firmware.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraState {
    /// Exposure in nanoseconds.
    pub exposure_ns: u64,
    /// Gain in decibels.
    pub gain_db: f64,
    /// Maximum exposure in nanoseconds that can be set now; longer exposures are clamped to this
    /// maximum. `None` while no exposure can be set, for example during a sequence.
    pub settable_ns: Option<u64>,
}

/// Ranges of the camera's settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraLimits {
    /// Minimum and maximum exposure in nanoseconds.
    pub exposure_ns: (u64, u64),
    /// Exposure at power-on in nanoseconds.
    pub default_exposure_ns: u64,
    /// Maximum gain in decibels.
    pub max_gain_db: f64,
}

/// An action of the host that concerns the firmware.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// A host has attached the device.
    Attached,
    /// The host has detached the device.
    Detached,
    /// The host sets the exposure, in nanoseconds.
    Exposure(u64),
    /// The host sets the gain, in decibels.
    Gain(f64),
    /// The host has committed the format and interval of the next stream.
    Committed(Negotiation),
    /// The host has started to read frames.
    Started,
    /// The host has stopped reading frames.
    Stopped,
    /// The host has sent these bytes to the serial port.
    Received(Vec<u8>),
    /// The serial lines that the host drives (DTR, RTS) have changed.
    Lines(HostLines),
    /// The host has set the line coding.
    LineCoding(LineCoding),
    /// A break begins (`true`) or ends (`false`).
    Break(bool),
}
