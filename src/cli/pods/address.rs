//! A pod's ports, and its pose in the room.

use crate::cli::interrupt::watch_signals;
use crate::{Pod, ScanOptions, Scanner};
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Pose, Rig};
use phasmid_profile::{RigPlace, Station, StationDevice};
use phasmid_protocol::Endpoints;
use phasmid_protocol::record::Observer;
use std::path::Path;
use std::time::Duration;

/// A pod.
pub(in crate::cli) struct Address {
    /// Its name in the station.
    pub(in crate::cli) name: String,
    pub(super) camera: String,
    pub(in crate::cli) control: String,
    /// Calibration that replaces the device's own, and the option that gave it.
    pub(super) calibration: Option<(String, Rig)>,
    /// Pose of its rig in the room, according to the station file.
    pub(in crate::cli) place: RigPlace,
}

impl Address {
    /// Reads the ports of a served device from its `device.json`.
    ///
    /// # Errors
    /// Returns an error if the folder has no device.
    pub(super) fn of_run_dir(device: &StationDevice, folder: &Path) -> Result<Self> {
        let endpoints = Endpoints::read(folder).map_err(|e| e.at("--run-dir"))?;
        let control = endpoints.control.display().to_string();
        Ok(Self::new(device, endpoints.camera, control))
    }

    /// Parses the ports of a device, `NAME=CAMERA,CONTROL`.
    ///
    /// # Errors
    /// Returns an error if the text has another form, or the station has no device with this name.
    pub(super) fn of_ports(text: &str, station: &Station) -> Result<Self> {
        let place = || format!("--device {text}");
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

    /// Whether both use the same camera or the same control port.
    pub(super) fn shares(&self, other: &Self) -> bool {
        self.camera == other.camera || self.control == other.control
    }

    /// Opens the ports, and shows their traffic to an observer if there is one. From now on, the signals end captures instead of the program.
    ///
    /// # Errors
    /// Returns an error if the device cannot be reached.
    pub(super) fn connect(&self, timeout: Duration, observer: Option<Observer>) -> Result<Scanner> {
        let options = ScanOptions {
            reply_timeout: timeout,
            frame_timeout: timeout,
            ..ScanOptions::default()
        };
        watch_signals();
        let (camera, control) = (&self.camera, &self.control);
        let scanner = match observer {
            Some(observer) => Scanner::observed(camera, control, options, observer),
            None => Scanner::connect(camera, control, options),
        };
        let scanner = scanner.map_err(|e| e.at(&self.name))?;
        Ok(match &self.calibration {
            Some((place, rig)) => scanner.with_calibration(place, *rig),
            None => scanner,
        })
    }

    /// Opens the ports of a pod that is to track.
    ///
    /// # Errors
    /// Returns an error if the device cannot be reached.
    pub(in crate::cli) fn pod(&self, timeout: Duration, observer: Option<Observer>) -> Result<Pod> {
        Ok(Pod::new(
            &self.name,
            self.connect(timeout, observer)?,
            self.place,
        ))
    }

    /// Returns the pose that maps coordinates in its rig's frame to the room's, in millimetres,
    /// according to the station file.
    pub(in crate::cli) fn room_from_rig(&self) -> Pose {
        Pose::from_xyz_deg(
            DVec3::from_array(self.place.position_mm),
            DVec3::from_array(self.place.rotation_deg),
        )
    }

    fn new(device: &StationDevice, camera: String, control: String) -> Self {
        Self {
            name: device.name.clone(),
            camera,
            control,
            calibration: None,
            place: device.rig().unwrap_or_default(),
        }
    }
}
