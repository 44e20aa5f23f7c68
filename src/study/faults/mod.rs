//! Tests the host with every fault: does it recover, report the fault, give a harmless cloud, or give a
//! wrong cloud? The last outcome must not occur.
//!
//! Each trial is a complete scan: an application opens port and camera of a device in memory, selects a
//! sequence, reads manifest and calibration, captures, decodes and triangulates. Its points are compared
//! with the points of a fault-free scan with the same random numbers. The devices are built-in profiles
//! with only the middle of the camera's image, in front of a plane, a sphere and a torso. In the default
//! table each link has one device and one scene; `--each` has all devices and all scenes.
//!
//! A cloud is harmless if at most one point in a hundred is missing and at most one in a thousand is
//! more than five of its stated standard deviations off. A cloud is recovered if it equals the
//! fault-free cloud, or if it is harmless after a repeated run. All other clouds are wrong.
//!
//! A cell counts scans by outcome. `phasmid faults matrix` recomputes the tables, and a test compares
//! them.
//!
#![doc = include_str!("matrix.md")]

mod bad_day;
mod matrix;
mod settings;
mod trial;

pub use bad_day::{BadDay, Place};
pub use matrix::{Cell, Row, Table};
pub use settings::{frames, messages};
pub use trial::{Difference, Outcome, Setting, Trial, Tried};

use phasmid_core::error::Result;

/// Returns all tables; `each` tests every frame and message instead of some. `step` receives progress
/// messages.
///
/// # Errors
/// Returns an error if a device cannot be scanned without faults.
pub fn tables(each: bool, step: &(dyn Fn(&str) + Sync)) -> Result<Vec<Table>> {
    let places = Place::all(each);
    let (by_link, by_dialect) = (frames(each)?, messages()?);
    Ok(vec![
        Table::fill(
            "Faults of frames",
            &by_link,
            &BadDay::of_frames(),
            places,
            step,
        )?,
        Table::fill(
            "Faults of the port",
            &by_dialect,
            &BadDay::of_messages(),
            places,
            step,
        )?,
    ])
}

/// Formats tables as Markdown.
pub fn markdown(tables: &[Table]) -> String {
    let texts: Vec<_> = tables.iter().map(Table::to_markdown).collect();
    texts.join("\n")
}
