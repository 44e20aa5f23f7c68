//! A sweep is a series of cases along one ratio of scales, with one oracle. A case is one task for the
//! program near its limits, with its outcome.

use phasmid_core::error::Result;
use phasmid_report::lab::{Check, Context, Row};

/// Cases with one oracle.
pub(super) struct Sweep {
    /// Name of the trial.
    pub(super) key: &'static str,
    pub(super) title: &'static str,
    /// Reference for the answer, and the error that first-order analysis allows.
    pub(super) oracle: &'static str,
    /// Description of the ratio, with its unit.
    pub(super) ratio: &'static str,
    /// Description of the error, with its unit.
    pub(super) error: &'static str,
    /// Whether errors are f64 rounding errors, whose last digits differ from machine to machine.
    pub(super) rounding: bool,
    pub(super) cases: fn(&Context<'_>) -> Result<Vec<Case>>,
}

/// Sweeps that belong together.
pub(super) struct Group {
    pub(super) title: &'static str,
    pub(super) sweeps: &'static [Sweep],
}

/// Outcome of a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outcome {
    /// An answer within the allowed error.
    Held,
    /// No answer, but a message or a mask that reports this.
    Refused,
    /// A wrong answer, or no answer without a message.
    Failed,
}

/// One case of a sweep.
#[derive(Debug, Clone)]
pub(super) struct Case {
    pub(super) name: String,
    /// Condition number or ratio of scales.
    ratio: f64,
    /// Error in the sweep's unit; NaN without an answer.
    found: f64,
    /// Error that first-order analysis allows.
    allowed: f64,
    /// Fraction of the pixels or draws that have an answer, if it may be below 1.
    kept: f64,
    /// Message of the program.
    says: String,
    outcome: Outcome,
}

impl Case {
    /// The columns of a case.
    pub(super) const COLUMNS: [&'static str; 8] = [
        "sweep", "case", "ratio", "found", "allowed", "kept", "outcome", "says",
    ];

    /// Creates a case with an answer; it fails if its error exceeds the allowed one.
    pub(super) fn held(name: impl Into<String>, ratio: f64, found: f64, allowed: f64) -> Self {
        let outcome = match found <= allowed {
            true => Outcome::Held,
            false => Outcome::Failed,
        };
        Self {
            name: name.into(),
            ratio,
            found,
            allowed,
            kept: f64::NAN,
            says: String::new(),
            outcome,
        }
    }

    /// Creates a case without an answer; it fails unless the program's message contains `words`.
    pub(super) fn refused(name: impl Into<String>, ratio: f64, says: &str, words: &str) -> Self {
        let said = says.contains(words) && !words.is_empty();
        Self {
            name: name.into(),
            ratio,
            found: f64::NAN,
            allowed: f64::NAN,
            kept: f64::NAN,
            // A message may contain several errors, one per line; keep the first.
            says: says.lines().next().unwrap_or_default().to_owned(),
            outcome: if said {
                Outcome::Refused
            } else {
                Outcome::Failed
            },
        }
    }

    /// Creates a failed case: an answer where none exists, or no answer where one exists.
    pub(super) fn failed(name: impl Into<String>, ratio: f64, says: &str) -> Self {
        Self {
            outcome: Outcome::Failed,
            ..Self::refused(name, ratio, says, "")
        }
    }

    /// Sets the fraction that has an answer; the case fails if it is below `least`.
    #[must_use]
    pub(super) fn kept(mut self, share: f64, least: f64) -> Self {
        self.kept = share;
        let enough = share >= least;
        if !enough {
            self.outcome = Outcome::Failed;
        }
        self
    }

    /// Sets the program's message.
    #[must_use]
    pub(super) fn says(mut self, says: impl Into<String>) -> Self {
        self.says = says.into();
        self
    }

    /// Returns the case as a row of the study.
    pub(super) fn row(&self, sweep: &str) -> Row {
        let outcome = match self.outcome {
            Outcome::Held => "held",
            Outcome::Refused => "refused",
            Outcome::Failed => "FAILED",
        };
        Row::new()
            .text("sweep", sweep)
            .text("case", &self.name)
            .number("ratio", self.ratio)
            .number("found", self.found)
            .number("allowed", self.allowed)
            .number("kept", self.kept)
            .text("outcome", outcome)
            .text("says", &self.says)
    }
}

/// Keeps the error with the largest ratio to its allowed value; NaN counts as largest.
pub(super) fn worse(worst: &mut (f64, f64), error: f64, allowed: f64) {
    if !(error / allowed <= worst.0 / worst.1) {
        *worst = (error, allowed);
    }
}

/// Returns the checks of a sweep from its rows: the worst ratio of error to allowed error, and the
/// number of cases that were wrong or gave no answer without a message.
pub(super) fn checks(sweep: &str, rows: &[&Row]) -> Vec<Check> {
    let over = rows
        .iter()
        .map(|row| row.value("found") / row.value("allowed"));
    let worst = over.filter(|v| !v.is_nan()).fold(f64::NAN, f64::max);
    let failed = rows.iter().filter(|row| row.get("outcome") == "FAILED");
    let names: Vec<&str> = failed.map(|row| row.get("case")).collect();
    let mut what = format!("{sweep}: failed cases");
    if !names.is_empty() {
        what = format!("{what} ({})", names.join("; "));
    }
    let mut checks = vec![Check::at_most(what, names.len() as f64, 0.0)];
    if !worst.is_nan() {
        let what = format!("{sweep}: worst error / allowed error");
        checks.push(Check::at_most(what, worst, 1.0));
    }
    checks
}
