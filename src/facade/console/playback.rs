//! Plays the recordings of a folder.

use super::calibrator::let_calibrate;
use super::follower::views;
use super::recording::Recording;
use phasmid_console::{Operator, Request, Sequence, Source};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::record::Event;
use serde_json::{Value, json};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Extension of the file names of recordings.
const ENDING: &str = ".rec";
/// Maximum number of recordings that are listed.
const MAX_LISTED: usize = 1000;
/// Minimum and maximum playback speed, in seconds of the recording per second.
const SPEEDS: [f64; 2] = [0.05, 20.0];
/// When a viewer jumps to a position, this many records before it are shown too.
const CONTEXT: usize = 60;

/// Plays the recordings of a folder; viewers of a console select and control them.
///
/// Viewers can open every regular file of the folder that is named `*.rec`, and no other file.
///
/// ```
/// use phasmid::{Console, ConsoleOptions, Playback};
///
/// let folder = std::env::temp_dir();
/// let console = Console::start(&ConsoleOptions::default())?;
/// let playback = Playback::start(console.source("recordings"), &folder, None)?;
/// # drop(playback);
/// # Ok::<(), phasmid::Error>(())
/// ```
pub struct Playback {
    inbox: Arc<Inbox>,
}

impl Playback {
    /// Starts a thread that plays the recordings that viewers select. `sequence` is used for a
    /// recording that does not name its sequence.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be read or the system refuses a thread.
    pub fn start(source: Source, folder: &Path, sequence: Option<Sequence>) -> Result<Self> {
        list(folder)?;
        let inbox = Arc::new(Inbox {
            folder: folder.to_owned(),
            state: Mutex::new(State::new()),
            news: Condvar::new(),
        });
        source.operate(inbox.clone());
        let_calibrate(&source);
        let player = Player {
            inbox: inbox.clone(),
            source,
            sequence: sequence.map(Arc::new),
            opened: None,
        };
        let thread = std::thread::Builder::new().name("playback".into());
        let thread = thread.spawn(move || player.run());
        thread.map_err(|e| Error::io("playback", e))?;
        Ok(Self { inbox })
    }
}

impl fmt::Debug for Playback {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let folder = &self.inbox.folder;
        f.debug_struct("Playback")
            .field("folder", folder)
            .finish_non_exhaustive()
    }
}

impl Drop for Playback {
    fn drop(&mut self) {
        // Do not join the thread: it may be reading.
        self.inbox.change(|state| state.ended = true);
    }
}

/// Requests of viewers, and the playback position.
struct State {
    ended: bool,
    /// Recording to open.
    open: Option<String>,
    /// Time to jump to.
    go_to_ns: Option<u64>,
    playing: bool,
    speed: f64,
    /// A moment of the host's clock, and the recording time that was shown at that moment.
    since: (Instant, u64),
    /// Name and times of the open recording.
    about: Option<(String, [u64; 2])>,
}

impl State {
    fn new() -> Self {
        Self {
            ended: false,
            open: None,
            go_to_ns: None,
            playing: false,
            speed: 1.0,
            since: (Instant::now(), 0),
            about: None,
        }
    }

    /// Returns the recording time that is shown now.
    fn now_ns(&self) -> u64 {
        let (since, from_ns) = self.since;
        let passed = match self.playing {
            true => since.elapsed().as_secs_f64() * self.speed,
            false => 0.0,
        };
        from_ns.saturating_add((passed * 1e9) as u64)
    }

    /// Continues from a recording time.
    fn go_on(&mut self, from_ns: u64) {
        self.since = (Instant::now(), from_ns);
    }

    /// Returns how long playback takes to reach a recording time, at most 60 s; `None` while paused.
    fn until(&self, time_ns: u64) -> Option<Duration> {
        let left = time_ns.saturating_sub(self.now_ns()) as f64 * 1e-9;
        { self.playing }.then(|| Duration::from_secs_f64((left / self.speed).min(60.0)))
    }
}

/// Receives the requests of viewers.
struct Inbox {
    folder: PathBuf,
    state: Mutex<State>,
    news: Condvar,
}

impl Inbox {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut State)) {
        change(&mut self.state());
        self.news.notify_all();
    }

    /// Returns whether reading a recording should end.
    fn is_over(&self) -> bool {
        let state = self.state();
        state.ended || state.open.is_some()
    }

    fn play(&self, playing: Option<bool>, at_s: Option<f64>, speed: Option<f64>) -> Result<Value> {
        let [slowest, fastest] = SPEEDS;
        if let Some(wrong) = speed.filter(|speed| !(slowest..=fastest).contains(speed)) {
            return Err(Error::input(
                "speed",
                wrong,
                format!("{slowest} to {fastest}"),
            ));
        }
        if let Some(wrong) = at_s.filter(|at| !(0.0..=1e9).contains(at)) {
            return Err(Error::input("at_s", wrong, "a time of the recording"));
        }
        self.change(|state| {
            let at_ns = state.now_ns();
            state.playing = playing.unwrap_or(state.playing) && state.about.is_some();
            state.speed = speed.unwrap_or(state.speed);
            state.go_on(at_ns);
            if let Some((_, [begin, end])) = &state.about
                && let Some(at_s) = at_s
            {
                state.go_to_ns = Some(((at_s * 1e9) as u64).clamp(*begin, *end));
            }
        });
        Ok(Value::Null)
    }

    fn about(&self) -> Value {
        let state = self.state();
        let Some((name, times)) = &state.about else {
            return Value::Null;
        };
        let [begin, end] = *times;
        let at = state.go_to_ns.unwrap_or_else(|| state.now_ns());
        let seconds = |ns: u64| ns as f64 * 1e-9;
        json!({
            "name": name,
            "begin_s": seconds(begin),
            "end_s": seconds(end),
            "at_s": seconds(at.clamp(begin, end)),
            "playing": state.playing,
            "speed": state.speed,
        })
    }
}

impl Operator for Inbox {
    fn answers(&self) -> &'static [&'static str] {
        &["playback"]
    }

    fn answer(&self, request: &Request) -> Result<Value> {
        match request {
            Request::Recordings {} => {
                let list = list(&self.folder)?.into_iter();
                Ok(list
                    .map(|(name, bytes)| json!({ "name": name, "bytes": bytes }))
                    .collect())
            }
            Request::Playback {} => Ok(self.about()),
            Request::Open { name } => {
                if !list(&self.folder)?.iter().any(|(listed, _)| listed == name) {
                    let found = format!("{name:?}");
                    return Err(Error::input("recording", found, "one of the list"));
                }
                self.change(|state| state.open = Some(name.clone()));
                Ok(Value::Null)
            }
            Request::Play {
                playing,
                at_s,
                speed,
            } => self.play(*playing, *at_s, *speed),
            _ => Err(Error::device("a recording takes no such requests")),
        }
    }
}

/// Returns the names and sizes of the recordings in a folder.
fn list(folder: &Path) -> Result<Vec<(String, u64)>> {
    let io = |e| Error::io(folder, e);
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        // Links are not followed: they may lead out of the folder.
        let (Ok(name), Ok(about)) = (entry.file_name().into_string(), entry.metadata()) else {
            continue;
        };
        if about.is_file() && name.ends_with(ENDING) {
            found.push((name, about.len()));
        }
    }
    found.sort();
    found.truncate(MAX_LISTED);
    Ok(found)
}

/// The thread that plays.
struct Player {
    inbox: Arc<Inbox>,
    source: Source,
    /// The sequence that is assumed for recordings that do not name their sequence.
    sequence: Option<Arc<Sequence>>,
    opened: Option<Opened>,
}

/// An open recording and the position in it.
struct Opened {
    recording: Recording,
    /// Index of the next record.
    next: usize,
}

/// The next action.
enum Step {
    End,
    Open(String),
    GoTo(u64),
    /// Show the next record.
    Show,
}

impl Player {
    fn run(mut self) {
        loop {
            match self.wait() {
                Step::End => return,
                Step::Open(name) => self.open(&name),
                Step::GoTo(time_ns) => self.go_to(time_ns),
                Step::Show => self.show_next(),
            }
        }
    }

    fn wait(&self) -> Step {
        let inbox = self.inbox.clone();
        let mut state = inbox.state();
        loop {
            if state.ended {
                return Step::End;
            }
            if let Some(name) = state.open.take() {
                return Step::Open(name);
            }
            if let Some(time_ns) = state.go_to_ns.take() {
                state.go_on(time_ns);
                return Step::GoTo(time_ns);
            }
            let opened = self.opened.as_ref();
            let next = opened.and_then(|opened| opened.recording.time_ns(opened.next));
            if state.playing && next.is_none() {
                let now_ns = state.now_ns();
                state.playing = false;
                state.go_on(now_ns);
            }
            match next.and_then(|next| state.until(next)) {
                Some(Duration::ZERO) => return Step::Show,
                Some(left) => {
                    let waited = inbox.news.wait_timeout(state, left);
                    state = waited.unwrap_or_else(PoisonError::into_inner).0;
                }
                None => {
                    let waited = inbox.news.wait(state);
                    state = waited.unwrap_or_else(PoisonError::into_inner);
                }
            }
        }
    }

    /// Opens a recording and plays it from its start.
    fn open(&mut self, name: &str) {
        self.opened = None;
        self.inbox.change(|state| {
            (state.about, state.playing, state.go_to_ns) = (None, false, None);
        });
        let reading = |part: f64| {
            self.source
                .say(Some(format!("reading {name}: {:.0} %", 100.0 * part)));
            !self.inbox.is_over()
        };
        match Recording::open(&self.inbox.folder.join(name), reading) {
            Ok(recording) => {
                self.source.restart(recording.has_device_times());
                self.source.say(
                    recording
                        .damage()
                        .map(|why| format!("{name} is shown up to its damage: {why}")),
                );
                let times = recording.times_ns();
                self.opened = Some(Opened { recording, next: 0 });
                self.inbox.change(|state| {
                    state.about = Some((name.to_owned(), times));
                    state.playing = true;
                    state.go_on(times[0]);
                });
            }
            Err(Error::Interrupted) => self.source.say(None),
            Err(why) => self.source.say(Some(why.to_string())),
        }
    }

    fn go_to(&mut self, time_ns: u64) {
        let Some(Opened { recording, .. }) = &self.opened else {
            return;
        };
        let end = recording.after(time_ns);
        let begin = end.saturating_sub(CONTEXT);
        let run = recording.run_before(end);
        // The last frame before the position may be older than the records that are shown, so show
        // that frame first.
        let frame = recording.frame_before(end).filter(|frame| *frame < begin);
        self.source.rewind(run.is_none());
        for at in frame.into_iter().chain(begin..end) {
            if self.inbox.is_over() || !self.show_record(at) {
                return;
            }
        }
        if let Some(run) = run {
            self.show_run(run);
        }
    }

    fn show_next(&mut self) {
        let Some(at) = self.opened.as_ref().map(|opened| opened.next) else {
            return;
        };
        if self.show_record(at)
            && let Some(opened) = &self.opened
            && let Some(run) = opened.recording.run_of_last(at)
        {
            self.show_run(run);
        }
    }

    /// Shows a record, and returns whether it could be read.
    fn show_record(&mut self, at: usize) -> bool {
        let Some(Opened { recording, next }) = &mut self.opened else {
            return false;
        };
        match recording.read(at) {
            Ok(record) => {
                *next = at + 1;
                if !matches!(record.event, Event::About(_)) {
                    let observer = self.source.observer();
                    observer.see(record.time_ns, record.channel, &record.event);
                }
                true
            }
            Err(why) => {
                *next = recording.len();
                self.source.say(Some(why.to_string()));
                false
            }
        }
    }

    /// Decodes a run of frames, if it is complete.
    fn show_run(&mut self, run: usize) {
        let Some(opened) = &mut self.opened else {
            return;
        };
        let sequence = opened
            .recording
            .sequence_of(run)
            .or_else(|| self.sequence.clone());
        let Some(sequence) = sequence else {
            let why = "this recording does not tell its sequence, so its scans are not decoded; \
                       name a manifest and a calibration when the console starts";
            self.source.say(Some(why.into()));
            return;
        };
        self.source.show_sequence(sequence.clone());
        if opened.recording.run_len(run) != sequence.manifest.frame.len() {
            return;
        }
        let frames = opened.recording.frames(run);
        match frames.and_then(|frames| views(&frames, &sequence)) {
            Ok(views) => self.source.show(Arc::new(views)),
            Err(why) => self.source.say(Some(why.to_string())),
        }
    }
}
