//! Mains flicker: light modulated at twice the mains frequency, integrated over an exposure.

use super::buffer::GeometryBuffer;
use phasmid_profile as profile;
use std::f64::consts::PI;

const NS_PER_S: u128 = 1_000_000_000;

/// Modulation shared by all flickering light of a scene.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Flicker {
    frequency_hz: u32,
    phase_rad: f64,
}

impl Flicker {
    pub(crate) fn new(flicker: &profile::Flicker) -> Self {
        Self {
            frequency_hz: flicker.frequency_hz,
            phase_rad: flicker.phase_deg.to_radians(),
        }
    }

    /// Returns the mean of cos(2 pi f t + phase) over an exposure of length T: the cosine at the
    /// middle of the exposure times sin(pi f T) / (pi f T), since the integral of a cosine is a
    /// difference of sines. Whole periods are removed in integer arithmetic, so that the billionth
    /// frame is as accurate as the first, and the mean over whole periods is exactly zero.
    pub(crate) fn swing(&self, start_ns: u64, exposure_ns: u64) -> f64 {
        let f = u128::from(self.frequency_hz);
        let turns = u128::from(exposure_ns) * f;
        let middle = (2 * u128::from(start_ns) + u128::from(exposure_ns)) * f % (2 * NS_PER_S);
        let cos = (middle as f64 / NS_PER_S as f64 * PI + self.phase_rad).cos();
        if turns == 0 {
            return cos;
        }
        let half_turns = (turns / NS_PER_S) % 2;
        let sin = ((turns % NS_PER_S) as f64 / NS_PER_S as f64 * PI).sin();
        let sign = if half_turns == 0 { 1.0 } else { -1.0 };
        sign * sin / (turns as f64 / NS_PER_S as f64 * PI) * cos
    }
}

/// Adds flickering light to the electrons of the pixels that start at index `first`; `seconds` is
/// the exposure times the mean of the flicker over it.
pub(crate) fn add(map: &GeometryBuffer, seconds: f32, first: usize, electrons: &mut [f32]) {
    let flickering = &map.flickering[first..first + electrons.len()];
    for (e, f) in electrons.iter_mut().zip(flickering) {
        *e = both(*e, seconds, *f);
    }
}

/// Returns the electrons of one pixel, with flickering light added if `seconds` is given.
pub(crate) fn with(electrons: f32, seconds: Option<f32>, flickering: f32) -> f32 {
    seconds.map_or(electrons, |seconds| both(electrons, seconds, flickering))
}

/// Returns the electrons of steady and flickering light, clamped at zero against rounding errors.
#[inline(always)]
fn both(electrons: f32, seconds: f32, flickering: f32) -> f32 {
    (electrons + seconds * flickering).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flicker(frequency_hz: u32, phase_deg: f64) -> Flicker {
        Flicker::new(&profile::Flicker {
            frequency_hz,
            depth: 1.0,
            phase_deg,
        })
    }

    #[test]
    fn flicker_is_the_integral_over_the_exposure() {
        for (hz, phase, start, exposure) in [
            (100, 0.0, 0, 8_000_000),
            (120, 77.0, 1_234_567, 1_000),
            (100, -200.0, 3_999_999, 23_456_789),
            (120, 10.0, 5, 90_000_001),
        ] {
            let n = 20_000;
            let sum: f64 = (0..n)
                .map(|i| {
                    let t = (start as f64 + exposure as f64 * (f64::from(i) + 0.5) / f64::from(n))
                        * 1e-9;
                    (2.0 * PI * f64::from(hz) * t + f64::to_radians(phase)).cos()
                })
                .sum();
            let found = flicker(hz, phase).swing(start, exposure);
            assert!((found - sum / f64::from(n)).abs() < 1e-6, "{found}");
        }
    }

    #[test]
    fn whole_periods_see_none_and_a_moment_sees_the_wave() {
        for periods in [1, 2, 7] {
            assert_eq!(flicker(100, 33.0).swing(1_111, periods * 10_000_000), 0.0);
        }
        let third = flicker(120, 0.0).swing(7, 25_000_000);
        assert_eq!(third, 0.0, "25 ms are three periods");
        let moment = flicker(100, 60.0).swing(10_000_000, 1);
        assert!((moment - 0.5).abs() < 1e-6, "{moment}");
        assert_eq!(flicker(100, 0.0).swing(0, 0), 1.0);
    }

    #[test]
    fn flicker_does_not_drift_over_a_billion_frames() {
        // In 10^9 frames of 20 ms there is a whole number of periods of 100 Hz.
        let light = flicker(100, 12.0);
        let late = 1_000_000_000 * 20_000_000;
        for start in [0, 1, 4_321_987] {
            assert_eq!(
                light.swing(start, 3_000_000),
                light.swing(start + late, 3_000_000)
            );
        }
    }
}
