//! Detects frames that do not belong to their sequence, from the decoded maps.
//!
//! Where there is little light, noise makes fringe orders uncertain. Where there is much light,
//! fringes and codes contradict each other only if the frames do not match the sequence: steps in
//! another order, bits in another order, or more than one frame of another pattern.

use super::{AxisMap, Decoded, Verdict};
use phasmid_core::statistics::median;
use phasmid_pattern::Axis;
use std::fmt;

/// Fraction of the brighter pixels with uncertain order above which the frames are doubted. Valid
/// captures of the built-in profiles have up to 0.005 of all pixels; any order of a code's bits or a
/// set's steps that passes the checks of the frames has 0.15 or more.
const MOST_UNCERTAIN: f64 = 0.08;
/// Fraction of saturated pixels, among saturated and valid ones, above which the frames are doubted.
const MOST_SATURATED: f64 = 0.5;
/// Fraction of the lit pixels with a coordinate below which a note says so.
const LEAST_VALID: f64 = 0.9;
/// Minimum number of pixels for a decision.
const FEWEST: usize = 400;

/// A reason to doubt that frames belong to their sequence, or that their exposure was right. It displays
/// as a message for users.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Doubt {
    /// The fringe order is uncertain in many of the brighter pixels.
    UncertainOrder {
        /// The projector's axis.
        axis: Axis,
        /// Fraction of the brighter pixels, 0 to 1.
        share: f64,
    },
    /// More than half of the pixels are saturated.
    Saturated {
        /// Fraction of the saturated and valid pixels, 0 to 1.
        share: f64,
    },
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UncertainOrder { axis, share } => write!(
                f,
                "the order along {axis} is uncertain in {:.0} % of the brighter pixels: frames may be \
                 exchanged, or show patterns that the sequence does not have",
                100.0 * share
            ),
            Self::Saturated { share } => write!(
                f,
                "{:.0} % of the pixels are saturated: shorten the exposure, or lower the gain",
                100.0 * share
            ),
        }
    }
}

impl std::error::Error for Doubt {}

impl Decoded {
    /// Returns a reason to doubt the frames, or `None`. Call it on maps as returned by the decoder,
    /// before orders are unwrapped or single pixels filled.
    pub fn doubt(&self) -> Option<Doubt> {
        let of_light = || self.axes().find_map(|(_, map)| saturated(map));
        self.doubt_of_orders().or_else(of_light)
    }

    /// Like [`Self::doubt`], for fringe orders alone: ignores saturation, which a bright object in
    /// front of the camera may cause.
    pub fn doubt_of_orders(&self) -> Option<Doubt> {
        let mut axes = self.axes();
        axes.find_map(|(axis, map)| uncertain(axis, &map.verdict, &self.modulation))
    }
}

/// Says which part of the lit pixels has a coordinate, and why most of the others have none, if it is
/// small.
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
    Some(format!(
        "axis {axis}: only {:.0} % of the lit pixels have a coordinate; {} are rejected as {}",
        100.0 * valid as f64 / lit as f64,
        map.count(*most),
        most.name()
    ))
}

fn uncertain(axis: Axis, verdicts: &[Verdict], modulation: &[f32]) -> Option<Doubt> {
    let ordered =
        |(verdict, _): &(&Verdict, &f32)| matches!(verdict, Verdict::Valid | Verdict::Uncertain);
    let pixels = || verdicts.iter().zip(modulation).filter(ordered);
    let mut lights: Vec<f32> = pixels().map(|(_, light)| *light).collect();
    if lights.len() < FEWEST {
        return None;
    }
    let usual = median(&mut lights)?;
    let bright = || pixels().filter(|(_, light)| **light >= usual);
    let count = bright().filter(|(v, _)| **v == Verdict::Uncertain).count();
    let share = count as f64 / bright().count().max(1) as f64;
    (share > MOST_UNCERTAIN).then_some(Doubt::UncertainOrder { axis, share })
}

fn saturated(map: &AxisMap) -> Option<Doubt> {
    let saturated = map.count(Verdict::Saturated);
    let share = saturated as f64 / (saturated + map.count(Verdict::Valid)).max(1) as f64;
    (saturated >= FEWEST && share > MOST_SATURATED).then_some(Doubt::Saturated { share })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::AxisMap;

    /// Maps in which `of_hundred` of every 100 pixels have `verdict` and `modulation`; the others are
    /// valid with 50 DN.
    fn decoded(verdict: Verdict, of_hundred: usize, modulation: f32) -> Decoded {
        let is_other = |i: usize| i % 100 < of_hundred;
        let pixels = 0..10_000;
        let verdicts = pixels.clone().map(|i| match is_other(i) {
            true => verdict,
            false => Verdict::Valid,
        });
        let light = |i: usize| if is_other(i) { modulation } else { 50.0 };
        Decoded {
            x: Some(AxisMap {
                verdict: verdicts.collect(),
                ..AxisMap::default()
            }),
            modulation: pixels.map(light).collect(),
            ..Decoded::default()
        }
    }

    #[test]
    fn uncertain_orders_in_good_light_are_doubted() {
        let doubt = |of_hundred, light| decoded(Verdict::Uncertain, of_hundred, light).doubt();
        assert_eq!(doubt(5, 50.0), None);
        // Noise explains uncertain orders where there is little light.
        assert_eq!(doubt(40, 3.0), None);
        let why = doubt(15, 50.0).unwrap();
        assert!(matches!(why, Doubt::UncertainOrder { axis: Axis::X, .. }));
        assert_eq!(
            why.to_string(),
            "the order along x is uncertain in 15 % of the brighter pixels: frames may be exchanged, or \
             show patterns that the sequence does not have"
        );
    }

    #[test]
    fn a_loss_of_lit_pixels_is_noted() {
        let note = |verdict, of_hundred| {
            let decoded = decoded(verdict, of_hundred, 50.0);
            note_of_loss(Axis::X, decoded.x.as_ref().unwrap())
        };
        assert_eq!(note(Verdict::Mixed, 10), None);
        let why = note(Verdict::Mixed, 11).unwrap();
        assert!(
            why.contains("only 89 % of the lit pixels")
                && why.contains("1100 are rejected as mixed"),
            "{why}"
        );
        assert_eq!(note(Verdict::Dim, 50), None);
    }

    #[test]
    fn saturated_pixels_are_doubted_where_they_are_most() {
        assert_eq!(decoded(Verdict::Saturated, 40, 120.0).doubt(), None);
        let why = decoded(Verdict::Saturated, 97, 120.0).doubt().unwrap();
        let why = why.to_string();
        assert!(why.starts_with("97 % of the pixels are saturated"), "{why}");
        assert_eq!(decoded(Verdict::Dim, 97, 1.0).doubt(), None);
        assert_eq!(Decoded::default().doubt(), None);
    }
}
