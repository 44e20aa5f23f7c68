//! `SEQuence`: stored, defined and selected sequences.

use super::form::{Setting, numeric};
use super::{Answer, MAX_TIME_S, say};
use crate::firmware::Firmware;
use crate::firmware::settings::{Settings, check_period, from_seconds, seconds};
use crate::firmware::table::Command;
use phasmid_protocol::scpi::{Args, ErrorCode, Number, Quantity, Unit, encode_block, quote};

impl Firmware {
    /// Returns the shortest period of the selected sequence that the camera and the projector's
    /// timing allow.
    fn shortest_period_ns(&self) -> u64 {
        let camera_ns = self.settings.shortest_period_ns();
        let Some(timing) = &self.profile.projector.timing else {
            return camera_ns;
        };
        let pattern_ns = self
            .settings
            .pattern_ns
            .unwrap_or(self.selected.shortest_ns);
        let step_ns = timing.resolution_ns();
        let on_clock_ns = camera_ns.div_ceil(step_ns).saturating_mul(step_ns);
        on_clock_ns.max(timing.shortest_period_ns(pattern_ns))
    }

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
                // `MIN` stands for the shortest period that camera and projector allow now; a
                // shorter period is a settings conflict.
                let floor = match Args::new(&unit.params).number(Quantity::Time) {
                    Ok(Number::Min) => seconds(self.shortest_period_ns()),
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
                        let settings = Settings {
                            period_ns: self.quantised(from_seconds(value)),
                            ..self.settings.clone()
                        };
                        self.check_selected(&settings)?;
                        self.settings = settings;
                    }
                }
                return Ok(None);
            }
            _ => {}
        }
        let name = args.text()?;
        match command {
            Command::Image => {
                let bytes = args.block()?;
                args.finish()?;
                self.memory.upload(name, bytes)?;
            }
            Command::DeleteImage => {
                args.finish()?;
                self.memory.delete_image(name)?;
            }
            Command::Define => {
                let toml = args.block()?;
                args.finish()?;
                self.not_initiated()?;
                let selected = self.selected.name == name;
                let (settings, timing) = (&self.settings, self.profile.projector.timing.as_ref());
                let stored = self.memory.define(name, toml, |new| match selected {
                    true => check_period(settings, new.period_ns, timing, new.shortest_ns),
                    false => Ok(()),
                })?;
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
                let timing = self.profile.projector.timing.as_ref();
                let (period_ns, shortest_ns) = (stored.period_ns, stored.shortest_ns);
                check_period(&self.settings, period_ns, timing, shortest_ns)?;
                self.select(stored);
            }
        }
        Ok(None)
    }
}
