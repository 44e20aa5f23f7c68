//! An open recording with random access.

use super::follower::continues;
use phasmid_console::Sequence;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::Frame;
use phasmid_protocol::record::{Channel, Damage, Event, Reader, Record, Side};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::sync::Arc;

/// Maximum number of records; of a longer recording, only the first records up to this number are
/// shown.
const MAX_RECORDS: usize = 4 << 20;
/// Number of records between two reports of progress.
const REPORTED: usize = 64;

/// Number, file offset, kind and time of a record.
struct Entry {
    number: u64,
    offset: u64,
    time_ns: u64,
    is_frame: bool,
}

/// A recording whose records and runs of frames have been found.
pub(super) struct Recording {
    place: String,
    reader: Reader<BufReader<File>>,
    entries: Vec<Entry>,
    /// Index of the first record that concerns a link rather than the recording itself.
    first: Option<usize>,
    /// Indices of the records of each run's frames; a run starts with the first frame of a sequence.
    runs: Vec<Vec<usize>>,
    /// Each sequence, with the index of the record that notes it.
    sequences: Vec<(usize, Arc<Sequence>)>,
    device_times: bool,
    damage: Option<Damage>,
}

impl Recording {
    /// Reads a recording once from start to end. `reading` is called with the fraction read so far
    /// and returns whether to continue.
    ///
    /// # Errors
    /// Returns an error if the file is not a recording or has no record, and [`Error::Interrupted`] if
    /// `reading` ends it.
    pub(super) fn open(path: &Path, mut reading: impl FnMut(f64) -> bool) -> Result<Self> {
        let place = path.display().to_string();
        let io = |e| Error::io(path, e);
        phasmid_core::file::regular(path)?;
        let file = File::open(path).map_err(io)?;
        let bytes = file.metadata().map_err(io)?.len().max(1);
        let mut found = Self {
            reader: Reader::new(BufReader::new(file), &place)?,
            place,
            entries: Vec::new(),
            first: None,
            runs: Vec::new(),
            sequences: Vec::new(),
            device_times: false,
            damage: None,
        };
        // Header of the first frame of the run that is being collected.
        let mut first = None;
        while found.entries.len() < MAX_RECORDS {
            let record = match found.reader.read() {
                Ok(Some(record)) => record,
                Ok(None) => break,
                Err(damage) => {
                    found.damage = Some(damage);
                    break;
                }
            };
            if found.entries.len().is_multiple_of(REPORTED)
                && !reading(record.offset as f64 / bytes as f64)
            {
                return Err(Error::Interrupted);
            }
            found.add(&record, &mut first);
        }
        match found.entries.is_empty() {
            true => Err(Error::input(
                &found.place,
                "no records",
                "a recording with records",
            )),
            false => Ok(found),
        }
    }

    fn add(&mut self, record: &Record, first: &mut Option<Frame>) {
        let index = self.entries.len();
        if record.channel != Channel::Recording && self.first.is_none() {
            self.first = Some(index);
        }
        self.entries.push(Entry {
            number: record.number,
            offset: record.offset,
            is_frame: matches!(record.event, Event::Frame(_)),
            // Records of another channel may have slightly earlier times: keep the times in order.
            time_ns: { self.entries.last() }
                .map_or(record.time_ns, |last| last.time_ns.max(record.time_ns)),
        });
        match &record.event {
            Event::About(about) => self.device_times = about.side == Side::Device,
            Event::Note(text) => {
                let sequence = Sequence::of_note(text);
                self.sequences
                    .extend(sequence.map(|sequence| (index, Arc::new(sequence))));
            }
            Event::Frame(frame) => {
                if let (Some(first), Some(run)) = (&first, self.runs.last_mut())
                    && continues(first, run.len(), frame)
                {
                    run.push(index);
                } else if frame.pattern_index == Some(0) {
                    self.runs.push(vec![index]);
                    *first = Some(Frame {
                        data: Vec::new(),
                        ..**frame
                    });
                } else {
                    *first = None;
                }
            }
            _ => {}
        }
    }

    /// Returns the number of records.
    pub(super) fn len(&self) -> usize {
        self.entries.len()
    }

    /// Returns the times of the first and of the last event.
    pub(super) fn times_ns(&self) -> [u64; 2] {
        let time = |entry: Option<&Entry>| entry.map_or(0, |entry| entry.time_ns);
        // Earlier records describe the recording itself.
        let first = self.first.unwrap_or_default();
        [time(self.entries.get(first)), time(self.entries.last())]
    }

    /// Returns the time of a record.
    pub(super) fn time_ns(&self, index: usize) -> Option<u64> {
        self.entries.get(index).map(|entry| entry.time_ns)
    }

    /// Returns whether the times are on the device's clock.
    pub(super) fn has_device_times(&self) -> bool {
        self.device_times
    }

    /// Returns where and why the recording becomes unreadable; `None` if it is readable to the end.
    pub(super) fn damage(&self) -> Option<&Damage> {
        self.damage.as_ref()
    }

    /// Returns the number of records up to and including a time.
    pub(super) fn after(&self, time_ns: u64) -> usize {
        self.entries
            .partition_point(|entry| entry.time_ns <= time_ns)
    }

    /// Returns the index of the last frame's record before a record.
    pub(super) fn frame_before(&self, index: usize) -> Option<usize> {
        self.entries[..index]
            .iter()
            .rposition(|entry| entry.is_frame)
    }

    /// Returns the index of the last run that has ended before a record.
    pub(super) fn run_before(&self, index: usize) -> Option<usize> {
        self.runs
            .partition_point(|run| run.last().is_some_and(|last| *last < index))
            .checked_sub(1)
    }

    /// Returns the run that ends with a record.
    pub(super) fn run_of_last(&self, index: usize) -> Option<usize> {
        self.runs
            .binary_search_by_key(&Some(&index), |run| run.last())
            .ok()
    }

    /// Returns the number of frames of a run.
    pub(super) fn run_len(&self, run: usize) -> usize {
        self.runs[run].len()
    }

    /// Returns the sequence of a run, if a note names it. A device's note precedes the first frame, a
    /// host's note follows the last; if both exist, the note that matches the number of frames is used.
    pub(super) fn sequence_of(&self, run: usize) -> Option<Arc<Sequence>> {
        let frames = &self.runs[run];
        let last = frames.last().copied().unwrap_or_default();
        let next = self.runs.get(run + 1).map_or(self.len(), |next| next[0]);
        let count = self.sequences.partition_point(|(index, _)| *index < last);
        let before = count.checked_sub(1).map(|at| &self.sequences[at].1);
        let after = self.sequences.get(count);
        let after = after.filter(|(index, _)| *index < next || before.is_none());
        let after = after.map(|(_, sequence)| sequence);
        let fits = |sequence: &&Arc<Sequence>| sequence.manifest.frame.len() == frames.len();
        let found = before.filter(fits).or(after.filter(fits));
        found.or(before).or(after).cloned()
    }

    /// Returns the frames of a run.
    ///
    /// # Errors
    /// Returns an error if the file has changed or cannot be read.
    pub(super) fn frames(&mut self, run: usize) -> Result<Vec<Arc<Frame>>> {
        let indices = self.runs[run].clone();
        let frames = indices
            .into_iter()
            .map(|index| match self.read(index)?.event {
                Event::Frame(frame) => Ok(frame),
                _ => Err(self.changed("another record where a frame was")),
            });
        frames.collect()
    }

    /// Reads a record.
    ///
    /// # Errors
    /// Returns an error if the file has changed or cannot be read.
    pub(super) fn read(&mut self, index: usize) -> Result<Record> {
        let Entry { number, offset, .. } = self.entries[index];
        { self.reader.go_to(number, offset) }.map_err(|e| Error::io(&self.place, e))?;
        match self.reader.read() {
            Ok(Some(record)) => Ok(record),
            Ok(None) => Err(self.changed("an end where a record was")),
            Err(damage) => Err(self.changed(&damage.to_string())),
        }
    }

    fn changed(&self, found: &str) -> Error {
        Error::input(&self.place, found, "the file as it was when it was opened")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Device, ScanOptions, Scanner, ServeOptions};
    use phasmid_device::link::RecordingFile;

    /// Records two scans of a served device.
    fn recorded(path: &Path) {
        let device = Device::builder().profile("webcam-grey").scene("sphere");
        let serving = device.build().unwrap().serve(&ServeOptions {
            record: Some(RecordingFile {
                path: path.to_owned(),
                started_unix_s: 0,
            }),
            ..ServeOptions::default()
        });
        let serving = serving.unwrap();
        let at = serving.endpoints();
        for sequence in ["quick-4", "quick-4-xy"] {
            let options = ScanOptions {
                sequence: Some(sequence.into()),
                ..ScanOptions::default()
            };
            let mut scanner = Scanner::connect(&at.camera_socket, &at.control, options).unwrap();
            scanner.scan().unwrap();
            scanner.finish().unwrap();
        }
        serving.stop().unwrap();
    }

    #[test]
    fn runs_and_their_sequences_are_found_and_read_in_any_order() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.rec");
        recorded(&path);
        let mut parts = Vec::new();
        let recording = Recording::open(&path, |part| {
            parts.push(part);
            true
        });
        let mut recording = recording.unwrap();
        assert!(
            parts[0] < 0.1 && parts.is_sorted() && parts.last().is_some_and(|part| *part < 1.0)
        );
        assert!(recording.has_device_times() && recording.damage().is_none());
        let names = [0, 1].map(|run| recording.sequence_of(run).unwrap().name.clone().unwrap());
        assert_eq!(names, ["quick-4", "quick-4-xy"]);
        for run in [1, 0] {
            let sequence = recording.sequence_of(run).unwrap();
            assert!(sequence.calibration.is_some());
            let frames = recording.frames(run).unwrap();
            assert_eq!(frames.len(), sequence.manifest.frame.len());
            let views = super::super::follower::views(&frames, &sequence).unwrap();
            let points = phasmid_console::Measurement::cloud(&views, "depth", usize::MAX);
            assert!(points.unwrap().points.len() > 10_000);
        }
        let [begin, end] = recording.times_ns();
        assert!(begin < end && recording.after(end) == recording.len());
        assert_eq!(recording.run_before(recording.len()), Some(1));
        assert_eq!(recording.run_before(recording.runs[1][0]), Some(0));
        assert_eq!(recording.run_before(recording.runs[0][12]), None);
        assert_eq!(recording.run_of_last(recording.runs[0][12]), Some(0));
        assert_eq!(recording.run_of_last(recording.runs[0][11]), None);
        let ended = Recording::open(&path, |_| false).err();
        assert!(matches!(ended, Some(Error::Interrupted)));
    }

    #[test]
    fn damaged_recording_is_open_up_to_the_damage() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.rec");
        recorded(&path);
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, &whole[..whole.len() / 3]).unwrap();
        let mut recording = Recording::open(&path, |_| true).unwrap();
        assert!(recording.damage().unwrap().what.contains("cut off"));
        let len = recording.len();
        assert!(len > 2 && recording.read(len - 1).is_ok());
        std::fs::write(&path, b"PHREC").unwrap();
        assert!(recording.read(1).is_err(), "it has changed meanwhile");
        assert!(Recording::open(&path, |_| true).is_err());
        assert!(Recording::open(folder.path(), |_| true).is_err());
    }
}
