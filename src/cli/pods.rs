//! Options that select the pods of a station (ports, poses and calibrations), and scans with these pods.

use super::interrupt::{flow, watch_signals};
use crate::{Pod, ScanOptions, Scanner};
use glam::DVec3;
use phasmid_calibrate::files::read_rig;
use phasmid_core::error::{Error, Result};
use phasmid_decode::Capture;
use phasmid_geometry::{Pose, Rig};
use phasmid_profile::{Configuration, RigPlace, Station, StationDevice};
use phasmid_protocol::Endpoints;
use phasmid_protocol::record::Observer;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Maximum timeout in seconds.
const MAX_TIMEOUT_S: f64 = 3600.0;

/// Options of commands that connect to all pods of a station.
#[derive(Debug, clap::Args)]
pub(super) struct PodArgs {
    /// Run directory of a served station, with a folder for each device.
    #[arg(
        long,
        value_name = "DIR",
        required_unless_present = "device",
        conflicts_with = "device"
    )]
    run_dir: Option<PathBuf>,
    /// Pod by its ports: its name in the station, its camera and its control port. Repeat for each pod.
    #[arg(long, value_name = "NAME=CAMERA,CONTROL")]
    device: Vec<String>,
    /// Station with the poses of the pods in the room: a built-in name or a TOML file.
    #[arg(long, value_name = "STATION", default_value = "sgrt-ceiling")]
    station: String,
    /// Calibration to use instead of the one a pod reports: the pod's name in the station, and a file
    /// that `phasmid scan --calibration` accepts. Repeat for each pod.
    #[arg(long, value_name = "NAME=FILE")]
    calibration: Vec<String>,
    /// Seconds to wait for a reply or a frame, 0.001 to 3600.
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    timeout: f64,
}

impl PodArgs {
    /// Returns the timeout for a reply or a frame.
    ///
    /// # Errors
    /// Returns an error if the number is out of range.
    pub(super) fn timeout(&self) -> Result<Duration> {
        match (0.001..=MAX_TIMEOUT_S).contains(&self.timeout) {
            true => Ok(Duration::from_secs_f64(self.timeout)),
            false => Err(Error::input(
                "--timeout",
                self.timeout,
                format!("0.001 to {MAX_TIMEOUT_S}"),
            )),
        }
    }

    /// Loads the station.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, or describes a single device.
    pub(super) fn station(&self) -> Result<Station> {
        match Configuration::load(&self.station).map_err(|e| e.at("--station"))? {
            Configuration::Station(station) => Ok(station),
            Configuration::Device(_) => Err(Error::input(
                format!("--station {}", self.station),
                "a device",
                "a station, which states the poses of its devices",
            )),
        }
    }

    /// Returns the addresses of all pods of a served station, or of the pods that the options name.
    ///
    /// # Errors
    /// Returns an error if a folder has no device, an option is malformed, a pod is not in the
    /// station, a pod or a port is named twice, or a calibration cannot be read.
    pub(super) fn addresses(&self, station: &Station) -> Result<Vec<Address>> {
        let mut addresses = match &self.run_dir {
            Some(folder) => {
                let of = |device: &StationDevice| {
                    Address::of_run_dir(device, &folder.join(&device.name))
                };
                station.device.iter().map(of).collect::<Result<Vec<_>>>()?
            }
            None => {
                let of = |text: &String| Address::of_ports(text, station);
                self.device.iter().map(of).collect::<Result<Vec<_>>>()?
            }
        };
        let names = addresses.iter().map(|address| address.name.clone());
        once("--device", names.collect())?;
        for (i, address) in addresses.iter().enumerate() {
            if let Some(first) = addresses[..i].iter().find(|first| first.shares(address)) {
                return Err(Error::input(
                    "--device",
                    format!("{} and {} use the same port", first.name, address.name),
                    "separate ports for each pod",
                ));
            }
        }
        let mut calibrated = Vec::new();
        for text in &self.calibration {
            let place = || format!("--calibration {text}");
            let Some((name, file)) = text.split_once('=').filter(|(_, file)| !file.is_empty())
            else {
                return Err(Error::input(place(), "no calibration", "NAME=FILE"));
            };
            let mut all = addresses.iter_mut();
            let Some(address) = all.find(|address| address.name == name) else {
                let names: Vec<&str> = addresses.iter().map(|a| a.name.as_str()).collect();
                return Err(Error::input(place(), format!("{name:?}"), names.join(", ")));
            };
            let rig = read_rig(file.as_ref()).map_err(|e| e.at(place()))?;
            address.calibration = Some((place(), rig));
            calibrated.push(name.to_owned());
        }
        once("--calibration", calibrated)?;
        Ok(addresses)
    }
}

/// Rejects a pod that is named twice.
fn once(option: &str, mut names: Vec<String>) -> Result<()> {
    names.sort();
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(Error::input(
            option,
            format!("{:?} twice", pair[0]),
            "each pod once",
        )),
        None => Ok(()),
    }
}

/// The addresses of a pod, its name and its pose.
pub(super) struct Address {
    /// Name of the pod in the station.
    pub(super) name: String,
    camera: String,
    pub(super) control: String,
    /// Calibration that replaces the device's own, and the option that gave it.
    calibration: Option<(String, Rig)>,
    /// Pose of the pod's rig in the room, according to the station file.
    pub(super) place: RigPlace,
}

impl Address {
    /// Reads the ports of a served device from its `device.json`.
    ///
    /// # Errors
    /// Returns an error if the folder has no device.
    fn of_run_dir(device: &StationDevice, folder: &Path) -> Result<Self> {
        let endpoints = Endpoints::read(folder).map_err(|e| e.at("--run-dir"))?;
        let control = endpoints.control.display().to_string();
        Ok(Self::new(device, endpoints.camera, control))
    }

    /// Parses the ports of a device, `NAME=CAMERA,CONTROL`.
    ///
    /// # Errors
    /// Returns an error if the text is malformed, or the station has no device with this name.
    fn of_ports(text: &str, station: &Station) -> Result<Self> {
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

    /// Returns whether two pods use the same camera or the same control port.
    fn shares(&self, other: &Self) -> bool {
        self.camera == other.camera || self.control == other.control
    }

    /// Opens the ports, and shows their traffic to an observer if there is one. From then on, a
    /// signal such as Ctrl-C ends captures instead of the program.
    ///
    /// # Errors
    /// Returns an error if the device cannot be reached.
    fn connect(&self, timeout: Duration, observer: Option<Observer>) -> Result<Scanner> {
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

    /// Opens the ports of a pod for tracking.
    ///
    /// # Errors
    /// Returns an error if the device cannot be reached.
    pub(super) fn pod(&self, timeout: Duration, observer: Option<Observer>) -> Result<Pod> {
        Ok(Pod::new(
            &self.name,
            self.connect(timeout, observer)?,
            self.place,
        ))
    }

    /// Returns the pose that maps coordinates in the pod's rig frame to the room frame, in
    /// millimetres, according to the station file.
    pub(super) fn room_from_rig(&self) -> Pose {
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

/// A pod whose ports are open.
pub(super) struct Source {
    name: String,
    scanner: Scanner,
    /// The sequence that was selected before [`Self::show`]; [`Self::finish`] restores it.
    before: Option<String>,
}

impl Source {
    /// Opens the ports.
    ///
    /// # Errors
    /// Returns an error if the device cannot be reached.
    pub(super) fn open(address: &Address, timeout: Duration) -> Result<Self> {
        Ok(Self {
            scanner: address.connect(timeout, None)?,
            name: address.name.clone(),
            before: None,
        })
    }

    /// Selects a sequence for the following scans, until [`Self::finish`] restores the previous
    /// sequence.
    ///
    /// # Errors
    /// Returns an error if the port is lost.
    pub(super) fn show(&mut self, sequence: &str) -> Result<()> {
        self.before = self.scanner.selected().map_err(|e| e.at(&self.name))?;
        self.scanner.select(sequence);
        Ok(())
    }

    /// Captures one scan.
    ///
    /// # Errors
    /// Returns an error as [`Scanner::scan`] does.
    pub(super) fn scan(&mut self) -> Result<Capture> {
        let captured = self.scanner.scan_with(|_| flow());
        captured.map_err(|e| e.at(&self.name))
    }

    /// Restores the sequence and trigger source that the device had before, and closes its ports.
    ///
    /// # Errors
    /// Returns an error if the port is lost.
    pub(super) fn finish(mut self) -> Result<()> {
        let selected = match &self.before {
            Some(name) => self.scanner.restore(name),
            None => Ok(()),
        };
        selected
            .and(self.scanner.finish())
            .map_err(|e| e.at(&self.name))
    }
}
