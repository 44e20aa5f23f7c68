//! Which images are which phase of the breathing cycle.

use super::folder;
use super::slice::Slice;
use super::stack::Stack;
use crate::error::{Error, Result};
use crate::patient::volume::{Grid, Volume};
use std::collections::BTreeMap;
use std::path::Path;

/// The phases of a 4D-CT, looked at but not yet in memory.
#[derive(Debug)]
pub struct Phases {
    phases: Vec<(f64, Stack)>,
    left_out: Vec<String>,
}

impl Phases {
    /// Looks at the 4D-CT in a folder and the folders in it.
    ///
    /// Several series are a phase each, by their images' nominal percentage (0020,9245 or
    /// 0020,9241), else by their descriptions: `50%`, `T=50`, `T50` or `phase 50`; 100 % is 0 %. A
    /// series that says no phase (an average, a maximum) is left out, see [`Phases::left_out`]. One
    /// series is divided by nominal percentage, else temporal position (0020,0100), else trigger
    /// time (0018,1060), which are taken for the order of bins of equal width.
    ///
    /// # Errors
    /// As for [`super::read_series`], for each phase; fewer than two phases, two of one percentage,
    /// phases whose grids or frames of reference are not the same.
    pub fn open(folder: &Path) -> Result<Self> {
        let mut series: BTreeMap<String, Vec<Slice>> = BTreeMap::new();
        for slice in folder::slices(folder)? {
            series.entry(slice.series.clone()).or_default().push(slice);
        }
        let mut left_out = Vec::new();
        let mut parts = Vec::new();
        let alone = series.len() == 1;
        for (_, slices) in series {
            if alone {
                parts = divided(slices);
            } else if let Some(percent) = percent_of(&slices) {
                parts.push((percent, slices));
            } else {
                let count = slices.len();
                left_out.push(format!("{}, {count} images", slices[0].title()));
            }
        }
        if parts.len() < 2 {
            let found = match (parts.first(), left_out.is_empty()) {
                (_, false) => format!("series without a phase: {}", left_out.join("; ")),
                (Some((_, slices)), _) => format!("one phase, of series {}", slices[0].title()),
                (None, _) => "one series that says no phases".to_owned(),
            };
            return Err(Error::input(
                folder.display(),
                found,
                "two or more phases: series described as `T=50%` or alike, or images with a \
                 nominal percentage, temporal position or trigger time",
            ));
        }
        parts.sort_by(|a, b| a.0.total_cmp(&b.0));
        if let Some(pair) = parts.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            let (a, b) = (&pair[0].1[0], &pair[1].1[0]);
            return Err(Error::input(
                b.place(),
                format!("a second phase at {} %: {}", pair[1].0, b.title()),
                format!("one; {} has {}", a.place(), a.title()),
            ));
        }
        let phases: Vec<(f64, Stack)> = parts
            .into_iter()
            .map(|(percent, slices)| Ok((percent, Stack::of(slices)?)))
            .collect::<Result<_>>()?;
        matching(&phases)?;
        Ok(Self { phases, left_out })
    }

    /// The phases' places in the cycle, in per cent, ascending from 0.
    pub fn percents(&self) -> impl Iterator<Item = f64> {
        self.phases.iter().map(|(percent, _)| *percent)
    }

    /// The grid that all have.
    pub fn grid(&self) -> &Grid {
        &self.phases[0].1.grid
    }

    /// Series that say no phase, by their descriptions.
    pub fn left_out(&self) -> &[String] {
        &self.left_out
    }

    /// Reads a phase, in the order of [`Phases::percents`], in Hounsfield units as
    /// [`super::read_series`] has them.
    ///
    /// # Errors
    /// What the system refuses, and files that have changed.
    ///
    /// # Panics
    /// Where there is no phase of that number.
    pub fn volume(&self, phase: usize) -> Result<Volume> {
        self.phases[phase].1.volume()
    }
}

/// Refuses phases that do not lie in the same voxels of the same patient.
fn matching(phases: &[(f64, Stack)]) -> Result<()> {
    let (first_percent, first) = &phases[0];
    for (percent, stack) in &phases[1..] {
        let (a, b) = (&first.slices[0], &stack.slices[0]);
        let differs = |here: String, there: String| {
            let place = format!("{}: phase {percent} %", b.place());
            let allowed = format!("as phase {first_percent} % of {}: {there}", a.place());
            Err(Error::input(place, here, allowed))
        };
        if a.patient != b.patient {
            let words = |s: &Slice| format!("patient {}", s.patient);
            return differs(words(b), words(a));
        }
        if a.frame != b.frame {
            let words = |s: &Slice| format!("frame of reference {}", s.frame);
            return differs(words(b), words(a));
        }
        if let Some((here, there)) = stack.grid.difference(&first.grid) {
            return differs(here, there);
        }
    }
    Ok(())
}

/// What all images of a series say of their phase, or what its name does.
fn percent_of(slices: &[Slice]) -> Option<f64> {
    let own = slices[0].percent;
    let alike = slices.iter().all(|slice| slice.percent == own);
    let percent = own.filter(|_| alike);
    let percent = percent.or_else(|| in_words(&slices[0].description))?;
    (0.0..=100.0).contains(&percent).then_some(percent % 100.0)
}

/// One series' images by phase.
fn divided(slices: Vec<Slice>) -> Vec<(f64, Vec<Slice>)> {
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
        return parts;
    }
    let percent = percent_of(&slices);
    percent
        .map(|percent| (percent, slices))
        .into_iter()
        .collect()
}

/// The percentage in a series' description: a number before `%`, or whole per cent after `T`, `T=` or
/// `phase`.
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
