//! Sweeps, that is cases along one ratio of scales with one oracle, and one case: what was asked of the
//! program at its limit, and what came of it.

use phasmid_core::error::Result;
use phasmid_report::lab::{Check, Context, Row};

/// Cases with one oracle.
pub(super) struct Sweep {
    /// Names its trial.
    pub(super) key: &'static str,
    pub(super) title: &'static str,
    /// What the answer is held against, and what first-order analysis allows.
    pub(super) oracle: &'static str,
    /// What the ratio is, with its unit.
    pub(super) ratio: &'static str,
    /// What the error is, with its unit.
    pub(super) error: &'static str,
    /// Errors are those of rounding in f64, whose last digits differ from machine to machine.
    pub(super) rounding: bool,
    pub(super) cases: fn(&Context<'_>) -> Result<Vec<Case>>,
}

/// Sweeps that belong together.
pub(super) struct Group {
    pub(super) title: &'static str,
    pub(super) sweeps: &'static [Sweep],
}

/// What came of a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outcome {
    /// An answer within the error allowed.
    Held,
    /// No answer, and words or a mask that say so.
    Refused,
    /// A wrong answer, or none without a word.
    Failed,
}

/// One case of a sweep.
#[derive(Debug, Clone)]
pub(super) struct Case {
    pub(super) name: String,
    /// Condition number or ratio of scales.
    ratio: f64,
    /// The error, in the sweep's unit; NaN where there is no answer.
    found: f64,
    /// What first-order analysis allows.
    allowed: f64,
    /// Share of the pixels or draws that have an answer, where it may be less than all.
    kept: f64,
    /// What the program says.
    says: String,
    outcome: Outcome,
}

impl Case {
    /// The columns of a case.
    pub(super) const COLUMNS: [&'static str; 8] = [
        "sweep", "case", "ratio", "found", "allowed", "kept", "outcome", "says",
    ];

    /// An answer with its error and what that may be.
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

    /// No answer: the words have to be among those that the program says.
    pub(super) fn refused(name: impl Into<String>, ratio: f64, says: &str, words: &str) -> Self {
        let said = says.contains(words) && !words.is_empty();
        Self {
            name: name.into(),
            ratio,
            found: f64::NAN,
            allowed: f64::NAN,
            kept: f64::NAN,
            // The first of several errors.
            says: says.lines().next().unwrap_or_default().to_owned(),
            outcome: if said {
                Outcome::Refused
            } else {
                Outcome::Failed
            },
        }
    }

    /// A case that gave an answer where there is none, or none where there is one.
    pub(super) fn failed(name: impl Into<String>, ratio: f64, says: &str) -> Self {
        Self {
            outcome: Outcome::Failed,
            ..Self::refused(name, ratio, says, "")
        }
    }

    /// With the share that has an answer; at least so much has to.
    #[must_use]
    pub(super) fn kept(mut self, share: f64, least: f64) -> Self {
        self.kept = share;
        let enough = share >= least;
        if !enough {
            self.outcome = Outcome::Failed;
        }
        self
    }

    /// With what the program says of what it leaves out.
    #[must_use]
    pub(super) fn says(mut self, says: impl Into<String>) -> Self {
        self.says = says.into();
        self
    }

    /// As a row of the study.
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

/// Keeps the error that comes nearest to what it is allowed, or is beyond it; NaN is beyond all.
pub(super) fn worse(worst: &mut (f64, f64), error: f64, allowed: f64) {
    if !(error / allowed <= worst.0 / worst.1) {
        *worst = (error, allowed);
    }
}

/// The checks of a sweep by its rows: the worst error over what is allowed, and how many cases were
/// wrong or gave no answer without a word.
pub(super) fn checks(sweep: &str, rows: &[&Row]) -> Vec<Check> {
    let over = rows
        .iter()
        .map(|row| row.value("found") / row.value("allowed"));
    let worst = over.filter(|v| !v.is_nan()).fold(f64::NAN, f64::max);
    let failed = rows.iter().filter(|row| row.get("outcome") == "FAILED");
    let names: Vec<&str> = failed.map(|row| row.get("case")).collect();
    let mut what = format!("{sweep}: cases wrong or silent");
    if !names.is_empty() {
        what = format!("{what} ({})", names.join("; "));
    }
    let mut checks = vec![Check::at_most(what, names.len() as f64, 0.0)];
    if !worst.is_nan() {
        let what = format!("{sweep}: worst error over what is allowed");
        checks.push(Check::at_most(what, worst, 1.0));
    }
    checks
}
