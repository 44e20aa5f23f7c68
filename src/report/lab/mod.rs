//! The framework of all studies: trials that run once and whose results are stored at once, and the
//! tables, plots and page made from the stored results.
//!
//! A [`Study`] lists its [`Trial`]s, which are independent of each other, and makes the sections of a
//! [`Document`] from their rows. [`run()`] runs the trials that are not in the folder yet, each on all
//! cores or several in parallel, and appends their [`Row`]s to `rows.csv`. So an interrupted study
//! continues where it stopped, and a [`Document`] can be rebuilt from its folder at any time
//! ([`read()`]). A document gets its rows in the order in which the study lists its trials, regardless
//! of the order in which they end.
//!
//! | file | contents |
//! | --- | --- |
//! | `trial`, `settings` | a trial, and what it runs with |
//! | `row`, `csv` | rows of results, and their lines in `rows.csv` |
//! | `folder` | the folder of a study |
//! | `runner` | runs trials and writes the document's files |
//! | `shard`, `join` | parts of a study that run in folders of their own, and are joined |
//! | `document` | the document: text, tables, figures, images, checks |
//! | `chart`, `labels` | charts and the names of their points |
//! | `markdown`, `page` | the document as Markdown and as HTML |

mod chart;
mod csv;
mod document;
mod folder;
mod join;
mod labels;
mod markdown;
mod page;
mod row;
mod runner;
mod settings;
mod shard;
mod trial;

pub use chart::{Chart, Series, SeriesStyle};
pub use document::{Block, Check, Document, Figure, Image, Section, Table};
pub use folder::Folder;
pub use join::join;
pub use page::page;
pub use row::{Row, Rows};
pub use runner::{Progress, read, run, run_shard, run_with_stop, write};
pub use settings::{Settings, Surroundings};
pub use shard::Shard;
pub use trial::{Context, Trial};

use phasmid_core::error::Result;

/// One study.
pub trait Study: Sync {
    /// Returns the study's name on the command line and in `study.json`.
    fn name(&self) -> &'static str;

    /// Returns the study's question in one sentence.
    fn about(&self) -> &'static str;

    /// Returns the heading of the document, by default the study's name.
    fn title(&self) -> &'static str {
        self.name()
    }

    /// Returns the columns of the study's rows, except those common to all studies ([`Row::COMMON`]).
    fn columns(&self) -> &'static [&'static str];

    /// Returns the parts that can run alone: the keys of their trials begin with the part's name and
    /// `/`. The other parts of the document are then empty.
    fn parts(&self) -> &'static [&'static str] {
        &[]
    }

    /// Returns all trials, in the order of their rows.
    ///
    /// # Errors
    /// Returns an error if a profile or scene cannot be read.
    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>>;

    /// Makes tables, plots and checks from the rows of all trials, and from files that trials have
    /// written to the folder.
    ///
    /// # Errors
    /// Returns an error if a file cannot be read or rows lack required values.
    fn sections(&self, rows: &Rows, folder: &Folder, settings: &Settings) -> Result<Vec<Section>>;
}

#[cfg(test)]
mod tests;
