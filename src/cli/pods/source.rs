//! The side of a pod that is at its ports.

use super::Address;
use crate::cli::{dialect, interrupt::Interruptible};
use phasmid_core::error::Result;
use phasmid_host::{
    Camera, Capture, Captured, Progress, ScanOptions, Scanner, SerialPort, open_camera,
};
use std::time::{Duration, Instant};

/// What a pod has scanned.
pub(in crate::cli) struct Taken {
    pub(in crate::cli) captured: Captured,
    pub(in crate::cli) identified: bool,
    /// When the last frame had come.
    pub(in crate::cli) arrived: Instant,
}

/// A pod whose ports are open.
pub(in crate::cli) struct Source {
    name: String,
    scanner: Scanner<Interruptible<Box<dyn Camera>>, SerialPort>,
    options: ScanOptions,
    /// The sequence that was selected before another was.
    before: Option<String>,
}

impl Source {
    /// Opens the ports.
    ///
    /// # Errors
    /// A device that cannot be reached.
    pub(in crate::cli) fn open(address: &Address, timeout: Duration) -> Result<Self> {
        let dialect = dialect::spoken(None, Some(&address.control))?;
        let port = SerialPort::open(&address.control)?;
        let mut scanner = Scanner::with_dialect(port, dialect, timeout, || {
            let camera = open_camera(&address.camera, Capture::Auto, timeout)?;
            Ok(Interruptible::new(camera))
        })
        .map_err(|e| e.at(&address.name))?;
        if let Some((place, rig)) = &address.calibration {
            scanner = scanner.with_calibration(place.clone(), *rig);
        }
        Ok(Self {
            name: address.name.clone(),
            scanner,
            options: ScanOptions {
                sequence: None,
                manifest: None,
                frame_timeout: timeout,
            },
            before: None,
        })
    }

    /// Hands frames out as they came, see [`Scanner::without_checks`].
    pub(in crate::cli) fn without_checks(self) -> Self {
        Self {
            scanner: self.scanner.without_checks(),
            ..self
        }
    }

    /// Shows another sequence than the selected one until it is let go.
    ///
    /// # Errors
    /// A port that has gone.
    pub(in crate::cli) fn show(&mut self, sequence: &str) -> Result<()> {
        self.before = self.scanner.selected().map_err(|e| e.at(&self.name))?;
        self.options.sequence = Some(sequence.to_owned());
        Ok(())
    }

    /// Scans.
    ///
    /// # Errors
    /// See [`Scanner::scan`].
    pub(in crate::cli) fn scan(&mut self) -> Result<Taken> {
        let mut arrived = Instant::now();
        let captured = self.scanner.scan(&self.options, &mut |progress| {
            if let Progress::Frame { .. } = progress {
                arrived = Instant::now();
            }
        });
        let captured = captured.map_err(|e| e.at(&self.name))?;
        Ok(Taken {
            identified: self.scanner.identifies(),
            captured,
            arrived,
        })
    }

    /// Leaves the device as it was found.
    ///
    /// # Errors
    /// A port that has gone.
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
