//! The study's page: `passes` with what options cost, and `links`.

mod links;
mod passes;

use phasmid_report::lab::{Document, Rows};

/// All of it.
pub fn document(rows: &Rows) -> Document {
    Document {
        title: "Speed".to_owned(),
        sections: vec![
            passes::section(rows),
            passes::options(rows),
            links::section(rows),
        ],
    }
}
