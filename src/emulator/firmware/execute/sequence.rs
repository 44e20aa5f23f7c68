//! `SEQuence`: what is stored, defined and selected.

use super::setting::{Setting, numeric};
use super::{Answer, MAX_TIME_S, check_period, say};
use crate::emulator::firmware::Firmware;
use crate::emulator::firmware::settings::{from_seconds, seconds};
use crate::emulator::firmware::table::Command;
use crate::protocol::scpi::{Args, ErrorCode, Number, Quantity, Unit, encode_block, quote};

impl Firmware {
    pub(super) fn sequence(&mut self, unit: &Unit, command: Command) -> Answer {
        let mut args = Args::new(&unit.params);
        match command {
            Command::Select if unit.query => return say(quote(&self.selected.name)),
            Command::List => {
                let names: Vec<_> = self.memory.names().map(quote).collect();
                return say(names.join(","));
            }
            Command::Count => return say(self.sequence_len()),
            Command::Data => {
                let toml = self.selected.manifest.to_toml();
                return Ok(Some(encode_block(toml.as_bytes())));
            }
            Command::Period => {
                if !unit.query {
                    self.not_running()?;
                }
                let default = seconds(self.selected.period_ns);
                // The shortest is what an exposure takes; what lies between is a conflict of settings.
                let floor = match Args::new(&unit.params).number(Quantity::Time) {
                    Ok(Number::Min) => seconds(self.settings.shortest_period_ns()),
                    _ => 1e-6,
                };
                let bounds = (floor, MAX_TIME_S, default);
                match numeric(
                    unit,
                    Quantity::Time,
                    seconds(self.settings.period_ns),
                    bounds,
                )? {
                    Setting::Say(value) => return say(value),
                    Setting::Set(value) => {
                        let period_ns = from_seconds(value);
                        check_period(&self.settings, period_ns)?;
                        self.settings.period_ns = period_ns;
                    }
                }
                return Ok(None);
            }
            _ => {}
        }
        let name = args.text()?;
        match command {
            Command::Picture => {
                let bytes = args.block()?;
                args.finish()?;
                self.memory.upload(name, bytes)?;
            }
            Command::DeletePicture => {
                args.finish()?;
                self.memory.delete_picture(name)?;
            }
            Command::Define => {
                let toml = args.block()?;
                args.finish()?;
                self.not_initiated()?;
                let selected = self.selected.name == name;
                if selected {
                    check_period(&self.settings, self.memory.first().period_ns)?;
                }
                let stored = self.memory.define(name, toml)?;
                if selected {
                    self.select(stored);
                }
            }
            Command::Delete => {
                args.finish()?;
                if self.selected.name == name {
                    return Err(ErrorCode::SettingsConflict
                        .with(format!("{name} is selected, select another first")));
                }
                self.memory.delete(name)?;
            }
            _ => {
                args.finish()?;
                self.not_initiated()?;
                let Some(stored) = self.memory.get(name).cloned() else {
                    return Err(ErrorCode::FileNameNotFound.with(name));
                };
                check_period(&self.settings, stored.period_ns)?;
                self.select(stored);
            }
        }
        Ok(None)
    }
}
