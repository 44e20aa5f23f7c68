//! `device.json`: identity and addresses of a served device.

use super::service::ClockPace;
use phasmid_core::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Name of the file in the run directory.
pub const FILE_NAME: &str = "device.json";
/// Maximum file size in bytes; it contains about a dozen paths.
const MOST_BYTES: u64 = 1 << 20;

/// The endpoints of one device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Endpoints {
    /// `*IDN?` of the device.
    pub name: String,
    /// Id of the process that serves the device.
    pub pid: u32,
    /// Profile as selected; absent if a recording does not name it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<String>,
    /// Scene as selected; absent if a recording does not name it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene: Option<String>,
    /// Noise seed; absent if a recording does not name it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Time mode of the device, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clock: Option<ClockPace>,
    /// Render time of the latest frames over the interval of their exposures, if device time is real
    /// time and this has been 1.5 or more: 3.8 means that frames are rendered 3.8 times slower than in
    /// real time. The server replaces the value when it changes by more than a factor of 1.5; below 1
    /// the device keeps up again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slowdown: Option<f64>,
    /// Path of the control port.
    pub control: PathBuf,
    /// Dialect of the control port, if known: a built-in name or the path of a dialect file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dialect: Option<String>,
    /// Bit rate of the control port; absent if transmission takes no time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baud: Option<u32>,
    /// Control port over USB, if the device is attached to this machine's kernel: `/dev/ttyACMN`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub control_usb: Option<PathBuf>,
    /// Address of the camera: `/dev/videoN`, `usb:HOST:PORT/BUSID` or `socket:PATH`.
    pub camera: String,
    /// Address of the frame socket, which exists in addition to any other camera: `socket:PATH`.
    pub camera_socket: String,
    /// Address of the camera over TCP, if requested: `tcp:127.0.0.1:PORT`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_tcp: Option<String>,
    /// Address of the device over USB/IP, if it is a USB device: `usb:HOST:PORT/BUSID`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub usb: Option<String>,
    /// Socket of the service channel, which no physical device has; empty for a recording.
    #[serde(default, skip_serializing_if = "is_empty")]
    pub service: PathBuf,
}

fn is_empty(path: &Path) -> bool {
    path.as_os_str().is_empty()
}

impl Endpoints {
    /// Reads `device.json` in a run directory.
    ///
    /// # Errors
    /// Returns an error if the file is missing, unreadable or not a `device.json`.
    pub fn read(run_dir: &Path) -> Result<Self> {
        let path = run_dir.join(FILE_NAME);
        let bytes = phasmid_core::file::read(&path, MOST_BYTES)?;
        Self::parse(
            &String::from_utf8_lossy(&bytes),
            &path.display().to_string(),
        )
    }

    /// Parses the text of a `device.json`; `place` names it in errors.
    ///
    /// # Errors
    /// Returns an error if the text is not a valid `device.json`.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        serde_json::from_str(text)
            .map_err(|e| Error::input(place, e, "the device.json of a served device"))
    }
}
