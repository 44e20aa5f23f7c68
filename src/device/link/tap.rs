//! Records the traffic between a served device and its clients, and passes it to an observer, each
//! if requested.

use super::Notice;
use crate::Firmware;
use crate::faults::Faults;
use phasmid_core::error::Result;
use phasmid_protocol::record::{About, Channel, Event, Limits, Observer, Recorder, Side};
use phasmid_protocol::{Endpoints, Frame};
use std::fs::File;
use std::path::PathBuf;
use std::sync::Arc;

/// Destination of a device's recording.
pub struct Recording {
    /// The file, which is still empty.
    pub file: File,
    /// Path of the file, for messages.
    pub path: PathBuf,
    /// Start of the recording in seconds since 1970.
    pub started_unix_s: u64,
}

/// Passes the traffic on the device's links to a recorder and an observer.
#[derive(Default)]
pub(super) struct Tap {
    recorder: Option<Recorder>,
    observer: Option<Observer>,
    /// Channels of the pty and of USB on which a client has sent something and has not disconnected
    /// since.
    speaking: Vec<Channel>,
    /// Number of camera clients that have connected, and number that have disconnected.
    cameras: (u64, u64),
    /// Number of times that faults have struck, as of the last record.
    struck: u64,
    /// The note of the sequence that was recorded last.
    noted: String,
}

impl Tap {
    /// Starts the recording if `recording` is given.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub(super) fn start(
        recording: Option<Recording>,
        observer: Option<Observer>,
        endpoints: &Endpoints,
        now_ns: u64,
        notice: Notice,
    ) -> Result<Self> {
        let Some(recording) = recording else {
            return Ok(Self {
                observer,
                ..Self::default()
            });
        };
        let about = About {
            side: Side::Device,
            program: concat!("phasmid ", env!("CARGO_PKG_VERSION")).into(),
            started_unix_s: recording.started_unix_s,
            name: endpoints.name.clone(),
            control: endpoints.control.display().to_string(),
            camera: endpoints.camera.clone(),
            profile: endpoints.profile.clone(),
            scene: endpoints.scene.clone(),
            seed: endpoints.seed,
            monotonic_ns: None,
        };
        let place = recording.path.display().to_string();
        let limits = Limits::default();
        let tell = move |text: &str| notice.tell(text);
        let recorder = Recorder::start(recording.file, &place, about, now_ns, limits, tell)?;
        Ok(Self {
            recorder: Some(recorder),
            observer,
            ..Self::default()
        })
    }

    /// Returns whether a recording or an observer wants events.
    fn is_on(&self) -> bool {
        self.recorder.is_some() || self.observer.is_some()
    }

    fn put(&self, time_ns: u64, channel: Channel, event: Event) {
        if let Some(observer) = &self.observer {
            observer.see(time_ns, channel, &event);
        }
        if let Some(recorder) = &self.recorder {
            recorder.put(time_ns, channel, event);
        }
    }

    /// Records bytes sent by a client.
    pub(super) fn sent(&mut self, channel: Channel, bytes: &[u8], now_ns: u64) {
        if self.is_on() {
            if !self.speaking.contains(&channel) {
                self.speaking.push(channel);
                self.put(now_ns, channel, Event::Opened);
            }
            self.put(now_ns, channel, Event::Sent(bytes.to_vec()));
        }
    }

    /// Records bytes sent by the device.
    pub(super) fn received(&self, channel: Channel, bytes: &[u8], now_ns: u64) {
        if self.is_on() {
            self.put(now_ns, channel, Event::Received(bytes.to_vec()));
        }
    }

    /// Records that the last client of a channel has disconnected; the disconnection of a client
    /// that sent nothing is not recorded.
    pub(super) fn left(&mut self, channel: Channel, now_ns: u64) {
        if self.is_on()
            && let Some(at) = self.speaking.iter().position(|&open| open == channel)
        {
            self.speaking.remove(at);
            self.put(now_ns, channel, Event::Left);
        }
    }

    /// Records that the port was disconnected or reconnected.
    pub(super) fn plugged(&mut self, plugged: bool, now_ns: u64) {
        if self.is_on() {
            let event = match plugged {
                true => Event::Plugged,
                false => Event::Unplugged,
            };
            self.put(now_ns, Channel::Control, event);
        }
        // A disconnection of the port disconnects its clients as well.
        self.speaking.retain(|&open| open != Channel::Control);
    }

    /// Records the faults that have struck since the last call.
    pub(super) fn faults(&mut self, faults: &Faults) {
        let total = faults.struck_in_all();
        let new = total - std::mem::replace(&mut self.struck, total);
        if self.is_on() && new > 0 {
            let count = usize::try_from(new).unwrap_or(usize::MAX);
            let latest: Vec<_> = faults.struck().rev().take(count).collect();
            for struck in latest.into_iter().rev() {
                let note = serde_json::to_string(struck).expect("numbers and strings");
                self.put(struck.time_ns, Channel::Recording, Event::Note(note));
            }
        }
    }

    /// Records that camera clients have connected or disconnected since the last call.
    pub(super) fn cameras(&mut self, counts: (u64, u64), now_ns: u64) {
        let before = std::mem::replace(&mut self.cameras, counts);
        if self.is_on() {
            let news = [
                (before.0..counts.0, Event::Opened),
                (before.1..counts.1, Event::Left),
            ];
            for (count, event) in news {
                count.for_each(|_| self.put(now_ns, Channel::Camera, event.clone()));
            }
        }
    }

    /// Records a frame that has left the device. Before the first frame of a sequence, also records
    /// a note of the sequence.
    pub(super) fn frame(&mut self, frame: &Arc<Frame>, firmware: &Firmware, now_ns: u64) {
        if let Some(recorder) = self
            .recorder
            .as_ref()
            .filter(|_| frame.pattern_index == Some(0))
        {
            let note = firmware.note();
            if note != self.noted {
                recorder.put(now_ns, Channel::Recording, Event::Note(note.clone()));
                self.noted = note;
            }
        }
        if self.is_on() {
            self.put(now_ns, Channel::Camera, Event::Frame(frame.clone()));
        }
    }
}
