//! Records what passes between a device that is served and its clients, if that is asked for.

use crate::faults::Faults;
use phasmid_core::error::Result;
use phasmid_protocol::record::{About, Channel, Event, Limits, Recorder, Side};
use phasmid_protocol::{Endpoints, Frame};
use std::fs::File;
use std::path::PathBuf;
use std::sync::Arc;

/// Where a device's recording goes.
pub struct Recording {
    /// The file, empty.
    pub file: File,
    /// Its path, for messages.
    pub path: PathBuf,
    /// Seconds since 1970 when it begins.
    pub started_unix_s: u64,
}

/// Listens in on the device's links.
#[derive(Default)]
pub(super) struct Tap {
    recorder: Option<Recorder>,
    /// Clients of port and USB that have said something and have not left.
    speaking: Vec<Channel>,
    /// Clients of the camera that have come and gone.
    cameras: (u64, u64),
    /// Faults that have struck.
    struck: u64,
}

impl Tap {
    /// Starts the recording.
    ///
    /// # Errors
    /// A file that takes nothing.
    pub(super) fn start(
        recording: Option<Recording>,
        endpoints: &Endpoints,
        now_ns: u64,
        notice: fn(&str),
    ) -> Result<Self> {
        let Some(recording) = recording else {
            return Ok(Self::default());
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
        let recorder = Recorder::start(recording.file, &place, about, now_ns, limits, notice)?;
        Ok(Self {
            recorder: Some(recorder),
            ..Self::default()
        })
    }

    /// A client has sent bytes.
    pub(super) fn sent(&mut self, channel: Channel, bytes: &[u8], now_ns: u64) {
        if let Some(recorder) = &self.recorder {
            if !self.speaking.contains(&channel) {
                self.speaking.push(channel);
                recorder.put(now_ns, channel, Event::Opened);
            }
            recorder.put(now_ns, channel, Event::Sent(bytes.to_vec()));
        }
    }

    /// The device has sent bytes.
    pub(super) fn received(&self, channel: Channel, bytes: &[u8], now_ns: u64) {
        if let Some(recorder) = &self.recorder {
            recorder.put(now_ns, channel, Event::Received(bytes.to_vec()));
        }
    }

    /// A channel's last client has left; one that has said nothing is none.
    pub(super) fn left(&mut self, channel: Channel, now_ns: u64) {
        if let Some(recorder) = &self.recorder
            && let Some(at) = self.speaking.iter().position(|&open| open == channel)
        {
            self.speaking.remove(at);
            recorder.put(now_ns, channel, Event::Left);
        }
    }

    /// The port has gone or is back.
    pub(super) fn plugged(&mut self, plugged: bool, now_ns: u64) {
        if let Some(recorder) = &self.recorder {
            let event = match plugged {
                true => Event::Plugged,
                false => Event::Unplugged,
            };
            recorder.put(now_ns, Channel::Control, event);
        }
        // Who was there is not any more; there is no need to say so.
        self.speaking.retain(|&open| open != Channel::Control);
    }

    /// Notes the faults that have struck since the last time.
    pub(super) fn faults(&mut self, faults: &Faults) {
        let total = faults.struck_in_all();
        let new = total - std::mem::replace(&mut self.struck, total);
        if let Some(recorder) = &self.recorder
            && new > 0
        {
            let count = usize::try_from(new).unwrap_or(usize::MAX);
            let latest: Vec<_> = faults.struck().rev().take(count).collect();
            for struck in latest.into_iter().rev() {
                let note = serde_json::to_string(struck).expect("numbers and strings");
                recorder.put(struck.time_ns, Channel::Recording, Event::Note(note));
            }
        }
    }

    /// So many of the camera's clients have come and gone so far.
    pub(super) fn cameras(&mut self, counts: (u64, u64), now_ns: u64) {
        let before = std::mem::replace(&mut self.cameras, counts);
        if let Some(recorder) = &self.recorder {
            let news = [
                (before.0..counts.0, Event::Opened),
                (before.1..counts.1, Event::Left),
            ];
            for (count, event) in news {
                count.for_each(|_| recorder.put(now_ns, Channel::Camera, event.clone()));
            }
        }
    }

    /// A frame has left the device.
    pub(super) fn frame(&self, frame: &Arc<Frame>, now_ns: u64) {
        if let Some(recorder) = &self.recorder {
            recorder.put(now_ns, Channel::Camera, Event::Frame(frame.clone()));
        }
    }
}
