//! Timing of a DLP projector, `[projector.timing]` of a profile: the controller's constraints on
//! exposure and period of a pattern.
//!
//! ```text
//!            |<------------------------- period ------------------------->|
//!  trigger   | dark before |      exposure of the pattern    | dark after |
//!  --------->|             |b0|b1|  b2 |    ...      b7      |            |
//!   delays   |             |<- the camera's exposure, by default
//! ```
//!
//! The exposure is the whole period, or shorter than it by at least a margin in which the
//! controller loads the next pattern (TI's DLP SDK: 230 us for the LightCrafter 4500 with its
//! DLPC350, 105 us for the LightCrafter 6500 with its DLPC900). It leaves room for the dark times
//! around it and is long enough to show all bits of the pattern. Between patterns the light is off.
//! All times are multiples of the controller's clock step.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use phasmid_pattern::Pattern;
use serde::{Deserialize, Serialize};

/// Maximum time in a profile in microseconds.
const MAX_US: f64 = 60e6;
/// Bit planes per buffer, which holds one 24-bit image (DLP LightCrafter 4500 user's guide DLPU011,
/// section 4.1).
const BUFFER_PLANES: usize = 24;

/// Display timing of a projector. All times are multiples of `resolution_us`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// Time step of the controller in microseconds; a whole number of nanoseconds.
    #[serde(default = "microsecond")]
    pub resolution_us: f64,
    /// Minimum exposure in microseconds of a pattern of 1, 2, up to 8 bits; entries beyond the
    /// projector's bit depth are unused.
    #[serde(deserialize_with = "phasmid_core::numbers::exactly")]
    pub min_exposure_us: [f64; 8],
    /// Pattern exposure after power-on and `*RST`, in microseconds; as long as the period allows
    /// when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exposure_us: Option<f64>,
    /// Minimum difference of period and exposure in microseconds, unless they are equal.
    #[serde(default)]
    pub margin_us: f64,
    /// Dark time before each pattern in microseconds, from the start of its period.
    #[serde(default)]
    pub dark_before_us: f64,
    /// Dark time after each pattern in microseconds.
    #[serde(default)]
    pub dark_after_us: f64,
    /// Delay from a trigger to the start of the first pattern's period in microseconds;
    /// `TRIGger:DELay` adds to it.
    #[serde(default)]
    pub trigger_delay_us: f64,
    /// Delay of the controller's trigger output, from the start of a pattern's period to the start
    /// of the camera's exposure, in microseconds; `dark_before_us` when absent, so that pattern and
    /// exposure start together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_delay_us: Option<f64>,
    /// Time to load a selected sequence from flash into the controller's memory, in microseconds
    /// per buffer of 24 bit planes. All buffers are loaded before the first pattern; none is loaded
    /// during display.
    #[serde(default)]
    pub load_us: f64,
    /// Whether grey patterns are shown bit by bit, the least significant first, so that an exposure
    /// that does not cover the whole pattern sees only some of its bits. If false, a level is
    /// constant light of that intensity.
    #[serde(default)]
    pub bit_planes: bool,
}

fn microsecond() -> f64 {
    1.0
}

/// Converts an already checked time from microseconds to nanoseconds.
fn ns(us: f64) -> u64 {
    (us * 1e3).round() as u64
}

/// Returns the bit depth of a pattern on a projector with `bits` bits.
fn depth(pattern: &Pattern, bits: u32) -> u32 {
    match pattern {
        Pattern::White {} | Pattern::Black {} | Pattern::Gray { .. } => 1,
        Pattern::Fringe { .. } | Pattern::Image { .. } => bits,
    }
}

impl Timing {
    /// Returns the time step in nanoseconds.
    pub fn resolution_ns(&self) -> u64 {
        ns(self.resolution_us).max(1)
    }

    /// Rounds a time to the controller's step, in nanoseconds; halves round up.
    pub fn quantise_ns(&self, time_ns: u64) -> u64 {
        let step = self.resolution_ns();
        time_ns.saturating_add(step / 2) / step * step
    }

    /// Returns the exposure after `*RST` in nanoseconds, if the profile sets one.
    pub fn exposure_ns(&self) -> Option<u64> {
        self.exposure_us.map(ns)
    }

    /// Returns the time from the start of a period to its pattern in nanoseconds.
    pub fn dark_before_ns(&self) -> u64 {
        ns(self.dark_before_us)
    }

    /// Returns the time from the start of a period to the camera's exposure in nanoseconds.
    pub fn camera_delay_ns(&self) -> u64 {
        self.camera_delay_us.map_or(self.dark_before_ns(), ns)
    }

    /// Returns the time from a trigger to the camera's first exposure in nanoseconds.
    pub fn first_delay_ns(&self) -> u64 {
        ns(self.trigger_delay_us) + self.camera_delay_ns()
    }

    /// Returns the minimum exposure in nanoseconds that suffices for each of the patterns on a
    /// projector with `bits` bits.
    pub fn shortest_exposure_ns<'a>(
        &self,
        patterns: impl IntoIterator<Item = &'a Pattern>,
        bits: u32,
    ) -> u64 {
        let shortest = |pattern| {
            let place = depth(pattern, bits).clamp(1, 8) as usize - 1;
            ns(self.min_exposure_us[place])
        };
        patterns.into_iter().map(shortest).max().unwrap_or(0)
    }

    /// Returns the maximum exposure in nanoseconds that fits a period; 0 if no exposure fits.
    pub fn longest_exposure_ns(&self, period_ns: u64) -> u64 {
        match self.dark_ns() {
            0 => period_ns,
            dark => period_ns.saturating_sub(dark.max(ns(self.margin_us))),
        }
    }

    /// Returns the minimum period in nanoseconds that fits an exposure.
    pub fn shortest_period_ns(&self, exposure_ns: u64) -> u64 {
        match self.dark_ns() {
            0 => exposure_ns,
            dark => exposure_ns.saturating_add(dark.max(ns(self.margin_us))),
        }
    }

    fn dark_ns(&self) -> u64 {
        ns(self.dark_before_us) + ns(self.dark_after_us)
    }

    /// Returns `(found, allowed)` for a message if an exposure does not fit a period or is shorter
    /// than `shortest_ns`, the minimum exposure of the patterns. All arguments are in nanoseconds.
    pub fn conflict(
        &self,
        period_ns: u64,
        exposure_ns: u64,
        shortest_ns: u64,
    ) -> Option<(String, String)> {
        let us = |ns: u64| format!("{} us", ns as f64 / 1e3);
        let (margin_ns, dark_ns) = (ns(self.margin_us), self.dark_ns());
        let shown = format!("patterns shown for {}", us(exposure_ns));
        let period = us(period_ns);
        if exposure_ns < shortest_ns {
            return Some((
                format!("{shown} in a period of {period}"),
                format!("{} or more, the time that their bits take", us(shortest_ns)),
            ));
        }
        if exposure_ns.saturating_add(dark_ns) > period_ns {
            return Some((
                format!("{shown} and {} of darkness", us(dark_ns)),
                format!("at most the period of {period}"),
            ));
        }
        if exposure_ns != period_ns && exposure_ns.saturating_add(margin_ns) > period_ns {
            return Some((
                format!("{shown} in a period of {period}"),
                format!("the whole period, or shorter by {} or more", us(margin_ns)),
            ));
        }
        None
    }

    /// Returns the time to load the patterns into the controller's memory, in nanoseconds.
    pub fn load_ns<'a>(&self, patterns: impl IntoIterator<Item = &'a Pattern>, bits: u32) -> u64 {
        let planes = patterns.into_iter().map(|p| depth(p, bits) as usize);
        let buffers = planes.sum::<usize>().div_ceil(BUFFER_PLANES);
        (buffers as u64).saturating_mul(ns(self.load_us))
    }

    /// Returns whether a time in microseconds is a multiple of the controller's step.
    fn is_step(&self, time_us: f64) -> bool {
        whole(time_us) && ns(time_us).is_multiple_of(self.resolution_ns())
    }
}

/// Returns whether a time in microseconds is a whole number of nanoseconds, within rounding error.
fn whole(time_us: f64) -> bool {
    let time_ns = time_us * 1e3;
    (time_ns - time_ns.round()).abs() <= 1e-6_f64.max(time_ns * 1e-12)
}

pub(super) fn check(t: &Timing, responds: bool, check: &Check<'_>) -> Result<()> {
    let field = |name: &str| format!("projector.timing.{name}");
    check.within(&field("resolution_us"), t.resolution_us, 1e-3..=1e6)?;
    check.that(
        whole(t.resolution_us),
        &field("resolution_us"),
        t.resolution_us,
        "whole nanoseconds",
    )?;
    let times = [
        ("exposure_us", t.exposure_us),
        ("margin_us", Some(t.margin_us)),
        ("dark_before_us", Some(t.dark_before_us)),
        ("dark_after_us", Some(t.dark_after_us)),
        ("trigger_delay_us", Some(t.trigger_delay_us)),
        ("camera_delay_us", t.camera_delay_us),
        ("load_us", Some(t.load_us)),
    ];
    let shortest = t.min_exposure_us.map(|us| ("min_exposure_us", Some(us)));
    for (name, us) in times.into_iter().chain(shortest) {
        let Some(us) = us else { continue };
        check.within(&field(name), us, 0.0..=MAX_US)?;
        on_clock(t, us, &field(name), check)?;
    }
    let [first, ..] = t.min_exposure_us;
    check.that(
        first > 0.0 && t.min_exposure_us.is_sorted(),
        &field("min_exposure_us"),
        format!("{:?}", t.min_exposure_us),
        "times above 0, none shorter than the time for fewer bits",
    )?;
    check.that(
        !(t.bit_planes && responds),
        &field("bit_planes"),
        "true, and projector.response",
        "only one of them: bits shown one after the other add up to light in proportion to the \
         level",
    )
}

/// Rejects a time that is not a multiple of the controller's step.
pub(super) fn on_clock(t: &Timing, us: f64, field: &str, check: &Check<'_>) -> Result<()> {
    check.that(
        t.is_step(us),
        field,
        check.given(field, us),
        format!("whole multiples of {} us, the resolution", t.resolution_us),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_pattern::Axis;

    fn timing() -> Timing {
        Timing {
            resolution_us: 1.0,
            min_exposure_us: [235.0, 700.0, 1570.0, 1700.0, 2000.0, 2500.0, 4500.0, 8333.0],
            exposure_us: None,
            margin_us: 230.0,
            dark_before_us: 0.0,
            dark_after_us: 0.0,
            trigger_delay_us: 0.0,
            camera_delay_us: None,
            load_us: 200_000.0,
            bit_planes: true,
        }
    }

    const FRINGE: Pattern = Pattern::Fringe {
        axis: Axis::X,
        period_px: 16.0,
        phase_rad: 0.0,
    };

    #[test]
    fn times_go_to_the_nearest_step() {
        let mut timing = timing();
        for (resolution_us, time_ns, nearest_ns) in [
            (1.0, 0, 0),
            (1.0, 499, 0),
            (1.0, 500, 1000),
            (1.0, 1499, 1000),
            (0.02, 29, 20),
            (0.02, 30, 40),
            (16.0, 23_999, 16_000),
            (16.0, 24_000, 32_000),
            (0.001, 7, 7),
        ] {
            timing.resolution_us = resolution_us;
            assert_eq!(timing.quantise_ns(time_ns), nearest_ns, "{resolution_us}");
        }
    }

    /// Compares with the rules of two controllers: the DLPC350, and the DLPC3478, which needs dark
    /// times.
    #[test]
    fn an_exposure_is_the_period_or_shorter_by_the_margin() {
        let dlpc350 = timing();
        let dlpc3478 = Timing {
            margin_us: 0.0,
            dark_before_us: 171.0,
            dark_after_us: 31.0,
            ..timing()
        };
        let both = Timing {
            margin_us: 230.0,
            ..dlpc3478.clone()
        };
        for (t, period_us, exposure_us, fits) in [
            (&dlpc350, 10_000, 10_000, true),
            (&dlpc350, 10_000, 10_001, false),
            (&dlpc350, 10_000, 9_999, false),
            (&dlpc350, 10_000, 9_771, false),
            (&dlpc350, 10_000, 9_770, true),
            (&dlpc350, 10_000, 8_333, true),
            (&dlpc350, 10_000, 8_332, false),
            (&dlpc3478, 10_000, 10_000, false),
            (&dlpc3478, 10_000, 9_799, false),
            (&dlpc3478, 10_000, 9_798, true),
            (&both, 10_000, 9_798, false),
            (&both, 10_000, 9_770, true),
        ] {
            let (period_ns, exposure_ns) = (period_us * 1000, exposure_us * 1000);
            let conflict = t.conflict(period_ns, exposure_ns, 8_333_000);
            assert_eq!(conflict.is_none(), fits, "{exposure_us}: {conflict:?}");
            let longest = t.longest_exposure_ns(period_ns);
            assert!(!fits || exposure_ns <= longest, "{exposure_us}");
            assert_eq!(t.conflict(period_ns, longest, 0), None);
            let shortest = t.shortest_period_ns(exposure_ns);
            assert_eq!(t.conflict(shortest, exposure_ns, 0), None);
            assert!(t.conflict(shortest - 1, exposure_ns, 0).is_some());
        }
    }

    #[test]
    fn bit_depth_sets_shortest_exposure_and_load_time() {
        let t = timing();
        let gray = Pattern::Gray {
            axis: Axis::X,
            cell_px: 16.0,
            bits: 6,
            bit: 0,
            inverted: false,
        };
        let white = Pattern::White {};
        for (patterns, bits, shortest_us, buffers) in [
            (vec![&white, &gray], 8, 235, 1),
            (vec![&white, &FRINGE], 8, 8333, 1),
            (vec![&FRINGE; 3], 8, 8333, 1),
            (vec![&FRINGE; 4], 8, 8333, 2),
            (vec![&FRINGE; 4], 6, 2500, 1),
            (vec![&gray; 25], 8, 235, 2),
            (vec![], 8, 0, 0),
        ] {
            let shortest = t.shortest_exposure_ns(patterns.iter().copied(), bits);
            assert_eq!(shortest, shortest_us * 1000, "{patterns:?}");
            let load = t.load_ns(patterns.iter().copied(), bits);
            assert_eq!(load, buffers * 200_000_000, "{patterns:?}");
        }
    }

    #[test]
    fn camera_delay_defaults_to_the_start_of_the_pattern() {
        let mut t = Timing {
            dark_before_us: 171.0,
            trigger_delay_us: 25.0,
            ..timing()
        };
        assert_eq!(
            (t.camera_delay_ns(), t.first_delay_ns()),
            (171_000, 196_000)
        );
        t.camera_delay_us = Some(0.0);
        assert_eq!((t.camera_delay_ns(), t.first_delay_ns()), (0, 25_000));
    }
}
