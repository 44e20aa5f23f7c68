//! Pattern sequences of a profile.

use super::Profile;
use super::timing::on_clock;
use phasmid_core::check::{Check, name};
use phasmid_core::error::Result;
use phasmid_pattern::manifest::check_frames;
use phasmid_pattern::{Axis, ManifestFrame, Pattern};
use serde::{Deserialize, Serialize};

/// A pattern sequence in the device's memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sequence {
    /// Name used by `SEQuence:SELect`.
    pub name: String,
    /// Pattern period in microseconds: at least exposure plus readout, and a period that the
    /// projector's `timing` allows if there is one.
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
        p.camera.shortest_period_us()..=60e6,
    )?;
    check_frames(&s.frame, &field("frame"), check.source)?;
    shown_in_time(s, &field("period_us"), p, check)?;
    for axis in [Axis::X, Axis::Y] {
        let size = match axis {
            Axis::X => p.projector.width_px,
            Axis::Y => p.projector.height_px,
        };
        gray_reaches(s, index, axis, size, check)?;
    }
    Ok(())
}

/// Checks that the period gives the projector time to show every pattern.
fn shown_in_time(s: &Sequence, field: &str, p: &Profile, check: &Check<'_>) -> Result<()> {
    let Some(timing) = &p.projector.timing else {
        return Ok(());
    };
    on_clock(timing, s.period_us, field, check)?;
    let period_ns = (s.period_us * 1e3).round() as u64;
    let exposure_ns = timing.exposure_ns();
    let patterns = s.frame.iter().map(|frame| &frame.pattern);
    let conflict = timing.conflict(
        period_ns,
        exposure_ns.unwrap_or(timing.longest_exposure_ns(period_ns)),
        timing.shortest_exposure_ns(patterns, p.projector.bits),
    );
    if let Some((found, allowed)) = conflict {
        return Err(check.source.violation(field, found, allowed));
    }
    check.that(
        timing.camera_delay_ns() < period_ns,
        "projector.timing.camera_delay_us",
        format!("{} us", timing.camera_delay_ns() as f64 / 1e3),
        format!("less than {field} = {}", s.period_us),
    )
}

/// Checks that a Gray code covers all fringes across the projector.
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
            format!("{bits} bits of {cell_px} px, which cover {reach} px"),
            format!(
                "at least {} bits for the fringes over {size} px",
                (f64::from(size) / cell_px).log2().ceil()
            ),
        )?;
    }
    Ok(())
}
