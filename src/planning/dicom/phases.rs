//! Which images are which phase of the breathing cycle.

use super::folder;
use super::slice::Slice;
use super::sorted::Sorted;
use super::stack::Stack;
use crate::volume::{Grid, Volume};
use phasmid_core::error::{Error, Result};
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
        let sorted = Sorted::of(folder::slices(folder)?)?;
        let left_out = sorted.left_out();
        if sorted.phases.len() < 2 {
            let found = match (sorted.phases.first(), &left_out[..]) {
                (Some((_, slices)), []) => format!("one phase, of series {}", slices[0].title()),
                (None, [_]) => "one series that says no phases".to_owned(),
                _ => format!("series without a phase: {}", left_out.join("; ")),
            };
            return Err(Error::input(
                folder.display(),
                found,
                "two or more phases: series described as `T=50%` or alike, or images with a \
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
