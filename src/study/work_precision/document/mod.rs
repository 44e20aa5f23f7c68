//! The page of the study.

mod cells;
mod frames;
mod scans;
mod terms;

use phasmid_report::lab::{Row, Rows, Section, Settings};

/// Returns all sections.
pub fn sections(rows: &Rows, settings: &Settings) -> Vec<Section> {
    let group = |name| rows.with("group", name).collect::<Vec<&Row>>();
    let [scans, frames, gpu, terms] = ["scan", "frames", "gpu", "term"].map(group);
    let bound_um = bound_um(&scans);
    // Parts that were not run have no rows and no section.
    let mut sections = Vec::new();
    if !scans.is_empty() {
        sections.push(scans::section(&scans, settings));
    }
    if !frames.is_empty() {
        sections.extend(frames::sections(&frames, &gpu, bound_um));
    }
    if !terms.is_empty() {
        sections.push(terms::section(&terms, bound_um));
    }
    sections
}

/// Returns the noise bound of twelve steps at the bench's resolution in micrometres, with which
/// noiseless frames are compared.
fn bound_um(scans: &[&Row]) -> f64 {
    let usual = scans.iter().find(|row| {
        row.value("steps") == 12.0 && row.value("scale") == 1.0 && row.value("samples") == 1.0
    });
    usual.map_or(f64::NAN, |row| row.value("bound_mm") * 1e3)
}
