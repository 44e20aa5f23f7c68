//! Fault schedules: the faults that a device injects, and the times at which it does so. The same
//! schedule always gives the same faults.
//!
//! ```toml
//! seed = 7                     # of all random choices; 0 when absent
//!
//! [[fault]]                    # the third frame of a sequence is torn, once
//! what = "torn"
//! when = { nth = 3 }
//!
//! [[fault]]                    # one in fifty replies is 300 ms late in the first minute
//! what = "late-reply"
//! by_ms = 300
//! when = { probability = 0.02, window_s = [0, 60] }
//!
//! [[fault]]                    # the device boots while the second sequence is being exposed
//! what = "reset"
//! on = "camera"
//! when = { command = "*TRG", nth = 40 }
//! times = 1
//! ```
//!
//! Conditions of `when` are evaluated in order, and all must hold: `device`, `frames`, `command`
//! and `window_s` select the frames or messages to count; `nth` and `every` apply to that count;
//! `probability` applies to the remainder; `times` limits the number of occurrences.

mod check;
mod fault;
mod kind;
#[cfg(test)]
mod tests;

pub use fault::{Fault, Frames, Struck, When};
pub use kind::{Direction, Flaw, Kind, Parameter, Side, What};

use phasmid_core::error::Result;
use phasmid_core::source::TomlSource;
use serde::{Deserialize, Serialize};
use std::path::Path;
use toml::Table;

/// Maximum number of faults in a schedule, including those added at run time.
pub const MAX_FAULTS: usize = 1024;

/// A schedule: the file of `phasmid serve --faults`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "schema", schemars(rename = "Schedule"))]
#[serde(deny_unknown_fields, bound(deserialize = "W: Deserialize<'de>"))]
pub struct Schedule<W = What> {
    /// Seed of all random choices.
    #[serde(default)]
    pub seed: u64,
    /// Faults. If two affect the same frame or message, the earlier one acts first.
    #[serde(default)]
    pub fault: Vec<Fault<W>>,
}

impl Default for Schedule {
    fn default() -> Self {
        Self {
            seed: 0,
            fault: Vec::new(),
        }
    }
}

impl Schedule {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or if [`Self::from_source`] fails.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_source(&TomlSource::read(path)?)
    }

    /// Reads and checks a file for devices of the given names.
    ///
    /// # Errors
    /// Returns an error if [`Self::read`] fails or if a fault names a device that is not among
    /// them.
    pub fn read_for(path: &Path, devices: &[&str]) -> Result<Self> {
        let source = TomlSource::read(path)?;
        let schedule = Self::from_source(&source)?;
        check_devices(&schedule, devices, &source)?;
        Ok(schedule)
    }

    /// Reads and checks a document.
    ///
    /// # Errors
    /// Returns an error with its line on a syntax error, an unknown field, a parameter that the
    /// fault does not have, or a value out of range.
    pub fn from_source(source: &TomlSource) -> Result<Self> {
        check_faults(source.deserialize()?, source)
    }
}

fn check_faults(written: Schedule<Table>, source: &TomlSource) -> Result<Schedule> {
    if written.fault.len() > MAX_FAULTS {
        let found = format!("{} faults", written.fault.len());
        return Err(source.violation("fault", found, format!("up to {MAX_FAULTS}")));
    }
    let faults = written.fault.into_iter().enumerate().map(|(i, fault)| {
        let fault = fault.read().and_then(|fault| fault.check().map(|()| fault));
        fault.map_err(|flaw| {
            let field = format!("fault[{i}].{}", flaw.field);
            source.violation(&field, flaw.found, flaw.allowed)
        })
    });
    Ok(Schedule {
        seed: written.seed,
        fault: faults.collect::<Result<_>>()?,
    })
}

/// Rejects faults for unknown devices, which could never occur.
fn check_devices(schedule: &Schedule, names: &[&str], source: &TomlSource) -> Result<()> {
    for (i, fault) in schedule.fault.iter().enumerate() {
        fault.check_device(names).map_err(|flaw| {
            let field = format!("fault[{i}].{}", flaw.field);
            source.violation(&field, flaw.found, flaw.allowed)
        })?;
    }
    Ok(())
}
