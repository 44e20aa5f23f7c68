//! A scanner: a camera and a command port that belong together. It runs a sequence and captures
//! each frame by its id.

use super::{Camera, Captured, CommandPort, Instrument};
use crate::error::{Error, Result};
use crate::geometry::Rig;
use crate::pattern::Manifest;
use crate::protocol::Frame;
use crate::protocol::scpi::{Param, parse, quote};
use std::time::{Duration, Instant};

/// How long the camera has to be silent before a run starts.
const QUIET: Duration = Duration::from_millis(20);
/// Bytes that a run's frames may take in memory, as many as the decoder takes from files.
const MAX_BYTES: u64 = 4 << 30;

/// How to scan.
#[derive(Debug, Clone)]
pub struct ScanOptions {
    /// The sequence to select; the one that is selected when absent.
    pub sequence: Option<String>,
    /// What the device projects, where it does not say so itself.
    pub manifest: Option<Manifest>,
    /// How long to wait for a frame, from the trigger or the frame before it.
    pub frame_timeout: Duration,
}

/// How far a scan has got.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress<'a> {
    /// The device has said who it is.
    Identified(&'a str),
    /// So many of so many frames are there.
    Frame {
        /// Frames captured.
        done: usize,
        /// Frames of the sequence.
        of: usize,
    },
    /// A run failed for this reason, and a second one starts.
    Retry(&'a str),
}

/// A device that scans.
pub struct Scanner<C, P> {
    camera: C,
    instrument: Instrument<P>,
    /// `TRIGger:SOURce` as it was found.
    source: String,
    /// A calibration in place of the device's own, and where it came from.
    given: Option<(String, Rig)>,
}

/// Why a run gave no capture.
enum Fault {
    /// A frame is missing, repeated, foreign or damaged: another run may do better.
    Frames(String),
    /// Anything else.
    Fatal(Error),
}

impl From<Error> for Fault {
    fn from(error: Error) -> Self {
        Self::Fatal(error)
    }
}

/// Makes a device expose nothing but what it is triggered to.
///
/// # Errors
/// What the device refuses.
fn quiet<P: CommandPort>(instrument: &mut Instrument<P>) -> Result<()> {
    instrument.order("INIT:CONT OFF;:ABOR;:TRIG:SOUR BUS;MODE SEQ")
}

impl<C: Camera, P: CommandPort> Scanner<C, P> {
    /// Puts a scanner together. The device is told to stop running free before `open_camera` is
    /// called, so that the camera has nothing to say yet when it is opened.
    ///
    /// # Errors
    /// What the port, the device or the camera refuses.
    pub fn new(
        port: P,
        timeout: Duration,
        open_camera: impl FnOnce() -> Result<C>,
    ) -> Result<Self> {
        let mut instrument = Instrument::open(port, timeout)?;
        let source = instrument.query("TRIG:SOUR?")?;
        quiet(&mut instrument)?;
        Ok(Self {
            camera: open_camera()?,
            instrument,
            source,
            given: None,
        })
    }

    /// Uses a calibration in place of the device's own; `place` names it in messages.
    #[must_use]
    pub fn with_calibration(mut self, place: impl Into<String>, rig: Rig) -> Self {
        self.given = Some((place.into(), rig));
        self
    }

    /// Lets go of the camera and leaves the trigger source as it was found: a camera that ran free
    /// does so again.
    ///
    /// # Errors
    /// What the port or the device refuses.
    pub fn finish(mut self) -> Result<()> {
        drop(self.camera);
        // It came from the device, but it is not sent back unread.
        if !self.source.is_empty() && self.source.chars().all(|c| c.is_ascii_alphanumeric()) {
            let restore = format!("ABOR;:TRIG:SOUR {}", self.source);
            self.instrument.order(&restore)?;
        }
        Ok(())
    }

    /// The device's control port, to set what a scan leaves alone: exposure, gain, light.
    pub fn instrument(&mut self) -> &mut Instrument<P> {
        &mut self.instrument
    }

    /// Captures a sequence. A run with a missing, repeated, foreign or damaged frame is
    /// repeated once.
    ///
    /// # Errors
    /// A device that refuses, is silent, says what cannot be understood, or fails twice; each with
    /// what was waited for and how long.
    pub fn scan(
        &mut self,
        options: &ScanOptions,
        progress: &mut dyn FnMut(Progress<'_>),
    ) -> Result<Captured> {
        let idn = self.identify()?;
        progress(Progress::Identified(&idn));
        quiet(&mut self.instrument)?;
        self.instrument.order("PROJ:POW ON")?;
        if let Some(name) = &options.sequence {
            self.select(name)?;
        }
        let manifest = self.manifest(options)?;
        let calibration = self.calibration()?;
        if let (Some((place, given)), Some(own)) = (&self.given, &calibration) {
            check_size(place, given, own)?;
        }
        let size = calibration.map(|rig| (rig.camera.lens.width_px, rig.camera.lens.height_px));
        let run = |scanner: &mut Self, progress: &mut dyn FnMut(Progress<'_>)| {
            scanner.run(manifest.frame.len(), size, options.frame_timeout, progress)
        };
        let frames = match run(self, progress) {
            Ok(frames) => frames,
            Err(Fault::Fatal(error)) => return Err(error),
            Err(Fault::Frames(first)) => {
                progress(Progress::Retry(&first));
                match run(self, progress) {
                    Ok(frames) => frames,
                    Err(Fault::Fatal(error)) => return Err(error),
                    Err(Fault::Frames(second)) => {
                        return Err(Error::device(format!(
                            "{}: two runs failed; first: {first}; then: {second}",
                            self.camera.info()
                        )));
                    }
                }
            }
        };
        Ok(Captured {
            idn,
            manifest,
            calibration: self.given.as_ref().map(|given| given.1).or(calibration),
            frames,
        })
    }

    fn identify(&mut self) -> Result<String> {
        let idn = self.instrument.query("*IDN?")?;
        if idn.split(',').count() < 4 {
            return Err(Error::device(format!(
                "{}: *IDN? was answered with {idn:?}, want manufacturer,model,serial,version",
                self.instrument.info()
            )));
        }
        Ok(idn)
    }

    fn select(&mut self, name: &str) -> Result<()> {
        let refused = match self.instrument.order(&format!("SEQ:SEL {}", quote(name))) {
            Ok(()) => return Ok(()),
            Err(error) => error,
        };
        // A name that the device does not have is the user's mistake; anything else is between
        // host and device, and so is a device that does not list its sequences.
        let Ok(list) = self.instrument.query("SEQ:LIST?") else {
            return Err(refused);
        };
        let names: Vec<String> = parse(format!("LIST {list}").as_bytes())
            .units
            .into_iter()
            .flat_map(|unit| unit.params)
            .filter_map(|param| match param {
                Param::Text(name) => Some(name),
                _ => None,
            })
            .collect();
        if names.is_empty() || names.iter().any(|known| known == name) {
            return Err(refused);
        }
        Err(Error::input(
            format!("--sequence {name}"),
            "no sequence of the device",
            names.join(", "),
        ))
    }

    fn text(&mut self, query: &str) -> Result<Option<String>> {
        let place = format!("{}: {query}", self.instrument.info());
        match self.instrument.query_block(query)? {
            None => Ok(None),
            Some(bytes) => String::from_utf8(bytes)
                .map(Some)
                .map_err(|_| Error::device(format!("{place}: the answer is not UTF-8"))),
        }
    }

    fn manifest(&mut self, options: &ScanOptions) -> Result<Manifest> {
        if let Some(manifest) = &options.manifest {
            return Ok(manifest.clone());
        }
        let place = format!("{}: SEQ:DATA?", self.instrument.info());
        match self.text("SEQ:DATA?")? {
            // A device that speaks nonsense is no mistake of the user's.
            Some(toml) => Manifest::parse(&toml, &place).map_err(Error::device),
            None => Err(Error::input(
                "--manifest",
                "none, and the device does not say what it projects",
                "the manifest of the sequence that is selected",
            )),
        }
    }

    fn calibration(&mut self) -> Result<Option<Rig>> {
        let place = format!("{}: CAL:DATA?", self.instrument.info());
        self.text("CAL:DATA?")?
            .map(|toml| Rig::from_toml(&toml, &place).map_err(Error::device))
            .transpose()
    }

    /// One run: arm, trigger, capture.
    fn run(
        &mut self,
        count: usize,
        size: Option<(u32, u32)>,
        timeout: Duration,
        progress: &mut dyn FnMut(Progress<'_>),
    ) -> Result<Vec<Frame>, Fault> {
        if let Some((width, height)) = size {
            // Refused before anything is exposed; a pixel takes a byte at least.
            self.check_room(count, u64::from(width) * u64::from(height))?;
        }
        quiet(&mut self.instrument)?;
        // Answered when the last frame of an earlier run has left the device.
        self.instrument.query("*OPC?")?;
        let stale = self.drain(timeout)?;
        self.instrument.order("INIT")?;
        self.instrument.tell("*TRG")?;
        let mut frames: Vec<Frame> = Vec::with_capacity(count);
        while frames.len() < count {
            match self.next_frame(timeout)? {
                None => {
                    // The device may know why.
                    self.instrument.check("INIT;*TRG")?;
                    return Err(Fault::Frames(format!(
                        "pattern {} of {count} is missing: no frame within {} s",
                        frames.len(),
                        timeout.as_secs_f64()
                    )));
                }
                Some(frame) => {
                    judge(&frame, &frames, stale, size).map_err(Fault::Frames)?;
                    // The others have the first one's size and format, or are refused.
                    if frames.is_empty() {
                        self.check_room(count, frame.data.len() as u64)?;
                    }
                    frames.push(frame);
                }
            }
            progress(Progress::Frame {
                done: frames.len(),
                of: count,
            });
        }
        self.instrument.check("INIT;*TRG")?;
        Ok(frames)
    }

    /// Whether memory has room for `count` frames of so many bytes.
    fn check_room(&self, count: usize, bytes: u64) -> Result<()> {
        let all = bytes.saturating_mul(count as u64);
        if all <= MAX_BYTES {
            return Ok(());
        }
        Err(Error::device(format!(
            "{}: {count} frames of {bytes} bytes are {} MiB in all, at most {} MiB are taken",
            self.camera.info(),
            all >> 20,
            MAX_BYTES >> 20
        )))
    }

    /// Takes frames that were under way until none comes; gives the last one's id.
    fn drain(&mut self, timeout: Duration) -> Result<Option<u64>, Fault> {
        let end = Instant::now() + timeout;
        let mut last = None;
        loop {
            match self.next_frame(QUIET) {
                Ok(None) => return Ok(last),
                Ok(Some(frame)) => last = Some(frame.id),
                // Damaged, but nobody wants it.
                Err(Fault::Frames(_)) => {}
                Err(fatal) => return Err(fatal),
            }
            if Instant::now() > end {
                return Err(Fault::Frames(format!(
                    "foreign frames: the camera runs free, waited {} s for silence",
                    timeout.as_secs_f64()
                )));
            }
        }
    }

    /// The camera's next frame; a damaged one is the run's fault, not the end.
    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>, Fault> {
        let frame = self.camera.next_frame(timeout);
        frame.map_err(|error| match self.camera.has_skipped() {
            true => Fault::Frames(error.to_string()),
            false => Fault::Fatal(error),
        })
    }
}

/// Refuses a calibration of another image size than the device's own has.
fn check_size(place: &str, given: &Rig, own: &Rig) -> Result<()> {
    let size = |rig: &Rig| {
        let lens = &rig.camera.lens;
        format!("{} x {}", lens.width_px, lens.height_px)
    };
    if size(given) == size(own) {
        return Ok(());
    }
    Err(Error::input(
        format!("{place}: camera.lens.width_px/height_px"),
        size(given),
        format!("the size of the device's frames, {}", size(own)),
    ))
}

/// Whether a frame is the one that is due after `before`; if not, what it is.
fn judge(
    frame: &Frame,
    before: &[Frame],
    stale: Option<u64>,
    size: Option<(u32, u32)>,
) -> Result<(), String> {
    let id = frame.id;
    let due = before.len();
    if before.iter().any(|other| other.id == id) || stale.is_some_and(|last| id == last) {
        return Err(format!(
            "frame {id} is repeated where pattern {due} was due"
        ));
    }
    let Some(index) = frame.pattern_index else {
        return Err(format!(
            "frame {id} is foreign: it shows no pattern of the sequence where pattern {due} was due"
        ));
    };
    let (first, index) = (before.first(), index as usize);
    let due_id = match first.map(|first| first.id.checked_add(due as u64)) {
        Some(None) => return Err(format!("frame {id} is foreign: ids end before it")),
        due_id => due_id.flatten(),
    };
    if stale.is_some_and(|last| id < last) || first.is_some_and(|first| id < first.id) {
        return Err(format!("frame {id} is foreign: it is older than this run"));
    }
    if index > due && due_id.is_none_or(|due_id| id.wrapping_sub(due_id) == (index - due) as u64) {
        return Err(format!(
            "pattern {due} is missing: frame {id} with pattern {index} came in its place"
        ));
    }
    if index != due || due_id.is_some_and(|due_id| id != due_id) {
        let wanted = due_id.map_or(String::new(), |due_id| format!("frame {due_id} with "));
        return Err(format!(
            "frame {id} with pattern {index} is foreign: {wanted}pattern {due} was due"
        ));
    }
    let got = (frame.width, frame.height);
    let same = first.is_none_or(|f| (f.width, f.height, f.format) == (got.0, got.1, frame.format));
    if !same || size.is_some_and(|size| size != got) {
        let (w, h) = size.or(first.map(|f| (f.width, f.height))).unwrap_or(got);
        return Err(format!(
            "frame {id} is foreign: {} x {} pixels of {:?}, want {w} x {h} in one format",
            got.0, got.1, frame.format
        ));
    }
    Ok(())
}
