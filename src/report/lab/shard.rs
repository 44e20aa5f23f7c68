//! Shards: parts of a study's trials that run in folders of their own, for example on the machines of a
//! cluster.

use phasmid_core::error::{Error, Result};
use std::str::FromStr;

/// Maximum number of shards.
const MOST: usize = 10_000;

/// One of several equal parts of a study's trials; by default all of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Index of the part, from 0.
    index: usize,
    of: usize,
}

impl Default for Shard {
    fn default() -> Self {
        Self { index: 0, of: 1 }
    }
}

impl FromStr for Shard {
    type Err = Error;

    /// Reads `I/N`: the I-th of N shards, from 1.
    fn from_str(text: &str) -> Result<Self> {
        let numbers = text.split_once('/');
        let numbers = numbers.and_then(|(i, of)| Some((i.parse().ok()?, of.parse().ok()?)));
        match numbers {
            Some((i, of)) if (1..=MOST).contains(&of) && (1..=of).contains(&i) => {
                Ok(Self { index: i - 1, of })
            }
            _ => {
                let allowed = format!("I/N, such as 2/8, with I from 1 to N and N up to {MOST}");
                Err(Error::input("shard", text, allowed))
            }
        }
    }
}

impl Shard {
    /// Whether the shard contains the trial with this index in the study's list.
    pub(super) fn has(self, trial: usize) -> bool {
        trial % self.of == self.index
    }
}
