//! `work-precision`: error against run time.
//!
//! Five questions. What do the knobs of four devices trade, and which setting is the cheapest for a wanted
//! accuracy (`devices`)? What do steps, resolution and samples a pixel buy in a scan with noise
//! (`scans`)? How far are frames from those of the reference path, which knows no shortcut and
//! computes in f64, and what does each way of filtering cost (`frames`)? What is each term of image
//! formation worth, and what does it cost (`terms`)? How far is interpolated geometry of moving scenes from
//! traced geometry, and what does it save (`motion`)?

mod closed;
mod devices;
mod document;
mod frames;
mod held;
mod motion;
mod needs;
mod phase;
mod rig;
mod row;
mod scans;
mod terms;

pub use needs::{CHECKS, checks, need};

use phasmid_core::error::Result;
use phasmid_report::lab::{Folder, Rows, Section, Settings, Study, Trial};

/// The study.
pub struct WorkPrecision;

impl Study for WorkPrecision {
    fn name(&self) -> &'static str {
        "work-precision"
    }

    fn about(&self) -> &'static str {
        "Error against run time: steps, resolution, samples, filtering, arithmetic, every term"
    }

    fn title(&self) -> &'static str {
        "Error against run time"
    }

    fn columns(&self) -> &'static [&'static str] {
        row::COLUMNS
    }

    fn parts(&self) -> &'static [&'static str] {
        &["device", "scan", "frames", "term", "motion"]
    }

    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>> {
        let mut trials = devices::trials(settings);
        trials.extend(scans::trials(settings));
        trials.extend(frames::trials(settings));
        trials.extend(terms::trials(settings));
        trials.extend(motion::trials(settings));
        Ok(trials)
    }

    fn sections(&self, rows: &Rows, _: &Folder, settings: &Settings) -> Result<Vec<Section>> {
        let mut sections = Vec::new();
        if rows.with("group", "device").next().is_some() {
            sections.push(devices::section(rows));
        }
        sections.extend(document::sections(rows, settings));
        if rows.with("group", "motion").next().is_some() {
            sections.push(motion::section(rows));
        }
        Ok(sections)
    }
}
