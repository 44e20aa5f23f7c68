//! What each command does and each query answers.

use super::super::Roi;
use super::settings::{Mode, Settings, Shown, Source, from_seconds, microseconds, seconds};
use super::status::OPERATION_COMPLETE;
use super::table::{Command, find};
use super::{Block, Firmware};
use crate::protocol::scpi::{
    Args, DeviceError, ErrorCode, Number, Quantity, Unit, encode_block, quote,
};

/// Longest times that can be set, in seconds.
const MAX_TIME_S: f64 = 60.0;
/// Shortest interval of free-running frames in seconds.
const MIN_INTERVAL_S: f64 = 1e-4;

const SOURCES: &[(&str, Source)] = &[
    ("SOFTware", Source::Software),
    ("BUS", Source::Bus),
    ("EXTernal", Source::External),
    ("INTernal", Source::Internal),
];
const MODES: &[(&str, Mode)] = &[("SEQuence", Mode::Sequence), ("STEP", Mode::Step)];

type Answer = Result<Option<Vec<u8>>, DeviceError>;

/// A query's answer.
fn say(value: impl std::fmt::Display) -> Answer {
    Ok(Some(value.to_string().into_bytes()))
}

/// The short form of the word for a value.
fn short<T: PartialEq>(choices: &[(&'static str, T)], value: &T) -> String {
    let word = choices.iter().find(|(_, v)| v == value).map_or("", |c| c.0);
    word.chars().filter(|c| !c.is_ascii_lowercase()).collect()
}

/// A setting with its bounds: what to set, or with `?` the value, or a bound when asked for one.
fn numeric(
    unit: &Unit,
    quantity: Quantity,
    value: f64,
    (min, max, default): (f64, f64, f64),
) -> Result<Setting, DeviceError> {
    let mut args = Args::new(&unit.params);
    if unit.query {
        if args.is_empty() {
            return Ok(Setting::Say(value));
        }
        let bound = match args.number(quantity)? {
            Number::Value(_) => return Err(ErrorCode::ParameterNotAllowed.into()),
            word => word.within(min, max, default)?,
        };
        args.finish()?;
        return Ok(Setting::Say(bound));
    }
    let number = args.number(quantity)?;
    args.finish()?;
    number.within(min, max, default).map(Setting::Set)
}

enum Setting {
    Say(f64),
    Set(f64),
}

impl Firmware {
    /// Executes one unit.
    pub(super) fn execute(&mut self, unit: &Unit) -> Answer {
        let command = find(unit)?;
        self.check_form(unit, command)?;
        match command {
            Command::Exposure
            | Command::Gain
            | Command::Format
            | Command::Roi
            | Command::Interval => self.camera(unit, command),
            Command::Lamp | Command::Current | Command::Shown => self.projector(unit, command),
            Command::Select
            | Command::List
            | Command::Count
            | Command::Period
            | Command::Data
            | Command::Picture
            | Command::DeletePicture
            | Command::Define
            | Command::Delete => self.sequence(unit, command),
            Command::Trigger
            | Command::BusTrigger
            | Command::Source
            | Command::Delay
            | Command::Mode
            | Command::Initiate
            | Command::Continuous
            | Command::Abort => self.trigger_system(unit, command),
            _ => self.common(unit, command),
        }
    }

    /// Refuses queries of what only acts, and orders to what only answers, as unknown headers; and
    /// parameters where none belong.
    fn check_form(&self, unit: &Unit, command: Command) -> Result<(), DeviceError> {
        use Command as C;
        let only_query = matches!(
            command,
            C::Identify
                | C::EventStatus
                | C::StatusByte
                | C::SelfTest
                | C::List
                | C::Count
                | C::Data
                | C::OperationEvent
                | C::OperationCondition
                | C::QuestionableEvent
                | C::QuestionableCondition
                | C::NextError
                | C::ErrorCount
                | C::Version
                | C::Calibration
                | C::FrameCount
        );
        let only_order = matches!(
            command,
            C::Reset
                | C::ClearStatus
                | C::Wait
                | C::BusTrigger
                | C::Picture
                | C::DeletePicture
                | C::Define
                | C::Delete
                | C::Trigger
                | C::Initiate
                | C::Abort
                | C::Preset
        );
        if (only_query && !unit.query) || (only_order && unit.query) {
            return Err(ErrorCode::UndefinedHeader.with(unit.header()));
        }
        let bare = only_query
            || matches!(
                command,
                C::Reset
                    | C::ClearStatus
                    | C::Wait
                    | C::BusTrigger
                    | C::Trigger
                    | C::Initiate
                    | C::Abort
                    | C::Preset
                    | C::OperationComplete
            )
            || unit.query && !numeric_command(command);
        if bare && !unit.params.is_empty() {
            return Err(ErrorCode::ParameterNotAllowed.with(unit.header()));
        }
        Ok(())
    }

    fn common(&mut self, unit: &Unit, command: Command) -> Answer {
        let mut args = Args::new(&unit.params);
        match command {
            Command::Identify => {
                let id = &self.profile.identity;
                return say(format!(
                    "{},{},{},{}",
                    id.manufacturer, id.model, id.serial, id.firmware
                ));
            }
            Command::Reset => self.reset(),
            Command::ClearStatus => {
                self.status.clear();
                self.completion_asked = false;
            }
            Command::EventEnable if unit.query => return say(self.status.event_enable),
            Command::EventEnable => {
                let value = args.number(Quantity::Plain)?.within(0.0, 255.0, 0.0)?;
                args.finish()?;
                self.status.event_enable = value.round() as u8;
            }
            Command::EventStatus => return say(self.status.take_event()),
            Command::OperationComplete if unit.query => self.block = Some(Block::Answer),
            Command::OperationComplete => {
                self.completion_asked = true;
                self.settle();
            }
            Command::ServiceEnable if unit.query => return say(self.status.service_enable),
            Command::ServiceEnable => {
                let value = args.number(Quantity::Plain)?.within(0.0, 255.0, 0.0)?;
                args.finish()?;
                // Bit 6 cannot be enabled (IEEE 488.2, 11.3.2.3).
                self.status.service_enable = value.round() as u8 & !(1 << 6);
            }
            Command::StatusByte => return say(self.status.byte(!self.answers.is_empty())),
            Command::SelfTest => return say(0),
            Command::Wait => self.block = Some(Block::Silent),
            Command::OperationEvent => return say(self.status.operation.take_event()),
            Command::OperationCondition => return say(self.status.operation.condition()),
            Command::QuestionableEvent => return say(self.status.questionable.take_event()),
            Command::QuestionableCondition => return say(self.status.questionable.condition()),
            Command::OperationEnable | Command::QuestionableEnable => {
                let register = match command {
                    Command::OperationEnable => &mut self.status.operation,
                    _ => &mut self.status.questionable,
                };
                if unit.query {
                    return say(register.enable);
                }
                let value = args.number(Quantity::Plain)?.within(0.0, 65535.0, 0.0)?;
                args.finish()?;
                // Bit 15 is not used (SCPI-1999 vol 1, 20).
                register.enable = value.round() as u16 & 0x7fff;
            }
            Command::Preset => self.status.preset(),
            Command::NextError => return say(self.status.next_error()),
            Command::ErrorCount => return say(self.status.error_count()),
            Command::Version => return say("1999.0"),
            Command::Calibration => {
                let mut rig = self.settings.roi.rig(self.profile.nominal_rig());
                let sensor = &self.profile.camera.sensor;
                rig.noise = Some(sensor.noise_model(self.settings.gain_db));
                return Ok(Some(encode_block(rig.to_toml().as_bytes())));
            }
            _ => return say(self.next_id),
        }
        Ok(None)
    }

    fn camera(&mut self, unit: &Unit, command: Command) -> Answer {
        let camera = &self.profile.camera;
        let settings = &self.settings;
        if !unit.query {
            self.not_running()?;
        }
        match command {
            Command::Exposure => {
                let [shortest, longest] = camera.exposure_range_us;
                let bounds = (shortest / 1e6, longest / 1e6, camera.exposure_us / 1e6);
                match numeric(unit, Quantity::Time, seconds(settings.exposure_ns), bounds)? {
                    Setting::Say(value) => return say(value),
                    Setting::Set(value) => {
                        let exposure_ns = from_seconds(value);
                        check_period(exposure_ns, settings.period_ns)?;
                        self.settings.exposure_ns = exposure_ns;
                    }
                }
            }
            Command::Gain => {
                let bounds = (0.0, camera.max_gain_db, 0.0);
                match numeric(unit, Quantity::Decibel, settings.gain_db, bounds)? {
                    Setting::Say(value) => return say(value),
                    Setting::Set(value) => self.settings.gain_db = value,
                }
            }
            Command::Interval => {
                let default = camera.frame_interval_us / 1e6;
                let bounds = (MIN_INTERVAL_S, MAX_TIME_S, default);
                match numeric(unit, Quantity::Time, seconds(settings.interval_ns), bounds)? {
                    Setting::Say(value) => return say(value),
                    Setting::Set(value) => self.settings.interval_ns = from_seconds(value),
                }
            }
            Command::Format => {
                let code = String::from_utf8_lossy(&camera.format.fourcc())
                    .trim_end()
                    .to_owned();
                if unit.query {
                    return say(code);
                }
                let mut args = Args::new(&unit.params);
                args.choice(&[(code.as_str(), ())])?;
                args.finish()?;
            }
            _ if unit.query => {
                let roi = settings.roi;
                return say(format!("{},{},{},{}", roi.x, roi.y, roi.width, roi.height));
            }
            _ => {
                let (width, height) = (camera.width_px, camera.height_px);
                self.settings.roi = roi(unit, width, height)?;
            }
        }
        Ok(None)
    }

    fn projector(&mut self, unit: &Unit, command: Command) -> Answer {
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

    fn sequence(&mut self, unit: &Unit, command: Command) -> Answer {
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
                // The shortest is the exposure, but what lies between is a conflict of settings.
                let floor = match Args::new(&unit.params).number(Quantity::Time) {
                    Ok(Number::Min) => seconds(self.settings.exposure_ns),
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
                        check_period(self.settings.exposure_ns, period_ns)?;
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
                let stored = self.memory.define(name, toml)?;
                if self.selected.name == name {
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
                check_period(self.settings.exposure_ns, stored.period_ns)?;
                self.select(stored);
            }
        }
        Ok(None)
    }

    fn trigger_system(&mut self, unit: &Unit, command: Command) -> Answer {
        let mut args = Args::new(&unit.params);
        match command {
            Command::Trigger => self.fire()?,
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
                    Setting::Set(value) => self.settings.delay_ns = from_seconds(value),
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

    fn not_running(&self) -> Result<(), DeviceError> {
        match self.state {
            super::State::Running { .. } => {
                Err(ErrorCode::SettingsConflict.with("a sequence is being exposed"))
            }
            _ => Ok(()),
        }
    }

    fn not_initiated(&self) -> Result<(), DeviceError> {
        if self.state.initiated() {
            return Err(ErrorCode::SettingsConflict
                .with("initiated, ABORt first (INITiate:CONTinuous OFF before that)"));
        }
        Ok(())
    }

    fn reset(&mut self) {
        self.settings = Settings::reset(&self.profile);
        let first = self.memory.first().clone();
        self.select(first);
        self.completion_asked = false;
        self.rest();
    }

    pub(super) fn sequence_len(&self) -> u32 {
        self.selected.slides.len() as u32
    }
}

/// Whether a command's query takes MINimum, MAXimum and DEFault.
fn numeric_command(command: Command) -> bool {
    matches!(
        command,
        Command::Exposure
            | Command::Gain
            | Command::Interval
            | Command::Current
            | Command::Period
            | Command::Delay
    )
}

fn check_period(exposure_ns: u64, period_ns: u64) -> Result<(), DeviceError> {
    if exposure_ns <= period_ns {
        return Ok(());
    }
    Err(ErrorCode::SettingsConflict.with(format!(
        "exposure {} s exceeds the sequence's period {} s",
        seconds(exposure_ns),
        seconds(period_ns)
    )))
}

/// x, y, width, height inside of the sensor.
fn roi(unit: &Unit, width: u32, height: u32) -> Result<Roi, DeviceError> {
    let mut args = Args::new(&unit.params);
    let mut next = |min: f64, max: u32, default: u32| {
        args.number(Quantity::Plain)?
            .within(min, f64::from(max), f64::from(default))
            .map(|value| value.round() as u32)
    };
    let x = next(0.0, width - 1, 0)?;
    let y = next(0.0, height - 1, 0)?;
    let w = next(1.0, width - x, width - x)?;
    let h = next(1.0, height - y, height - y)?;
    args.finish()?;
    Ok(Roi {
        x,
        y,
        width: w,
        height: h,
    })
}

/// Bits that `settle` raises.
pub(super) const COMPLETE: u8 = OPERATION_COMPLETE;

/// The profile's exposure fits the profile's period; kept beside the rule that says so.
pub(super) fn power_on_is_consistent(profile: &crate::profile::Profile) -> bool {
    check_period(
        microseconds(profile.camera.exposure_us),
        microseconds(profile.sequence[0].period_us),
    )
    .is_ok()
}
