//! Formats tables as Markdown that is also readable on a terminal.

use super::document::{Block, Check, Document, Table, checks_of};
use crate::plot::figures;

impl Table {
    /// Returns the table in Markdown, with aligned columns.
    pub fn markdown(&self) -> String {
        let all = || std::iter::once(&self.header).chain(&self.rows);
        let width = |i: usize| {
            let cells = all().filter_map(|row| row.get(i));
            cells
                .map(|cell| cell.chars().count())
                .max()
                .unwrap_or(0)
                .max(3)
        };
        let widths: Vec<usize> = (0..self.header.len()).map(width).collect();
        let line = |row: &Vec<String>| {
            let cells = widths.iter().enumerate().map(|(i, &width)| {
                let cell = row.get(i).map_or("", String::as_str).replace('|', "/");
                if i == 0 {
                    format!("{cell:<width$}")
                } else {
                    format!("{cell:>width$}")
                }
            });
            format!("| {} |\n", cells.collect::<Vec<_>>().join(" | "))
        };
        let rule = widths.iter().enumerate().map(|(i, &width)| {
            let dashes = "-".repeat(width - 1);
            if i == 0 {
                format!("{dashes}-")
            } else {
                format!("{dashes}:")
            }
        });
        let rule = format!("| {} |\n", rule.collect::<Vec<_>>().join(" | "));
        let mut out = line(&self.header) + &rule;
        out.extend(self.rows.iter().map(line));
        out
    }
}

impl Document {
    /// Returns the question, the verdict with all checks, and the tables in Markdown. Without `times`,
    /// the text has no measured times, so that a second run gives the same text: instead of the verdict,
    /// the checks and their limits follow the tables.
    pub fn markdown(&self, times: bool) -> String {
        let mut out = format!("# {}\n", self.title);
        if times {
            out += &format!("\n{}\n", self.asked);
            if let Some(verdict) = self.verdict() {
                let checks = checks_table(&self.by_verdict()).markdown();
                out += &format!("\n**{verdict}**\n\n{checks}");
            }
        }
        for section in &self.sections {
            let mut body = String::new();
            for block in &section.blocks {
                match block {
                    Block::Table(table) if !table.rows.is_empty() && (times || !table.timed) => {
                        body += &format!("\n{}\n\n{}", table.caption, table.markdown());
                    }
                    _ => {}
                }
            }
            if !body.is_empty() {
                out += &format!("\n## {}\n{body}", section.title);
            }
        }
        if !times {
            let mut table = Table::new("", "", &["section", "check", "at most"]);
            for section in &self.sections {
                for check in checks_of(section) {
                    table.row([&section.title, &check.what, &figures(check.allowed, 4)]);
                }
            }
            out += &format!("\n## Checks\n\n{}", table.markdown());
        }
        out
    }

    /// Returns the text for a terminal: tables except details, failed checks, and the number of passed
    /// checks.
    pub fn screen(&self) -> String {
        let mut out = format!("# {}\n", self.title);
        let is_shown = |table: &&Table| !table.detail && !table.rows.is_empty();
        for table in self.tables().filter(is_shown) {
            out += &format!("\n{}\n\n{}", table.caption, table.markdown());
        }
        let all = self.checks().count();
        let mut failed = self.by_verdict();
        failed.retain(|(_, check)| !check.passed());
        if !failed.is_empty() {
            out += &format!("\n{}", checks_table(&failed).markdown());
        }
        let passed = all - failed.len();
        out + &format!("\n{passed} of {all} checks passed\n")
    }
}

/// Returns the checks, each with the heading of its section, as a table.
pub(super) fn checks_table(checks: &[(&str, &Check)]) -> Table {
    let mut table = Table::new("", "", &["section", "check", "found", "at most", ""]);
    for (section, check) in checks {
        let verdict = if check.passed() { "passed" } else { "FAILED" };
        table.row([
            (*section).to_owned(),
            check.what.clone(),
            figures(check.found, 4),
            figures(check.allowed, 4),
            verdict.to_owned(),
        ]);
    }
    table
}
