//! Finds and reads the CT of one phase.

use super::slice::{Slice, slices};
use super::sorted::Sorted;
use super::stack::Stack;
use crate::volume::Volume;
use phasmid_core::error::{Error, Result};
use std::path::Path;

/// Tolerance for nominal percentages, in per cent.
const NOMINAL: f64 = 0.5;

/// Reads the CT of a phase, given in per cent of the cycle, from a folder and its subfolders, like
/// [`super::read_series`], and returns it with the series' title. A folder with one series is read
/// even if the series states no phase. A 4D-CT is divided as by [`Phases`](super::Phases), and the
/// series of the phase is read.
///
/// # Errors
/// Returns the errors of [`super::read_series`], and an error if there are several series without a
/// phase, if a 4D-CT lacks the phase, or if the images of a single series state another phase.
pub fn read_reference(folder: &Path, percent: f64) -> Result<(Volume, String)> {
    let sorted = Sorted::of(slices(folder)?)?;
    let slices = chosen(sorted, percent, folder)?;
    let title = slices[0].title();
    Ok((Stack::of(slices)?.volume()?, title))
}

fn chosen(mut sorted: Sorted, percent: f64, folder: &Path) -> Result<Vec<Slice>> {
    let meant = |at: f64| (at - percent).abs() <= NOMINAL;
    let left_out = sorted.left_out();
    match (&sorted.phases[..], &left_out[..]) {
        ([], [_]) => return Ok(sorted.rest.remove(0)),
        ([(at, slices)], []) => {
            // Only a percentage in the images is sure to refer to the cycle; a percentage in a series
            // description may have another meaning.
            let says = slices[0].percent.is_some();
            if says && !meant(*at) {
                return Err(Error::input(
                    slices[0].place(),
                    format!("phase {at} %: {}", slices[0].title()),
                    format!("phase {percent} %, the reference"),
                ));
            }
            return Ok(sorted.phases.remove(0).1);
        }
        ([], _) => {
            return Err(Error::input(
                folder.display(),
                format!("series without a phase: {}", left_out.join("; ")),
                "one series, or a 4D-CT whose series state their phases, as `T=50%` or similar",
            ));
        }
        _ => {}
    }
    if let Some(at) = sorted.phases.iter().position(|(at, _)| meant(*at)) {
        return Ok(sorted.phases.remove(at).1);
    }
    let all: Vec<String> = sorted.phases.iter().map(|(at, _)| at.to_string()).collect();
    let mut found = format!("phases {} %", all.join(", "));
    if !left_out.is_empty() {
        found += &format!(", and {}", left_out.join("; "));
    }
    let allowed = format!("phase {percent} %, the reference, among them");
    Err(Error::input(folder.display(), found, allowed))
}
