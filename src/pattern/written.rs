//! Patterns as a manifest or a profile writes them: one by one, or in sets that stand for several
//! patterns.

use super::manifest::MAX_FRAMES;
use super::{Axis, ManifestFrame, Pattern};
use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::path::PathBuf;

/// Maximum number of steps of a fringe set; published methods use up to 64.
const MAX_STEPS: u32 = 128;
/// Maximum number of bits of a Gray code.
const MAX_BITS: u32 = 20;

/// A pattern, or a set of them.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Written {
    /// A sinusoidal fringe.
    Fringe {
        /// Axis of variation.
        axis: Axis,
        /// Period in projector pixels, above 2.
        period_px: f64,
        /// Phase in radians at pixel index 0.
        phase_rad: f64,
    },
    /// One bit of a Gray code.
    Gray {
        /// Axis of variation.
        axis: Axis,
        /// Width of a code cell in projector pixels.
        cell_px: f64,
        /// Number of bits of the complete code.
        bits: u32,
        /// Index of the bit shown; 0 is the least significant.
        bit: u32,
        /// Whether the bit is shown inverted.
        #[serde(default)]
        inverted: bool,
    },
    /// Uniform, full brightness.
    White {},
    /// Uniform, zero brightness.
    Black {},
    /// An image file, shown pixel for pixel.
    Image {
        /// Path, relative to the file that contains this entry.
        file: PathBuf,
    },
    /// Fringes whose phases are equally spaced over one turn.
    FringeSet {
        /// Axis of variation.
        axis: Axis,
        /// Period in projector pixels, above 2.
        period_px: f64,
        /// Number of fringes, 3 or more.
        steps: u32,
        /// Phase in radians of the first fringe at pixel index 0; each of the others has 2 pi / steps
        /// more than the one before it.
        #[serde(default)]
        phase_rad: f64,
    },
    /// All bits of a Gray code, the most significant first.
    GraySet {
        /// Axis of variation.
        axis: Axis,
        /// Width of a code cell in projector pixels.
        cell_px: f64,
        /// Number of bits.
        bits: u32,
        /// Whether each bit is followed by its inverse.
        #[serde(default)]
        inverted: bool,
        /// Whether the finest bit of the code with cells half as wide follows; it determines the order
        /// where two cells meet.
        #[serde(default)]
        half_cell: bool,
    },
}

/// The patterns of one entry.
#[derive(Deserialize)]
#[serde(try_from = "Written")]
pub(crate) struct Patterns(Vec<Pattern>);

impl TryFrom<Patterns> for Pattern {
    type Error = String;

    fn try_from(Patterns(mut patterns): Patterns) -> Result<Self, String> {
        match (patterns.pop(), patterns.is_empty()) {
            (Some(pattern), true) => Ok(pattern),
            _ => Err("a set of patterns; expected one pattern".to_owned()),
        }
    }
}

/// An entry of a list of frames.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Photograph, relative to the folder of the frames; not for a set.
    #[serde(default)]
    file: Option<PathBuf>,
    /// The projected pattern, or a set of patterns, each of which becomes a frame.
    #[cfg_attr(feature = "schema", schemars(with = "Written"))]
    pattern: Patterns,
}

#[derive(Deserialize)]
#[serde(try_from = "Entry")]
struct EntryFrames(Vec<ManifestFrame>);

/// Deserialises a list of frames; a set becomes a frame for each of its patterns.
///
/// # Errors
/// Returns an error for a value out of range, for a set of several patterns with one file, and for more
/// than [`MAX_FRAMES`] frames, which are not expanded.
pub fn frames<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<ManifestFrame>, D::Error> {
    from.deserialize_seq(Frames)
}

struct Frames;

impl<'de> Visitor<'de> for Frames {
    type Value = Vec<ManifestFrame>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list: [[...]] for tables, [...] for values")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let mut frames = Vec::new();
        while let Some(EntryFrames(entry)) = list.next_element()? {
            if frames.len() + entry.len() > MAX_FRAMES {
                return Err(A::Error::custom(format!(
                    "more than {MAX_FRAMES} frames; expected 1 to {MAX_FRAMES} frames"
                )));
            }
            frames.extend(entry);
        }
        Ok(frames)
    }
}

impl TryFrom<Entry> for EntryFrames {
    type Error = String;

    fn try_from(entry: Entry) -> Result<Self, String> {
        let Patterns(patterns) = entry.pattern;
        if let Some(file) = entry.file.as_ref().filter(|_| patterns.len() > 1) {
            let count = patterns.len();
            return Err(format!(
                "file {file:?} for a set of {count} patterns; expected a frame with its own file for each of them"
            ));
        }
        let frame = |pattern| ManifestFrame {
            file: entry.file.clone(),
            pattern,
        };
        Ok(Self(patterns.into_iter().map(frame).collect()))
    }
}

impl TryFrom<Written> for Patterns {
    type Error = String;

    fn try_from(written: Written) -> Result<Self, String> {
        let patterns = match written {
            Written::Fringe {
                axis,
                period_px,
                phase_rad,
            } => {
                vec![Pattern::Fringe {
                    axis,
                    period_px,
                    phase_rad,
                }]
            }
            Written::Gray {
                axis,
                cell_px,
                bits,
                bit,
                inverted,
            } => {
                vec![Pattern::Gray {
                    axis,
                    cell_px,
                    bits,
                    bit,
                    inverted,
                }]
            }
            Written::White {} => vec![Pattern::White {}],
            Written::Black {} => vec![Pattern::Black {}],
            Written::Image { file } => vec![Pattern::Image { file }],
            Written::FringeSet {
                axis,
                period_px,
                steps,
                phase_rad,
            } => {
                if !(3..=MAX_STEPS).contains(&steps) {
                    return Err(format!("steps = {steps}; expected 3 to {MAX_STEPS}"));
                }
                Pattern::fringe_set(axis, period_px, steps, phase_rad)
            }
            Written::GraySet {
                axis,
                cell_px,
                bits,
                inverted,
                half_cell,
            } => {
                let finer = u32::from(half_cell);
                if !(1..=MAX_BITS - finer).contains(&bits) {
                    let most = MAX_BITS - finer;
                    return Err(format!("bits = {bits}; expected 1 to {most}"));
                }
                Pattern::gray_set(axis, cell_px, bits, half_cell, inverted)
            }
        };
        match patterns.iter().try_for_each(check) {
            Ok(()) => Ok(Self(patterns)),
            Err((name, found, expected)) => Err(format!("{name} = {found}; expected {expected}")),
        }
    }
}

/// Checks one pattern; an error consists of the field's name, the value found and the allowed values.
fn check(pattern: &Pattern) -> Result<(), (&'static str, String, String)> {
    let refuse = |name, found: &dyn std::fmt::Display, allowed: &str| {
        Err((name, found.to_string(), allowed.to_string()))
    };
    match pattern {
        Pattern::Fringe {
            period_px,
            phase_rad,
            ..
        } => {
            if !(period_px.is_finite() && *period_px > 2.0 && *period_px <= 1e6) {
                return refuse("period_px", period_px, "above 2, up to 1e6");
            }
            if !(phase_rad.is_finite() && phase_rad.abs() <= 1e4) {
                return refuse("phase_rad", phase_rad, "-1e4 to 1e4");
            }
        }
        Pattern::Gray {
            cell_px, bits, bit, ..
        } => {
            if !(cell_px.is_finite() && (1.0..=1e6).contains(cell_px)) {
                return refuse("cell_px", cell_px, "1 to 1e6");
            }
            if !(1..=MAX_BITS).contains(bits) {
                return refuse("bits", bits, &format!("1 to {MAX_BITS}"));
            }
            if bit >= bits {
                return refuse("bit", bit, &format!("0 to bits - 1 = {}", bits - 1));
            }
        }
        Pattern::Image { file } => {
            if file.as_os_str().is_empty() {
                return refuse("file", &"an empty path", "the path of an image");
            }
        }
        Pattern::White {} | Pattern::Black {} => {}
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::{Manifest, Pattern};

    fn manifest(frames: &str) -> Result<Manifest, String> {
        let head = "[projector]\nwidth_px = 640\nheight_px = 480\n";
        Manifest::parse(&format!("{frames}\n{head}"), "m.toml").map_err(|e| e.to_string())
    }

    #[test]
    fn sets_stand_for_their_patterns_in_order() {
        let sets = manifest(
            "frame = [
  { pattern = { kind = \"fringe-set\", axis = \"x\", period_px = 16, steps = 4 } },
  { pattern = { kind = \"gray-set\", axis = \"y\", cell_px = 16, bits = 2, half_cell = true } },
  { pattern = { kind = \"gray-set\", axis = \"x\", cell_px = 8, bits = 1, inverted = true } },
  { pattern = { kind = \"white\" } },
]",
        );
        let single = manifest(
            "frame = [
  { pattern = { kind = \"fringe\", axis = \"x\", period_px = 16, phase_rad = 0 } },
  { pattern = { kind = \"fringe\", axis = \"x\", period_px = 16, phase_rad = 1.5707963267948966 } },
  { pattern = { kind = \"fringe\", axis = \"x\", period_px = 16, phase_rad = 3.141592653589793 } },
  { pattern = { kind = \"fringe\", axis = \"x\", period_px = 16, phase_rad = 4.71238898038469 } },
  { pattern = { kind = \"gray\", axis = \"y\", cell_px = 16, bits = 2, bit = 1 } },
  { pattern = { kind = \"gray\", axis = \"y\", cell_px = 16, bits = 2, bit = 0 } },
  { pattern = { kind = \"gray\", axis = \"y\", cell_px = 8, bits = 3, bit = 0 } },
  { pattern = { kind = \"gray\", axis = \"x\", cell_px = 8, bits = 1, bit = 0 } },
  { pattern = { kind = \"gray\", axis = \"x\", cell_px = 8, bits = 1, bit = 0, inverted = true } },
  { pattern = { kind = \"white\" } },
]",
        );
        let (sets, single) = (sets.unwrap(), single.unwrap());
        assert_eq!(sets, single);
        // A written manifest lists each frame.
        let text = sets.to_toml();
        assert_eq!(Manifest::parse(&text, "again").unwrap(), single);
    }

    #[test]
    fn the_first_phase_of_a_set_is_added_to_all() {
        let set = "frame = [{ pattern = { kind = \"fringe-set\", axis = \"x\", period_px = 9, steps = 3, phase_rad = 0.5 } }]";
        let phases: Vec<f64> = manifest(set)
            .unwrap()
            .frame
            .iter()
            .map(|frame| match frame.pattern {
                Pattern::Fringe { phase_rad, .. } => phase_rad,
                _ => f64::NAN,
            })
            .collect();
        let third = std::f64::consts::TAU / 3.0;
        for (found, expected) in phases.iter().zip([0.5, 0.5 + third, 0.5 + 2.0 * third]) {
            assert!((found - expected).abs() < 1e-15, "{phases:?}");
        }
    }

    #[test]
    fn wrong_sets_are_named_with_their_lines() {
        let wrong = manifest(
            "[[frame]]
pattern = { kind = \"fringe-set\", axis = \"x\", period_px = 16, steps = 4000000000 }
[[frame]]
pattern = { kind = \"gray-set\", axis = \"x\", cell_px = 16, bits = 20, half_cell = true }
[[frame]]
pattern = { kind = \"fringe-set\", axis = \"x\", period_px = nan, steps = 4 }
",
        );
        let message = wrong.unwrap_err();
        for part in [
            "m.toml:2: frame[0].pattern: steps = 4000000000; expected 3 to 128",
            "m.toml:4: frame[1].pattern: bits = 20; expected 1 to 19",
            "m.toml:6: frame[2].pattern: period_px = NaN; expected above 2",
        ] {
            assert!(message.contains(part), "{part} not in: {message}");
        }
        let set = "pattern = { kind = \"fringe-set\", axis = \"x\", period_px = 16, steps = 4 }";
        let message = manifest(&format!("[[frame]]\nfile = \"one.png\"\n{set}\n")).unwrap_err();
        assert!(
            message.contains("\"one.png\" for a set of 4 patterns"),
            "{message}"
        );
    }

    #[test]
    fn many_sets_are_refused_before_they_are_expanded() {
        let set =
            "{ pattern = { kind = \"fringe-set\", axis = \"x\", period_px = 16, steps = 128 } },";
        let sets = |count: usize| manifest(&format!("frame = [{}]", set.repeat(count)));
        assert_eq!(sets(32).unwrap().frame.len(), 4096);
        let expected = "m.toml:1: frame: more than 4096 frames; expected 1 to 4096 frames";
        for count in [33, 50_000] {
            assert_eq!(sets(count).unwrap_err(), expected);
        }
    }
}
