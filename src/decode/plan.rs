//! Plans how to decode a sequence, axis by axis, or reports what the sequence lacks.
//!
//! Collects the fringes and Gray bits of each axis from a sequence in any order, then decides how the
//! fringe order is determined.

use super::gray::{self, GrayCode, GrayFrame, Threshold};
use super::steps::FringeSet;
use phasmid_core::error::{Error, Result};
use phasmid_pattern::{Axis, Manifest, Pattern};

/// Maximum number of periods along one axis, to limit the search among candidates.
const MAX_SETS: usize = 16;
/// Two positions are indistinguishable if their wrapped coordinates differ by less than this fraction
/// of every period.
const SAME_PHASE: f64 = 0.002;

/// How the fringe order (number of whole periods) is determined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Order {
    /// Not determined: coordinates are modulo this period, in projector pixels.
    Wrapped {
        /// Period in projector pixels.
        period_px: f64,
    },
    /// By the combination of all fringe sets, and by Gray code if the sets' combination repeats within
    /// the axis.
    Resolved {
        /// Distance after which all fringe sets repeat, in projector pixels; infinite if beyond the
        /// axis.
        repeat_px: f64,
    },
    /// By Gray code without fringes: the coordinate is the centre of a cell.
    Cells,
}

/// How one axis is decoded.
#[derive(Debug, Clone)]
pub struct AxisPlan {
    /// The projector's axis.
    pub axis: Axis,
    /// Number of projector pixels along the axis.
    pub extent_px: f64,
    /// Fringe sets, finest period first.
    pub sets: Vec<FringeSet>,
    /// Gray code, if used.
    pub gray: Option<GrayCode>,
    /// How the fringe order is determined.
    pub order: Order,
    /// Threshold of each Gray bit, in the order of the code's bits.
    pub(super) thresholds: Vec<Threshold>,
}

/// How a sequence is decoded.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The axes that the sequence encodes, x before y.
    pub axes: Vec<AxisPlan>,
    /// Index of the white frame.
    pub white: Option<usize>,
    /// Index of the black frame.
    pub black: Option<usize>,
    /// Number of frames in the sequence.
    pub frames: usize,
    /// Notes for the user about the sequence, such as frames that are not needed.
    pub notes: Vec<String>,
    used: Vec<bool>,
}

impl Plan {
    /// Plans the decoding of a manifest's sequence.
    ///
    /// # Errors
    /// Returns an error that names what is missing if the sequence determines no coordinate.
    pub fn new(manifest: &Manifest) -> Result<Self> {
        let patterns = || manifest.frame.iter().map(|f| &f.pattern).enumerate();
        let white = patterns().find_map(|(i, p)| matches!(p, Pattern::White {}).then_some(i));
        let black = patterns().find_map(|(i, p)| matches!(p, Pattern::Black {}).then_some(i));
        let references = white.is_some() && black.is_some();
        let mut notes = Vec::new();
        let mut axes = Vec::new();
        for (axis, extent) in [
            (Axis::X, manifest.projector.width_px),
            (Axis::Y, manifest.projector.height_px),
        ] {
            let plan = plan_axis(axis, f64::from(extent), manifest, references, &mut notes)?;
            axes.extend(plan);
        }
        if axes.is_empty() {
            return Err(Error::input(
                "sequence",
                "neither fringes nor Gray code",
                "fringes of 3 or more steps, or a Gray code, along x or y",
            ));
        }
        let mut used = vec![false; manifest.frame.len()];
        for axis in &axes {
            for &i in axis.sets.iter().flat_map(|s| &s.frames) {
                used[i] = true;
            }
            for bit in axis.gray.iter().flat_map(|g| &g.bits) {
                for i in [bit.plain, bit.inverse].into_iter().flatten() {
                    used[i] = true;
                }
            }
        }
        for i in [white, black].into_iter().flatten() {
            used[i] = true;
        }
        Ok(Self {
            axes,
            white,
            black,
            frames: manifest.frame.len(),
            notes,
            used,
        })
    }

    /// Returns whether frame `i` of the sequence is needed.
    pub fn uses(&self, i: usize) -> bool {
        self.used.get(i).copied().unwrap_or(false)
    }

    /// Returns the plan of an axis, if encoded.
    pub fn axis(&self, axis: Axis) -> Option<&AxisPlan> {
        self.axes.iter().find(|a| a.axis == axis)
    }

    /// Indices of the white and black frames, if both exist.
    pub(super) fn references(&self) -> Option<(usize, usize)> {
        self.white.zip(self.black)
    }
}

/// Plans one axis; `None` if the sequence does not encode it.
fn plan_axis(
    axis: Axis,
    extent_px: f64,
    manifest: &Manifest,
    references: bool,
    notes: &mut Vec<String>,
) -> Result<Option<AxisPlan>> {
    let sets = fringe_sets(axis, manifest)?;
    let gray_frames: Vec<GrayFrame> = manifest
        .frame
        .iter()
        .enumerate()
        .filter_map(|(frame, f)| match f.pattern {
            Pattern::Gray {
                axis: a,
                cell_px,
                bit,
                inverted,
                ..
            } if a == axis => Some(GrayFrame {
                frame,
                cell_px,
                bit,
                inverted,
            }),
            _ => None,
        })
        .collect();
    if sets.is_empty() && gray_frames.is_empty() {
        return Ok(None);
    }
    let found = gray::find(axis, extent_px, &gray_frames);
    let (gray, order) = resolve(axis, extent_px, &sets, &found)?;
    if let (Some(missing), true) = (&found.missing, gray.is_some() || !sets.is_empty()) {
        notes.push(format!("{missing} is missing; decoded without it"));
    }
    let thresholds = gray.iter().flat_map(|g| &g.bits);
    let thresholds = thresholds
        .map(|&bit| gray::threshold(axis, bit, references, !sets.is_empty()))
        .collect::<Result<Vec<_>>>()?;
    Ok(Some(AxisPlan {
        axis,
        extent_px,
        sets,
        gray,
        order,
        thresholds,
    }))
}

/// The fringe sets of an axis, finest period first.
fn fringe_sets(axis: Axis, manifest: &Manifest) -> Result<Vec<FringeSet>> {
    let mut groups: Vec<(f64, Vec<usize>, Vec<f64>)> = Vec::new();
    for (i, frame) in manifest.frame.iter().enumerate() {
        let Pattern::Fringe {
            axis: a,
            period_px,
            phase_rad,
        } = frame.pattern
        else {
            continue;
        };
        if a != axis {
            continue;
        }
        let near = groups
            .iter()
            .position(|g| (g.0 / period_px - 1.0).abs() < 1e-6);
        let at = near.unwrap_or_else(|| {
            groups.push((period_px, Vec::new(), Vec::new()));
            groups.len() - 1
        });
        groups[at].1.push(i);
        groups[at].2.push(phase_rad);
    }
    if groups.len() > MAX_SETS {
        return Err(Error::input(
            format!("sequence, axis {axis}"),
            format!("fringes of {} periods", groups.len()),
            format!("up to {MAX_SETS} periods per axis"),
        ));
    }
    groups.sort_by(|a, b| a.0.total_cmp(&b.0));
    groups
        .into_iter()
        .map(|(period, frames, phases)| {
            let place = format!("sequence, axis {axis}, fringes of period {period} px");
            FringeSet::new(&place, period, frames, phases)
        })
        .collect()
}

/// The shortest shift below `extent_px` that leaves all fringe sets unchanged; infinite if there is
/// none.
fn repeat_px(sets: &[FringeSet], extent_px: f64) -> f64 {
    let Some(finest) = sets.first() else {
        return f64::INFINITY;
    };
    let mut k = 1.0;
    while k * finest.period_px < extent_px {
        let shift = k * finest.period_px;
        let unseen = sets.iter().all(|set| {
            let turns = shift / set.period_px;
            (turns - turns.round()).abs() < SAME_PHASE
        });
        if unseen {
            return shift;
        }
        k += 1.0;
    }
    f64::INFINITY
}

/// Chooses how the fringe order of an axis is found, and the Gray code needed for it.
fn resolve(
    axis: Axis,
    extent_px: f64,
    sets: &[FringeSet],
    found: &gray::Found,
) -> Result<(Option<GrayCode>, Order)> {
    let place = format!("sequence, axis {axis}");
    let incomplete = |missing: &str| {
        Error::input(
            &place,
            format!("{missing} is missing"),
            format!("every bit from a cell up to the projector's {extent_px} px"),
        )
    };
    let missing = found.missing.as_deref();
    if sets.is_empty() {
        return match (&found.code, missing) {
            (Some(code), None) => Ok((Some(code.clone()), Order::Cells)),
            (_, missing) => Err(incomplete(missing.unwrap_or("a Gray bit"))),
        };
    }
    let repeat = repeat_px(sets, extent_px);
    let resolved = Order::Resolved { repeat_px: repeat };
    if let Some(code) = &found.code
        && code.cell_px <= repeat * (1.0 + 1e-6)
    {
        return Ok((Some(code.clone()), resolved));
    }
    if repeat.is_infinite() {
        return Ok((None, resolved));
    }
    if let Some(missing) = missing {
        return Err(incomplete(missing));
    }
    let periods: Vec<String> = sets.iter().map(|s| s.period_px.to_string()).collect();
    let periods = periods.join(" and ");
    if let Some(code) = &found.code {
        return Err(Error::input(
            place,
            format!(
                "Gray cells of {} px, wider than the {repeat:.6} px after which the fringes of \
                 period {periods} px repeat",
                code.cell_px
            ),
            format!("Gray cells of at most {repeat:.6} px, or one more period"),
        ));
    }
    if sets.len() > 1 {
        return Err(Error::input(
            place,
            format!(
                "fringes of period {periods} px repeat after {repeat:.6} px of {extent_px} px, and \
                 there is no Gray code"
            ),
            format!("a Gray code with cells of at most {repeat:.6} px, or one more period"),
        ));
    }
    let period_px = sets[0].period_px;
    Ok((None, Order::Wrapped { period_px }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn manifest(frames: &[(&str, f64, f64)]) -> Manifest {
        // Each entry of `frames`: (kind and axis, period or cell, phase or bit).
        let mut text = "[projector]\nwidth_px = 1920\nheight_px = 1080\n".to_owned();
        for (kind, a, b) in frames {
            let (kind, axis) = kind.split_once(' ').unwrap_or((kind, ""));
            let pattern = match kind {
                "fringe" => {
                    format!(
                        "kind = \"fringe\", axis = \"{axis}\", period_px = {a}, phase_rad = {b}"
                    )
                }
                "gray" => {
                    format!(
                        "kind = \"gray\", axis = \"{axis}\", cell_px = {a}, bits = 8, bit = {b}"
                    )
                }
                other => format!("kind = \"{other}\""),
            };
            text += &format!("[[frame]]\npattern = {{ {pattern} }}\n");
        }
        Manifest::parse(&text, "t").unwrap()
    }

    fn steps(period: f64, n: u32) -> Vec<(&'static str, f64, f64)> {
        (0..n)
            .map(|i| {
                (
                    "fringe x",
                    period,
                    f64::from(i) * std::f64::consts::TAU / f64::from(n),
                )
            })
            .collect()
    }

    fn error(frames: &[(&'static str, f64, f64)]) -> String {
        Plan::new(&manifest(frames)).unwrap_err().to_string()
    }

    #[test]
    fn errors_name_the_missing_patterns() {
        let gray = |skip: f64| {
            (0..7)
                .map(f64::from)
                .filter(move |&b| b != skip)
                .map(|b| ("gray x", 16.0, b))
                .collect::<Vec<_>>()
        };
        for (frames, needles) in [
            (
                [steps(16.0, 4), gray(3.0)].concat(),
                vec!["Gray bit 3", "axis x"],
            ),
            ([steps(16.0, 4), gray(6.0)].concat(), vec!["Gray bit 6"]),
            ([gray(2.0)].concat(), vec!["Gray bit 2"]),
            (
                [steps(16.0, 2), gray(9.0)].concat(),
                vec!["2 steps", "period 16 px"],
            ),
            (
                [steps(8.0, 4), gray(9.0)].concat(),
                vec!["cells of 16 px", "8"],
            ),
            (
                [steps(16.0, 4), steps(24.0, 4)].concat(),
                vec!["repeat after 48", "1920", "Gray"],
            ),
            (
                vec![("white", 0.0, 0.0)],
                vec!["neither fringes nor Gray code"],
            ),
            (gray(9.0), vec!["threshold", "white and a black"]),
        ] {
            let message = error(&frames);
            for needle in needles {
                assert!(message.contains(needle), "{needle} not in: {message}");
            }
        }
    }

    #[test]
    fn a_hole_below_a_code_that_is_fine_enough_is_only_noted() {
        let mut frames = steps(16.0, 4);
        frames.extend((0..7).map(|b| ("gray x", 16.0, f64::from(b))));
        frames.push(("gray x", 4.0, 0.0));
        let plan = Plan::new(&manifest(&frames)).unwrap();
        assert_eq!(plan.axes[0].gray.as_ref().unwrap().cell_px, 16.0);
        assert!(plan.notes[0].contains("Gray bit 1 of the cells of 4 px"));
    }

    #[test]
    fn one_set_alone_is_wrapped_and_beats_are_found() {
        let plan = Plan::new(&manifest(&steps(16.0, 3))).unwrap();
        assert_eq!(plan.axes[0].order, Order::Wrapped { period_px: 16.0 });
        let frames = [steps(66.6666666667, 3), steps(100.0, 3)].concat();
        assert!(error(&frames).contains("repeat after 200.0"));
        let frames = [steps(64.0, 3), steps(70.0, 3)].concat();
        let plan = Plan::new(&manifest(&frames)).unwrap();
        assert_eq!(
            plan.axes[0].order,
            Order::Resolved {
                repeat_px: f64::INFINITY
            }
        );
    }
}
