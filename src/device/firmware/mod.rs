//! The firmware: commands in, replies and exposures out, all in device time. Nothing here waits:
//! whoever drives it says what time it is, and asks when something will happen next.
//!
#![doc = include_str!("commands.md")]
//!
//! [`protocol::wire`]: phasmid_protocol::wire
//! [`protocol::data_line`]: phasmid_protocol::data_line
//! [`pattern::Manifest`]: phasmid_pattern::Manifest
//! [`geometry::Rig`]: phasmid_geometry::Rig

mod controls;
mod execute;
mod exposing;
mod memory;
mod messages;
mod settings;
mod shining;
mod shown;
mod status;
mod table;
#[cfg(test)]
mod tests;
mod trigger;
mod undo;

pub use controls::CameraControls;
pub use memory::UserSequence;
pub use messages::{Answered, Done};
pub use trigger::State;
pub use undo::Before;

use super::projection::Planes;
use super::{Exposure, Slide, StreamSink};
use memory::{Memory, Stored};
use messages::{Current, Waiting};
use phasmid_core::error::Result;
use phasmid_profile::Profile;
use phasmid_protocol::dialect::Event;
use phasmid_protocol::scpi::{DeviceError, ErrorCode, Framer, Framing, Unit};
use phasmid_protocol::usb::cdc::LineCoding;
use settings::{Settings, Source};
use shining::Shining;
use status::Status;
use std::collections::VecDeque;
use std::sync::Arc;

/// Events that wait to be told.
const MAX_EVENTS: usize = 1024;

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
    /// The memory at power-on.
    loaded: Memory,
    selected: Arc<Stored>,
    white: Arc<Slide>,
    black: Arc<Slide>,
    state: State,
    status: Status,
    framer: Framer,
    /// The message that is being executed.
    current: Option<Current>,
    /// What is left of it.
    units: VecDeque<Unit>,
    /// What ends it.
    current_error: Option<DeviceError>,
    /// Messages behind it.
    waiting: VecDeque<Waiting>,
    waiting_bytes: usize,
    block: Option<Block>,
    /// `*OPC` was given and has not been answered in the event register.
    completion_asked: bool,
    /// Answers of the message that is being executed.
    answers: Vec<Vec<u8>>,
    output: Vec<Answered>,
    /// Messages with tickets that have been worked off.
    done: Vec<Done>,
    exposures: Vec<Exposure>,
    /// What has happened and was not told yet.
    events: VecDeque<Event>,
    next_id: u64,
    /// Exposures since power-on that were triggered.
    triggered: u64,
    /// Starts of the exposures of the selected sequence's patterns, when it was last exposed.
    taken_ns: Vec<u64>,
    /// The light source, where it is more than on and off.
    shining: Option<Shining>,
    /// Exposures whose frames have not left the device.
    in_flight: u64,
    /// Triggers since power-on or `*RST` that came too early.
    missed: u64,
    /// When the selected sequence is in the controller's memory.
    loaded_ns: u64,
    /// No exposure starts before this: the projector shows the last pattern until then, or the camera
    /// is not so quick.
    free_from_ns: u64,
    /// Bits of grey patterns, as far as they were seen one by one.
    planes: Planes,
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
            loaded: memory.clone(),
            memory,
            white: Arc::new(Slide::Uniform(full)),
            black: Arc::new(Slide::Uniform(0)),
            state: State::Idle,
            status: Status::power_on(),
            framer: Framer::default(),
            current: None,
            units: VecDeque::new(),
            current_error: None,
            waiting: VecDeque::new(),
            waiting_bytes: 0,
            block: None,
            completion_asked: false,
            answers: Vec::new(),
            output: Vec::new(),
            done: Vec::new(),
            exposures: Vec::new(),
            events: VecDeque::new(),
            next_id: 0,
            triggered: 0,
            taken_ns: Vec::new(),
            shining: Shining::new(profile, &Settings::reset(profile)),
            in_flight: 0,
            missed: 0,
            loaded_ns: 0,
            free_from_ns: 0,
            planes: Planes::default(),
            streaming: false,
            line: profile.control.line_coding(),
            link: None,
            now_ns: 0,
            profile: profile.clone(),
        })
    }

    /// Switches the device off and on again. Settings, sequences and pictures that came over the
    /// port are lost, and what was under way is not exposed to its end; frames that have been
    /// exposed still leave. Ids go on, so that none comes twice. As with `*RST`, the frames' format
    /// and region stay where a link cannot change them now.
    pub fn power_cycle(&mut self, now_ns: u64) {
        self.advance(now_ns);
        self.hang_up();
        self.state = State::Idle;
        self.memory = self.loaded.clone();
        let (roi, format) = (self.settings.roi, self.settings.format);
        if self.link.is_some() && self.in_flight > 0 {
            self.settings = Settings {
                roi,
                format,
                ..Settings::reset(&self.profile)
            };
            self.select(self.memory.first().clone());
            self.rest();
        } else {
            // A link that refuses keeps its frames; there is nobody to tell.
            let _ = self.reset();
        }
        self.events.clear();
        self.completion_asked = false;
        // What is selected is loaded while the device starts.
        (self.missed, self.loaded_ns, self.free_from_ns) = (0, 0, 0);
        self.status = Status::power_on();
        self.run();
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
            Framing::Message(message) => self.line(&message),
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
            if let Some(index) = exposed.index {
                self.tell(Event::Exposed {
                    index: u64::from(index),
                    id: self.next_id - 1,
                });
                if index + 1 == len {
                    self.tell(Event::SequenceDone);
                }
            }
        }
        self.run();
    }

    /// When an exposure has ended next, or, at rest, the device is ready for a trigger, in device
    /// time; `None` while nothing is under way.
    pub fn next_event_ns(&self) -> Option<u64> {
        match self.state {
            State::Idle => Some(self.ready_ns()).filter(|ready_ns| *ready_ns > self.now_ns),
            state => state.next_event_ns(&self.settings),
        }
    }

    /// From when on a trigger is in time.
    fn ready_ns(&self) -> u64 {
        let delay_ns = self.settings.start_delay_ns();
        self.loaded_ns
            .max(self.free_from_ns.saturating_sub(delay_ns))
    }

    /// What is to be rendered, in order.
    pub fn take_exposures(&mut self) -> Vec<Exposure> {
        std::mem::take(&mut self.exposures)
    }

    /// What is to be sent over the control port, all of it.
    pub fn take_output(&mut self) -> Vec<u8> {
        self.take_answered()
            .into_iter()
            .flat_map(|a| a.bytes)
            .collect()
    }

    /// What is to be sent over the control port, by the lines that it answers.
    pub fn take_answered(&mut self) -> Vec<Answered> {
        std::mem::take(&mut self.output)
    }

    /// What has happened since this was asked last; of very much the latest.
    pub fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events).into()
    }

    fn tell(&mut self, event: Event) {
        if self.events.len() >= MAX_EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(event);
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
            self.tell(Event::TriggerMissed);
            self.status.report(error);
        }
        self.run();
    }

    /// Forgets unfinished input and replies, as when a cable is pulled. Exposures go on.
    pub fn hang_up(&mut self) {
        self.framer.reset();
        self.current = None;
        self.units.clear();
        self.current_error = None;
        self.waiting.clear();
        self.waiting_bytes = 0;
        self.block = None;
        self.answers.clear();
        self.output.clear();
        self.done.clear();
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

    /// Says that a message was thrown away because the device had no time for it.
    pub fn input_lost(&mut self) {
        self.status
            .report(ErrorCode::InputBufferOverrun.with("the device is busy"));
    }

    /// Where the trigger system stands.
    pub fn state(&self) -> State {
        self.state
    }
}
