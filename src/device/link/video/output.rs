//! Writes frames to a loopback node for as long as it exists.

use super::candidates::{first_free, nodes};
use super::open::Open;
use crate::{Stream, StreamSink};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::Frame;
use rustix::io::Errno;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Result of writing a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::link) enum Put {
    /// The node accepted the frame, and readers can get it.
    Done,
    /// The frame was exposed before the stream format changed, so readers cannot get it any more.
    Outdated,
    /// The node did not accept the frame.
    Lost,
}

/// A loopback node that receives the device's frames. Clones refer to the same node, since the
/// firmware asks the node before the stream format changes, and the event loop writes the frames.
#[derive(Clone)]
pub struct VideoOutput(Arc<Mutex<Output>>);

struct Output {
    path: PathBuf,
    label: String,
    /// Reason why this node was chosen, if the user did not name one.
    choice: Option<String>,
    bits: u32,
    /// The system's monotonic time at device time 0.
    power_on: Duration,
    stream: Stream,
    /// The open node, or the error with which reopening it failed. The node is closed only for a
    /// moment while the format changes.
    node: Result<Open>,
}

impl VideoOutput {
    /// Opens a node for the stream of a sensor with `bits` bits. `power_on` is the system's
    /// monotonic time at device time 0.
    ///
    /// # Errors
    /// Returns an error if the node is not a loopback node (a mistake of the user), is in use, or
    /// keeps another format for its readers, or if the system refuses.
    pub fn open(path: &Path, stream: &Stream, bits: u32, power_on: Duration) -> Result<Self> {
        let node = Open::new(path, stream, bits, true)?;
        Ok(Self(Arc::new(Mutex::new(Output {
            path: path.to_owned(),
            label: node.label.clone(),
            choice: None,
            bits,
            power_on,
            stream: *stream,
            node: Ok(node),
        }))))
    }

    /// Opens the first free node whose label shows that it is meant for this program; see
    /// [`Self::open`].
    ///
    /// # Errors
    /// Returns an error with the reason if no such node can be opened.
    pub fn open_any(stream: &Stream, bits: u32, power_on: Duration) -> Result<Self> {
        let nodes = nodes(Path::new("/dev"), Path::new("/sys/class/video4linux"));
        let open = |path: &Path| Self::open(path, stream, bits, power_on);
        let (video, passed_over) = first_free(nodes, open).map_err(Error::device)?;
        let mut choice = "the first free node labelled Phasmid".to_owned();
        if !passed_over.is_empty() {
            choice += &format!("; {passed_over}");
        }
        video.output().choice = Some(choice);
        Ok(video)
    }

    /// Returns the address of the node.
    pub fn address(&self) -> String {
        self.output().path.display().to_string()
    }

    /// Describes the node and, if the user did not name one, why it was chosen.
    pub fn about(&self) -> String {
        let output = self.output();
        let what = format!("v4l2loopback {:?}", output.label);
        match &output.choice {
            Some(why) => format!("{what}, {why}"),
            None => what,
        }
    }

    /// Writes a frame. Its timestamp is the start of the exposure on the system's monotonic clock.
    ///
    /// # Errors
    /// Returns an error if the node has disappeared or the system refuses the write.
    pub(in crate::link) fn put(&self, frame: &Frame) -> Result<Put> {
        let mut output = self.output();
        let Output {
            path,
            power_on,
            stream,
            node,
            ..
        } = &mut *output;
        if !stream.carries(frame) {
            return Ok(Put::Outdated);
        }
        let node = match node {
            Ok(node) => node,
            Err(e) => return Err(Error::device(&*e)),
        };
        let time = *power_on + Duration::from_nanos(frame.exposure_start_ns);
        match node.queue.put(&frame.data, time) {
            Ok(()) => Ok(Put::Done),
            Err(e) if e.kind() == io::ErrorKind::WouldBlock => Ok(Put::Lost),
            Err(e) if Errno::from_io_error(&e) == Some(Errno::NODEV) => {
                Err(Error::device(format!(
                    "{} disappeared: its kernel module was removed",
                    path.display()
                )))
            }
            Err(e) => Err(Error::io(&*path, e)),
        }
    }

    fn output(&self) -> MutexGuard<'_, Output> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl StreamSink for VideoOutput {
    /// Sets a new format by closing and reopening the node, because a node keeps its format until
    /// every program has closed it. This is done now and not with the next frame, so that the next
    /// reader finds the new format.
    fn announce(&mut self, stream: &Stream) -> Result<()> {
        let mut output = self.output();
        if stream.same_frames(&output.stream) {
            if let Ok(node) = &output.node {
                node.announce_interval(stream.interval_ns);
            }
            output.stream = *stream;
            return Ok(());
        }
        let (path, bits) = (output.path.clone(), output.bits);
        output.node = Err(Error::device(format!("{} is closed", path.display())));
        match Open::new(&path, stream, bits, false) {
            Ok(node) => {
                output.node = Ok(node);
                output.stream = *stream;
                Ok(())
            }
            Err(e) => {
                output.node = Open::new(&path, &output.stream, bits, false);
                Err(e)
            }
        }
    }
}
