//! One pod: its ports on one side, its place in the room on the other.

use crate::cli::{dialect, interrupt::Interruptible};
use crate::error::{Error, Result};
use crate::geometry::Pose;
use crate::host::track::Sight;
use crate::host::{
    Camera, Capture, Captured, Progress, ScanOptions, Scanner, SerialPort, open_camera,
};
use crate::profile::{RigPlace, Station, StationDevice};
use crate::protocol::Endpoints;
use glam::DVec3;
use std::path::Path;
use std::time::{Duration, Instant};

/// Where a pod is reached, and where it stands.
pub(super) struct Address {
    pub(super) name: String,
    camera: String,
    control: String,
    room_from_rig: Pose,
}

impl Address {
    /// Of a device that is served, by its `device.json`.
    ///
    /// # Errors
    /// A folder without a device.
    pub(super) fn of_run_dir(device: &StationDevice, folder: &Path) -> Result<Self> {
        let endpoints = Endpoints::read(folder)?;
        let control = endpoints.control.display().to_string();
        Ok(Self::new(device, endpoints.camera, control))
    }

    /// Of a device by its ports, `NAME=CAMERA,CONTROL`.
    ///
    /// # Errors
    /// Words of another form, and a name that the station does not have.
    pub(super) fn of_ports(text: &str, station: &Station) -> Result<Self> {
        let place = || format!("--pod {text}");
        let parts = text.split_once('=').and_then(|(name, ports)| {
            let (camera, control) = ports.split_once(',')?;
            Some((name, camera, control))
        });
        let Some((name, camera, control)) = parts else {
            return Err(Error::input(place(), "no pod", "NAME=CAMERA,CONTROL"));
        };
        let Some(device) = station.device.iter().find(|device| device.name == name) else {
            let names: Vec<&str> = station.device.iter().map(|d| d.name.as_str()).collect();
            return Err(Error::input(
                place(),
                format!("{name:?}, which {} does not have", station.name),
                names.join(", "),
            ));
        };
        Ok(Self::new(device, camera.to_owned(), control.to_owned()))
    }

    fn new(device: &StationDevice, camera: String, control: String) -> Self {
        let RigPlace {
            position_mm,
            rotation_deg,
        } = device.rig().unwrap_or_default();
        Self {
            name: device.name.clone(),
            camera,
            control,
            room_from_rig: Pose::from_xyz_deg(
                DVec3::from_array(position_mm),
                DVec3::from_array(rotation_deg),
            ),
        }
    }

    /// What looks at its frames.
    pub(super) fn sight(&self) -> Sight {
        Sight::new(&self.name, self.room_from_rig)
    }
}

/// What a pod has scanned.
pub(super) struct Taken {
    pub(super) captured: Captured,
    pub(super) identified: bool,
    /// When the last frame had come.
    pub(super) arrived: Instant,
}

/// The side of a pod that is at its ports.
pub(super) struct Source {
    name: String,
    scanner: Scanner<Interruptible<Box<dyn Camera>>, SerialPort>,
    options: ScanOptions,
}

impl Source {
    /// Opens the ports.
    ///
    /// # Errors
    /// A device that cannot be reached.
    pub(super) fn open(address: &Address, timeout: Duration) -> Result<Self> {
        let dialect = dialect::spoken(None, Some(&address.control))?;
        let port = SerialPort::open(&address.control)?;
        let scanner = Scanner::with_dialect(port, dialect, timeout, || {
            let camera = open_camera(&address.camera, Capture::Auto, timeout)?;
            Ok(Interruptible::new(camera))
        })?;
        Ok(Self {
            name: address.name.clone(),
            scanner: scanner.without_checks(),
            options: ScanOptions {
                sequence: None,
                manifest: None,
                frame_timeout: timeout,
            },
        })
    }

    /// Scans.
    ///
    /// # Errors
    /// See [`Scanner::scan`].
    pub(super) fn scan(&mut self) -> Result<Taken> {
        let mut arrived = Instant::now();
        let captured = self.scanner.scan(&self.options, &mut |progress| {
            if let Progress::Frame { .. } = progress {
                arrived = Instant::now();
            }
        });
        let captured = captured.map_err(|e| e.at(&self.name))?;
        Ok(Taken {
            identified: self.scanner.identifies(),
            captured,
            arrived,
        })
    }

    /// Leaves the device as it was found.
    ///
    /// # Errors
    /// A port that has gone.
    pub(super) fn finish(self) -> Result<()> {
        self.scanner.finish()
    }
}
