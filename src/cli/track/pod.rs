//! One pod: its ports, its place in the room, its last scan.

use crate::cli::{dialect, interrupt::Interruptible};
use crate::decode::{Decoder, Options};
use crate::error::{Error, Result};
use crate::geometry::Pose;
use crate::host::track::Measured;
use crate::host::{Camera, Capture, Captured, ScanOptions, Scanner, SerialPort, open_camera};
use crate::profile::{RigPlace, Station, StationDevice};
use crate::protocol::Endpoints;
use glam::DVec3;
use std::path::Path;
use std::time::Duration;

/// A pod of a scanner that has several.
pub(super) struct Pod {
    name: String,
    scanner: Scanner<Interruptible<Box<dyn Camera>>, SerialPort>,
    options: ScanOptions,
    room_from_rig: Pose,
    captured: Option<Captured>,
    /// Of the sequence and calibration of the first scan.
    decoder: Option<Decoder>,
}

impl Pod {
    /// A device that is served, by its `device.json`.
    ///
    /// # Errors
    /// A folder without a device, and a device that cannot be reached.
    pub(super) fn of_run_dir(
        device: &StationDevice,
        folder: &Path,
        timeout: Duration,
    ) -> Result<Self> {
        let endpoints = Endpoints::read(folder)?;
        let control = endpoints.control.display().to_string();
        Self::open(device, &endpoints.camera, &control, timeout)
    }

    /// A device by its ports, `NAME=CAMERA,CONTROL`.
    ///
    /// # Errors
    /// Words of another form, a name that the station does not have, and a device that cannot be
    /// reached.
    pub(super) fn of_ports(text: &str, station: &Station, timeout: Duration) -> Result<Self> {
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
        Self::open(device, camera, control, timeout)
    }

    fn open(
        device: &StationDevice,
        camera: &str,
        control: &str,
        timeout: Duration,
    ) -> Result<Self> {
        let RigPlace {
            position_mm,
            rotation_deg,
        } = device.rig().unwrap_or_default();
        let dialect = dialect::spoken(None, Some(control))?;
        let scanner = Scanner::with_dialect(SerialPort::open(control)?, dialect, timeout, || {
            Ok(Interruptible::new(open_camera(
                camera,
                Capture::Auto,
                timeout,
            )?))
        })?;
        Ok(Self {
            name: device.name.clone(),
            scanner,
            options: ScanOptions {
                sequence: None,
                manifest: None,
                frame_timeout: timeout,
            },
            room_from_rig: Pose::from_xyz_deg(
                DVec3::from_array(position_mm),
                DVec3::from_array(rotation_deg),
            ),
            captured: None,
            decoder: None,
        })
    }

    /// Scans, and gives the device time of the last frame's end in nanoseconds.
    ///
    /// # Errors
    /// See [`Scanner::scan`].
    pub(super) fn scan(&mut self) -> Result<u64> {
        let captured = self.scanner.scan(&self.options, &mut |_| {});
        let captured = captured.map_err(|e| e.at(&self.name))?;
        let end_ns = captured
            .frames
            .last()
            .map_or(0, |frame| frame.exposure_end_ns);
        self.captured = Some(captured);
        Ok(end_ns)
    }

    /// Decodes what was scanned and adds at most so many of its points.
    ///
    /// # Errors
    /// Frames that cannot be decoded, and a device without a calibration.
    pub(super) fn measure(&mut self, measured: &mut Measured, most: usize) -> Result<()> {
        let Some(captured) = self.captured.take() else {
            return Ok(());
        };
        if captured.calibration.is_none() {
            return Err(Error::device(format!(
                "{}: the device has no calibration to give",
                self.name
            )));
        }
        let decoder = match self.decoder.take() {
            Some(decoder) => decoder,
            None => captured.decode(Options::default())?.0,
        };
        let decoded = captured.with_stack(|stack| decoder.decode(stack))?;
        let cloud = decoder.cloud(&decoded);
        let depths = decoded.depth.iter().zip(&decoded.depth_sigma);
        let sigma: Vec<f32> = depths
            .filter(|(depth, _)| !depth.is_nan())
            .map(|(_, sigma)| *sigma)
            .collect();
        measured.push_pod(&cloud.points, &sigma, &self.room_from_rig, most);
        self.decoder = Some(decoder);
        Ok(())
    }

    /// Leaves the device as it was found.
    ///
    /// # Errors
    /// A port that has gone.
    pub(super) fn finish(self) -> Result<()> {
        self.scanner.finish()
    }
}
