//! `TRIGger`, `INITiate` and `ABORt`.

use super::form::{Setting, numeric};
use super::{Answer, MAX_TIME_S, say};
use crate::firmware::Firmware;
use crate::firmware::settings::{Mode, Source, from_seconds, seconds};
use crate::firmware::table::Command;
use phasmid_protocol::scpi::{Args, ErrorCode, Quantity, Unit};

const SOURCES: &[(&str, Source)] = &[
    ("SOFTware", Source::Software),
    ("BUS", Source::Bus),
    ("EXTernal", Source::External),
    ("INTernal", Source::Internal),
];
const MODES: &[(&str, Mode)] = &[("SEQuence", Mode::Sequence), ("STEP", Mode::Step)];

/// Returns the short form of the SCPI word for a value.
fn short<T: PartialEq>(choices: &[(&'static str, T)], value: &T) -> String {
    let word = choices.iter().find(|(_, v)| v == value).map_or("", |c| c.0);
    word.chars().filter(|c| !c.is_ascii_lowercase()).collect()
}

impl Firmware {
    pub(super) fn trigger_system(&mut self, unit: &Unit, command: Command) -> Answer {
        let mut args = Args::new(&unit.params);
        match command {
            Command::Trigger => self.fire()?,
            Command::Missed => return say(self.missed),
            Command::BusTrigger => {
                if !matches!(self.settings.source, Source::Bus | Source::Software) {
                    return Err(ErrorCode::TriggerIgnored
                        .with("TRIGger:SOURce is neither BUS nor SOFTware"));
                }
                self.fire()?;
            }
            Command::Source if unit.query => return say(short(SOURCES, &self.settings.source)),
            Command::Source => {
                let source = args.choice(SOURCES)?;
                args.finish()?;
                if source != self.settings.source {
                    self.not_initiated()?;
                    self.settings.source = source;
                    self.rest();
                }
            }
            Command::Delay => {
                if !unit.query {
                    self.not_running()?;
                }
                let bounds = (0.0, MAX_TIME_S, 0.0);
                match numeric(
                    unit,
                    Quantity::Time,
                    seconds(self.settings.delay_ns),
                    bounds,
                )? {
                    Setting::Say(value) => return say(value),
                    Setting::Set(value) => {
                        self.settings.delay_ns = self.quantised(from_seconds(value));
                    }
                }
            }
            Command::Mode if unit.query => return say(short(MODES, &self.settings.mode)),
            Command::Mode => {
                let mode = args.choice(MODES)?;
                args.finish()?;
                if mode != self.settings.mode {
                    self.not_initiated()?;
                    self.settings.mode = mode;
                }
            }
            Command::Initiate => self.state.initiate(&self.settings)?,
            Command::Continuous if unit.query => return say(u8::from(self.settings.continuous)),
            Command::Continuous => {
                let on = args.boolean()?;
                args.finish()?;
                if on != self.settings.continuous {
                    self.settings.continuous = on;
                    if !self.state.initiated() {
                        self.rest();
                    }
                }
            }
            _ => self.rest(),
        }
        Ok(None)
    }
}
