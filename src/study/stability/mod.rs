//! Study `stability`: stiff and extreme cases, each with its oracle, its condition number or ratio
//! of scales, the error found, the error that first-order analysis allows, and what the program
//! says where it gives no answer.
//!
//! A sweep is one trial, its cases are its rows. Most call the library's functions
//! on numbers made here in closed form; few render. A case passes when its error is within what is
//! allowed, or when there is no answer and the program says so; a wrong answer without a word fails,
//! and so does none without one.

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
        "Stiff and extreme cases against closed forms: where each method holds, and what it says where it breaks."
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
