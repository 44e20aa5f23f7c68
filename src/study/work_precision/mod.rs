//! Study `work-precision`: error versus run time.
//!
//! Five parts: the knobs of four devices, and the fastest setting for a wanted accuracy (`devices`);
//! steps, resolution and samples per pixel in scans with noise (`scans`); frames of each filter
//! compared with the reference path, which has no shortcuts and computes in f64 (`frames`); benefit and
//! cost of each term of image formation (`terms`); and error and time of interpolated instead of traced
//! geometry in moving scenes (`motion`).

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
