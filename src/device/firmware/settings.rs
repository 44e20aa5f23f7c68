//! Settings that commands change, and their values after power-on and `*RST`.

use super::super::{Roi, Shutter};
use phasmid_profile::{Profile, Timing};
use phasmid_protocol::PixelFormat;
use phasmid_protocol::scpi::{DeviceError, ErrorCode};

/// Trigger source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Source {
    Software,
    Bus,
    External,
    /// The camera runs free at its frame interval.
    Internal,
}

/// Part of the sequence that one trigger starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    /// The whole sequence.
    Sequence,
    /// The next pattern.
    Step,
}

/// Content shown by the projector while the camera runs free.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shown {
    White,
    Black,
    /// A pattern of the selected sequence.
    Pattern(u32),
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Settings {
    pub(super) exposure_ns: u64,
    pub(super) gain_db: f64,
    pub(super) roi: Roi,
    pub(super) format: PixelFormat,
    pub(super) interval_ns: u64,
    /// Line time of a rolling shutter, fixed by the sensor; 0 for a global shutter.
    pub(super) line_time_ns: u64,
    /// Readout time of the whole sensor with a global shutter, in nanoseconds, and number of rows of
    /// the sensor; both are fixed by the sensor.
    pub(super) readout: (u64, u32),
    /// Shortest time between the starts of two frames in nanoseconds; fixed by the camera.
    pub(super) shortest_interval_ns: u64,
    pub(super) lamp: bool,
    /// Projector light relative to full, 0 to 1.
    pub(super) current: f64,
    pub(super) shown: Shown,
    pub(super) period_ns: u64,
    /// Time for which a projector with timing shows a pattern, in nanoseconds; `None` means as long
    /// as the period allows.
    pub(super) pattern_ns: Option<u64>,
    pub(super) source: Source,
    pub(super) delay_ns: u64,
    /// The part of the trigger delay that the hardware fixes, in nanoseconds.
    pub(super) own_delay_ns: u64,
    pub(super) mode: Mode,
    pub(super) continuous: bool,
}

impl Settings {
    /// Returns the settings after power-on and `*RST`: lamp on and white, the profile's exposure,
    /// gain 0, the whole sensor, free-running.
    pub(super) fn reset(profile: &Profile) -> Self {
        let camera = &profile.camera;
        let timing = profile.projector.timing.as_ref();
        Self {
            exposure_ns: microseconds(camera.exposure_us),
            gain_db: 0.0,
            roi: Roi {
                x: 0,
                y: 0,
                width: camera.width_px,
                height: camera.height_px,
            },
            format: camera.format,
            interval_ns: microseconds(camera.frame_interval_us),
            line_time_ns: camera.line_time_ns(),
            readout: (camera.readout_ns(), camera.height_px),
            shortest_interval_ns: camera.shortest_interval_ns(),
            lamp: true,
            current: 1.0,
            shown: Shown::White,
            period_ns: microseconds(profile.sequence[0].period_us),
            pattern_ns: timing.and_then(Timing::exposure_ns),
            source: Source::Internal,
            delay_ns: 0,
            own_delay_ns: timing.map_or(0, Timing::first_delay_ns),
            mode: Mode::Sequence,
            continuous: false,
        }
    }

    /// Returns the shutter of the present region.
    pub(super) fn shutter(&self) -> Shutter {
        Shutter {
            line_time_ns: self.line_time_ns,
            first_row: self.roi.y,
            rows: self.roi.height,
        }
    }

    /// Time from the start of the first row's exposure to the end of the last row's.
    pub(super) fn frame_ns(&self) -> u64 {
        self.exposure_ns.saturating_add(self.shutter().skew_ns())
    }

    /// Readout time of a global shutter's frame after its exposure.
    pub(super) fn readout_ns(&self) -> u64 {
        let (whole_ns, rows) = self.readout;
        let here_ns = u128::from(whole_ns) * u128::from(self.roi.height);
        (here_ns / u128::from(rows.max(1))) as u64
    }

    /// Time from the start of the first row's exposure to the end of readout.
    pub(super) fn done_ns(&self) -> u64 {
        self.frame_ns().saturating_add(self.readout_ns())
    }

    /// Shortest time between the starts of two exposures: no row starts a new exposure before its
    /// previous exposure has ended and all rows have been read.
    pub(super) fn shortest_period_ns(&self) -> u64 {
        self.exposure_ns
            .saturating_add(self.readout_ns())
            .max(self.shutter().readout_ns())
            .max(self.shortest_interval_ns)
    }

    /// Time from a trigger to the start of the first exposure.
    pub(super) fn start_delay_ns(&self) -> u64 {
        self.delay_ns.saturating_add(self.own_delay_ns)
    }

    /// Time within a period for which a projector with timing shows a pattern.
    pub(super) fn pattern_ns(&self, timing: &Timing, period_ns: u64) -> u64 {
        self.pattern_ns
            .unwrap_or_else(|| timing.longest_exposure_ns(period_ns))
    }
}

/// Converts microseconds, already checked to be positive, to nanoseconds.
pub(super) fn microseconds(us: f64) -> u64 {
    (us * 1e3).round() as u64
}

/// Converts seconds, already checked to be non-negative, to nanoseconds.
pub(super) fn from_seconds(s: f64) -> u64 {
    (s * 1e9).round() as u64
}

/// Converts nanoseconds to seconds.
pub(super) fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}

/// Rejects settings whose exposures do not fit the period. For a projector with timing, also rejects
/// settings that do not let each pattern be shown for at least `shortest_ns`.
pub(super) fn check_period(
    settings: &Settings,
    period_ns: u64,
    timing: Option<&Timing>,
    shortest_ns: u64,
) -> Result<(), DeviceError> {
    let period_s = seconds(period_ns);
    let shown = timing.and_then(|timing| {
        let pattern_ns = settings.pattern_ns(timing, period_ns);
        timing.conflict(period_ns, pattern_ns, shortest_ns)
    });
    let conflict = if settings.exposure_ns > period_ns {
        format!(
            "exposure {} s exceeds the sequence's period {period_s} s",
            seconds(settings.exposure_ns)
        )
    } else if settings.shutter().readout_ns() > period_ns {
        format!(
            "{} rows are read in {} s, which exceeds the sequence's period {period_s} s",
            settings.roi.height,
            seconds(settings.shutter().readout_ns())
        )
    } else if settings.shortest_period_ns() > period_ns {
        format!(
            "a frame takes {} s until the camera is ready for the next one, which exceeds the \
             sequence's period {period_s} s",
            seconds(settings.shortest_period_ns())
        )
    } else if let Some((found, allowed)) = shown {
        format!("{found}, allowed {allowed}")
    } else {
        return Ok(());
    };
    Err(ErrorCode::SettingsConflict.with(conflict))
}

/// Returns whether the profile's exposure fits the profile's period.
pub(super) fn power_on_is_consistent(profile: &Profile) -> bool {
    let settings = Settings::reset(profile);
    let projector = &profile.projector;
    let timing = projector.timing.as_ref();
    let patterns = profile.sequence[0].frame.iter().map(|f| &f.pattern);
    let shortest_ns = timing.map_or(0, |t| t.shortest_exposure_ns(patterns, projector.bits));
    check_period(&settings, settings.period_ns, timing, shortest_ns).is_ok()
}
