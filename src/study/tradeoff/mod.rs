//! Error versus run time for one device and scene: the effect of every setting that trades one for the
//! other ([`settings`], [`measure`]), and the fastest setting that reaches a wanted accuracy
//! ([`cheapest`]).
//!
//! ```
//! use phasmid_profile::{Profile, Scene};
//! use phasmid_report::stopwatch::Stopwatch;
//! use phasmid_study::tradeoff::{Setting, cheapest, measure};
//!
//! let (profile, scene) = (Profile::load("webcam-grey")?, Scene::load("plane")?);
//! let begin = std::time::Instant::now();
//! let clock = || begin.elapsed();
//! let watch = Stopwatch::new(&clock);
//! let steps = [3, 12].map(|n| Setting { steps: Some(n), scale: Some(0.35), ..Setting::default() });
//! let one = |setting| measure((&profile, &scene), setting, 1, watch, (1, 0.0));
//! let measured = steps.iter().map(one).collect::<Result<Vec<_>, _>>()?;
//! assert!(measured[1].rmse_mm < measured[0].rmse_mm);
//! assert_eq!(cheapest(&measured, 1e-6), None);
//! # Ok::<(), phasmid_core::error::Error>(())
//! ```
//!
//! | file | contents |
//! | --- | --- |
//! | `setting` | the knobs, and the device with them |
//! | `measured` | error and time of a setting, and the choice among several |

mod measured;
mod setting;

pub use measured::{LEAST_COVERAGE, MOST_GROSS, Measured, cheapest, front, measure};
pub use setting::{Setting, settings};

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_profile::{Profile, Scene};
    use phasmid_report::stopwatch::Stopwatch;
    use std::time::Instant;

    fn small() -> (Profile, Scene) {
        let mut profile = Profile::load("webcam-grey").unwrap();
        crate::clinic::binned(&mut profile, [320, 240]);
        (profile, Scene::load("sphere").unwrap())
    }

    fn measured(setting: &Setting) -> Measured {
        let (profile, scene) = small();
        let begin = Instant::now();
        let clock = || begin.elapsed();
        let watch = Stopwatch::new(&clock);
        measure((&profile, &scene), setting, 1, watch, (1, 0.0)).unwrap()
    }

    #[test]
    fn settings_are_those_that_the_device_and_the_scene_have() {
        let (profile, scene) = small();
        let all = settings(&profile, &scene);
        assert_eq!(all[0], Setting::default());
        for (i, one) in all.iter().enumerate() {
            assert!(!all[..i].contains(one), "{one}");
            assert!(one.time_samples.is_none() && one.interreflection.is_none());
        }
        let has = |text: &str| all.iter().any(|one| one.to_string() == text);
        for text in [
            "as in the profile",
            "3 steps",
            "12 steps, side x 0.5",
            "period x 2",
            "quick-4-xy",
        ] {
            assert!(has(text), "{text}");
        }
        // The list omits the device's own number of steps.
        assert!(!has("4 steps"));
        let mut moving = scene;
        let motion =
            "[[keyframes]]\ntime_s = 0\n[[keyframes]]\ntime_s = 2\nposition_mm = [0, 0, 1]";
        moving.object[0].motion = Some(toml::from_str(motion).unwrap());
        assert_eq!(settings(&profile, &moving).len(), all.len() + 3);
    }

    #[test]
    fn steps_and_periods_change_the_error_as_the_bound_says() {
        let usual = measured(&Setting::default());
        assert_eq!((usual.size_px, usual.frames), ([320, 240], 13));
        for (setting, frames, range) in [
            (
                Setting {
                    steps: Some(16),
                    ..Setting::default()
                },
                25,
                0.48..0.52,
            ),
            (
                Setting {
                    period: Some(0.5),
                    ..Setting::default()
                },
                14,
                0.5..0.7,
            ),
            (
                Setting {
                    period: Some(2.0),
                    ..Setting::default()
                },
                12,
                1.8..2.0,
            ),
        ] {
            let found = measured(&setting);
            assert!(found.is_sound(), "{found:?}");
            assert_eq!(found.frames, frames);
            // The bound is proportional to the period and to one over the root of the number of steps;
            // short periods lose contrast, because a pixel averages over part of a period.
            let ratio = found.bound_mm / usual.bound_mm;
            assert!(range.contains(&ratio), "{setting}: {ratio}");
            assert!(found.rmse_mm < 1.5 * found.bound_mm, "{found:?}");
        }
    }

    #[test]
    fn the_front_has_the_settings_that_no_other_beats() {
        let base = measured(&Setting::default());
        let with = |render_ms: f64, rmse_mm: f64, coverage: f64| Measured {
            render_ms,
            decode_ms: 1.0,
            rmse_mm,
            coverage,
            gross_error_rate: 0.0,
            ..base.clone()
        };
        let all = [
            with(1.0, 0.3, 1.0),
            with(2.0, 0.1, 1.0),
            with(3.0, 0.2, 1.0),
            with(0.5, 0.01, 0.5),
            with(9.0, f64::NAN, 1.0),
            with(4.0, 0.05, 1.0),
        ];
        assert_eq!(front(&all), [true, true, false, false, false, true]);
        let chosen = |wanted| cheapest(&all, wanted).map(|m| m.rmse_mm);
        assert_eq!(
            [0.3, 0.25, 0.07, 0.01].map(chosen),
            [Some(0.3), Some(0.1), Some(0.05), None]
        );
    }
}
