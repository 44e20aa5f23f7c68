//! The latest frame and scan of each source, and the viewers. Frames do not queue: a slow viewer
//! misses frames.

use crate::measurement::Measurement;
use crate::operator::{Operator, Request};
use crate::recording::Recording;
use crate::room::{KnownRow, Room, RoomRow, RoomScan};
use crate::sequence::Sequence;
use crate::traffic::{Entry, Traffic};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::Frame;
use phasmid_protocol::record::{Channel, Event, Side};
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::mem::take;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Instant;
use tokio::sync::watch;

/// Maximum number of viewers at a time.
const MAX_VIEWERS: usize = 16;
/// Maximum number of tracking results that are kept for a room.
const MAX_ROWS: usize = 3000;

/// A frame that a source has shown.
#[derive(Clone)]
pub(crate) struct Shown {
    /// Running number of the frame among all that the source has shown, from 1.
    pub(crate) number: u64,
    pub(crate) frame: Arc<Frame>,
    /// Whether id, pattern and times come from the device; if not, the id is a running number.
    pub(crate) identified: bool,
    /// Time of arrival at the hub.
    pub(crate) arrived: Instant,
}

/// A value that a source has shown, with its running number among all that the source has shown.
#[derive(Clone)]
pub(crate) struct Numbered<T> {
    pub(crate) number: u64,
    pub(crate) value: T,
}

/// Returns the latest value if its number is greater than `number`.
fn newer<T: Clone>(latest: &Option<Numbered<T>>, number: u64) -> Option<Numbered<T>> {
    { latest.as_ref() }
        .filter(|latest| latest.number > number)
        .cloned()
}

/// A scanner.
#[derive(Default)]
struct Source {
    name: String,
    latest: Option<Shown>,
    sequence: Option<Numbered<Arc<Sequence>>>,
    measurement: Option<Numbered<Arc<dyn Measurement>>>,
    room: Option<Numbered<Arc<Room>>>,
    /// Tracking results in the room.
    rows: VecDeque<Numbered<Arc<KnownRow>>>,
    /// Number of results so far.
    results: u64,
    /// The patient in the last scan.
    scan: Arc<RoomScan>,
    operators: Vec<Arc<dyn Operator>>,
    /// Status text for viewers: the current activity, or the reason why it failed.
    status: Option<String>,
    traffic: Traffic,
    /// The last running number; frames, sequences, measurements, rooms and results share it.
    shown: u64,
    /// Whether the source plays recordings.
    plays: bool,
    /// Number of restarts.
    era: u64,
    recording: Option<Recording>,
    /// Reason why the last recording ended, unless a viewer ended it.
    cut: Option<String>,
    /// Number of programs that are known to read the camera.
    readers: u64,
    /// Reason why the last frame was damaged or why the camera is gone.
    why: Option<String>,
    /// Which of camera and control port are unplugged.
    unplugged: Unplugged,
}

impl Source {
    /// Forgets the latest frame and the state of the links.
    fn rewind(&mut self) {
        self.latest = None;
        (self.readers, self.why, self.unplugged) = (0, None, Unplugged::default());
    }

    /// Gives a value the next running number.
    fn number<T>(&mut self, value: T) -> Numbered<T> {
        self.shown += 1;
        Numbered {
            number: self.shown,
            value,
        }
    }
}

/// The links of a source that are unplugged.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub(crate) struct Unplugged {
    pub(crate) camera: bool,
    pub(crate) control: bool,
}

/// The state of a source, for the page; its frames are sent separately.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub(crate) struct Standing {
    pub(crate) name: String,
    pub(crate) readers: u64,
    pub(crate) why: Option<String>,
    pub(crate) unplugged: Unplugged,
    /// Whether the source is a treatment room.
    pub(crate) room: bool,
    /// Kinds of requests that the source answers.
    pub(crate) answers: Vec<&'static str>,
    pub(crate) status: Option<String>,
    /// Number of restarts. When it changes, the page forgets everything that the source has shown.
    pub(crate) era: u64,
    /// Name of the recording that is being made.
    pub(crate) recording: Option<String>,
    /// Reason why the last recording ended, unless a viewer ended it.
    pub(crate) cut: Option<String>,
}

#[derive(Default)]
struct State {
    sources: Vec<Source>,
    /// Number of viewers so far.
    numbered: u64,
    /// Numbers of the connected viewers.
    viewers: Vec<u64>,
    controller: Option<u64>,
}

/// Returns whether a channel is a camera's.
fn is_camera(channel: Channel) -> bool {
    matches!(channel, Channel::Camera | Channel::Counted)
}

/// The sources and the viewers.
pub(crate) struct Hub {
    state: Mutex<State>,
    /// Number of changes so far; viewers are notified when it increases.
    news: watch::Sender<u64>,
    /// Folder of recordings.
    recordings: Option<PathBuf>,
    /// Token of the address at which other people may watch.
    view_token: String,
}

impl Hub {
    /// Creates a hub without sources. `recordings` is the folder into which viewers may record and
    /// upload, if any.
    pub(crate) fn new(recordings: Option<PathBuf>, view_token: String) -> Self {
        Self {
            state: Mutex::default(),
            news: watch::Sender::new(0),
            recordings,
            view_token,
        }
    }

    /// Returns the folder of recordings.
    pub(crate) fn recordings(&self) -> Option<&Path> {
        self.recordings.as_deref()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell(&self) {
        self.news.send_modify(|count| *count += 1);
    }

    /// Adds a source and returns its index. `plays` says whether the source plays recordings.
    pub(crate) fn add(&self, name: String, plays: bool) -> usize {
        let mut state = self.state();
        state.sources.push(Source {
            name,
            plays,
            ..Source::default()
        });
        let index = state.sources.len() - 1;
        drop(state);
        self.tell();
        index
    }

    /// Handles an event of a source's links. It never blocks for long, because the data for a
    /// viewer is copied in that viewer's own task.
    pub(crate) fn see(&self, source: usize, time_ns: u64, channel: Channel, event: &Event) {
        let mut state = self.state();
        let source = &mut state.sources[source];
        source.traffic.push(time_ns, channel, event);
        if let Some(recording) = &source.recording {
            recording.put(time_ns, channel, event);
        }
        match event {
            Event::Frame(frame) => {
                source.shown += 1;
                source.latest = Some(Shown {
                    number: source.shown,
                    frame: frame.clone(),
                    identified: channel == Channel::Camera,
                    arrived: Instant::now(),
                });
            }
            Event::Opened if is_camera(channel) => {
                source.readers += 1;
                source.unplugged.camera = false;
            }
            Event::Opened if channel.is_port() => source.unplugged.control = false,
            Event::Left if is_camera(channel) => {
                source.readers = source.readers.saturating_sub(1);
            }
            Event::Note(why) if is_camera(channel) => {
                source.why = Some(why.clone());
            }
            Event::Unplugged | Event::Plugged => {
                let unplugged = *event == Event::Unplugged;
                match channel.is_port() {
                    true => source.unplugged.control = unplugged,
                    false => {
                        source.unplugged.camera = unplugged;
                        if unplugged {
                            source.readers = 0;
                        }
                        source.why = source.why.take().filter(|_| unplugged);
                    }
                }
            }
            _ => {}
        }
        drop(state);
        self.tell();
    }

    /// Shows the patterns of a sequence from now on.
    pub(crate) fn show_sequence(&self, source: usize, sequence: Arc<Sequence>) {
        let mut state = self.state();
        let source = &mut state.sources[source];
        let shown = source.sequence.as_ref();
        if shown.is_none_or(|shown| shown.value != sequence) {
            if let Some(recording) = &source.recording {
                let now_ns = source.traffic.last_ns().unwrap_or(0);
                recording.note(now_ns, &sequence);
            }
            source.sequence = Some(source.number(sequence));
            drop(state);
            self.tell();
        }
    }

    /// Forgets what a source has shown. `device_times` says whether its events will have times of the
    /// device's clock.
    pub(crate) fn restart(&self, source: usize, device_times: bool) {
        let mut state = self.state();
        let source = &mut state.sources[source];
        source.rewind();
        (source.sequence, source.measurement) = (None, None);
        source.traffic.restart(device_times);
        source.era += 1;
        drop(state);
        self.tell();
    }

    /// Forgets the latest frame and the state of the links of a source and, if `measurement` is
    /// set, its measurement.
    pub(crate) fn rewind(&self, source: usize, measurement: bool) {
        let mut state = self.state();
        let source = &mut state.sources[source];
        source.rewind();
        if measurement && source.measurement.take().is_some() {
            source.era += 1;
        }
        drop(state);
        self.tell();
    }

    /// Starts (`on`) or ends a recording of a source, and returns the recording's name.
    fn record(self: &Arc<Self>, source: usize, on: bool) -> Result<Value> {
        let mut state = self.state();
        let scanner = &mut state.sources[source];
        let name = match (on, &scanner.recording, self.recordings()) {
            (true, Some(running), _) => {
                let why = format!("{} is being recorded already", running.name());
                return Err(Error::device(why));
            }
            (true, None, Some(folder)) => {
                let side = match scanner.traffic.has_device_times() {
                    true => Side::Device,
                    false => Side::Host,
                };
                let now_ns = scanner.traffic.last_ns().unwrap_or(0);
                let name = scanner.name.clone();
                // Release the lock, so that a slow disk does not block the viewers.
                drop(state);
                let hub: Weak<Self> = Arc::downgrade(self);
                let notice = move |why: &str| {
                    if let Some(hub) = hub.upgrade() {
                        hub.cut(source, why);
                    }
                };
                let started = Recording::start(folder, &name, side, now_ns, notice)?;
                let mut state = self.state();
                let scanner = &mut state.sources[source];
                if let Some(sequence) = &scanner.sequence {
                    started.note(now_ns, &sequence.value);
                }
                let name = started.name().to_owned();
                scanner.cut = None;
                let other = scanner.recording.replace(started);
                drop(state);
                drop(other);
                name
            }
            (false, Some(_), _) => {
                let ended = scanner.recording.take();
                scanner.cut = None;
                drop(state);
                // Dropping the recording writes its end to the disk, so the lock is released first.
                ended.map_or_else(String::new, |ended| ended.name().to_owned())
            }
            (true, None, None) => {
                return Err(Error::device("recording needs a folder: --recordings DIR"));
            }
            (false, None, _) => {
                return Err(Error::device("there is no recording to end"));
            }
        };
        self.tell();
        Ok(json!({ "name": name }))
    }

    /// Stores the reason why the recording of a source ended without a request by a viewer.
    fn cut(&self, source: usize, why: &str) {
        self.state().sources[source].cut = Some(why.to_owned());
        self.tell();
    }

    /// Ends all recordings, and drops the operators, because they may hold a reference to this hub.
    pub(crate) fn close(&self) {
        let mut state = self.state();
        let sources = state.sources.iter_mut();
        let ended: Vec<_> = sources
            .map(|source| (source.recording.take(), take(&mut source.operators)))
            .collect();
        drop(state);
        // Dropping the recordings writes their ends to the disk, so the lock is released first.
        drop(ended);
    }

    /// Shows a measurement.
    pub(crate) fn show(&self, source: usize, measurement: Arc<dyn Measurement>) {
        let mut state = self.state();
        let source = &mut state.sources[source];
        source.measurement = Some(source.number(measurement));
        drop(state);
        self.tell();
    }

    /// Shows a treatment room.
    pub(crate) fn show_room(&self, source: usize, room: Arc<Room>) {
        let mut state = self.state();
        let source = &mut state.sources[source];
        source.room = Some(source.number(room));
        drop(state);
        self.tell();
    }

    /// Shows the result of a scan in a room, and the patient in it. Returns the result's number.
    pub(crate) fn show_tracked(&self, source: usize, row: RoomRow, scan: Arc<RoomScan>) -> u64 {
        let mut state = self.state();
        let source = &mut state.sources[source];
        if source.rows.len() == MAX_ROWS {
            source.rows.pop_front();
        }
        source.results += 1;
        let id = source.results;
        let row = source.number(Arc::new(KnownRow { id, row }));
        source.rows.push_back(row);
        source.scan = scan;
        drop(state);
        self.tell();
        id
    }

    /// Adds the truth to a result, by its number.
    pub(crate) fn add_truth(&self, source: usize, id: u64, truth: [f64; 4]) {
        let mut state = self.state();
        let source = &mut state.sources[source];
        let Some(at) = source.rows.iter().rposition(|row| row.value.id == id) else {
            return;
        };
        let mut row = source.rows[at].value.row.clone();
        row.truth = Some(truth);
        source.rows[at] = source.number(Arc::new(KnownRow { id, row }));
        drop(state);
        self.tell();
    }

    /// Lets viewers operate a source.
    pub(crate) fn operate(&self, source: usize, operator: Arc<dyn Operator>) {
        let mut state = self.state();
        let operators = &mut state.sources[source].operators;
        let is_replaced = |known: &Arc<dyn Operator>| {
            { known.answers().iter() }.any(|kind| operator.answers().contains(kind))
        };
        let replaced: Vec<_> = operators
            .extract_if(.., |known| is_replaced(known))
            .collect();
        operators.push(operator);
        drop(state);
        // The operators may hold this hub, so drop them without the lock.
        drop(replaced);
        self.tell();
    }

    /// Sets the status text of a source.
    pub(crate) fn say(&self, source: usize, status: Option<String>) {
        self.state().sources[source].status = status;
        self.tell();
    }

    /// Returns the latest frame of a source.
    pub(crate) fn frame(&self, source: usize) -> Option<Arc<Frame>> {
        let state = self.state();
        let latest = state.sources.get(source)?.latest.as_ref();
        latest.map(|shown| shown.frame.clone())
    }

    /// Returns the last measurement of a source.
    pub(crate) fn measurement(&self, source: usize) -> Option<Arc<dyn Measurement>> {
        let state = self.state();
        let measurement = state.sources.get(source)?.measurement.as_ref();
        measurement.map(|shown| shown.value.clone())
    }

    /// Returns whether no further viewer is admitted. The last place is reserved for a viewer that may
    /// control.
    pub(crate) fn is_full(&self, may_control: bool) -> bool {
        self.state().viewers.len() >= MAX_VIEWERS - usize::from(!may_control)
    }

    /// Admits a viewer, and gives it control if it may control and no viewer has control. Returns
    /// `None` if there are too many viewers.
    pub(crate) fn enter(self: &Arc<Self>, may_control: bool) -> Option<Seat> {
        let mut state = self.state();
        if state.viewers.len() >= MAX_VIEWERS - usize::from(!may_control) {
            return None;
        }
        state.numbered += 1;
        let number = state.numbered;
        state.viewers.push(number);
        if may_control && state.controller.is_none() {
            state.controller = Some(number);
        }
        drop(state);
        self.tell();
        Some(Seat {
            hub: self.clone(),
            number,
            may_control,
            news: self.news.subscribe(),
        })
    }
}

/// Results that a viewer has not seen.
pub(crate) struct NewRows {
    pub(crate) rows: Vec<Arc<KnownRow>>,
    /// The largest of the results' numbers.
    pub(crate) last: u64,
    /// The patient in the last scan.
    pub(crate) scan: Arc<RoomScan>,
}

/// A connected viewer's place at the hub; dropping this value frees the place.
pub(crate) struct Seat {
    hub: Arc<Hub>,
    number: u64,
    may_control: bool,
    news: watch::Receiver<u64>,
}

/// The hub as a viewer sees it.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub(crate) struct View {
    pub(crate) sources: Vec<Standing>,
    pub(crate) viewers: usize,
    /// Whether this viewer may take control.
    pub(crate) may_control: bool,
    /// Whether this viewer has control.
    pub(crate) controls: bool,
    /// Whether another viewer has control.
    pub(crate) other_controls: bool,
    /// Token with which others may watch.
    pub(crate) view_token: String,
}

impl Seat {
    /// Waits until something has changed since the last call.
    pub(crate) async fn changed(&mut self) {
        // This cannot fail, because the sender lives as long as `hub`.
        let _ = self.news.changed().await;
    }

    /// Returns the sources and who has control.
    pub(crate) fn view(&self) -> View {
        let state = self.hub.state();
        let sources = state.sources.iter().map(|source| Standing {
            name: source.name.clone(),
            readers: source.readers,
            why: source.why.clone(),
            unplugged: source.unplugged,
            room: source.room.is_some(),
            answers: self.answers(source),
            status: source.status.clone(),
            era: source.era,
            recording: { source.recording.as_ref() }.map(|recording| recording.name().to_owned()),
            cut: source.cut.clone(),
        });
        View {
            sources: sources.collect(),
            viewers: state.viewers.len(),
            may_control: self.may_control,
            controls: state.controller == Some(self.number),
            other_controls: state.controller.is_some_and(|viewer| viewer != self.number),
            view_token: self.hub.view_token.clone(),
        }
    }

    /// Returns the kinds of requests that a source answers.
    fn answers(&self, source: &Source) -> Vec<&'static str> {
        let answers = { source.operators.iter() }.flat_map(|operator| operator.answers());
        let records = self.hub.recordings.is_some() && !source.plays;
        let record = records.then_some("record");
        answers.copied().chain(record).collect()
    }

    /// Returns the room of a source if its number is greater than `number`.
    pub(crate) fn newer_room(&self, source: usize, number: u64) -> Option<Numbered<Arc<Room>>> {
        newer(&self.hub.state().sources.get(source)?.room, number)
    }

    /// Returns the results with numbers greater than `number`, and the patient in the last scan.
    pub(crate) fn newer_rows(&self, source: usize, number: u64) -> Option<NewRows> {
        let state = self.hub.state();
        let source = state.sources.get(source)?;
        let last = source.rows.iter().map(|row| row.number).max()?;
        let new = source.rows.iter().filter(|row| row.number > number);
        (last > number).then(|| NewRows {
            rows: new.map(|row| row.value.clone()).collect(),
            last,
            scan: source.scan.clone(),
        })
    }

    /// Returns the latest frame of a source if it is newer than the frame with this number.
    pub(crate) fn newer(&self, source: usize, number: u64) -> Option<Shown> {
        let state = self.hub.state();
        let latest = state.sources.get(source)?.latest.as_ref()?;
        (latest.number > number).then(|| latest.clone())
    }

    /// Returns the sequence of a source if its number is greater than `number`.
    pub(crate) fn newer_sequence(
        &self,
        source: usize,
        number: u64,
    ) -> Option<Numbered<Arc<Sequence>>> {
        newer(&self.hub.state().sources.get(source)?.sequence, number)
    }

    /// Returns the latest measurement of a source if it is newer than measurement `number`.
    pub(crate) fn newer_measurement(
        &self,
        source: usize,
        number: u64,
    ) -> Option<Numbered<Arc<dyn Measurement>>> {
        newer(&self.hub.state().sources.get(source)?.measurement, number)
    }

    /// Returns the events of a source that are newer than event `number`.
    pub(crate) fn traffic(&self, source: usize, number: u64) -> Vec<Entry> {
        let state = self.hub.state();
        let source = state.sources.get(source);
        source.map_or_else(Vec::new, |source| source.traffic.after(number))
    }

    /// Returns the operator that answers a request of this viewer.
    ///
    /// # Errors
    /// Returns the reason why the request is refused.
    pub(crate) fn operator(
        &self,
        source: usize,
        request: &Request,
    ) -> std::result::Result<Arc<dyn Operator>, &'static str> {
        let state = self.hub.state();
        if state.controller != Some(self.number) && !request.only_asks() {
            return Err("take control first");
        }
        let kind = request.kind();
        let scanner = state.sources.get(source);
        let Some(scanner) = scanner.filter(|scanner| self.answers(scanner).contains(&kind)) else {
            return Err("this scanner does not take such requests");
        };
        let record = || -> Arc<dyn Operator> {
            let hub = self.hub.clone();
            Arc::new(Records { hub, source })
        };
        let mut operators = scanner.operators.iter();
        let operator = operators.find(|operator| operator.answers().contains(&kind));
        Ok(operator.map_or_else(record, Arc::clone))
    }

    /// With `take`, takes control if this viewer may control; else gives control back. With
    /// `if_free`, does not take control from another viewer.
    pub(crate) fn control(&self, take: bool, if_free: bool) {
        let mut state = self.hub.state();
        if take && self.may_control && !(if_free && state.controller.is_some()) {
            state.controller = Some(self.number);
        } else if !take && state.controller == Some(self.number) {
            state.controller = None;
        }
        drop(state);
        self.hub.tell();
    }
}

/// The operator that starts and ends recordings of a source for viewers.
struct Records {
    hub: Arc<Hub>,
    source: usize,
}

impl Operator for Records {
    fn answers(&self) -> &'static [&'static str] {
        &["record"]
    }

    fn answer(&self, request: &Request) -> Result<Value> {
        match request {
            Request::Record(on) => self.hub.record(self.source, *on),
            _ => Err(Error::device(
                "only requests to start or end a recording are answered here",
            )),
        }
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        let mut state = self.hub.state();
        state.viewers.retain(|viewer| *viewer != self.number);
        if state.controller == Some(self.number) {
            state.controller = None;
        }
        drop(state);
        self.hub.tell();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_viewer_controls_at_a_time() {
        let hub = Arc::new(Hub::new(None, String::new()));
        let watcher = hub.enter(false).unwrap();
        let first = hub.enter(true).unwrap();
        let second = hub.enter(true).unwrap();
        let controls = || [&watcher, &first, &second].map(|seat| seat.view().controls);
        assert_eq!(controls(), [false, true, false]);
        watcher.control(true, false);
        assert_eq!(controls(), [false, true, false]);
        second.control(true, true);
        assert_eq!(controls(), [false, true, false]);
        second.control(true, false);
        assert_eq!(controls(), [false, false, true]);
        assert!(first.view().other_controls && watcher.view().other_controls);
        first.control(false, false);
        assert_eq!(controls(), [false, false, true]);
        second.control(false, false);
        assert_eq!(controls(), [false; 3]);
        first.control(true, true);
        drop(first);
        assert!(!watcher.view().other_controls);
        assert_eq!(watcher.view().viewers, 2);
    }

    #[test]
    fn viewers_are_limited_and_make_room() {
        let hub = Arc::new(Hub::new(None, String::new()));
        let seats: Vec<_> = (1..MAX_VIEWERS)
            .map(|_| hub.enter(false).unwrap())
            .collect();
        assert!(hub.enter(false).is_none() && hub.is_full(false) && !hub.is_full(true));
        let last = hub.enter(true).unwrap();
        assert!(hub.enter(true).is_none() && hub.is_full(true));
        drop((seats, last));
        assert!(hub.enter(false).is_some());
    }
}
