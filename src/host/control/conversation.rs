//! The common interface of conversations with a device, whatever the framing of its dialect; and a
//! function that repeats a reading until two readings agree.

use phasmid_core::error::{Error, Result};
use phasmid_protocol::dialect::Value;
use std::fmt::Display;

/// Maximum number of attempts at an operation that may fail because data was corrupted in transit.
pub(super) const TRIES: u32 = 3;
/// Maximum number of readings, two of which must agree.
const READINGS: usize = 5;

/// Values of an answer, each with its name in the dialect's file.
pub(super) type Values = Vec<(String, Value)>;

/// A conversation with a device in the commands of its dialect.
pub(super) trait Conversation {
    /// Returns the port's path, for messages.
    fn info(&self) -> &str;

    /// Returns the port and the label of a command, for messages.
    fn place(&self, command: &str) -> String;

    /// Restores contact with a device that was silent, out of step, or gone.
    ///
    /// # Errors
    /// Returns an error if the device does not come back within the timeout.
    fn recover(&mut self) -> Result<()>;

    /// Starts to watch for a restart of the device.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    fn begin(&mut self) -> Result<()>;

    /// Returns whether the device has restarted since [`Self::begin`], as far as the host can tell.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    fn restarted(&mut self) -> Result<bool>;

    /// Performs a command and returns the values of its answer; `None` if the device does not know
    /// the query. The device may execute the command more than once.
    ///
    /// # Errors
    /// Returns an error if the port fails, the device refuses, or the dialect cannot express the
    /// arguments.
    fn ask(&mut self, command: &str, args: &[(&str, Value)]) -> Result<Option<Values>>;

    /// Sends a command once, without waiting for an answer.
    ///
    /// # Errors
    /// Returns an error if the port is gone, or if the dialect cannot express the arguments.
    fn send(&mut self, command: &str, args: &[(&str, Value)]) -> Result<()>;

    /// Discards answers that are still in transit.
    ///
    /// # Errors
    /// Returns an error if the port is gone.
    fn hush(&mut self) -> Result<()>;
}

/// Reads until two readings agree.
///
/// # Errors
/// Returns an error if a reading fails or no two agree.
pub(super) fn agreed<T: PartialEq>(
    place: impl Display,
    mut read: impl FnMut() -> Result<T>,
) -> Result<T> {
    let mut readings = Vec::with_capacity(READINGS);
    while readings.len() < READINGS {
        let reading = read()?;
        if readings.contains(&reading) {
            return Ok(reading);
        }
        readings.push(reading);
    }
    Err(Error::device(format!(
        "{place}: {READINGS} readings, no two of which agree"
    )))
}
