//! Opens a pod's ports and scans with it.

use super::Address;
use crate::Scanner;
use crate::cli::interrupt::flow;
use phasmid_core::error::Result;
use phasmid_decode::Capture;
use std::time::Duration;

/// A pod whose ports are open.
pub(in crate::cli) struct Source {
    name: String,
    scanner: Scanner,
    /// The sequence that was selected before [`Self::show`], which `finish` restores.
    before: Option<String>,
}

impl Source {
    /// Opens the ports.
    ///
    /// # Errors
    /// Returns an error if the device cannot be reached.
    pub(in crate::cli) fn open(address: &Address, timeout: Duration) -> Result<Self> {
        Ok(Self {
            scanner: address.connect(timeout, None)?,
            name: address.name.clone(),
            before: None,
        })
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
    pub(in crate::cli) fn scan(&mut self) -> Result<Capture> {
        let captured = self.scanner.scan_with(|_| flow());
        captured.map_err(|e| e.at(&self.name))
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
