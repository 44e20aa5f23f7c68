//! What all studies share: trials that run once and are written down at once, tables and plots made
//! of what was written down, one page that holds them.
//!
//! A [`Study`] names its [`Trial`]s, which are independent of each other, and makes a [`Document`] of
//! their rows. [`run()`] runs those that are not in the folder yet, each on all cores or several side
//! by side, and appends their [`Row`]s to `rows.csv`: a study that was interrupted goes on where it
//! was, and a [`Document`] can be made anew from its folder at any time ([`read()`]). Rows come in
//! the order in which the study names its trials, whatever the order in which they ended.

mod chart;
mod check;
mod csv;
mod document;
mod folder;
mod labels;
mod markdown;
mod page;
mod row;
mod runner;
mod settings;
mod trial;

pub use chart::{Chart, Look, Series};
pub use check::Check;
pub use document::{Block, Document, Figure, Picture, Section, Table};
pub use folder::Folder;
pub use page::page;
pub use row::{Row, Rows};
pub use runner::{Progress, read, run, write};
pub use settings::{Settings, Surroundings};
pub use trial::{Context, Trial};

use phasmid_core::error::Result;

/// One study.
pub trait Study: Sync {
    /// What the command line calls it, which is the name of its folder's kind, too.
    fn name(&self) -> &'static str;

    /// What it is about, in one sentence.
    fn about(&self) -> &'static str;

    /// The columns of its rows, without the ones that all studies have ([`Row::COMMON`]).
    fn columns(&self) -> &'static [&'static str];

    /// Parts that make sense alone: the keys of their trials begin with the name and `/`. What a
    /// document says of the others is then empty.
    fn parts(&self) -> &'static [&'static str] {
        &[]
    }

    /// All trials, in the order of their rows.
    ///
    /// # Errors
    /// Profiles and scenes that cannot be read.
    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>>;

    /// Tables, plots and checks from the rows of all trials, and from files that trials left in the
    /// folder.
    ///
    /// # Errors
    /// Files that cannot be read, rows that lack what is needed.
    fn document(&self, rows: &Rows, folder: &Folder, settings: &Settings) -> Result<Document>;
}

#[cfg(test)]
mod tests;
