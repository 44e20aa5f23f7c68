//! Opens recordings, and creates recordings for `phasmid scan --record`.

use crate::cli::interrupt::Unfinished;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::stream;
use phasmid_host::{Tape, monotonic_ns};
use phasmid_protocol::record::{About, Limits, Reader, Recorder, Side, Summary};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime};

/// Opens a recording.
///
/// # Errors
/// Returns an error if the file cannot be opened, or is not a regular file or not a recording.
pub(crate) fn open(path: &Path) -> Result<Reader<BufReader<File>>> {
    phasmid_core::file::regular(path)?;
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    Reader::new(BufReader::new(file), &path.display().to_string())
}

/// Returns the seconds since 1970, or 0 if the clock is set to an earlier time.
pub(crate) fn unix_s() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.map_or(0, |since| since.as_secs())
}

/// A recording in progress. The file gets its final name when the first frame is recorded. If a
/// scan is refused before its first frame, no recording remains, and an earlier recording of that
/// name is kept.
pub(crate) struct Recording {
    path: PathBuf,
    /// Draft folder that contains the file until the file gets its final name.
    unnamed: Option<Unfinished>,
    /// Result of renaming the file to its final name.
    named: Result<()>,
}

impl Recording {
    /// Starts the recording of a device with these addresses. The recording's times count from
    /// `start`. An existing file is replaced only with `force`.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be written.
    pub(crate) fn start(
        path: &Path,
        force: bool,
        [camera, control]: [&str; 2],
        start: Instant,
    ) -> Result<(Self, Tape)> {
        let unnamed = Unfinished::create("--record", folder_of(path), force)?;
        let now_ns = move || u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        let about = About {
            side: Side::Host,
            program: concat!("phasmid ", env!("CARGO_PKG_VERSION")).into(),
            started_unix_s: unix_s(),
            name: if control.is_empty() { camera } else { control }.to_owned(),
            control: control.to_owned(),
            camera: camera.to_owned(),
            profile: None,
            scene: None,
            seed: None,
            monotonic_ns: Some(monotonic_ns().saturating_sub(now_ns())),
        };
        let file = stream(&file_in(&unnamed, path), false).map_err(|e| e.at("--record"))?;
        let place = path.display().to_string();
        let notice = |text: &str| eprintln!("phasmid: {text}");
        let recorder = Recorder::start(file, &place, about, 0, Limits::default(), notice)?;
        let recording = Self {
            path: path.to_owned(),
            unnamed: Some(unnamed),
            named: Ok(()),
        };
        Ok((recording, Tape::new(recorder, now_ns)))
    }

    /// Gives the file its final name, unless it already has it.
    pub(crate) fn keep(&mut self) {
        let Some(unnamed) = self.unnamed.take() else {
            return;
        };
        self.named = unnamed.finish([""; 0], None).map_err(|why| match why {
            Error::Input { .. } => Error::input(
                format!("--record {}", self.path.display()),
                "a file that was created during the scan",
                "a new file, or --force to overwrite",
            ),
            why => why.at("--record"),
        });
    }

    /// Ends the recording. Call this after the last tape is dropped. A recording without a frame is
    /// kept only if it has traffic and the user's input did not cause the failure.
    ///
    /// # Errors
    /// Returns an error if the file could not be given its name; then it is deleted.
    pub(crate) fn end(mut self, failed: Option<&Error>) -> Result<()> {
        let refused = failed.is_some_and(|why| why.exit_code() == 2);
        if !refused && self.has_traffic() {
            self.keep();
        }
        self.named
    }

    /// Returns whether the file holds bytes or frames.
    fn has_traffic(&self) -> bool {
        let Some(unnamed) = &self.unnamed else {
            return false;
        };
        let reader = open(&file_in(unnamed, &self.path));
        reader.is_ok_and(|mut reader| {
            let summary = Summary::of(&mut reader);
            summary.sent.count + summary.received.count + summary.frame.count > 0
        })
    }
}

/// Returns the path of the recording's file until the file gets its final name.
fn file_in(unnamed: &Unfinished, path: &Path) -> PathBuf {
    unnamed.draft().join(path.file_name().unwrap_or_default())
}

/// Returns the folder of a file.
pub(crate) fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Starts a recording with the name of an existing file, ends it, and returns the content of
    /// the file with that name.
    fn record(path: &Path, frame: bool, failed: Option<Error>) -> String {
        fs::write(path, "earlier").unwrap();
        let begun = Recording::start(path, true, ["camera", ""], Instant::now());
        let (mut recording, tape) = begun.unwrap();
        assert_eq!(fs::read(path).unwrap(), b"earlier");
        if frame {
            recording.keep();
        }
        drop(tape);
        recording.end(failed.as_ref()).unwrap();
        let count = fs::read_dir(folder_of(path)).unwrap().count();
        assert_eq!(count, 1, "no draft is left");
        String::from_utf8_lossy(&fs::read(path).unwrap()).into_owned()
    }

    #[test]
    fn only_a_recording_of_something_replaces_an_earlier_one() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.rec");
        let refused = Error::input("--sequence", "moon", "quick-4");
        assert_eq!(record(&path, false, Some(refused)), "earlier");
        assert_eq!(record(&path, false, Some(Error::device("gone"))), "earlier");
        assert!(record(&path, true, None).contains("camera"));
        assert!(record(&path, true, Some(Error::Interrupted)).contains("camera"));
    }

    #[test]
    fn file_created_during_the_scan_is_kept() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.rec");
        let begun = Recording::start(&path, false, ["camera", ""], Instant::now());
        let (mut recording, tape) = begun.unwrap();
        fs::write(&path, "theirs").unwrap();
        recording.keep();
        drop(tape);
        let refused = recording.end(None).unwrap_err();
        assert_eq!(refused.exit_code(), 2);
        assert_eq!(fs::read(&path).unwrap(), b"theirs");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }
}
