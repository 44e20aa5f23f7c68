//! `PROJector`: the lamp, its current and what is shown at rest.

use super::setting::{Setting, numeric};
use super::{Answer, say};
use crate::emulator::firmware::Firmware;
use crate::emulator::firmware::settings::Shown;
use crate::emulator::firmware::table::Command;
use crate::protocol::scpi::{Args, Quantity, Unit};

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
            _ if unit.query => {
                return match self.settings.shown {
                    Shown::White => say("WHIT"),
                    Shown::Black => say("BLAC"),
                    Shown::Pattern(index) => say(index),
                };
            }
            _ => {
                let shown = if matches!(unit.params[..], [crate::protocol::scpi::Param::Name(_)]) {
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
}
