//! Every fault against the host: does it recover, does it say what is wrong, is the damage harmless, or does it
//! go on with a wrong cloud? The last may not be.
//!
//! Each scan is a whole one: an application opens port and camera of a device in memory, selects a
//! sequence, reads manifest and calibration, captures, decodes and triangulates; its points are held
//! against those of a scan without faults and with the same random numbers. The devices are the middles of
//! two built-in profiles' cameras, before a plane, a sphere and a torso. In the ordinary table each link has
//! one device before one scene; `--each` has all devices before all scenes.
//!
//! A cloud is harmless if at most one point in a hundred is missing and one in a thousand is more than five of
//! its stated standard deviations off; it is recovered if it is the fault-free one, or harmless after a
//! repeated run. Others are wrong.
//!
//! A cell counts scans: what the host made of the fault. `phasmid faults matrix` makes the tables anew,
//! and a test holds it to them.
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

/// All tables; `each` frame and message in turn, or some of them. `step` is told what is being tried.
///
/// # Errors
/// A device that cannot be scanned when all is well.
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

/// Tables as Markdown.
pub fn markdown(tables: &[Table]) -> String {
    let texts: Vec<_> = tables.iter().map(Table::to_markdown).collect();
    texts.join("\n")
}
