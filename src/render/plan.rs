//! Plan: which terms of image formation a scene and its patterns need, and why. Terms it omits
//! would not change a byte.

use super::term::{Needs, Pass, Term};
use crate::pattern_image::PatternImage;
use phasmid_pattern::Axis;
use serde::Serialize;

/// Set of the terms that are computed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Plan {
    /// One bit per element of [`Term::ALL`].
    terms: u64,
}

/// The plan's decision on one term.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Decision {
    /// The pass that the term belongs to.
    pub pass: Pass,
    /// The term.
    pub term: Term,
    /// Whether it is computed.
    pub included: bool,
    /// Reason for the decision.
    pub why: &'static str,
}

impl Plan {
    /// Creates the plan for profile and scene, before any pattern is known.
    pub(super) fn new(needs: &Needs<'_>) -> Self {
        let mut plan = Self::default();
        for term in Term::ALL {
            plan.set(term, needs.decide(term).0);
        }
        plan
    }

    /// Returns whether a term is computed.
    pub const fn has(&self, term: Term) -> bool {
        self.terms >> term as u32 & 1 != 0
    }

    pub(super) fn set(&mut self, term: Term, included: bool) {
        let bit = 1 << term as u32;
        self.terms = if included {
            self.terms | bit
        } else {
            self.terms & !bit
        };
    }

    /// Adds the terms a pattern needs; returns whether the plan changed.
    pub(super) fn include(&mut self, pattern_image: &PatternImage) -> bool {
        let before = *self;
        match pattern_image {
            PatternImage::Uniform(_) => {}
            PatternImage::Row(Axis::X, _) => self.set(Term::FootprintX, true),
            PatternImage::Row(Axis::Y, _) => self.set(Term::FootprintY, true),
            PatternImage::Image { .. } => {
                self.set(Term::FootprintX, true);
                self.set(Term::FootprintY, true);
            }
        }
        *self != before
    }

    /// Returns the decision on every term, in pass order.
    pub(super) fn decisions(&self, needs: &Needs<'_>) -> Vec<Decision> {
        let decision = |term: Term| {
            let (needed, why) = needs.decide(term);
            let included = self.has(term);
            let why = match (needed, included) {
                (false, true) => term.why_added(),
                (true, false) => "left out on request",
                _ => why,
            };
            Decision {
                pass: term.pass(),
                term,
                included,
                why,
            }
        };
        Term::ALL.into_iter().map(decision).collect()
    }
}
