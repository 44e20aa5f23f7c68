//! Projector light source: rise time and thermal droop.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// Light source with a finite rise time that loses output as it warms. Data sheets give both: rise
/// and fall time, and relative flux over junction temperature.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Led {
    /// Rise time from 10 to 90 per cent, equal to the fall time, in microseconds: 2.2 time
    /// constants.
    pub rise_us: f64,
    /// Parts that warm up, such as junction, board and heat sink, each with its own time constant.
    /// At most eight.
    #[serde(default)]
    pub droop: Vec<Droop>,
}

/// Light lost as one part of the source warms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Droop {
    /// Thermal time constant in seconds.
    pub time_constant_s: f64,
    /// Fraction of the light lost when this part has reached its steady temperature at full
    /// current.
    pub fraction: f64,
}

impl Led {
    /// Maximum number of `droop` entries.
    pub const MAX_DROOPS: usize = 8;
    /// Maximum of the sum of all `fraction` values. At 1 the warm source would emit no light.
    pub const MOST_LOST: f64 = 0.9;
}

pub(super) fn check(led: &Led, check: &Check<'_>) -> Result<()> {
    check.within("projector.led.rise_us", led.rise_us, 1e-3..=1e6)?;
    check.that(
        led.droop.len() <= Led::MAX_DROOPS,
        "projector.led.droop",
        format!("{} entries", led.droop.len()),
        format!("at most {}", Led::MAX_DROOPS),
    )?;
    for (i, droop) in led.droop.iter().enumerate() {
        let field = |name| format!("projector.led.droop[{i}].{name}");
        let (time, share) = (droop.time_constant_s, droop.fraction);
        check.within(&field("time_constant_s"), time, 1e-6..=1e6)?;
        check.within(&field("fraction"), share, 0.0..=Led::MOST_LOST)?;
    }
    let lost: f64 = led.droop.iter().map(|droop| droop.fraction).sum();
    check.that(
        lost <= Led::MOST_LOST,
        "projector.led.droop",
        format!("fractions that sum to {lost}"),
        format!("at most {}", Led::MOST_LOST),
    )
}

#[cfg(test)]
mod tests {
    use crate::Profile;

    fn parse(led: &str) -> phasmid_core::error::Result<Profile> {
        let text = phasmid_device_profiles::WEBCAM_GREY;
        let mut at = text.find("[projector]").unwrap();
        at += text[at + 1..].find("\n[").unwrap() + 1;
        Profile::parse(&format!("{}\n{led}\n{}", &text[..at], &text[at..]), "p")
    }

    #[test]
    fn sources_are_read_and_impossible_ones_refused() {
        let droop = |time: &str, share: &str| {
            format!("[[projector.led.droop]]\ntime_constant_s = {time}\nfraction = {share}\n")
        };
        let led = |rise: &str| format!("[projector.led]\nrise_us = {rise}\n");
        let good = format!(
            "{}{}{}",
            led("3.5"),
            droop("0.4", "0.05"),
            droop("90", "0.1")
        );
        let read = parse(&good).unwrap().projector.led.unwrap();
        assert_eq!((read.rise_us, read.droop.len()), (3.5, 2));
        assert_eq!(parse("").unwrap().projector.led, None);
        for (text, words) in [
            (
                led("0"),
                "projector.led.rise_us: 0; expected 0.001 to 1000000",
            ),
            (led("nan"), "projector.led.rise_us"),
            (
                led("5") + &droop("0", "0.1"),
                "droop[0].time_constant_s: 0;",
            ),
            (led("5") + &droop("9", "-0.1"), "droop[0].fraction: -0.1;"),
            (
                led("5") + &droop("9", "0.5").repeat(2),
                "fractions that sum to 1;",
            ),
            (
                led("5") + &droop("9", "0.01").repeat(9),
                "9 entries; expected at most 8",
            ),
            ("[projector.led]\n".to_owned(), "rise_us"),
            (led("5") + "fall_us = 2", "fall_us"),
        ] {
            let e = parse(&text).unwrap_err();
            assert_eq!(e.exit_code(), 2);
            assert!(e.to_string().contains(words), "{e}");
        }
    }
}
