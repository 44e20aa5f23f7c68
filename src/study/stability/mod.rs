//! Study `stability`: stiff and extreme cases. Each case has an oracle (an independent reference
//! result), a condition number or ratio of scales, the error found, the error that first-order analysis
//! allows, and, without an answer, the program's message.
//!
//! A sweep is one trial; its cases are the rows. Nearly all cases call the library's functions with
//! numbers in closed form; a few render. A case passes if its error is within the allowed error, or if
//! the program gives a message instead of an answer. It fails with a wrong answer, or with neither an
//! answer nor a message.

mod boards;
mod case;
mod document;
mod exposures;
mod lenses;
mod levels;
mod light;
mod meshes;
mod orders;
mod pixels;
mod rays;
mod repeats;
mod scenes;
mod stack;
mod steps;

use case::{Case, Group, Sweep};
use phasmid_core::error::Result;
use phasmid_report::lab::{Context, Folder, Row, Rows, Section, Settings, Study, Trial};

/// All sweeps, in the order of the report.
const GROUPS: &[Group] = &[
    rays::GROUP,
    scenes::GROUP,
    lenses::GROUP,
    steps::GROUP,
    levels::GROUP,
    orders::GROUP,
    pixels::GROUP,
    meshes::GROUP,
    boards::GROUP,
    light::GROUP,
    exposures::GROUP,
    repeats::GROUP,
];

/// The study.
pub struct Stability;

impl Study for Stability {
    fn name(&self) -> &'static str {
        "stability"
    }

    fn about(&self) -> &'static str {
        "Stiff and extreme cases compared with closed forms: where each method works, and what it \
         reports where it breaks."
    }

    fn title(&self) -> &'static str {
        "Stability at the extremes"
    }

    fn columns(&self) -> &'static [&'static str] {
        &Case::COLUMNS
    }

    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>> {
        let sweeps = GROUPS.iter().flat_map(|group| group.sweeps);
        Ok(sweeps
            .map(|sweep| Trial::new(sweep.key, settings.seed, |context| rows(sweep, context)))
            .collect())
    }

    fn sections(&self, rows: &Rows, _: &Folder, _: &Settings) -> Result<Vec<Section>> {
        Ok(document::sections(rows, GROUPS))
    }
}

fn rows(sweep: &Sweep, context: &Context<'_>) -> Result<Vec<Row>> {
    let cases = (sweep.cases)(context)?;
    Ok(cases.iter().map(|case| case.row(sweep.key)).collect())
}
