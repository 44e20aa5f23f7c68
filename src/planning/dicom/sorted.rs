//! Sorts images by series and breathing phase.

use super::slice::Slice;
use phasmid_core::error::{Error, Result};
use std::collections::BTreeMap;

/// The images of a folder, grouped by series and phase.
pub(super) struct Sorted {
    /// Per cent of the cycle, ascending, and the images of that phase.
    pub(super) phases: Vec<(f64, Vec<Slice>)>,
    /// Series without a phase.
    pub(super) rest: Vec<Vec<Slice>>,
}

impl Sorted {
    /// Groups images: of several series, each is one phase or none; a single series is divided by
    /// the phases its images state.
    ///
    /// # Errors
    /// Returns an error if two series have the same phase.
    pub(super) fn of(slices: Vec<Slice>) -> Result<Self> {
        let mut series: BTreeMap<String, Vec<Slice>> = BTreeMap::new();
        for slice in slices {
            series.entry(slice.series.clone()).or_default().push(slice);
        }
        let alone = series.len() == 1;
        let mut sorted = Self {
            phases: Vec::new(),
            rest: Vec::new(),
        };
        for (_, slices) in series {
            if alone {
                match divided(slices) {
                    Ok(phases) => sorted.phases = phases,
                    Err(slices) => sorted.rest.push(slices),
                }
            } else if let Some(percent) = percent_of(&slices) {
                sorted.phases.push((percent, slices));
            } else {
                sorted.rest.push(slices);
            }
        }
        sorted.phases.sort_by(|a, b| a.0.total_cmp(&b.0));
        let twice = sorted.phases.windows(2).find(|pair| pair[0].0 == pair[1].0);
        if let Some(pair) = twice {
            let (a, b) = (&pair[0].1[0], &pair[1].1[0]);
            return Err(Error::input(
                b.place(),
                format!("a second phase at {} %: {}", pair[1].0, b.title()),
                format!("one; {} has {}", a.place(), a.title()),
            ));
        }
        Ok(sorted)
    }

    /// Returns the descriptions of the series without a phase.
    pub(super) fn left_out(&self) -> Vec<String> {
        let words = |slices: &Vec<Slice>| format!("{}, {} images", slices[0].title(), slices.len());
        self.rest.iter().map(words).collect()
    }
}

/// Returns the phase stated by all images of a series, or else by its description.
fn percent_of(slices: &[Slice]) -> Option<f64> {
    let own = slices[0].percent;
    let alike = slices.iter().all(|slice| slice.percent == own);
    let percent = own.filter(|_| alike);
    let percent = percent.or_else(|| in_words(&slices[0].description))?;
    (0.0..=100.0).contains(&percent).then_some(percent % 100.0)
}

/// Divides the images of one series by phase; returns them all as `Err` if no phase is stated.
fn divided(slices: Vec<Slice>) -> Result<Vec<(f64, Vec<Slice>)>, Vec<Slice>> {
    type Key = fn(&Slice) -> Option<f64>;
    let keys: [Key; 3] = [|s| s.percent, |s| s.temporal, |s| s.trigger_ms];
    for (number, key) in keys.into_iter().enumerate() {
        let mut values: Vec<f64> = slices.iter().filter_map(key).collect();
        if values.len() < slices.len() {
            continue;
        }
        values.sort_by(f64::total_cmp);
        values.dedup();
        if values.len() < 2 {
            continue;
        }
        let mut parts: Vec<(f64, Vec<Slice>)> = (0..values.len())
            .map(|bin| match number {
                0 => (values[bin] % 100.0, Vec::new()),
                _ => (100.0 * bin as f64 / values.len() as f64, Vec::new()),
            })
            .collect();
        for slice in slices {
            let value = key(&slice).unwrap_or_default();
            let bin = values.partition_point(|&v| v < value);
            parts[bin].1.push(slice);
        }
        return Ok(parts);
    }
    match percent_of(&slices) {
        Some(percent) => Ok(vec![(percent, slices)]),
        None => Err(slices),
    }
}

/// Extracts the percentage from a series description: a number before `%`, or an integer after `T`,
/// `T=` or `phase`.
pub(super) fn in_words(text: &str) -> Option<f64> {
    let digit = |c: char| c.is_ascii_digit();
    if let Some((before, _)) = text.split_once('%') {
        let before = before.trim_end();
        let from = before
            .rfind(|c: char| !digit(c) && c != '.')
            .map_or(0, |at| {
                at + before[at..].chars().next().map_or(1, char::len_utf8)
            });
        return before[from..].parse().ok();
    }
    let lower = text.to_ascii_lowercase();
    for mark in ["phase", "t"] {
        for (at, _) in lower.match_indices(mark) {
            let starts_a_word = !lower[..at].ends_with(|c: char| c.is_ascii_alphanumeric());
            let after = lower[at + mark.len()..].trim_start_matches([' ', '=', '_']);
            let end = after.find(|c| !digit(c)).unwrap_or(after.len());
            let whole = !after[end..].starts_with(|c: char| c.is_ascii_alphanumeric());
            if starts_a_word && whole && (1..=3).contains(&end) {
                return after[..end].parse().ok();
            }
        }
    }
    None
}
