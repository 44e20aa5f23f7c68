//! A shot: one exposure requested by the firmware.

use crate::led::Emission;
use crate::pattern_image::PatternImage;
use std::ops::Range;
use std::sync::Arc;

/// One exposure: its light and its timing in device time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Shot {
    /// Id of the frame; a device never repeats an id.
    pub id: u64,
    /// Number that seeds the noise. Triggered and free-running exposures are counted separately, so
    /// that a sequence has the same noise however long the camera ran free before it.
    pub noise_id: u64,
    /// Index of the pattern in the selected sequence; `None` when free-running.
    pub pattern_index: Option<u32>,
    /// Pattern that the projector shows first; `None` if its light is off.
    pub pattern_image: Option<Arc<PatternImage>>,
    /// Projector light relative to full current, 0 to 1.
    pub light: f64,
    /// Patterns shown later, in order of time. They require [`Term::RollingShutter`](crate::Term),
    /// so that only rows that are still exposing see them, or [`Term::PatternTiming`](crate::Term).
    pub then: Vec<Showing>,
    /// Output of the light source over device time, which replaces every `light` while a pattern is
    /// shown. It requires [`Term::PatternTiming`](crate::Term).
    pub emission: Option<Arc<Emission>>,
    /// Start of the first row's exposure in nanoseconds of device time.
    pub start_ns: u64,
    /// Exposure of each row in nanoseconds.
    pub exposure_ns: u64,
    /// Shutter; global by default.
    pub shutter: Shutter,
    /// Gain in decibels above the sensor's base gain.
    pub gain_db: f64,
}

/// A pattern that the projector shows from a given time on.
#[derive(Debug, Clone, PartialEq)]
pub struct Showing {
    /// Start time in nanoseconds of device time.
    pub from_ns: u64,
    /// The pattern; `None` if the projector's light is off.
    pub pattern_image: Option<Arc<PatternImage>>,
    /// Light relative to full current, 0 to 1.
    pub light: f64,
}

/// The electronic shutter: the exposure of the r-th row that is read out starts r line times after
/// the exposure of the first. The default is a global shutter.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Shutter {
    /// Nanoseconds from the start of one row's exposure to the start of the next row's; 0 for a
    /// global shutter.
    pub line_time_ns: u64,
    /// First row that is read out, counted on the sensor.
    pub first_row: u32,
    /// Number of rows that are read out.
    pub rows: u32,
}

impl Shutter {
    /// Returns the delay of a sensor row relative to the first row that is read out, in nanoseconds.
    /// A row that is not read out has the delay of the nearest row that is.
    pub fn delay_ns(&self, row: u32) -> u64 {
        let line = row
            .saturating_sub(self.first_row)
            .min(self.rows.saturating_sub(1));
        u64::from(line).saturating_mul(self.line_time_ns)
    }

    /// Returns the delay of the last row after the first, in nanoseconds.
    pub fn skew_ns(&self) -> u64 {
        self.delay_ns(u32::MAX)
    }

    /// Returns the readout time of the rows in nanoseconds; no row can be exposed again earlier.
    pub fn readout_ns(&self) -> u64 {
        u64::from(self.rows).saturating_mul(self.line_time_ns)
    }
}

impl Shot {
    /// Returns the start of a sensor row's exposure in nanoseconds of device time.
    pub fn row_start_ns(&self, row: u32) -> u64 {
        self.start_ns.saturating_add(self.shutter.delay_ns(row))
    }

    /// Returns the end of the last row's exposure in nanoseconds of device time.
    pub fn end_ns(&self) -> u64 {
        self.row_start_ns(u32::MAX).saturating_add(self.exposure_ns)
    }

    /// Returns the interval in which each pattern is seen by an exposure that starts at `start_ns`:
    /// the index of the pattern (0 is `pattern_image`, higher indices refer to `then`) and the
    /// interval in nanoseconds of device time. There is at least one interval; an interval is empty
    /// only if the exposure is.
    pub fn seen(&self, start_ns: u64) -> impl Iterator<Item = (usize, Range<u64>)> {
        let end_ns = start_ns.saturating_add(self.exposure_ns);
        // A zero-length exposure sees the pattern shown at that instant.
        let moment = u64::from(self.exposure_ns == 0);
        (0..=self.then.len()).filter_map(move |place| {
            let from = match place {
                0 => 0,
                _ => self.then[place - 1].from_ns,
            };
            let to = self.then.get(place).map_or(u64::MAX, |next| next.from_ns);
            let (from, to) = (from.max(start_ns), to.min(end_ns.saturating_add(moment)));
            (from < to).then(|| (place, from..to - moment))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shot() -> Shot {
        let showing = |from_ns| Showing {
            from_ns,
            pattern_image: None,
            light: 1.0,
        };
        Shot {
            then: vec![showing(1100), showing(1130)],
            start_ns: 1000,
            exposure_ns: 60,
            shutter: Shutter {
                line_time_ns: 10,
                first_row: 5,
                rows: 12,
            },
            ..Shot::default()
        }
    }

    #[test]
    fn rows_start_one_after_another_within_the_region() {
        let shot = shot();
        let starts = [0, 5, 6, 16, 17, 4000].map(|row| shot.row_start_ns(row));
        assert_eq!(starts, [1000, 1000, 1010, 1110, 1110, 1110]);
        assert_eq!((shot.end_ns(), shot.shutter.readout_ns()), (1170, 120));
        let global = Shot {
            shutter: Shutter::default(),
            ..shot
        };
        assert_eq!((global.row_start_ns(7), global.end_ns()), (1000, 1060));
    }

    #[test]
    fn exposure_is_divided_among_the_patterns_shown() {
        let shot = shot();
        let seen = |start| shot.seen(start).collect::<Vec<_>>();
        assert_eq!(seen(1000), [(0, 1000..1060)]);
        assert_eq!(seen(1040), [(0, 1040..1100)]);
        assert_eq!(seen(1041), [(0, 1041..1100), (1, 1100..1101)]);
        let three = [(0, 1090..1100), (1, 1100..1130), (2, 1130..1150)];
        assert_eq!(seen(1090), three);
        assert_eq!(seen(1100), [(1, 1100..1130), (2, 1130..1160)]);
        assert_eq!(seen(1130), [(2, 1130..1190)]);
        let moment = Shot {
            exposure_ns: 0,
            ..shot
        };
        let seen = |start| moment.seen(start).collect::<Vec<_>>();
        assert_eq!(
            (seen(1099), seen(1100)),
            (vec![(0, 1099..1099)], vec![(1, 1100..1100)])
        );
    }
}
