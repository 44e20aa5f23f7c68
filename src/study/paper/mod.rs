//! The paper's experiments on the paper's rig, with the paper's figures beside ours.
//!
//! Wu et al. scan a square frustum, the trapezoid, at five distances and a torso from three sides in
//! a game engine, and turn phases into heights with one formula. Here the same is scanned by the
//! emulated bench, and decoded both ways: by triangulation and by their formula
//! ([`phasmid_calibrate::height`]), whose fringe frequency f0 is held at what it is at 1000 mm or
//! measured anew. `formula` says in closed form what holding it does.

mod bench;
mod calibration;
mod distances;
mod figures;
mod formula;
mod grey;
mod light;
mod parts;
mod pictures;
mod published;
mod scan;
mod views;
mod words;

use figures::Figures;
use phasmid_core::error::Result;
use phasmid_report::lab::{Document, Folder, Rows, Settings, Study, Trial};

/// The study.
pub struct Paper;

/// Columns beside those of [`Figures`].
const COLUMNS: [&str; 23] = [
    "distance_mm",
    "method",
    "case",
    "light",
    "ambient_w_m2",
    "saturated",
    "f0_per_mm",
    "closed_mm",
    "closed_off_mm",
    "grey_dn",
    "modulation_dn",
    "poses",
    "camera_px",
    "projector_px",
    "dots_px",
    "mahalanobis_squared",
    "bound_99",
    "camera_focal_px",
    "camera_focal_error_px",
    "projector_focal_px",
    "projector_focal_error_px",
    "baseline_error_mm",
    "warnings",
];

/// All columns: the others', then those of the figures.
const ALL_COLUMNS: [&str; COLUMNS.len() + Figures::COLUMNS.len()] = {
    let mut all = [""; COLUMNS.len() + Figures::COLUMNS.len()];
    let mut i = 0;
    while i < all.len() {
        all[i] = if i < COLUMNS.len() {
            COLUMNS[i]
        } else {
            Figures::COLUMNS[i - COLUMNS.len()]
        };
        i += 1;
    }
    all
};

impl Study for Paper {
    fn name(&self) -> &'static str {
        "paper"
    }

    fn about(&self) -> &'static str {
        "The paper's experiments on the paper's rig, with the paper's figures beside ours."
    }

    fn columns(&self) -> &'static [&'static str] {
        &ALL_COLUMNS
    }

    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>> {
        let mut all = pictures::trials(settings);
        all.extend(distances::trials(settings));
        all.extend(parts::trials(settings));
        all.extend(views::trials(settings));
        all.extend(light::trials(settings));
        all.extend(grey::trials(settings));
        all.extend(calibration::trials(settings));
        Ok(all)
    }

    fn document(&self, rows: &Rows, folder: &Folder, settings: &Settings) -> Result<Document> {
        Ok(Document {
            title: "The paper's experiments".to_owned(),
            sections: vec![
                words::section(settings),
                pictures::section(),
                distances::section(rows),
                parts::section(rows),
                views::section(rows),
                light::section(rows),
                grey::section(rows, folder)?,
                calibration::section(rows),
                words::trends(),
            ],
        })
    }
}
