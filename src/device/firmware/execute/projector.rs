//! `PROJector`: the lamp, its current, and the pattern shown while free-running.

use super::form::{Setting, numeric};
use super::{Answer, MAX_TIME_S, say};
use crate::firmware::Firmware;
use crate::firmware::settings::{Settings, Shown, from_seconds, seconds};
use crate::firmware::table::Command;
use phasmid_protocol::scpi::{Args, ErrorCode, Number, Quantity, Unit};

impl Firmware {
    pub(super) fn projector(&mut self, unit: &Unit, command: Command) -> Answer {
        let mut args = Args::new(&unit.params);
        if !unit.query {
            self.not_running()?;
        }
        match command {
            Command::Lamp if unit.query => return say(u8::from(self.settings.lamp)),
            Command::Lamp => {
                let on = args.boolean()?;
                args.finish()?;
                self.settings.lamp = on;
            }
            Command::Current => {
                let bounds = (0.0, 1.0, 1.0);
                match numeric(unit, Quantity::Ratio, self.settings.current, bounds)? {
                    Setting::Say(value) => return say(value),
                    Setting::Set(value) => self.settings.current = value,
                }
            }
            Command::PatternExposure => return self.pattern_exposure(unit),
            _ if unit.query => {
                return match self.settings.shown {
                    Shown::White => say("WHIT"),
                    Shown::Black => say("BLAC"),
                    Shown::Pattern(index) => say(index),
                };
            }
            _ => {
                let shown = if matches!(unit.params[..], [phasmid_protocol::scpi::Param::Name(_)]) {
                    args.choice(&[("WHITe", Shown::White), ("BLACk", Shown::Black)])?
                } else {
                    let last = f64::from(self.sequence_len() - 1);
                    let index = args.number(Quantity::Plain)?.within(0.0, last, 0.0)?;
                    Shown::Pattern(index.round() as u32)
                };
                args.finish()?;
                self.settings.shown = shown;
            }
        }
        Ok(None)
    }

    /// Sets or queries how long a pattern is shown; a projector without timing shows it for the
    /// whole period.
    fn pattern_exposure(&mut self, unit: &Unit) -> Answer {
        let period_ns = self.settings.period_ns;
        let Some(timing) = &self.profile.projector.timing else {
            if !unit.query {
                return Err(ErrorCode::SettingsConflict
                    .with("the projector shows a pattern for its whole period"));
            }
            let s = seconds(period_ns);
            return match numeric(unit, Quantity::Time, s, (s, s, s))? {
                Setting::Say(value) | Setting::Set(value) => say(value),
            };
        };
        let longest_ns = timing.longest_exposure_ns(period_ns);
        let default_ns = timing.exposure_ns();
        let word = Args::new(&unit.params).number(Quantity::Time).ok();
        // A value between the limits of all periods but outside the present bounds is a settings
        // conflict.
        let (min, max) = match (unit.query, word) {
            (true, _) | (false, Some(Number::Min | Number::Max)) => {
                (seconds(self.selected.shortest_ns), seconds(longest_ns))
            }
            _ => (0.0, MAX_TIME_S),
        };
        let bounds = (min, max, seconds(default_ns.unwrap_or(longest_ns)));
        let now = seconds(self.settings.pattern_ns(timing, period_ns));
        match numeric(unit, Quantity::Time, now, bounds)? {
            Setting::Say(value) => say(value),
            Setting::Set(value) => {
                let pattern_ns = match word {
                    Some(Number::Default) => default_ns,
                    _ => Some(timing.quantise_ns(from_seconds(value))),
                };
                let settings = Settings {
                    pattern_ns,
                    ..self.settings.clone()
                };
                self.check_selected(&settings)?;
                self.settings = settings;
                Ok(None)
            }
        }
    }
}
