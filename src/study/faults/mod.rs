//! Every fault against the host: does it recover, does it say what is wrong, or does it go on with a
//! wrong cloud? The last may not be.
//!
//! Each scan is a whole one: an application opens port and camera of a device in memory, selects a
//! sequence, reads manifest and calibration, captures, decodes and triangulates; its points are held
//! against the truth. The device is the middle of a built-in profile's camera. A right cloud has at
//! most as many points more than 1 mm off as sound scans have, and nearly as many points.

mod bad_day;
mod desk;
mod matrix;
mod settings;
mod trial;

pub use bad_day::{BadDay, Place};
pub use desk::{Desk, DeskCamera, DeskPort, Link};
pub use matrix::{Cell, Row, Table};
pub use settings::{frames, messages};
pub use trial::{Cloud, Outcome, Setting, Trial, Tried};

use crate::error::Result;

/// All tables; `step` is told what is being tried.
///
/// # Errors
/// A device that cannot be scanned when all is well.
pub fn tables(step: &(dyn Fn(&str) + Sync)) -> Result<Vec<Table>> {
    let (by_link, by_dialect) = (frames()?, messages()?);
    Ok(vec![
        Table::fill("Faults of frames", &by_link, &BadDay::of_frames(), step)?,
        Table::fill(
            "Faults of the port",
            &by_dialect,
            &BadDay::of_messages(),
            step,
        )?,
    ])
}

/// Tables as Markdown.
pub fn markdown(tables: &[Table]) -> String {
    let texts: Vec<_> = tables.iter().map(Table::to_markdown).collect();
    texts.join("\n")
}
