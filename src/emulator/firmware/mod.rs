//! The firmware: commands in, replies and exposures out, all in device time. Nothing here waits:
//! whoever drives it says what time it is, and asks when something will happen next.
//!
#![doc = include_str!("commands.md")]
//!
//! [`protocol::wire`]: crate::protocol::wire
//! [`protocol::data_line`]: crate::protocol::data_line
//! [`pattern::Manifest`]: crate::pattern::Manifest
//! [`geometry::Rig`]: crate::geometry::Rig

mod controls;
mod execute;
mod exposing;
mod memory;
mod messages;
mod settings;
mod shining;
mod status;
mod table;
#[cfg(test)]
mod tests;
mod trigger;

pub use controls::CameraControls;
pub use memory::UserSequence;
pub use trigger::State;

use super::{Exposure, Slide, StreamSink};
use crate::error::Result;
use crate::profile::Profile;
use crate::protocol::scpi::{DeviceError, ErrorCode, Framer, Framing, Program, Unit};
use crate::protocol::usb::cdc::LineCoding;
use memory::{Memory, Stored};
use settings::{Settings, Source};
use shining::Shining;
use status::Status;
use std::collections::VecDeque;
use std::sync::Arc;

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
    /// Exposures since power-on that were triggered.
    triggered: u64,
    /// Starts of the exposures of the selected sequence's patterns, when it was last exposed.
    taken_ns: Vec<u64>,
    /// The light source, where it is more than on and off.
    shining: Option<Shining>,
    /// Exposures whose frames have not left the device.
    in_flight: u64,
    streaming: bool,
    /// How the host has set the serial line; nothing here depends on it.
    line: LineCoding,
    /// The link that has to know what frames come.
    link: Option<Box<dyn StreamSink + Send>>,
    now_ns: u64,
}

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
            triggered: 0,
            taken_ns: Vec::new(),
            shining: Shining::new(profile, &Settings::reset(profile)),
            in_flight: 0,
            streaming: false,
            line: LineCoding::default(),
            link: None,
            now_ns: 0,
            profile: profile.clone(),
        })
    }

    /// Puts a link behind the camera that is asked before the frames change. It is ready for those
    /// of [`Self::stream`].
    pub fn attach(&mut self, link: Box<dyn StreamSink + Send>) {
        self.link = Some(link);
    }

    /// Says how the host has set the serial line: `SYSTem:COMMunicate:SERial` tells it.
    pub fn set_line_coding(&mut self, line: LineCoding) {
        self.line = line;
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
}
