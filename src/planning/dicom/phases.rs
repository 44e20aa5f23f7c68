//! The phases of a 4D-CT.

use super::slice::{Slice, slices};
use super::sorted::Sorted;
use super::stack::Stack;
use crate::volume::{Grid, Volume};
use phasmid_core::error::{Error, Result};
use std::path::Path;

/// The phases of a 4D-CT, with headers read but pixels not loaded.
#[derive(Debug)]
pub struct Phases {
    phases: Vec<(f64, Stack)>,
    left_out: Vec<String>,
}

impl Phases {
    /// Reads the headers of the 4D-CT in a folder and its subfolders.
    ///
    /// If there are several series, each is one phase, given by its images' nominal percentage
    /// (0020,9245 or 0020,9241), else by its description: `50%`, `T=50`, `T50` or `phase 50`; 100 %
    /// counts as 0 %. A series without a phase (an average or maximum) is left out, see
    /// [`Phases::left_out`]. A single series is divided by nominal percentage, else by temporal
    /// position (0020,0100), else by trigger time (0018,1060); the last two are taken as the order
    /// of bins of equal width.
    ///
    /// # Errors
    /// Returns the errors of [`super::read_series`] for each phase, and an error if there are fewer
    /// than two phases, two with the same percentage, or phases with different grids or frames of
    /// reference.
    pub fn open(folder: &Path) -> Result<Self> {
        let sorted = Sorted::of(slices(folder)?)?;
        let left_out = sorted.left_out();
        if sorted.phases.len() < 2 {
            let found = match (sorted.phases.first(), &left_out[..]) {
                (Some((_, slices)), []) => format!("one phase, of series {}", slices[0].title()),
                (None, [_]) => "one series without phases".to_owned(),
                _ => format!("series without a phase: {}", left_out.join("; ")),
            };
            return Err(Error::input(
                folder.display(),
                found,
                "two or more phases: series described as `T=50%` or similar, or images with a \
                 nominal percentage, temporal position or trigger time",
            ));
        }
        let phases: Vec<(f64, Stack)> = sorted
            .phases
            .into_iter()
            .map(|(percent, slices)| Ok((percent, Stack::of(slices)?)))
            .collect::<Result<_>>()?;
        matching(&phases)?;
        Ok(Self { phases, left_out })
    }

    /// Returns the positions of the phases in the cycle, in per cent, ascending from 0.
    pub fn percents(&self) -> impl Iterator<Item = f64> {
        self.phases.iter().map(|(percent, _)| *percent)
    }

    /// Returns the grid common to all phases.
    pub fn grid(&self) -> &Grid {
        &self.phases[0].1.grid
    }

    /// Returns the descriptions of the series without a phase.
    pub fn left_out(&self) -> &[String] {
        &self.left_out
    }

    /// Reads a phase, indexed as in [`Phases::percents`], in Hounsfield units as by
    /// [`super::read_series`].
    ///
    /// # Errors
    /// Returns an error if a file cannot be read or has changed.
    ///
    /// # Panics
    /// Panics if the index is out of range.
    pub fn volume(&self, phase: usize) -> Result<Volume> {
        self.phases[phase].1.volume()
    }
}

/// Rejects phases that differ in grid, patient or frame of reference.
fn matching(phases: &[(f64, Stack)]) -> Result<()> {
    let (first_percent, first) = &phases[0];
    for (percent, stack) in &phases[1..] {
        let (a, b) = (&first.slices[0], &stack.slices[0]);
        let differs = |here: String, there: String| {
            let place = format!("{}: phase {percent} %", b.place());
            let allowed = format!("{there}, as in phase {first_percent} % of {}", a.place());
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
