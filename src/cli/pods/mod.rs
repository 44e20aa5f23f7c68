//! The pods of a station as options name them: where each is reached, where it stands, and what
//! calibrates it.

mod address;
mod source;

pub(super) use address::Address;
pub(super) use source::{Source, Taken};

use phasmid_calibrate::files::read_rig;
use phasmid_core::error::{Error, Result};
use phasmid_profile::{Configuration, Station, StationDevice};
use std::path::PathBuf;
use std::time::Duration;

/// Longest timeout in seconds.
const MAX_TIMEOUT_S: f64 = 3600.0;

/// Options of commands that reach all pods of a station.
#[derive(Debug, clap::Args)]
pub(super) struct PodArgs {
    /// Run directory of a served station: each of its devices in a folder of its name.
    #[arg(
        long,
        value_name = "DIR",
        required_unless_present = "device",
        conflicts_with = "device"
    )]
    run_dir: Option<PathBuf>,
    /// A pod by its ports: its name in the station, its camera and its control port. Once for each.
    #[arg(long, value_name = "NAME=CAMERA,CONTROL")]
    device: Vec<String>,
    /// Where the pods stand in the room: a station's name or file.
    #[arg(long, value_name = "STATION", default_value = "sgrt-ceiling")]
    station: String,
    /// Calibration of a pod in place of its own: its name in the station and any file that `phasmid scan
    /// --calibration` takes. Once for each.
    #[arg(long, value_name = "NAME=FILE")]
    calibration: Vec<String>,
    /// Seconds to wait for a reply or a frame.
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    timeout: f64,
}

impl PodArgs {
    /// How long to wait.
    ///
    /// # Errors
    /// A number that is no time to wait.
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

    /// The station.
    ///
    /// # Errors
    /// A file that cannot be read, and one of a device alone.
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

    /// All pods of a served station, or those that are named.
    ///
    /// # Errors
    /// Folders without a device, words of another form, pods that the station does not have, one that
    /// is named twice, ports that are named twice, and calibrations that cannot be read.
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

/// Refuses a pod that is named a second time.
fn once(option: &str, mut names: Vec<String>) -> Result<()> {
    names.sort();
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(Error::input(
            option,
            format!("{:?} a second time", pair[0]),
            "each pod once",
        )),
        None => Ok(()),
    }
}
