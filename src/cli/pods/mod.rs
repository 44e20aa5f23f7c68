//! Options that select the pods of a station: the ports, poses and calibrations.

mod address;
mod source;

pub(super) use address::Address;
pub(super) use source::Source;

use phasmid_calibrate::files::read_rig;
use phasmid_core::error::{Error, Result};
use phasmid_profile::{Configuration, Station, StationDevice};
use std::path::PathBuf;
use std::time::Duration;

/// Maximum timeout in seconds.
const MAX_TIMEOUT_S: f64 = 3600.0;

/// Options of commands that reach all pods of a station.
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
                "a station, which says where its devices stand",
            )),
        }
    }

    /// Returns all pods of a served station, or the named ones.
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
                    format!("{} and {} by the same port", first.name, address.name),
                    "ports of its own for each pod",
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
