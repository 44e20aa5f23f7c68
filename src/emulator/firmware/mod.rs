//! The firmware: commands in, replies and exposures out, all in device time. Nothing here waits:
//! whoever drives it says what time it is, and asks when something will happen next.

mod execute;
mod memory;
mod settings;
mod status;
mod table;
#[cfg(test)]
mod tests;
mod trigger;

pub use memory::UserSequence;
pub use trigger::State;

use super::{Exposure, Shot, Slide};
use crate::error::Result;
use crate::pattern::Pattern;
use crate::profile::Profile;
use crate::protocol::scpi::{DeviceError, ErrorCode, Framer, Framing, Program, Unit, parse};
use memory::{Memory, Stored};
use settings::{Settings, Shown, Source};
use std::collections::VecDeque;
use std::sync::Arc;

/// Messages that wait behind `*WAI` or `*OPC?`.
const MAX_WAITING: usize = 64;
/// Bytes of messages that wait.
const MAX_WAITING_BYTES: usize = 64 << 20;

/// What holds up the execution of a message until no operation is pending.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Block {
    /// `*WAI`.
    Silent,
    /// `*OPC?`, which answers 1 then.
    Answer,
}

/// The device behind the control port.
///
/// After power-on and `*RST`: lamp on and white, the profile's exposure, gain 0, the whole sensor,
/// the first sequence selected, `TRIGger:SOURce INTernal` (the camera runs free while somebody
/// reads from it), `TRIGger:MODE SEQuence`, no delay, `INITiate:CONTinuous OFF`.
pub struct Firmware {
    profile: Profile,
    settings: Settings,
    memory: Memory,
    selected: Arc<Stored>,
    white: Arc<Slide>,
    black: Arc<Slide>,
    state: State,
    status: Status,
    framer: Framer,
    /// Units of the message that is being executed.
    current: VecDeque<Unit>,
    /// What ends the message that is being executed.
    current_error: Option<DeviceError>,
    /// Messages behind it, with their lengths in bytes.
    waiting: VecDeque<(Program, usize)>,
    waiting_bytes: usize,
    block: Option<Block>,
    /// `*OPC` was given and has not been answered in the event register.
    completion_asked: bool,
    /// Answers of the message that is being executed.
    answers: Vec<Vec<u8>>,
    output: Vec<u8>,
    exposures: Vec<Exposure>,
    next_id: u64,
    /// Exposures whose frames have not left the device.
    in_flight: u64,
    streaming: bool,
    now_ns: u64,
}

use status::Status;

impl Firmware {
    /// Powers the device on at time 0.
    ///
    /// # Errors
    /// Sequences whose pictures cannot be read or that do not fit the projector.
    pub fn new(profile: &Profile, user: &[UserSequence]) -> Result<Self> {
        debug_assert!(execute::power_on_is_consistent(profile));
        let memory = Memory::new(profile, user)?;
        let full = (1u16 << profile.projector.bits) - 1;
        Ok(Self {
            settings: Settings::reset(profile),
            selected: memory.first().clone(),
            memory,
            white: Arc::new(Slide::Uniform(full)),
            black: Arc::new(Slide::Uniform(0)),
            state: State::Idle,
            status: Status::power_on(),
            framer: Framer::default(),
            current: VecDeque::new(),
            current_error: None,
            waiting: VecDeque::new(),
            waiting_bytes: 0,
            block: None,
            completion_asked: false,
            answers: Vec::new(),
            output: Vec::new(),
            exposures: Vec::new(),
            next_id: 0,
            in_flight: 0,
            streaming: false,
            now_ns: 0,
            profile: profile.clone(),
        })
    }

    /// Takes bytes from the control port at a time.
    pub fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        self.advance(now_ns);
        let mut framer = std::mem::take(&mut self.framer);
        framer.push(bytes, &mut |framing| match framing {
            Framing::Message(message) => self.message(&message),
            Framing::Dropped(error) => self.status.report(error),
        });
        self.framer = framer;
    }

    /// Works off what was due up to a time.
    pub fn advance(&mut self, now_ns: u64) {
        self.now_ns = self.now_ns.max(now_ns);
        let len = self.sequence_len();
        while let Some(exposed) = self.state.advance(&self.settings, len, self.now_ns) {
            self.expose(exposed);
        }
        self.run();
    }

    /// When an exposure ends next, in device time; `None` while nothing is under way.
    pub fn next_event_ns(&self) -> Option<u64> {
        self.state.next_event_ns(&self.settings)
    }

    /// What is to be rendered, in order.
    pub fn take_exposures(&mut self) -> Vec<Exposure> {
        std::mem::take(&mut self.exposures)
    }

    /// What is to be sent over the control port.
    pub fn take_output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.output)
    }

    /// Says that the frames of so many exposures have left the device (or, with nobody to read
    /// them, never will).
    pub fn delivered(&mut self, frames: u64) {
        self.in_flight = self.in_flight.saturating_sub(frames);
        self.run();
    }

    /// Exposures whose frames have not left the device.
    pub fn in_flight(&self) -> u64 {
        self.in_flight
    }

    /// Identity of the next frame.
    pub fn next_id(&self) -> u64 {
        self.next_id
    }

    /// Says whether somebody reads from the camera; only then does it run free.
    pub fn set_streaming(&mut self, on: bool, now_ns: u64) {
        self.advance(now_ns);
        if on != self.streaming {
            self.streaming = on;
            if !self.state.initiated() {
                self.rest();
                self.run();
            }
        }
    }

    /// A pulse on the external trigger input; without effect unless that is the source.
    pub fn external_trigger(&mut self, now_ns: u64) {
        self.advance(now_ns);
        if self.settings.source == Source::External
            && let Err(error) = self.fire()
        {
            self.status.report(error);
        }
        self.run();
    }

    /// Forgets unfinished input and replies, as when a cable is pulled. Exposures go on.
    pub fn hang_up(&mut self) {
        self.framer.reset();
        self.current.clear();
        self.current_error = None;
        self.waiting.clear();
        self.waiting_bytes = 0;
        self.block = None;
        self.answers.clear();
        self.output.clear();
    }

    /// Gives up on a block that stopped coming, so that the next line is read as one.
    pub fn input_stalled(&mut self) {
        if self.framer.inside_block() {
            self.framer.reset();
            self.status
                .report(ErrorCode::InvalidBlockData.with("the block stopped coming"));
        }
    }

    /// Whether the input stands inside of a block.
    pub fn inside_block(&self) -> bool {
        self.framer.inside_block()
    }

    /// Says that a reply was thrown away because nobody read those before it.
    pub fn reply_lost(&mut self) {
        self.status
            .report(ErrorCode::QueryDeadlocked.with("replies are not being read"));
    }

    /// Where the trigger system stands.
    pub fn state(&self) -> State {
        self.state
    }

    fn message(&mut self, message: &[u8]) {
        let program = parse(message);
        // A trigger or ABORt acts at once even behind a waiting *OPC?, as the interface messages
        // GET and DCL do on a bus; otherwise a device that waits for it could not be reached.
        if self.block.is_some() && program.error.is_none() && program.units.iter().all(urgent) {
            for unit in &program.units {
                if let Err(error) = self.execute(unit) {
                    self.status.report(error);
                }
            }
        } else if self.waiting.len() >= MAX_WAITING
            || self.waiting_bytes + message.len() > MAX_WAITING_BYTES
        {
            self.status
                .report(ErrorCode::InputBufferOverrun.with("too much waits behind *WAI or *OPC?"));
        } else {
            self.waiting_bytes += message.len();
            self.waiting.push_back((program, message.len()));
        }
        self.run();
    }

    /// Executes what can be executed now.
    fn run(&mut self) {
        self.settle();
        loop {
            if let Some(block) = self.block {
                if self.pending() {
                    return;
                }
                self.block = None;
                if block == Block::Answer {
                    self.answers.push(b"1".to_vec());
                }
            }
            if let Some(unit) = self.current.pop_front() {
                match self.execute(&unit) {
                    Ok(answer) => self.answers.extend(answer),
                    Err(error) => {
                        // A unit that was not understood voids the rest of its message.
                        if error.code.number() > -200 {
                            self.current.clear();
                            self.current_error = None;
                        }
                        self.status.report(error);
                    }
                }
                self.settle();
                continue;
            }
            if let Some(error) = self.current_error.take() {
                self.status.report(error);
            }
            if !self.answers.is_empty() {
                self.output.extend(self.answers.join(&b';'));
                self.output.push(b'\n');
                self.answers.clear();
            }
            let Some((program, len)) = self.waiting.pop_front() else {
                return;
            };
            self.waiting_bytes -= len;
            self.current = program.units.into();
            self.current_error = program.error;
        }
    }

    /// Whether an operation is pending: an INITiate that is not worked off, or frames of one that
    /// have not left the device. A camera that runs free, or is armed again and again, never ends.
    fn pending(&self) -> bool {
        match self.state {
            State::Free { .. } => false,
            State::Idle => self.in_flight > 0,
            State::Armed { .. } | State::Running { .. } => !self.settings.continuous,
        }
    }

    /// Brings the status registers up to date.
    fn settle(&mut self) {
        self.status.operation.set(match self.state {
            State::Idle => 0,
            State::Armed { .. } => status::WAITING_FOR_TRIGGER,
            State::Free { .. } | State::Running { .. } => status::MEASURING,
        });
        if self.completion_asked && !self.pending() {
            self.completion_asked = false;
            self.status.raise(execute::COMPLETE);
        }
    }

    fn rest(&mut self) {
        self.state = State::rest(&self.settings, self.streaming, self.now_ns);
    }

    fn fire(&mut self) -> Result<(), DeviceError> {
        let len = self.sequence_len();
        self.state.trigger(&self.settings, len, self.now_ns)
    }

    fn select(&mut self, stored: Arc<Stored>) {
        self.settings.period_ns = stored.period_ns;
        self.selected = stored;
        if matches!(self.settings.shown, Shown::Pattern(i) if i >= self.sequence_len()) {
            self.settings.shown = Shown::White;
        }
    }

    /// The selected sequence as it would be exposed with the present settings: what
    /// ground truth is asked about. It exposes nothing.
    pub fn selected_sequence(&self) -> Vec<(Pattern, Shot)> {
        let shots = self
            .selected
            .slides
            .iter()
            .enumerate()
            .map(|(i, slide)| Shot {
                id: 0,
                pattern_index: Some(i as u32),
                slide: Some(slide.clone()),
                light: self.settings.current,
                start_ns: 0,
                exposure_ns: self.settings.exposure_ns,
                gain_db: self.settings.gain_db,
            });
        let frames = self.selected.manifest.frame.iter();
        frames.map(|f| f.pattern.clone()).zip(shots).collect()
    }

    fn expose(&mut self, exposed: trigger::Exposed) {
        let Settings {
            exposure_ns,
            gain_db,
            roi,
            lamp,
            current,
            shown,
            ..
        } = self.settings;
        let slide = match exposed.index.map_or(shown, Shown::Pattern) {
            Shown::White => &self.white,
            Shown::Black => &self.black,
            Shown::Pattern(index) => &self.selected.slides[index as usize],
        };
        self.exposures.push(Exposure {
            shot: Shot {
                id: self.next_id,
                pattern_index: exposed.index,
                slide: lamp.then(|| slide.clone()),
                light: current,
                start_ns: exposed.start_ns,
                exposure_ns,
                gain_db,
            },
            roi,
        });
        self.next_id += 1;
        self.in_flight += 1;
    }
}

/// Whether a unit acts even while others wait.
fn urgent(unit: &Unit) -> bool {
    use table::Command;
    matches!(
        table::find(unit),
        Ok(Command::BusTrigger | Command::Trigger | Command::Abort)
    ) && !unit.query
}
