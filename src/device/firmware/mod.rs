//! The firmware: takes commands and returns replies and exposures, all in device time. It never
//! waits: the caller passes in the current time and asks when the next event is due.
//!
#![doc = include_str!("commands.md")]
//!
//! [`protocol::wire`]: phasmid_protocol::wire
//! [`protocol::data_line`]: phasmid_protocol::data_line
//! [`pattern::Manifest`]: phasmid_pattern::Manifest
//! [`geometry::Rig`]: phasmid_geometry::Rig

mod direct;
mod execute;
mod exposing;
mod memory;
mod messages;
mod pending;
mod settings;
mod shining;
mod status;
mod table;
#[cfg(test)]
mod tests;
mod trigger;

pub use direct::{Before, CameraControls};
pub use memory::UserSequence;
pub use pending::{Answered, Done};
pub use trigger::State;

use super::projection::Planes;
use super::{Exposure, PatternImage, StreamSink};
use memory::{Memory, Stored};
use pending::{Block, Current, Waiting};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::Rig;
use phasmid_profile::Profile;
use phasmid_protocol::dialect::Event;
use phasmid_protocol::scpi::{DeviceError, ErrorCode, Framer, Framing, Unit};
use phasmid_protocol::service::SequenceAbout;
use phasmid_protocol::usb::cdc::LineCoding;
use settings::{Settings, Source, power_on_is_consistent};
use shining::Shining;
use status::Status;
use std::cell::OnceCell;
use std::collections::VecDeque;
use std::sync::Arc;

/// Maximum number of events kept until the host fetches them.
const MAX_EVENTS: usize = 1024;

/// The firmware: the device as seen through its control port.
///
/// State after power-on and `*RST`: lamp on and white, the profile's exposure, gain 0, the whole
/// sensor, the first sequence selected, `TRIGger:SOURce INTernal` (free-running while a client
/// reads frames), `TRIGger:MODE SEQuence`, no delay, `INITiate:CONTinuous OFF`.
pub struct Firmware {
    profile: Profile,
    settings: Settings,
    memory: Memory,
    /// Copy of the memory at power-on, which a power cycle restores.
    loaded: Memory,
    selected: Arc<Stored>,
    white: Arc<PatternImage>,
    black: Arc<PatternImage>,
    state: State,
    status: Status,
    framer: Framer,
    /// The message being executed.
    current: Option<Current>,
    /// Units of the current message that are still to be executed.
    units: VecDeque<Unit>,
    /// Parse error that ends the current message.
    current_error: Option<DeviceError>,
    /// Messages queued behind the current one.
    waiting: VecDeque<Waiting>,
    waiting_bytes: usize,
    block: Option<Block>,
    /// Whether `*OPC` was received and its event bit is not set yet.
    completion_asked: bool,
    /// Answers so far of the message being executed.
    answers: Vec<Vec<u8>>,
    output: Vec<Answered>,
    /// Completed messages that were submitted with a ticket.
    done: Vec<Done>,
    exposures: Vec<Exposure>,
    /// Events that [`Self::take_events`] has not returned yet.
    events: VecDeque<Event>,
    next_id: u64,
    /// Number of triggered exposures since power-on.
    triggered: u64,
    /// Exposure start of each pattern of the selected sequence in its last run, in nanoseconds.
    taken_ns: Vec<u64>,
    /// State of the projector's light source, if the profile models one.
    shining: Option<Shining>,
    /// Number of exposures whose frames have not left the device.
    in_flight: u64,
    /// Number of triggers since power-on or `*RST` that came too early.
    missed: u64,
    /// Device time at which the controller has finished loading the selected sequence, in
    /// nanoseconds.
    loaded_ns: u64,
    /// Earliest device time at which the next exposure can start, in nanoseconds: until then the
    /// projector still shows the last pattern or the camera is not ready.
    free_from_ns: u64,
    /// Bit planes of the grey patterns that were split into bit planes most recently.
    planes: Planes,
    streaming: bool,
    /// Serial line settings of the host; they have no effect on the device.
    line: LineCoding,
    /// The factory calibration or the error of computing it; computed on first use.
    calibration: OnceCell<Result<Rig>>,
    /// Link that must know the stream format in advance.
    link: Option<Box<dyn StreamSink + Send>>,
    now_ns: u64,
}

impl Firmware {
    /// Powers the device on at time 0.
    ///
    /// # Errors
    /// Returns an error if a sequence's images cannot be read or do not fit the projector.
    pub fn new(profile: &Profile, user: &[UserSequence]) -> Result<Self> {
        debug_assert!(power_on_is_consistent(profile));
        let memory = Memory::new(profile, user)?;
        let full = (1u16 << profile.projector.bits) - 1;
        Ok(Self {
            settings: Settings::reset(profile),
            selected: memory.first().clone(),
            loaded: memory.clone(),
            memory,
            white: Arc::new(PatternImage::Uniform(full)),
            black: Arc::new(PatternImage::Uniform(0)),
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
            calibration: OnceCell::new(),
            link: None,
            now_ns: 0,
            profile: profile.clone(),
        })
    }

    /// Switches the device off and on again. Settings, sequences and images received over the port
    /// are lost, and exposures in progress are dropped; frames already exposed still leave. Frame
    /// ids continue, so that no id occurs twice. As with `*RST`, pixel format and region are kept
    /// while a link cannot change them.
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
            // A link that refuses the change keeps its format. No client is connected, so nobody
            // needs to be notified.
            let _ = self.reset();
        }
        self.events.clear();
        self.completion_asked = false;
        // The selected sequence loads during start-up.
        (self.missed, self.loaded_ns, self.free_from_ns) = (0, 0, 0);
        self.status = Status::power_on();
        self.run();
    }

    /// Attaches a link that is asked before the stream format changes. The link must already be
    /// ready for the format of [`Self::stream`].
    pub fn attach(&mut self, link: Box<dyn StreamSink + Send>) {
        self.link = Some(link);
    }

    /// Returns the headers of the commands in their long form; small letters may be left out.
    pub fn headers() -> impl Iterator<Item = &'static str> {
        table::TABLE.iter().map(|(pattern, _)| *pattern)
    }

    /// Returns the names of the sequences in the memory.
    pub fn sequence_names(&self) -> impl Iterator<Item = &str> {
        self.memory.names()
    }

    /// Returns the calibration that the device reports, for the whole sensor. The first call
    /// computes the calibration, which takes 10 to 100 ms.
    ///
    /// # Errors
    /// Returns the errors of [`Profile::factory_rig`].
    pub fn factory_calibration(&self) -> Result<&Rig, &Error> {
        let compute = || self.profile.factory_rig();
        self.calibration.get_or_init(compute).as_ref()
    }

    /// Returns the calibration that the device reports, for the region of interest and with the noise
    /// of the present settings.
    ///
    /// # Errors
    /// Returns the errors of [`Self::factory_calibration`].
    pub fn reported_calibration(&self) -> Result<Rig, &Error> {
        let mut rig = self.settings.roi.rig(*self.factory_calibration()?);
        let sensor = &self.profile.camera.sensor;
        let exposure_s = self.settings.exposure_ns as f64 * 1e-9;
        rig.noise = Some(sensor.noise_model(self.settings.gain_db, exposure_s));
        Ok(rig)
    }

    /// Returns the selected sequence and its name.
    pub fn selected(&self) -> SequenceAbout {
        SequenceAbout {
            name: self.selected.name.clone(),
            manifest: self.selected.manifest.to_toml(),
        }
    }

    /// Returns the note that a recording stores about the selected sequence and the calibration.
    pub fn note(&self) -> String {
        let rig = self.reported_calibration().ok();
        self.selected().to_note(rig.map(|rig| rig.to_toml()))
    }

    /// Sets the serial line coding that `SYSTem:COMMunicate:SERial` reports.
    pub fn set_line_coding(&mut self, line: LineCoding) {
        self.line = line;
    }

    /// Receives bytes from the control port at device time `now_ns`.
    pub fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        self.advance(now_ns);
        let mut framer = std::mem::take(&mut self.framer);
        framer.push(bytes, &mut |framing| match framing {
            Framing::Message(message) => self.line(&message),
            Framing::Dropped(error) => self.status.report(error),
        });
        self.framer = framer;
    }

    /// Returns the device time up to which everything has been processed, in nanoseconds.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Processes everything due up to `now_ns`.
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

    /// Returns the device time of the next event: the end of the next exposure, or in the idle
    /// state the time at which the device is ready for a trigger. `None` while nothing is pending.
    pub fn next_event_ns(&self) -> Option<u64> {
        match self.state {
            State::Idle => Some(self.ready_ns()).filter(|ready_ns| *ready_ns > self.now_ns),
            state => state.next_event_ns(&self.settings),
        }
    }

    /// Returns the earliest device time at which a trigger is not missed.
    fn ready_ns(&self) -> u64 {
        let delay_ns = self.settings.start_delay_ns();
        self.loaded_ns
            .max(self.free_from_ns.saturating_sub(delay_ns))
    }

    /// Takes the exposures to be rendered, in order.
    pub fn take_exposures(&mut self) -> Vec<Exposure> {
        std::mem::take(&mut self.exposures)
    }

    /// Takes all bytes to be sent over the control port.
    pub fn take_output(&mut self) -> Vec<u8> {
        self.take_answered()
            .into_iter()
            .flat_map(|a| a.bytes)
            .collect()
    }

    /// Takes the replies to be sent over the control port, each with the line that it answers.
    pub fn take_answered(&mut self) -> Vec<Answered> {
        std::mem::take(&mut self.output)
    }

    /// Takes the events since the last call; only the latest `MAX_EVENTS` are kept.
    pub fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events).into()
    }

    fn tell(&mut self, event: Event) {
        if self.events.len() >= MAX_EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(event);
    }

    /// Reports that the frames of `frames` exposures have left the device, or were dropped because
    /// no client reads them.
    pub fn delivered(&mut self, frames: u64) {
        self.in_flight = self.in_flight.saturating_sub(frames);
        self.run();
    }

    /// Returns the number of exposures whose frames have not left the device.
    pub fn in_flight(&self) -> u64 {
        self.in_flight
    }

    /// Returns the id of the next frame.
    pub fn next_id(&self) -> u64 {
        self.next_id
    }

    /// Sets whether a client reads frames; the camera runs free only then.
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

    /// Handles a pulse on the external trigger input; it has no effect unless the trigger source is
    /// `EXTernal`.
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

    /// Discards unfinished input and replies, as when a cable is pulled. Exposures continue.
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

    /// Abandons a data block that stopped arriving, so that the next line is parsed as a command.
    pub fn input_stalled(&mut self) {
        if self.framer.inside_block() {
            self.framer.reset();
            self.status
                .report(ErrorCode::InvalidBlockData.with("the block stopped arriving"));
        }
    }

    /// Returns whether the input is inside a data block.
    pub fn inside_block(&self) -> bool {
        self.framer.inside_block()
    }

    /// Queues the error for a reply that was dropped because earlier replies had not been read.
    pub fn reply_lost(&mut self) {
        self.status
            .report(ErrorCode::QueryDeadlocked.with("replies are not being read"));
    }

    /// Queues the error for a message that was dropped because the device was busy.
    pub fn input_lost(&mut self) {
        self.status
            .report(ErrorCode::InputBufferOverrun.with("the device is busy"));
    }

    /// Returns the state of the trigger system.
    pub fn state(&self) -> State {
        self.state
    }
}
