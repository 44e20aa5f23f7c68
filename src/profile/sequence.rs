//! Pattern sequences of a profile.

use super::timing::on_clock;
use super::{Camera, Projector};
use phasmid_core::check::{Check, name};
use phasmid_core::error::Result;
use phasmid_pattern::manifest::check_count;
use phasmid_pattern::{Axis, MAX_SIDE_PX, ManifestFrame, Pattern};
use serde::{Deserialize, Serialize};

/// A pattern sequence in the device's memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Sequence {
    /// Name used by `SEQuence:SELect`.
    pub name: String,
    /// Pattern period in microseconds: at least exposure plus readout, and a period that the
    /// projector's `timing` allows if there is one.
    pub period_us: f64,
    /// The patterns in order; a file may write them in sets.
    #[serde(deserialize_with = "phasmid_pattern::written::frames")]
    #[cfg_attr(
        feature = "schema",
        schemars(with = "Vec<phasmid_pattern::written::Entry>")
    )]
    pub frame: Vec<ManifestFrame>,
}

impl Sequence {
    /// Returns two short sequences, the second for calibration: fringes of 16 px in 4 steps and a Gray
    /// code with its half-cell bit, along x or along both axes, white and black.
    pub(super) fn plain(projector: &Projector, period_us: f64) -> [Self; 2] {
        const PERIOD_PX: f64 = 16.0;
        let along = |axis, size_px: u32| {
            // Clamp the projector's size here, because it may be invalid; the projector's checks
            // report an invalid size.
            let size_px = f64::from(size_px.clamp(32, MAX_SIDE_PX));
            let bits = (size_px / PERIOD_PX).log2().ceil() as u32;
            let mut patterns = Pattern::fringe_set(axis, PERIOD_PX, 4, 0.0);
            patterns.extend(Pattern::gray_set(axis, PERIOD_PX, bits, true, false));
            patterns
        };
        let x = along(Axis::X, projector.width_px);
        let y = along(Axis::Y, projector.height_px);
        let sequence = |name: &str, fringes: Vec<Pattern>| {
            let levels = [Pattern::White {}, Pattern::Black {}];
            let frame = |pattern| ManifestFrame {
                file: None,
                pattern,
            };
            Self {
                name: name.to_owned(),
                period_us,
                frame: fringes.into_iter().chain(levels).map(frame).collect(),
            }
        };
        let both = [x.clone(), y].concat();
        [sequence("4-step", x), sequence("4-step-xy", both)]
    }
}

/// Checks that a device with this camera and projector can run a sequence.
pub(super) fn check(
    s: &Sequence,
    index: usize,
    (camera, projector): (&Camera, &Projector),
    check: &Check<'_>,
) -> Result<()> {
    // The default sequences have the period of free-running frames.
    let is_given = check.source.has(&format!("sequence[{index}]"));
    let field = |name: &str| match is_given {
        true => format!("sequence[{index}].{name}"),
        false => "camera.frame_interval_us".to_owned(),
    };
    check.section(|check| name(&s.name, &field("name"), check));
    let shortest_us = camera.shortest_period_us();
    check.that(
        (shortest_us..=60e6).contains(&s.period_us),
        &field("period_us"),
        check.given(&field("period_us"), s.period_us),
        format!(
            "{shortest_us} to 60000000: no shorter than camera.exposure_us = {} and the readout",
            camera.exposure_us
        ),
    )?;
    check_count(&s.frame, &field("frame"), check.source)?;
    shown_in_time(s, &field("period_us"), projector, check)?;
    for axis in [Axis::X, Axis::Y] {
        let size = match axis {
            Axis::X => projector.width_px,
            Axis::Y => projector.height_px,
        };
        gray_reaches(s, index, axis, size, check)?;
    }
    Ok(())
}

/// Checks that the period gives the projector time to show every pattern.
fn shown_in_time(
    s: &Sequence,
    field: &str,
    projector: &Projector,
    check: &Check<'_>,
) -> Result<()> {
    let Some(timing) = &projector.timing else {
        return Ok(());
    };
    on_clock(timing, s.period_us, field, check)?;
    let period_ns = (s.period_us * 1e3).round() as u64;
    let exposure_ns = timing.exposure_ns();
    let patterns = s.frame.iter().map(|frame| &frame.pattern);
    let conflict = timing.conflict(
        period_ns,
        exposure_ns.unwrap_or(timing.longest_exposure_ns(period_ns)),
        timing.shortest_exposure_ns(patterns, projector.bits),
    );
    if let Some((found, allowed)) = conflict {
        return Err(check.source.violation(field, found, allowed));
    }
    let delay = match timing.camera_delay_us {
        Some(_) => "projector.timing.camera_delay_us",
        None => "projector.timing.dark_before_us",
    };
    check.that(
        timing.camera_delay_ns() < period_ns,
        delay,
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
    for frame in &s.frame {
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
            &format!("sequence[{index}].frame"),
            format!("{bits} bits of {cell_px} px, which cover {reach} px"),
            format!(
                "at least {} bits for the fringes over {size} px",
                (f64::from(size) / cell_px).log2().ceil()
            ),
        )?;
    }
    Ok(())
}
