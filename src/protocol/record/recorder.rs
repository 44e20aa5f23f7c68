//! Writes a recording to a file, or to memory in tests and fuzzing, on its own thread, so that the
//! caller never waits for the disk.
//!
//! The write queue is bounded. If the disk is too slow or full, the recording ends with one notice
//! and, if there is space for it, a record of the reason; the session itself continues.

use super::{About, Channel, Event, MAX_BYTES, encode_head, encode_record};
use phasmid_core::error::{Error, Result};
use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Limits of the write queue.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Maximum number of records in the queue.
    pub records: usize,
    /// Maximum number of bytes in the queue.
    pub bytes: usize,
}

impl Default for Limits {
    /// Returns 65,536 records and 512 MiB, which is half a minute of a camera at 17 MB/s.
    fn default() -> Self {
        Self {
            records: 1 << 16,
            bytes: 512 << 20,
        }
    }
}

#[derive(Default)]
struct Queue {
    records: VecDeque<(u64, Channel, Event)>,
    bytes: usize,
    /// Time of the last record.
    time_ns: u64,
    /// Whether the queue accepts no more records.
    ended: bool,
}

struct Shared {
    queue: Mutex<Queue>,
    put: Condvar,
    limits: Limits,
}

impl Shared {
    fn queue(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A recording in progress; dropping it ends the recording cleanly.
pub struct Recorder {
    shared: Arc<Shared>,
    writer: Option<JoinHandle<()>>,
}

impl Recorder {
    /// Starts a recording at a time. `notice` is called at most once, with the reason if the
    /// recording is cut. `place` names the file in this notice.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written or the thread cannot be started.
    pub fn start(
        mut store: impl Store + 'static,
        place: &str,
        about: About,
        time_ns: u64,
        limits: Limits,
        notice: impl Fn(&str) + Send + 'static,
    ) -> Result<Self> {
        let about = Event::About(about);
        let first = encode_record(0, time_ns, Channel::Recording, &about);
        let start = [&encode_head()[..], &first].concat();
        store.write_all(&start).map_err(|e| Error::io(place, e))?;
        let queue = Queue {
            time_ns,
            ..Queue::default()
        };
        let shared = Arc::new(Shared {
            queue: Mutex::new(queue),
            put: Condvar::new(),
            limits,
        });
        let mut writer = Writer {
            shared: shared.clone(),
            store,
            number: 1,
            len: start.len() as u64,
            place: place.to_owned(),
        };
        let thread = std::thread::Builder::new().name("recording".into());
        let writer = thread
            .spawn(move || writer.run(&notice))
            .map_err(|e| Error::io(place, e))?;
        Ok(Self {
            shared,
            writer: Some(writer),
        })
    }

    /// Records an event at a time. Never blocks; events after a cut are dropped.
    pub fn put(&self, time_ns: u64, channel: Channel, event: Event) {
        match event {
            Event::Sent(bytes) if bytes.len() > MAX_BYTES => {
                let pieces = bytes.chunks(MAX_BYTES);
                pieces.for_each(|piece| self.put_one(time_ns, channel, Event::Sent(piece.into())));
            }
            Event::Received(bytes) if bytes.len() > MAX_BYTES => {
                let pieces = bytes.chunks(MAX_BYTES).map(Vec::from);
                pieces.for_each(|piece| self.put_one(time_ns, channel, Event::Received(piece)));
            }
            event => self.put_one(time_ns, channel, event),
        }
    }

    fn put_one(&self, time_ns: u64, channel: Channel, event: Event) {
        let mut queue = self.shared.queue();
        if queue.ended {
            return;
        }
        let bytes = queue.bytes + event.bytes();
        let Limits {
            records,
            bytes: most,
        } = self.shared.limits;
        queue.time_ns = queue.time_ns.max(time_ns);
        if queue.records.len() < records && bytes <= most {
            queue.bytes = bytes;
            queue.records.push_back((time_ns, channel, event));
        } else {
            let why = format!(
                "the disk is too slow: {} records of {} bytes waited to be written",
                queue.records.len(),
                queue.bytes
            );
            queue
                .records
                .push_back((time_ns, Channel::Recording, Event::Cut(why)));
            queue.ended = true;
        }
        self.shared.put.notify_one();
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        let mut queue = self.shared.queue();
        if !queue.ended {
            queue.ended = true;
            let end = (queue.time_ns, Channel::Recording, Event::End);
            queue.records.push_back(end);
            self.shared.put.notify_one();
        }
        drop(queue);
        if let Some(writer) = self.writer.take() {
            // The thread has already reported any failure.
            let _ = writer.join();
        }
    }
}

struct Writer<S> {
    shared: Arc<Shared>,
    store: S,
    /// Index of the next record.
    number: u64,
    /// Bytes of all complete records, including the file header.
    len: u64,
    place: String,
}

impl<S: Store> Writer<S> {
    fn run(&mut self, notice: &impl Fn(&str)) {
        while let Some((time_ns, channel, event)) = self.next() {
            if let Event::Cut(why) = &event {
                self.tell(notice, why);
            }
            if let Err(e) = self.write(time_ns, channel, &event) {
                let why = format!("cannot be written: {e}");
                self.give_up(time_ns, &why);
                self.tell(notice, &why);
                return;
            }
        }
    }

    fn tell(&self, notice: &impl Fn(&str), why: &str) {
        notice(&format!(
            "{}: the recording ends here, the device continues: {why}; reported only once",
            self.place
        ));
    }

    /// Waits for the next record to write. Returns `None` when the recording has ended and the queue
    /// is empty.
    fn next(&mut self) -> Option<(u64, Channel, Event)> {
        let mut queue = self.shared.queue();
        loop {
            if let Some(next) = queue.records.pop_front() {
                queue.bytes = queue.bytes.saturating_sub(next.2.bytes());
                return Some(next);
            }
            if queue.ended {
                return None;
            }
            let waited = self.shared.put.wait(queue);
            queue = waited.unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn write(&mut self, time_ns: u64, channel: Channel, event: &Event) -> std::io::Result<()> {
        let record = encode_record(self.number, time_ns, channel, event);
        self.store.write_all(&record)?;
        self.number += 1;
        self.len += record.len() as u64;
        Ok(())
    }

    /// Ends the recording, and replaces the partially written record by a record of the reason if
    /// there is room for it.
    fn give_up(&mut self, time_ns: u64, why: &str) {
        let mut queue = self.shared.queue();
        queue.ended = true;
        queue.records = VecDeque::new();
        queue.bytes = 0;
        drop(queue);
        let cut = Event::Cut(why.to_owned());
        // If this fails, the file ends with a partial record, which readers report.
        if self.store.cut_back(self.len).is_ok() {
            let _ = self.write(time_ns, Channel::Recording, &cut);
        }
    }
}

/// Destination of a recording; can be truncated to the last complete record.
pub trait Store: Write + Send {
    /// Truncates the recording to its first `len` bytes.
    ///
    /// # Errors
    /// Returns an error if the system call fails.
    fn cut_back(&mut self, len: u64) -> io::Result<()>;
}

impl Store for File {
    fn cut_back(&mut self, len: u64) -> io::Result<()> {
        self.set_len(len)?;
        self.seek(SeekFrom::Start(len)).map(drop)
    }
}

impl Store for Vec<u8> {
    fn cut_back(&mut self, len: u64) -> io::Result<()> {
        self.truncate(usize::try_from(len).unwrap_or(usize::MAX));
        Ok(())
    }
}
