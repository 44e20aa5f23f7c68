//! Recording, on the host's side, of the traffic between host and device. Wrapped cameras and ports
//! behave as without the wrapper.

use super::{Camera, CommandPort, monotonic_ns};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::Frame;
use phasmid_protocol::record::{Channel, Event, Observer, Recorder};
use std::sync::Arc;
use std::time::Duration;

/// A recording that a camera and a port share and that ends when both are dropped; or an observer of
/// their traffic.
#[derive(Clone)]
pub struct Tape {
    kept: Kept,
    now_ns: Arc<dyn Fn() -> u64 + Send + Sync>,
}

/// Destination of the traffic.
#[derive(Clone)]
enum Kept {
    Recorded(Arc<Recorder>),
    Shown(Observer),
}

impl Tape {
    /// Creates a tape; `now_ns` returns the nanoseconds since the start of the recording.
    pub fn new(recorder: Recorder, now_ns: impl Fn() -> u64 + Send + Sync + 'static) -> Self {
        Self {
            kept: Kept::Recorded(Arc::new(recorder)),
            now_ns: Arc::new(now_ns),
        }
    }

    /// Creates a tape that passes the traffic to an observer, with times on the system's monotonic
    /// clock.
    pub fn shown(observer: Observer) -> Self {
        Self {
            kept: Kept::Shown(observer),
            now_ns: Arc::new(monotonic_ns),
        }
    }

    /// Adds a text note to the recording.
    pub fn note(&self, text: String) {
        self.put(Channel::Recording, Event::Note(text));
    }

    fn put(&self, channel: Channel, event: Event) {
        let now_ns = (self.now_ns)();
        match &self.kept {
            Kept::Recorded(recorder) => recorder.put(now_ns, channel, event),
            Kept::Shown(observer) => observer.see(now_ns, channel, &event),
        }
    }
}

/// A camera. If there is a tape, its frames are recorded as the host receives them.
pub struct RecordedCamera<C: Camera> {
    camera: C,
    tape: Option<Tape>,
    /// The device is gone and has not been reopened.
    gone: bool,
}

impl<C: Camera> RecordedCamera<C> {
    /// Wraps a newly opened camera.
    pub fn new(camera: C, tape: Option<Tape>) -> Self {
        let recorded = Self {
            camera,
            tape,
            gone: false,
        };
        recorded.put(Event::Opened);
        recorded
    }

    fn put(&self, event: Event) {
        if let Some(tape) = &self.tape {
            let channel = match self.camera.identifies() {
                true => Channel::Camera,
                false => Channel::Counted,
            };
            tape.put(channel, event);
        }
    }
}

impl<C: Camera> Camera for RecordedCamera<C> {
    fn info(&self) -> &str {
        self.camera.info()
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>> {
        let frame = self.camera.next_frame(timeout);
        if self.tape.is_some() {
            match &frame {
                Ok(None) => {}
                Ok(Some(frame)) => self.put(Event::Frame(Arc::new(frame.clone()))),
                Err(error) => {
                    self.put(Event::Note(error.to_string()));
                    // Unless the error concerns a single frame, no more frames follow.
                    if !self.camera.has_skipped() && !std::mem::replace(&mut self.gone, true) {
                        self.put(Event::Unplugged);
                    }
                }
            }
        }
        frame
    }

    fn has_skipped(&self) -> bool {
        self.camera.has_skipped()
    }

    fn identifies(&self) -> bool {
        self.camera.identifies()
    }

    fn has_gone(&self) -> bool {
        self.camera.has_gone()
    }

    fn reopen(&mut self, timeout: Duration) -> Result<()> {
        if !self.gone {
            self.put(Event::Left);
        }
        let reopened = self.camera.reopen(timeout);
        match &reopened {
            Ok(()) => {
                if std::mem::take(&mut self.gone) {
                    self.put(Event::Plugged);
                }
                self.put(Event::Opened);
            }
            Err(error) => self.put(Event::Note(error.to_string())),
        }
        reopened
    }
}

impl<C: Camera> Drop for RecordedCamera<C> {
    fn drop(&mut self) {
        self.put(Event::Left);
    }
}

/// A command port. If there is a tape, its traffic is recorded in both directions.
pub struct RecordedPort<P: CommandPort> {
    port: P,
    tape: Option<Tape>,
    /// The device is gone and has not been reopened.
    unplugged: bool,
}

impl<P: CommandPort> RecordedPort<P> {
    /// Wraps a newly opened port.
    pub fn new(port: P, tape: Option<Tape>) -> Self {
        let recorded = Self {
            port,
            tape,
            unplugged: false,
        };
        recorded.put(|| Event::Opened);
        recorded
    }

    fn put(&self, event: impl FnOnce() -> Event) {
        if let Some(tape) = &self.tape {
            tape.put(Channel::Control, event());
        }
    }

    /// Records once that the device is gone.
    fn unplug(&mut self) {
        if !std::mem::replace(&mut self.unplugged, true) {
            self.put(|| Event::Unplugged);
        }
    }
}

impl<P: CommandPort> CommandPort for RecordedPort<P> {
    fn info(&self) -> &str {
        self.port.info()
    }

    fn send(&mut self, bytes: &[u8], timeout: Duration) -> Result<()> {
        // Record before sending, so that in the recording no answer precedes its question. Bytes
        // sent to a device that is known to be gone are not part of the conversation.
        if !self.unplugged {
            self.put(|| Event::Sent(bytes.to_vec()));
        }
        let sent = self.port.send(bytes, timeout);
        match &sent {
            Ok(()) if self.unplugged => self.put(|| Event::Sent(bytes.to_vec())),
            Ok(()) => {}
            Err(error) => {
                self.put(|| Event::Note(format!("these bytes were not sent: {error}")));
                // An I/O error means that the port is gone; a device that accepts no data is still
                // there.
                if matches!(error, Error::Io { .. }) {
                    self.unplug();
                }
            }
        }
        sent
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize> {
        let received = self.port.receive(buffer, timeout);
        match &received {
            Ok(0) => {}
            Ok(len) => self.put(|| Event::Received(buffer[..*len].to_vec())),
            Err(error) => {
                self.put(|| Event::Note(error.to_string()));
                self.unplug();
            }
        }
        received
    }

    fn reopen(&mut self, timeout: Duration) -> Result<()> {
        if !self.unplugged {
            self.put(|| Event::Left);
        }
        let reopened = self.port.reopen(timeout);
        match &reopened {
            Ok(()) => {
                if std::mem::take(&mut self.unplugged) {
                    self.put(|| Event::Plugged);
                }
                self.put(|| Event::Opened);
            }
            Err(error) => self.put(|| Event::Note(error.to_string())),
        }
        reopened
    }
}

impl<P: CommandPort> Drop for RecordedPort<P> {
    fn drop(&mut self) {
        self.put(|| Event::Left);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MemoryCamera, MemoryPort};
    use phasmid_protocol::PixelFormat;
    use phasmid_protocol::record::{About, Limits, Reader, Record, Side};
    use std::fs::File;
    use std::path::Path;
    use std::sync::atomic::{AtomicU64, Ordering};

    /// Creates a tape in a new file; its clock advances with every reading.
    fn tape(path: &Path) -> Tape {
        let file = File::create(path).unwrap();
        let about = About {
            side: Side::Host,
            program: "test".into(),
            started_unix_s: 1,
            name: "memory port".into(),
            control: "memory port".into(),
            camera: "memory camera".into(),
            profile: None,
            scene: None,
            seed: None,
            monotonic_ns: None,
        };
        let recorder = Recorder::start(file, "rec", about, 0, Limits::default(), |_| {}).unwrap();
        let time = AtomicU64::new(0);
        Tape::new(recorder, move || time.fetch_add(1, Ordering::Relaxed) + 1)
    }

    fn records(path: &Path) -> Vec<Record> {
        let mut reader = Reader::new(File::open(path).unwrap(), "rec").unwrap();
        std::iter::from_fn(|| reader.read().unwrap()).collect()
    }

    #[test]
    fn camera_and_port_are_recorded_in_one_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("rec");
        let tape = tape(&path);
        let frame = Frame {
            id: 4,
            pattern_index: Some(1),
            width: 2,
            height: 1,
            format: PixelFormat::Grey,
            exposure_start_ns: 0,
            exposure_end_ns: 1,
            data: vec![1, 2],
        };
        let memory = MemoryCamera::default();
        memory.put(frame.clone());
        let port = MemoryPort::new(|_: &[u8]| b"yes\n".to_vec());
        let mut port = RecordedPort::new(port, Some(tape.clone()));
        let mut camera = RecordedCamera::new(memory, Some(tape));
        port.send(b"well?\n", Duration::ZERO).unwrap();
        let mut buffer = [0; 9];
        assert_eq!(port.receive(&mut buffer, Duration::ZERO).unwrap(), 4);
        assert_eq!(
            camera.next_frame(Duration::ZERO).unwrap(),
            Some(frame.clone())
        );
        assert_eq!(camera.next_frame(Duration::ZERO).unwrap(), None);
        drop(camera);
        drop(port);
        let found = records(&path).into_iter();
        let found: Vec<_> = found.map(|r| (r.time_ns, r.channel, r.event)).collect();
        let want = [
            (1, Channel::Control, Event::Opened),
            (2, Channel::Camera, Event::Opened),
            (3, Channel::Control, Event::Sent(b"well?\n".to_vec())),
            (4, Channel::Control, Event::Received(b"yes\n".to_vec())),
            (5, Channel::Camera, Event::Frame(Arc::new(frame))),
            (6, Channel::Camera, Event::Left),
            (7, Channel::Control, Event::Left),
            (7, Channel::Recording, Event::End),
        ];
        assert_eq!(found[1..], want);
    }

    /// A port that disconnects when it is written to, and can be reopened.
    #[derive(Default)]
    struct Loose {
        gone: bool,
    }

    impl CommandPort for Loose {
        fn info(&self) -> &str {
            "loose"
        }

        fn send(&mut self, bytes: &[u8], _: Duration) -> Result<()> {
            self.gone |= bytes == b"pull\n";
            match (self.gone, bytes) {
                (true, _) => Err(Error::io("loose", std::io::ErrorKind::BrokenPipe.into())),
                (_, b"full\n") => Err(Error::device("nothing is taken")),
                _ => Ok(()),
            }
        }

        fn receive(&mut self, _: &mut [u8], _: Duration) -> Result<usize> {
            match self.gone {
                true => Err(Error::device("gone")),
                false => Ok(0),
            }
        }

        fn reopen(&mut self, _: Duration) -> Result<()> {
            self.gone = false;
            Ok(())
        }
    }

    #[test]
    fn unplugging_and_replugging_of_the_port_is_recorded() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("rec");
        let mut port = RecordedPort::new(Loose::default(), Some(tape(&path)));
        assert!(port.send(b"pull\n", Duration::ZERO).is_err());
        assert!(port.receive(&mut [0; 9], Duration::ZERO).is_err());
        assert!(port.send(b"hello?\n", Duration::ZERO).is_err());
        port.reopen(Duration::ZERO).unwrap();
        // A device that accepts no data is not gone.
        assert!(port.send(b"full\n", Duration::ZERO).is_err());
        port.reopen(Duration::ZERO).unwrap();
        drop(port);
        let said = |text: &str| Event::Sent(text.as_bytes().to_vec());
        let found = records(&path).into_iter().map(|record| record.event);
        let events: Vec<_> = found.filter(|e| !matches!(e, Event::Note(_))).collect();
        let want = [
            Event::Opened,
            said("pull\n"),
            Event::Unplugged,
            Event::Plugged,
            Event::Opened,
            said("full\n"),
            Event::Left,
            Event::Opened,
            Event::Left,
            Event::End,
        ];
        assert_eq!(events[1..], want);
    }
}
