//! The document of a study: text, tables, plots, images and checks.

use super::row::Row;
use crate::plot::{Sheet, figures};

/// The result of a study, from which pages and tables are made.
#[derive(Debug, Clone)]
pub struct Document {
    /// The heading.
    pub title: String,
    /// The question that the study answers, in one sentence.
    pub asked: String,
    /// Content below the question and the verdict.
    pub sections: Vec<Section>,
}

/// A part of a document with its own heading.
#[derive(Debug, Clone)]
pub struct Section {
    /// The heading.
    pub title: String,
    /// Content below the heading.
    pub blocks: Vec<Block>,
}

/// An element of a section.
#[derive(Debug, Clone)]
pub enum Block {
    /// A paragraph.
    Words(String),
    /// A table.
    Table(Table),
    /// A plot, which is also written to its own file.
    Figure(Figure),
    /// An image that a trial has written.
    Image(Image),
    /// Results, each with its limit.
    Checks(Vec<Check>),
}

/// A table of text; the first column names the row.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Unique name among the tables of all studies, such as `paper-distances`.
    pub name: String,
    /// Description of the content, with the conditions of the measurement.
    pub caption: String,
    /// Names of the columns, with units.
    pub header: Vec<String>,
    /// Rows, each with one cell per column.
    pub rows: Vec<Vec<String>>,
    /// Whether the table contains measured times, which differ between runs.
    pub timed: bool,
    /// Whether another table summarises this one. Such a detail is written to the files but not to the
    /// terminal.
    pub detail: bool,
}

/// A plot.
#[derive(Debug, Clone)]
pub struct Figure {
    /// The file's name without `.svg`.
    pub name: String,
    /// Description of the content.
    pub caption: String,
    /// The drawing.
    pub sheet: Sheet,
}

/// An image that a trial has written with [`super::Folder::leave`].
#[derive(Debug, Clone)]
pub struct Image {
    /// The file's name, which ends in `.png`.
    pub file: String,
    /// Description of the content.
    pub caption: String,
}

impl Document {
    /// Returns all blocks in order.
    pub fn blocks(&self) -> impl Iterator<Item = &Block> {
        self.sections.iter().flat_map(|section| &section.blocks)
    }

    /// Returns all tables.
    pub fn tables(&self) -> impl Iterator<Item = &Table> {
        self.blocks().filter_map(|block| match block {
            Block::Table(table) => Some(table),
            _ => None,
        })
    }

    /// Returns all checks.
    pub fn checks(&self) -> impl Iterator<Item = &Check> {
        self.sections.iter().flat_map(checks_of)
    }

    /// Returns in one sentence whether the checks hold; `None` without checks.
    pub fn verdict(&self) -> Option<String> {
        let all = self.checks().count();
        let failed = self.checks().filter(|check| !check.passed()).count();
        match (all, failed) {
            (0, _) => None,
            (1, 0) => Some("The check passed.".to_owned()),
            (_, 0) => Some(format!("All {all} checks passed.")),
            _ => Some(format!("{failed} of {all} checks FAILED.")),
        }
    }

    /// Returns all checks, each with the heading of its section, failed ones first.
    pub(super) fn by_verdict(&self) -> Vec<(&str, &Check)> {
        let of_section = |section| checks_of(section).map(|check| (section.title.as_str(), check));
        let mut all: Vec<_> = self.sections.iter().flat_map(of_section).collect();
        all.sort_by_key(|(_, check)| check.passed());
        all
    }
}

impl Section {
    /// Makes a section.
    pub fn new(title: &str, blocks: Vec<Block>) -> Self {
        Self {
            title: title.to_owned(),
            blocks,
        }
    }
}

pub(super) fn checks_of(section: &Section) -> impl Iterator<Item = &Check> {
    let of = section.blocks.iter().filter_map(|block| match block {
        Block::Checks(checks) => Some(checks),
        _ => None,
    });
    of.flatten()
}

impl Table {
    /// Makes a table without rows.
    pub fn new(name: &str, caption: impl Into<String>, header: &[&str]) -> Self {
        Self {
            name: name.to_owned(),
            caption: caption.into(),
            header: header.iter().map(|&word| word.to_owned()).collect(),
            rows: Vec::new(),
            timed: false,
            detail: false,
        }
    }

    /// Makes a table with a line for each of `rows`. Each entry of `columns` has a column's header, the
    /// name of its value in a row, and the number of significant figures, or 0 for text.
    pub fn of<'a>(
        name: &str,
        caption: impl Into<String>,
        rows: impl IntoIterator<Item = &'a Row>,
        columns: &[(&str, &str, usize)],
    ) -> Self {
        let header: Vec<&str> = columns.iter().map(|(header, ..)| *header).collect();
        let mut table = Self::new(name, caption, &header);
        for row in rows {
            table.row(columns.iter().map(|&(_, value, digits)| match digits {
                0 => row.get(value).to_owned(),
                _ => figures(row.value(value), digits),
            }));
        }
        table
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// Marks the table as a table of measured times.
    #[must_use]
    pub fn timed(mut self) -> Self {
        self.timed = true;
        self
    }

    /// Marks the table as a detail, which is written to the files only.
    #[must_use]
    pub fn detail(mut self) -> Self {
        self.detail = true;
        self
    }
}

/// A result and its limit.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// Checked quantity, with its unit.
    pub what: String,
    /// The result.
    pub found: f64,
    /// The largest value that passes.
    pub allowed: f64,
}

impl Check {
    /// Makes a check that a result is at most `allowed`.
    pub fn at_most(what: impl Into<String>, found: f64, allowed: f64) -> Self {
        Self {
            what: what.into(),
            found,
            allowed,
        }
    }

    /// Whether the check passes. NaN does not pass.
    pub fn passed(&self) -> bool {
        self.found <= self.allowed
    }
}
