//! The serial function of a configuration, located by its class codes (CDC 1.2, 5.2; PSTN 1.2,
//! 5.3).

use super::topology::{Configuration, TransferKind};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::usb::descriptor::class;

/// Subclass of the abstract control model.
const ABSTRACT_CONTROL: u8 = 2;
/// Subtype of the union descriptor, which groups the interfaces of a function.
const UNION: u8 = 6;

/// A serial port, as described by its descriptors.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SerialFunction {
    /// Number of the control interface.
    pub control: u8,
    /// Address of the notification endpoint.
    pub notifications: Option<u8>,
    /// Address of the endpoint for data from the device.
    pub input: u8,
    /// Address of the endpoint for data to the device.
    pub output: u8,
}

impl SerialFunction {
    /// Finds the first serial port.
    ///
    /// # Errors
    /// Returns an error if there is none, or if its descriptors are invalid.
    pub fn find(configuration: &Configuration) -> Result<Self> {
        Self::first(configuration).map_err(Error::device)
    }

    fn first(configuration: &Configuration) -> Result<Self, String> {
        let control = configuration
            .interfaces
            .iter()
            .find(|i| i.class[..2] == [class::COMMUNICATIONS, ABSTRACT_CONTROL])
            .ok_or("the device has no serial port (no CDC-ACM interface)")?;
        let union = control.extra.iter().find(|d| d[2] == UNION && d.len() >= 5);
        let number = union.ok_or("the serial port names no data interface")?[4];
        let (input, output) = configuration
            .settings(number)
            .filter(|i| i.class[0] == class::CDC_DATA && i.setting == 0)
            .find_map(|i| {
                let input = i.endpoint(TransferKind::Bulk, true)?;
                let output = i.endpoint(TransferKind::Bulk, false)?;
                Some((input.address, output.address))
            })
            .ok_or_else(|| format!("the serial port's data interface {number} has no endpoints"))?;
        let notifications = control.endpoint(TransferKind::Interrupt, true);
        Ok(Self {
            control: control.number,
            notifications: notifications.map(|e| e.address),
            input,
            output,
        })
    }
}
