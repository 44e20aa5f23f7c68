//! Positions of all values of a document.

use std::collections::BTreeMap;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Positions of a value and of the values in it. `key` is the position of the value's key, or, for
/// an element of a list, of the element itself.
pub(crate) struct Positions {
    key: Range<usize>,
    span: Range<usize>,
    inside: Inside,
}

enum Inside {
    Nothing,
    List(Vec<Positions>),
    Table(BTreeMap<String, Positions>),
}

/// The kind of position that an error has.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    Value,
    List,
    /// A table that lacks a field.
    Table,
    /// A key, which is not part of the path.
    Key,
}

impl Positions {
    pub fn of(root: &Spanned<DeTable<'_>>) -> Self {
        Self {
            key: root.span(),
            span: root.span(),
            inside: Inside::of_table(root.get_ref()),
        }
    }

    fn of_value(key: Range<usize>, value: &Spanned<DeValue<'_>>) -> Self {
        let inside = match value.get_ref() {
            DeValue::Array(list) => {
                let elements = list.iter().map(|value| Self::of_value(value.span(), value));
                Inside::List(elements.collect())
            }
            DeValue::Table(table) => Inside::of_table(table),
            _ => Inside::Nothing,
        };
        let span = value.span();
        Self { key, span, inside }
    }

    /// Finds the value at a path such as `frame[3].pattern`. Returns its position and `true`, or, if the
    /// value does not exist, the position of the closest enclosing table and `false`.
    pub fn find(&self, path: &str) -> (usize, bool) {
        let mut here = self;
        for step in path.split('.') {
            let (key, indices) = step.split_once('[').unwrap_or((step, ""));
            let Inside::Table(table) = &here.inside else {
                return (here.key.start, false);
            };
            let Some(value) = table.get(key) else {
                return (here.key.start, false);
            };
            here = value;
            for index in indices.split(']').filter(|s| !s.is_empty()) {
                let index = index.trim_start_matches('[').parse::<usize>();
                let element = match (&here.inside, index) {
                    (Inside::List(list), Ok(index)) => list.get(index),
                    _ => None,
                };
                match element {
                    Some(element) => here = element,
                    None => return (here.key.start, false),
                }
            }
        }
        (here.key.start, true)
    }

    /// Returns the path of the innermost value at a position; empty for the document.
    pub fn path_at(&self, span: &Range<usize>, part: Part) -> String {
        let mut path = String::new();
        self.search(span, part, "", &mut path);
        path
    }

    fn search(&self, span: &Range<usize>, part: Part, here: &str, found: &mut String) {
        let fits = match part {
            Part::List => matches!(self.inside, Inside::List(_)),
            Part::Table => matches!(self.inside, Inside::Table(_)),
            Part::Value | Part::Key => true,
        };
        if fits && (self.span == *span || self.key == *span) {
            here.clone_into(found);
            if part == Part::Key && self.key == *span {
                found.truncate(here.rfind('.').unwrap_or(0));
            }
        }
        match &self.inside {
            Inside::Nothing => {}
            Inside::List(list) => {
                for (i, value) in list.iter().enumerate() {
                    value.search(span, part, &format!("{here}[{i}]"), found);
                }
            }
            Inside::Table(table) => {
                for (key, value) in table {
                    let dot = if here.is_empty() { "" } else { "." };
                    value.search(span, part, &format!("{here}{dot}{key}"), found);
                }
            }
        }
    }
}

impl Inside {
    fn of_table(table: &DeTable<'_>) -> Self {
        let entries = table.iter().map(|(key, value)| {
            let name = key.get_ref().to_string();
            (name, Positions::of_value(key.span(), value))
        });
        Self::Table(entries.collect())
    }
}
