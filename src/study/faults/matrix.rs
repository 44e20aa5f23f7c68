//! The fault matrix: every fault in every setting; each cell counts outcomes.

use super::{BadDay, Difference, Outcome, Place, Setting, Trial};
use phasmid_core::error::Result;
use rayon::prelude::*;
use serde::Serialize;
use std::fmt::Write;

/// Outcomes of one fault at one kind of place in one setting.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Cell {
    /// Scans that gave the fault-free cloud.
    pub recovered: u32,
    /// Scans that ended with an error that says what is wrong.
    pub reported: u32,
    /// Scans of damaged frames whose cloud hardly differs from the fault-free cloud.
    pub harmless: u32,
    /// Scans that gave another cloud without an error.
    pub wrong: u32,
    /// Scans that gave another cloud without an error, for faults that no frame shows
    /// ([`BadDay::is_unfindable`]).
    pub unfindable: u32,
    /// Largest differences among the harmless and the wrong scans.
    pub difference: Difference,
    /// Scans in which the fault never struck.
    pub missed: u32,
    /// One of the error messages.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub said: Option<String>,
    /// The wrong scans and their differences.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub wrongs: Vec<String>,
}

/// A line of the table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The fault.
    pub fault: String,
    /// The place of the fault.
    pub place: &'static str,
    /// One cell per setting.
    pub cells: Vec<Cell>,
}

/// A table: faults by settings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table {
    /// Title of the table.
    pub title: String,
    /// Names of the settings.
    pub settings: Vec<String>,
    /// Rows of the table.
    pub rows: Vec<Row>,
}

impl Table {
    /// Tests every fault in every setting.
    ///
    /// # Errors
    /// Returns an error if a setting cannot be scanned without faults.
    pub fn fill(
        title: &str,
        settings: &[Setting],
        days: &[BadDay],
        places: [Place; 4],
        step: &(dyn Fn(&str) + Sync),
    ) -> Result<Self> {
        let columns: Vec<Vec<Cell>> = settings
            .par_iter()
            .map(|setting| column(setting, days, places, step))
            .collect::<Result<_>>()?;
        let keys = days
            .iter()
            .flat_map(|day| places.map(|place| (day.name.clone(), place.name())));
        let rows = keys.enumerate().map(|(i, (fault, place))| Row {
            fault,
            place,
            cells: columns.iter().map(|column| column[i].clone()).collect(),
        });
        Ok(Self {
            title: title.to_owned(),
            settings: settings.iter().map(|s| s.name.clone()).collect(),
            rows: rows.collect(),
        })
    }

    /// Returns the number of scans with a wrong cloud and no error.
    pub fn wrong(&self) -> u32 {
        let cells = self.rows.iter().flat_map(|row| &row.cells);
        cells.map(|cell| cell.wrong).sum()
    }

    /// Returns the total number of scans.
    pub fn scans(&self) -> u32 {
        let cells = self.rows.iter().flat_map(|row| &row.cells);
        cells
            .map(|cell| {
                let right = cell.recovered + cell.reported + cell.harmless;
                right + cell.wrong + cell.unfindable + cell.missed
            })
            .sum()
    }

    /// Describes the scans with a wrong cloud and no error.
    pub fn wrongs(&self) -> impl Iterator<Item = String> {
        self.rows.iter().flat_map(|row| {
            let cells = row.cells.iter().zip(&self.settings);
            cells.flat_map(move |(cell, setting)| {
                let words = move |how| format!("{setting}, {}, {}: {how}", row.fault, row.place);
                cell.wrongs.iter().map(words)
            })
        })
    }

    /// Returns the table as Markdown.
    pub fn to_markdown(&self) -> String {
        let mut text = format!("## {}\n\n| fault | when |", self.title);
        for setting in &self.settings {
            let _ = write!(text, " {setting} |");
        }
        text.push_str("\n| --- | --- |");
        text.push_str(&" --- |".repeat(self.settings.len()));
        text.push('\n');
        for row in &self.rows {
            let _ = write!(text, "| {} | {} |", row.fault, row.place);
            for cell in &row.cells {
                let _ = write!(text, " {} |", cell.words());
            }
            text.push('\n');
        }
        text
    }
}

/// Tests all faults in one setting.
fn column(
    setting: &Setting,
    days: &[BadDay],
    places: [Place; 4],
    step: &(dyn Fn(&str) + Sync),
) -> Result<Vec<Cell>> {
    let mut trial = Trial::new(setting)?;
    let mut cells = Vec::new();
    for day in days {
        step(&format!("{}: {}", setting.name, day.name));
        for place in places {
            let count = trial.events(&day.fault);
            let mut cell = Cell::default();
            for schedule in day.schedules(place, count) {
                let tried = trial.scan(&schedule)?;
                let outcome = trial.judge(&tried);
                if tried.struck.is_empty() {
                    cell.missed += 1;
                    continue;
                }
                match outcome {
                    Outcome::Recovered => cell.recovered += 1,
                    Outcome::Reported(said) => {
                        cell.reported += 1;
                        cell.said.get_or_insert(said);
                    }
                    Outcome::Harmless(difference) => {
                        cell.harmless += 1;
                        cell.difference = cell.difference.worst(difference);
                    }
                    Outcome::Wrong(difference) if day.is_unfindable(place) => {
                        cell.unfindable += 1;
                        cell.difference = cell.difference.worst(difference);
                    }
                    Outcome::Wrong(difference) => {
                        cell.wrong += 1;
                        cell.difference = cell.difference.worst(difference);
                        let first = &tried.struck[0];
                        let Difference { lost, moved } = difference;
                        cell.wrongs.push(format!(
                            "seed {}: {:.2} % of the points lost, {:.2} % moved; fault at frame \
                             {:?}, command {:?}",
                            schedule.seed,
                            100.0 * lost,
                            100.0 * moved,
                            first.frame,
                            first.command
                        ));
                    }
                }
            }
            cells.push(cell);
        }
    }
    Ok(cells)
}

impl Cell {
    /// Lists the non-zero counts in words.
    fn words(&self) -> String {
        let counts = [
            ("recovered", self.recovered),
            ("reported", self.reported),
            ("harmless", self.harmless),
            ("unfindable", self.unfindable),
            ("WRONG", self.wrong),
        ];
        let said: Vec<_> = counts
            .into_iter()
            .filter(|(_, count)| *count > 0)
            .map(|(name, count)| format!("{name} {count}"))
            .collect();
        if said.is_empty() {
            return "did not strike".to_owned();
        }
        let Difference { lost, moved } = self.difference;
        match self.difference == Difference::default() {
            true => said.join(", "),
            false => format!(
                "{} ({:.2} % lost, {:.2} % moved)",
                said.join(", "),
                100.0 * lost,
                100.0 * moved
            ),
        }
    }
}
