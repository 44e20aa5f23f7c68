//! One pod: its ports on one side, its place in the room on the other.

use crate::cli::{dialect, interrupt::Interruptible};
use crate::decode::{Decoded, Decoder, Options};
use crate::error::{Error, Result};
use crate::geometry::Pose;
use crate::host::track::Measured;
use crate::host::{
    Camera, Capture, Captured, Progress, ScanOptions, Scanner, SerialPort,
    check_identified_sequence, check_sequence, open_camera,
};
use crate::profile::{RigPlace, Station, StationDevice};
use crate::protocol::Endpoints;
use glam::DVec3;
use std::path::Path;
use std::time::{Duration, Instant};

/// Where a pod is reached, and where it stands.
pub(super) struct Address {
    name: String,
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
}

/// What a pod has scanned.
pub(super) struct Taken {
    captured: Captured,
    identified: bool,
    /// Device time of the last frame's end in nanoseconds.
    pub(super) end_ns: u64,
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
        let last = captured.frames.last();
        Ok(Taken {
            end_ns: last.map_or(0, |frame| frame.exposure_end_ns),
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

/// The side of a pod that looks at frames.
pub(super) struct Sight {
    name: String,
    room_from_rig: Pose,
    /// Of the sequence and calibration of the first scan.
    decoder: Option<Decoder>,
    decoded: Decoded,
    points: Vec<[f32; 3]>,
}

impl Sight {
    pub(super) fn new(address: &Address) -> Self {
        Self {
            name: address.name.clone(),
            room_from_rig: address.room_from_rig,
            decoder: None,
            decoded: Decoded::default(),
            points: Vec::new(),
        }
    }

    /// Decodes what was scanned and adds at most so many of its points. Frames that do not follow
    /// their sequence add none; what is wrong with them is given.
    ///
    /// # Errors
    /// Frames that cannot be decoded, and a device without a calibration.
    pub(super) fn measure(
        &mut self,
        taken: &Taken,
        measured: &mut Measured,
        most: usize,
    ) -> Result<Option<String>> {
        let captured = &taken.captured;
        if captured.calibration.is_none() {
            return Err(Error::device(format!(
                "{}: the device has no calibration to give",
                self.name
            )));
        }
        let check = match taken.identified {
            true => check_identified_sequence,
            false => check_sequence,
        };
        let (checked, depths) = rayon::join(
            || check(&captured.manifest, &captured.frames),
            || self.depths(captured),
        );
        depths?;
        if let Err(why) = checked {
            return Ok(Some(format!("{}: {why}", self.name)));
        }
        if let Some(decoder) = &self.decoder {
            decoder.points_into(&self.decoded, &mut self.points);
        }
        let depths = self.decoded.depth.iter().zip(&self.decoded.depth_sigma);
        let known = depths.filter(|(depth, _)| !depth.is_nan());
        let sigma: Vec<f32> = known.map(|(_, sigma)| *sigma).collect();
        measured.push_pod(&self.points, &sigma, &self.room_from_rig, most);
        Ok(None)
    }

    fn depths(&mut self, captured: &Captured) -> Result<()> {
        let decoder = match &self.decoder {
            Some(decoder) => decoder,
            None => self.decoder.insert(captured.decode(Options::default())?.0),
        };
        captured.with_stack(|stack| decoder.decode_into(stack, &mut self.decoded))
    }
}
