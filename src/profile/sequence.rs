//! The pattern sequences of a profile.

use super::Profile;
use super::check::{Check, name};
use crate::error::Result;
use crate::pattern::manifest::check_frames;
use crate::pattern::{Axis, ManifestFrame, Pattern};
use serde::{Deserialize, Serialize};

/// A pattern sequence in the device's memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sequence {
    /// Name by which `SEQuence:SELect` takes it.
    pub name: String,
    /// Time from one pattern to the next in microseconds; at least the exposure, and what a rolling
    /// shutter takes to read a frame.
    pub period_us: f64,
    /// The patterns in order.
    pub frame: Vec<ManifestFrame>,
}

pub(super) fn check(s: &Sequence, index: usize, p: &Profile, check: &Check<'_>) -> Result<()> {
    let field = |name: &str| format!("sequence[{index}].{name}");
    name(&s.name, &field("name"), check)?;
    check.within(
        &field("period_us"),
        s.period_us,
        p.camera.shortest_interval_us()..=60e6,
    )?;
    check_frames(&s.frame, &field("frame"), check.source)?;
    for axis in [Axis::X, Axis::Y] {
        let size = match axis {
            Axis::X => p.projector.width_px,
            Axis::Y => p.projector.height_px,
        };
        gray_reaches(s, index, axis, size, check)?;
    }
    Ok(())
}

/// A Gray code has to number every fringe that the projector shows.
fn gray_reaches(
    s: &Sequence,
    index: usize,
    axis: Axis,
    size: u32,
    check: &Check<'_>,
) -> Result<()> {
    let fringes = s
        .frame
        .iter()
        .any(|f| matches!(f.pattern, Pattern::Fringe { axis: a, .. } if a == axis));
    for (i, frame) in s.frame.iter().enumerate() {
        let Pattern::Gray {
            axis: a,
            cell_px,
            bits,
            ..
        } = frame.pattern
        else {
            continue;
        };
        let reach = cell_px * f64::from(bits).exp2();
        check.that(
            !fringes || a != axis || reach >= f64::from(size),
            &format!("sequence[{index}].frame[{i}].pattern.bits"),
            format!("{bits} bits of {cell_px} px, which number {reach} px"),
            format!(
                "at least {} bits for the fringes over {size} px",
                (f64::from(size) / cell_px).log2().ceil()
            ),
        )?;
    }
    Ok(())
}
