//! Opens a pod's ports and scans with it.

use super::Address;
use crate::cli::{
    decode::name_calibration,
    interrupt::{flow, watch_signals},
};
use crate::{ScanOptions, Scanner};
use phasmid_core::error::Result;
use phasmid_decode::Capture;
use phasmid_host::Progress;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// A scan of one pod.
pub(in crate::cli) struct Taken {
    pub(in crate::cli) captured: Capture,
    pub(in crate::cli) identified: bool,
    /// When the last frame arrived.
    pub(in crate::cli) arrived: Instant,
}

/// A pod whose ports are open.
pub(in crate::cli) struct Source {
    name: String,
    scanner: Scanner,
    /// Where its calibration came from, if it is not the device's own.
    calibration: Option<PathBuf>,
    /// The sequence that was selected before [`Self::show`], which `finish` restores.
    before: Option<String>,
}

impl Source {
    /// Opens the ports.
    ///
    /// # Errors
    /// Returns an error if the device cannot be reached.
    pub(in crate::cli) fn open(address: &Address, timeout: Duration) -> Result<Self> {
        let options = ScanOptions {
            calibration: address.calibration.as_ref().map(|(_, rig)| *rig),
            reply_timeout: timeout,
            frame_timeout: timeout,
            ..ScanOptions::default()
        };
        watch_signals();
        let scanner = Scanner::connect(&address.camera, &address.control, options);
        Ok(Self {
            scanner: scanner.map_err(|e| e.at(&address.name))?,
            name: address.name.clone(),
            calibration: address.calibration.as_ref().map(|(place, _)| place.into()),
            before: None,
        })
    }

    /// Returns captures without checking them, see [`Scanner::without_checks`].
    pub(in crate::cli) fn without_checks(self) -> Self {
        Self {
            scanner: self.scanner.without_checks(),
            ..self
        }
    }

    /// Selects a sequence for the following scans, until [`Self::finish`] restores the previous one.
    ///
    /// # Errors
    /// Returns an error if the port is lost.
    pub(in crate::cli) fn show(&mut self, sequence: &str) -> Result<()> {
        self.before = self.scanner.selected().map_err(|e| e.at(&self.name))?;
        self.scanner.select(sequence);
        Ok(())
    }

    /// Captures one scan.
    ///
    /// # Errors
    /// Returns an error as [`Scanner::scan`] does.
    pub(in crate::cli) fn scan(&mut self) -> Result<Taken> {
        let mut arrived = Instant::now();
        let captured = self.scanner.scan_with(|progress| {
            if let Progress::Frame { .. } = progress {
                arrived = Instant::now();
            }
            flow()
        });
        let captured = captured
            .map_err(|e| name_calibration(e, self.calibration.as_deref()).at(&self.name))?;
        Ok(Taken {
            identified: self.scanner.identifies(),
            captured,
            arrived,
        })
    }

    /// Restores the state that the device had before.
    ///
    /// # Errors
    /// Returns an error if the port is lost.
    pub(in crate::cli) fn finish(mut self) -> Result<()> {
        let selected = match &self.before {
            Some(name) => self.scanner.restore(name),
            None => Ok(()),
        };
        selected
            .and(self.scanner.finish())
            .map_err(|e| e.at(&self.name))
    }
}
