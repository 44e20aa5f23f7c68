//! Reads manifest and calibration from the device before a scan captures frames.

use super::{ScanOptions, Scanner};
use crate::{Camera, CommandPort};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::Rig;
use phasmid_pattern::Manifest;

impl<C: Camera, P: CommandPort> Scanner<C, P> {
    pub(super) fn manifest(&mut self, options: &ScanOptions) -> Result<Manifest> {
        if let Some(manifest) = &options.manifest {
            return Ok(manifest.clone());
        }
        match self.control.manifest()? {
            // An invalid manifest from the device is not the user's mistake.
            Some((toml, place)) => Manifest::parse(&toml, &place).map_err(Error::device),
            None => Err(Error::input(
                "--manifest",
                "no manifest, and the device does not provide one",
                "the manifest of the selected sequence",
            )),
        }
    }

    pub(super) fn calibration(&mut self) -> Result<Option<Rig>> {
        let calibration = self.control.calibration()?;
        calibration
            .map(|(toml, place)| Rig::from_toml(&toml, &place).map_err(Error::device))
            .transpose()
    }
}

/// Rejects a calibration whose image size differs from that of the device's own calibration.
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
