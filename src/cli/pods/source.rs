//! Opens a pod's ports and scans with it.

use super::Address;
use crate::cli::{dialect, interrupt::Interruptible};
use phasmid_core::error::Result;
use phasmid_decode::Capture;
use phasmid_host::{Camera, CameraDriver, Progress, ScanOptions, Scanner, SerialPort, open_camera};
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
    control: String,
    scanner: Scanner<Interruptible<Box<dyn Camera>>, SerialPort>,
    options: ScanOptions,
    /// The sequence that was selected before [`Self::show`], which `finish` restores.
    before: Option<String>,
}

impl Source {
    /// Opens the ports.
    ///
    /// # Errors
    /// Returns an error if the device cannot be reached.
    pub(in crate::cli) fn open(address: &Address, timeout: Duration) -> Result<Self> {
        let dialect = dialect::spoken(None, Some(&address.control))?;
        let port = SerialPort::open(&address.control)?;
        let mut scanner = Scanner::with_dialect(port, dialect, timeout, || {
            let camera = open_camera(&address.camera, CameraDriver::Auto, timeout)?;
            Ok(Interruptible::new(camera))
        })
        .map_err(|e| e.at(&address.name))?;
        if let Some((place, rig)) = &address.calibration {
            scanner = scanner.with_calibration(place.clone(), *rig);
        }
        Ok(Self {
            name: address.name.clone(),
            control: address.control.clone(),
            scanner,
            options: ScanOptions {
                sequence: None,
                manifest: None,
                frame_timeout: timeout,
            },
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
        self.options.sequence = Some(sequence.to_owned());
        Ok(())
    }

    /// Captures one scan.
    ///
    /// # Errors
    /// Returns an error as [`Scanner::scan`] does.
    pub(in crate::cli) fn scan(&mut self) -> Result<Taken> {
        let mut arrived = Instant::now();
        let captured = self.scanner.scan(&self.options, &mut |progress| {
            if let Progress::Frame { .. } = progress {
                arrived = Instant::now();
            }
        });
        let captured =
            captured.map_err(|e| dialect::name_stepped_clock(e, &self.control).at(&self.name))?;
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
            Some(name) => self.scanner.select(name),
            None => Ok(()),
        };
        selected
            .and(self.scanner.finish())
            .map_err(|e| e.at(&self.name))
    }
}
