//! The paper's experiments on the paper's rig, with the paper's figures beside ours.
//!
//! Wu et al. scan a square frustum, the trapezoid, at five distances and a torso from three sides in a
//! game engine, and convert phases to heights with one formula. Here the emulated bench scans the same
//! objects, decoded both by triangulation and by their formula ([`phasmid_calibrate::height`]). The
//! formula's fringe frequency f0 is either held at its value at 1000 mm or measured anew. `formula`
//! states in closed form the error that holding f0 causes.

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

use figures::Figures;
use phasmid_core::error::Result;
use phasmid_report::lab::{Block, Folder, Rows, Section, Settings, Study, Trial};

/// The study.
pub struct Paper;

/// Columns of this study, besides the columns of [`Figures`].
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

/// All columns: this study's, then those of the figures.
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
        "The experiments of Wu et al. on their rig, with their results and ours."
    }

    fn title(&self) -> &'static str {
        "The paper's experiments"
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

    fn sections(&self, rows: &Rows, folder: &Folder, settings: &Settings) -> Result<Vec<Section>> {
        Ok(vec![
            bench_section(settings),
            pictures::section(),
            distances::section(rows),
            parts::section(rows),
            views::section(rows),
            light::section(rows),
            grey::section(rows, folder)?,
            calibration::section(rows),
            trends(),
        ])
    }
}

/// Describes the bench and our own choices.
fn bench_section(settings: &Settings) -> Section {
    let mut blocks = vec![Block::Words(BENCH.to_owned())];
    if settings.quick {
        blocks.push(Block::Words(QUICK.to_owned()));
    }
    Section::new("The bench", blocks)
}

const BENCH: &str = "Wu et al., \"Virtual 3D surface imaging system for the validation of tumor \
    tracking algorithm used in surface-guided radiotherapy\", scan in a game engine. Here their \
    bench is the profile pmp-bench: a camera of 1138 x 489 pixels with a 20 mm lens and a sensor \
    36 mm wide, a projector of 1920 x 1080 pixels, a baseline of 400 mm, 12 phase steps with a \
    period of 16 px (0.172 line pairs per mm at 1000 mm), a Gray code, 8 bits, and the shot and \
    read noise of an industrial camera. Camera (f/16) and projector (5 mm of aperture) are focused \
    at 1000 mm. Errors are those with the true rig unless stated otherwise; the truth is exact, by \
    ray casting in f64.";

const QUICK: &str = "In the quick form, the camera's image is cropped to the object, with the same \
    pixels, and the calibration has fewer poses.";

/// Summarises the sections.
fn trends() -> Section {
    Section {
        title: "Where the trends agree".to_owned(),
        blocks: [AGREE, NOT]
            .map(|words| Block::Words(words.to_owned()))
            .into(),
    }
}

const AGREE: &str = "They agree in these points: errors grow on both sides of 1000 mm if f0 is \
    held; they increase from centre to rim to foot; left and right are alike; light that drowns \
    the fringes causes errors of millimetres; reprojection errors are hundredths of a pixel.";

const NOT: &str = "They differ in these points. Size: where no constant is wrong, our errors are \
    some twenty to ninety times smaller, because only the camera's noise over twelve frames \
    remains, and neither a formula nor the spacing of points adds to it. Distances below 1000 mm: \
    the paper's errors are smaller than the formula's. Cross-section: its error should be larger \
    than that of the whole. View from the feet: here it is hardly worse than the others. The \
    projector's light: it costs us coverage, not accuracy. HD: a single wrong pixel determines it.";
