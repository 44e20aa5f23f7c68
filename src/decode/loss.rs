//! A note about lit pixels without a coordinate.

use super::{AxisMap, Verdict};
use phasmid_pattern::Axis;

/// Minimum fraction of lit pixels with a coordinate; below it a note is written.
const LEAST_VALID: f64 = 0.9;
/// Minimum number of lit pixels for a note.
const FEWEST: usize = 400;

/// Returns a note with the fraction of lit pixels that have a coordinate, and the main reason for the
/// losses, if the fraction is small.
pub(super) fn note_of_loss(axis: Axis, map: &AxisMap) -> Option<String> {
    let lit = map.verdict.len() - map.count(Verdict::Dim);
    let valid = map.count(Verdict::Valid);
    if lit < FEWEST || valid as f64 >= LEAST_VALID * lit as f64 {
        return None;
    }
    let lost = |verdict: &&Verdict| !matches!(verdict, Verdict::Valid | Verdict::Dim);
    let most = Verdict::ALL
        .iter()
        .filter(lost)
        .max_by_key(|v| map.count(**v))?;
    let advice = match most {
        Verdict::Saturated => ": shorten the exposure, or lower the gain",
        _ => "",
    };
    Some(format!(
        "axis {axis}: only {:.0} % of the lit pixels have a coordinate; {} are rejected as {}{advice}",
        100.0 * valid as f64 / lit as f64,
        map.count(*most),
        most.name()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loss_of_lit_pixels_is_noted() {
        let note = |verdict, of_hundred| {
            let verdicts = (0..10_000).map(|i| match i % 100 < of_hundred {
                true => verdict,
                false => Verdict::Valid,
            });
            let map = AxisMap {
                verdict: verdicts.collect(),
                ..AxisMap::default()
            };
            note_of_loss(Axis::X, &map)
        };
        assert_eq!(note(Verdict::Mixed, 10), None);
        let why = note(Verdict::Mixed, 11).unwrap();
        assert!(
            why.contains("only 89 % of the lit pixels")
                && why.ends_with("1100 are rejected as mixed"),
            "{why}"
        );
        assert_eq!(note(Verdict::Dim, 50), None);
        let why = note(Verdict::Saturated, 97).unwrap();
        assert!(
            why.ends_with("saturated: shorten the exposure, or lower the gain"),
            "{why}"
        );
    }
}
