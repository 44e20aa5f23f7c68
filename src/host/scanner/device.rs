//! What a scan asks of the device before it captures: who it is, which sequence, what it projects,
//! how it is calibrated.

use super::{ScanOptions, Scanner};
use crate::error::{Error, Result};
use crate::geometry::Rig;
use crate::host::{Camera, CommandPort};
use crate::pattern::Manifest;
use crate::protocol::scpi::{Param, parse, quote};

impl<C: Camera, P: CommandPort> Scanner<C, P> {
    pub(super) fn identify(&mut self) -> Result<String> {
        let idn = self.instrument.query("*IDN?")?;
        if idn.split(',').count() < 4 {
            return Err(Error::device(format!(
                "{}: *IDN? was answered with {idn:?}, want manufacturer,model,serial,version",
                self.instrument.info()
            )));
        }
        Ok(idn)
    }

    pub(super) fn select(&mut self, name: &str) -> Result<()> {
        let refused = match self.instrument.order(&format!("SEQ:SEL {}", quote(name))) {
            Ok(()) => return Ok(()),
            Err(error) => error,
        };
        // A name that the device does not have is the user's mistake; anything else is between
        // host and device, and so is a device that does not list its sequences.
        let Ok(list) = self.instrument.query("SEQ:LIST?") else {
            return Err(refused);
        };
        let names: Vec<String> = parse(format!("LIST {list}").as_bytes())
            .units
            .into_iter()
            .flat_map(|unit| unit.params)
            .filter_map(|param| match param {
                Param::Text(name) => Some(name),
                _ => None,
            })
            .collect();
        if names.is_empty() || names.iter().any(|known| known == name) {
            return Err(refused);
        }
        Err(Error::input(
            format!("--sequence {name}"),
            "no sequence of the device",
            names.join(", "),
        ))
    }

    fn text(&mut self, query: &str) -> Result<Option<String>> {
        let place = format!("{}: {query}", self.instrument.info());
        match self.instrument.query_block(query)? {
            None => Ok(None),
            Some(bytes) => String::from_utf8(bytes)
                .map(Some)
                .map_err(|_| Error::device(format!("{place}: the answer is not UTF-8"))),
        }
    }

    pub(super) fn manifest(&mut self, options: &ScanOptions) -> Result<Manifest> {
        if let Some(manifest) = &options.manifest {
            return Ok(manifest.clone());
        }
        let place = format!("{}: SEQ:DATA?", self.instrument.info());
        match self.text("SEQ:DATA?")? {
            // A device that speaks nonsense is no mistake of the user's.
            Some(toml) => Manifest::parse(&toml, &place).map_err(Error::device),
            None => Err(Error::input(
                "--manifest",
                "none, and the device does not say what it projects",
                "the manifest of the sequence that is selected",
            )),
        }
    }

    pub(super) fn calibration(&mut self) -> Result<Option<Rig>> {
        let place = format!("{}: CAL:DATA?", self.instrument.info());
        self.text("CAL:DATA?")?
            .map(|toml| Rig::from_toml(&toml, &place).map_err(Error::device))
            .transpose()
    }
}

/// Refuses a calibration of another image size than the device's own has.
pub(super) fn check_size(place: &str, given: &Rig, own: &Rig) -> Result<()> {
    let size = |rig: &Rig| {
        let lens = &rig.camera.lens;
        format!("{} x {}", lens.width_px, lens.height_px)
    };
    if size(given) == size(own) {
        return Ok(());
    }
    Err(Error::input(
        format!("{place}: camera.lens.width_px/height_px"),
        size(given),
        format!("the size of the device's frames, {}", size(own)),
    ))
}
