//! A recording of a scanner's traffic, which a viewer starts and stops.

use crate::sequence::Sequence;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use phasmid_protocol::record::{About, Channel, Event, Limits, Recorder, Side};
use std::path::Path;
use std::time::SystemTime;

/// Maximum number in the name of a recording in a folder.
const LAST: u32 = 99_999;

/// A recording in progress.
pub(crate) struct Recording {
    recorder: Recorder,
    name: String,
    /// Time of the scanner's events that is time 0 of the recording.
    begin_ns: u64,
}

impl Recording {
    /// Starts a new recording in a folder. `now_ns` is the present time of the scanner's events;
    /// `notice` is called with the reason if the recording ends by itself.
    ///
    /// # Errors
    /// Returns an error if the file cannot be created.
    pub(crate) fn start(
        folder: &Path,
        scanner: &str,
        side: Side,
        now_ns: u64,
        notice: impl Fn(&str) + Send + 'static,
    ) -> Result<Self> {
        let names = (1..=LAST).map(|number| format!("recording-{number}.rec"));
        let free = { names }.find(|name| folder.join(name).symlink_metadata().is_err());
        let name = free.ok_or_else(|| {
            let found = format!("{LAST} recordings");
            Error::input(folder.display(), found, "fewer recordings in this folder")
        })?;
        let file = new_file::stream(&folder.join(&name), false)?;
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        // A host's recording counts times from its start; a device's recording keeps the device's times.
        let begin_ns = match side {
            Side::Host => now_ns,
            Side::Device => 0,
        };
        let about = About {
            side,
            program: concat!("phasmid ", env!("CARGO_PKG_VERSION")).into(),
            started_unix_s: since.map_or(0, |since| since.as_secs()),
            name: scanner.to_owned(),
            control: String::new(),
            camera: String::new(),
            profile: None,
            scene: None,
            seed: None,
            monotonic_ns: (side == Side::Host).then_some(begin_ns),
        };
        let now_ns = now_ns - begin_ns;
        let recorder = Recorder::start(file, &name, about, now_ns, Limits::default(), notice)?;
        Ok(Self {
            recorder,
            name,
            begin_ns,
        })
    }

    /// Returns the name of the file.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Records an event.
    pub(crate) fn put(&self, time_ns: u64, channel: Channel, event: &Event) {
        let time_ns = time_ns.saturating_sub(self.begin_ns);
        self.recorder.put(time_ns, channel, event.clone());
    }

    /// Records a note of the sequence to which the following frames belong.
    pub(crate) fn note(&self, time_ns: u64, sequence: &Sequence) {
        let note = Event::Note(sequence.to_note());
        self.put(time_ns, Channel::Recording, &note);
    }
}
