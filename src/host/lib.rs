//! Host side of the scanner: connects to any device that provides a camera and a command port, and
//! runs scans. Devices are addressed by path, socket or host, never by type: the host treats
//! whatever it opens as a device. The system's monotonic clock is read for two purposes only: to
//! end waits in time, and to distinguish frames taken before the trigger from later ones. The crate
//! depends on `phasmid-core`, `phasmid-geometry`, `phasmid-pattern`, `phasmid-protocol`,
//! `phasmid-v4l2` (feature `v4l2`) and `phasmid-decode`, but not on the simulated device or the
//! renderer. Radiotherapy applications that use this crate are in `phasmid-sgrt`.
//!
//! | module | contents |
//! | --- | --- |
//! | `camera` | cameras by address: V4L2 devices, webcams, frame sockets, memory |
//! | `control` | a device's control port, in SCPI or in a dialect from a file |
//! | `instrument` | SCPI instrument behind a command port |
//! | `plug` | finds the nodes of a USB device again after it was unplugged |
//! | `port` | command ports: serial ports and memory |
//! | `record` | recording of the traffic between host and device |
//! | `scanner` | runs a sequence and captures its frames |
//! | `sockets` | Unix domain sockets where the system has them, TCP connections and their token |
//! | `time` | the system's monotonic clock, bounded waits and retries |
//! | [`usb`] | USB devices over USB/IP, without a kernel driver |

mod camera;
mod control;
mod instrument;
mod plug;
mod port;
mod record;
mod scanner;
mod sockets;
mod time;

pub mod usb;

#[cfg(all(target_os = "linux", feature = "v4l2"))]
pub use camera::explain_device;
pub use camera::{Camera, CameraDriver, Intake, MemoryCamera, SocketCamera, open_camera};
pub use instrument::Instrument;
pub use port::{CommandPort, MemoryPort, SerialPort};
pub use record::{RecordedCamera, RecordedPort, Tape};
pub use scanner::{Flow, Progress, ScanOptions, Scanner, scan_free_running};
pub use time::monotonic_ns;
