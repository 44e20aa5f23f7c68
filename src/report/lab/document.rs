//! What a study says: words, tables, plots, pictures, checks.

use super::check::Check;
use crate::plot::Sheet;

/// A study's result, as pages and tables are made of it.
#[derive(Debug, Clone)]
pub struct Document {
    /// The heading.
    pub title: String,
    /// What follows it.
    pub sections: Vec<Section>,
}

/// A part with a heading of its own.
#[derive(Debug, Clone)]
pub struct Section {
    /// The heading.
    pub title: String,
    /// What follows it.
    pub blocks: Vec<Block>,
}

/// One thing after the other.
#[derive(Debug, Clone)]
pub enum Block {
    /// A paragraph.
    Words(String),
    /// A table.
    Table(Table),
    /// A plot, which is a file of its own as well.
    Figure(Figure),
    /// A picture that a trial left.
    Picture(Picture),
    /// What the figures are held to.
    Checks(Vec<Check>),
}

/// A table of words; the first column names the row.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Names it among the tables of all studies, as `paper-distances`.
    pub name: String,
    /// What it shows, with the conditions.
    pub caption: String,
    /// Names of the columns, with units.
    pub header: Vec<String>,
    /// Cells, as many in each row as there are columns.
    pub rows: Vec<Vec<String>>,
    /// Whether its figures are times, which no second run repeats.
    pub timed: bool,
    /// Whether it is one of many of which another gives the gist: in the files, not on the screen.
    pub detail: bool,
}

/// A plot.
#[derive(Debug, Clone)]
pub struct Figure {
    /// The file's name without `.svg`.
    pub name: String,
    /// What it shows.
    pub caption: String,
    /// The drawing.
    pub sheet: Sheet,
}

/// A picture that a trial left with [`super::Folder::leave`].
#[derive(Debug, Clone)]
pub struct Picture {
    /// The file's name, which ends in `.png`.
    pub file: String,
    /// What it shows.
    pub caption: String,
}

impl Document {
    /// Its blocks, one after the other.
    pub fn blocks(&self) -> impl Iterator<Item = &Block> {
        self.sections.iter().flat_map(|section| &section.blocks)
    }

    /// Its tables.
    pub fn tables(&self) -> impl Iterator<Item = &Table> {
        self.blocks().filter_map(|block| match block {
            Block::Table(table) => Some(table),
            _ => None,
        })
    }

    /// Its checks.
    pub fn checks(&self) -> impl Iterator<Item = &Check> {
        let of = self.blocks().filter_map(|block| match block {
            Block::Checks(checks) => Some(checks),
            _ => None,
        });
        of.flatten()
    }
}

impl Table {
    /// A table without rows.
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

    /// A row more.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// The same table as one of times.
    #[must_use]
    pub fn timed(mut self) -> Self {
        self.timed = true;
        self
    }

    /// The same table as one that is left to the files.
    #[must_use]
    pub fn detail(mut self) -> Self {
        self.detail = true;
        self
    }
}
