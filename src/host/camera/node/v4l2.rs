//! Selects the method by which a V4L2 device is read, and reads a device through its buffer queue.
//!
//! Pixels of Y10, Y12 and Y16 are little-endian 16-bit words with the sensor's bits in the low
//! bits, as V4L2 defines them; Y10P and Y12P are the packed formats of MIPI CSI-2. Both times of a
//! frame are the driver's timestamp.

use super::{Camera, CameraDriver, EINVAL, EIO, ENOTTY, explain};
use phasmid_core::error::{Error, Result};
use phasmid_pattern::MAX_SIDE_PX;
use phasmid_protocol::{Frame, PixelFormat, printable};
use phasmid_v4l2::{
    CaptureQueue, FORGOTTEN, FourCc, Node, PixelLayout, RELOAD, Taken, current_format,
    offered_formats, set_format,
};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use v4l::Device;

/// Number of buffers to request from the driver. Do not reduce it: in v4l2loopback 0.12 the
/// smallest request of any client shrinks the buffer ring for all clients, and a shorter ring
/// overwrites a frame sooner while it is being read. In 0.12, a reader more than two frames behind
/// skips to the newest frame, whatever the ring's length; from 0.15 on, it may fall behind by the
/// length of the ring.
const BUFFERS: u32 = 32;
/// Interval at which to query a device that has no format yet. v4l2loopback 0.12 sends no event
/// when a producer arrives, and without a producer the node may not even report the capture
/// capability.
const ASK_AGAIN: Duration = Duration::from_millis(20);
/// Formats read through the buffer queue, best first.
const MONO: [FourCc; 6] = [*b"Y16 ", *b"Y12 ", *b"Y12P", *b"Y10 ", *b"Y10P", *b"GREY"];
/// Formats of webcams, best first.
const WEBCAM: [FourCc; 2] = [*b"YUYV", *b"MJPG"];

/// A device whose format has been chosen.
pub(super) struct Found {
    pub(super) address: String,
    /// Path of the device node. If the address is a symbolic link, this is its target.
    pub(super) path: PathBuf,
    pub(super) device: Device,
    pub(super) layout: PixelLayout,
    webcam: bool,
}

impl Found {
    /// Returns whether to read the device with nokhwa.
    pub(super) fn is_webcam(&self) -> bool {
        self.webcam
    }
}

/// Reason why a device cannot be read.
enum Refusal {
    /// The device has no format or does not capture yet, but a producer may be about to start.
    NotYet(Error),
    Final(Error),
}

/// Opens a device and chooses its format, waiting up to the timeout for a producer.
///
/// # Errors
/// Returns an error if the device cannot be opened, is not a camera, or offers no format that the
/// capture method reads.
pub(super) fn find(address: &str, capture: CameraDriver, timeout: Duration) -> Result<Found> {
    let end = Instant::now() + timeout;
    loop {
        match settle(address, capture) {
            Ok(found) => return Ok(found),
            Err(Refusal::Final(error)) => return Err(error),
            Err(Refusal::NotYet(error)) if Instant::now() >= end => return Err(error),
            Err(Refusal::NotYet(_)) => std::thread::sleep(ASK_AGAIN),
        }
    }
}

fn no_producer(address: &str) -> Error {
    Error::device(format!(
        "--camera {address}: no producer streams into this loopback node yet; start one, such as \
         `phasmid serve --camera {address}`"
    ))
}

fn settle(address: &str, capture: CameraDriver) -> Result<Found, Refusal> {
    let place = format!("--camera {address}");
    let (device, node) =
        Node::open(Path::new(address)).map_err(|e| Refusal::Final(explain(address, "open", e)))?;
    if node.is_forgotten() {
        // Report this as temporary: when a producer starts, the node's capabilities change in two
        // steps, and between these two steps the node cannot be distinguished from this case.
        return Err(Refusal::NotYet(Error::device(format!(
            "{place}: {FORGOTTEN}; reload the module: `{RELOAD}`"
        ))));
    }
    if !node.captures && node.is_loopback() {
        return Err(Refusal::NotYet(no_producer(address)));
    }
    if !node.captures || !node.streams {
        let found = format!(
            "{} ({}), which captures no frames",
            printable(&node.card),
            printable(&node.driver)
        );
        let allowed = "a capture device; `phasmid doctor` lists them";
        return Err(Refusal::Final(Error::input(place, found, allowed)));
    }
    let offered: Vec<FourCc> = offered_formats(&device).iter().map(|o| o.0).collect();
    let now = match current_format(&device) {
        Ok(layout) => layout,
        Err(e) if matches!(e.raw_os_error(), Some(EINVAL | EIO | ENOTTY)) && node.is_loopback() => {
            return Err(Refusal::NotYet(no_producer(address)));
        }
        Err(e) => return Err(Refusal::Final(explain(address, "ask for the format", e))),
    };
    let Some(fourcc) = choose(capture, now.fourcc, &offered) else {
        if offered.is_empty() && node.is_loopback() {
            return Err(Refusal::NotYet(no_producer(address)));
        }
        return Err(Refusal::Final(nothing_readable(&place, capture, &offered)));
    };
    let layout = if fourcc == now.fourcc {
        now
    } else {
        set_format(&device, (now.width, now.height), fourcc)
            .map_err(|e| Refusal::Final(explain(address, "set the format", e)))?
    };
    let side = 1..=MAX_SIDE_PX;
    let fits = side.contains(&layout.width) && side.contains(&layout.height);
    if layout.fourcc != fourcc || !fits {
        return Err(Refusal::Final(Error::device(format!(
            "{place}: asked for {}, the driver has {} of {} x {}",
            name(fourcc),
            name(layout.fourcc),
            layout.width,
            layout.height
        ))));
    }
    // nokhwa takes node numbers, not paths, so a link must be resolved.
    let path = std::fs::canonicalize(address)
        .map_err(|e| Refusal::Final(explain(address, "follow the link", e)))?;
    Ok(Found {
        address: address.to_owned(),
        path,
        device,
        layout,
        webcam: capture == CameraDriver::Nokhwa
            || (capture == CameraDriver::Auto && WEBCAM.contains(&fourcc)),
    })
}

/// Chooses the format to read: the device's current format if it can be read, else the best format
/// that the device offers.
fn choose(capture: CameraDriver, now: FourCc, offered: &[FourCc]) -> Option<FourCc> {
    let best = |wanted: &[FourCc]| {
        let mut candidates = std::iter::once(&now).chain(wanted);
        // A driver that lists no formats still has a current format.
        candidates
            .find(|code| wanted.contains(code) && (**code == now || offered.contains(code)))
            .copied()
    };
    match capture {
        CameraDriver::Auto => best(&MONO).or_else(|| best(&WEBCAM)),
        CameraDriver::V4l => best(&MONO).or_else(|| best(&WEBCAM[..1])),
        CameraDriver::Nokhwa => best(&WEBCAM),
    }
}

fn nothing_readable(place: &str, capture: CameraDriver, offered: &[FourCc]) -> Error {
    let names: Vec<String> = offered.iter().map(|code| name(*code)).collect();
    let (flag, allowed) = match capture {
        CameraDriver::Auto => ("", "GREY, Y10, Y10P, Y12, Y12P, Y16, YUYV or MJPG"),
        CameraDriver::V4l => (
            " with --capture v4l",
            "GREY, Y10, Y10P, Y12, Y12P, Y16 or YUYV",
        ),
        CameraDriver::Nokhwa => (
            " with --capture nokhwa",
            "YUYV or MJPG; or --capture v4l for GREY, Y10, Y10P, Y12, Y12P, Y16 and YUYV",
        ),
    };
    let found = if names.is_empty() {
        "no format".to_owned()
    } else {
        names.join(", ")
    };
    Error::input(
        format!("{place}{flag}"),
        format!("a device that offers {found}"),
        allowed,
    )
}

/// Returns a FourCC code as text.
pub(super) fn name(fourcc: FourCc) -> String {
    fourcc.escape_ascii().to_string().trim_end().to_owned()
}

/// A camera read through its buffer queue.
pub(super) struct V4l2Camera {
    address: String,
    queue: CaptureQueue,
    layout: PixelLayout,
    format: PixelFormat,
    /// Id and driver sequence number of the last frame.
    last: Option<(u64, u32)>,
    skipped: bool,
    bytes: Vec<u8>,
}

impl V4l2Camera {
    /// Starts the stream, waiting up to the timeout for the producer to start streaming.
    pub(super) fn start(found: Found, timeout: Duration) -> Result<Self> {
        let Found {
            address,
            device,
            layout,
            ..
        } = found;
        // `find` accepts only the formats in `MONO` and `WEBCAM`, so the format is known.
        let format = PixelFormat::from_fourcc(layout.fourcc).unwrap_or(PixelFormat::Y16);
        let row = format.row_bytes(layout.width);
        // Some drivers report a stride of 0 if rows have no padding.
        let stride = if layout.stride == 0 {
            row as u32
        } else {
            layout.stride
        };
        if (stride as usize) < row {
            return Err(Error::device(format!(
                "--camera {address}: rows of {stride} bytes for {} pixels of {}",
                layout.width,
                name(layout.fourcc)
            )));
        }
        let end = Instant::now() + timeout;
        let queue = loop {
            match CaptureQueue::start(&device, BUFFERS) {
                Ok(queue) => break queue,
                // v4l2loopback reports EIO until its producer streams.
                Err(e) if e.raw_os_error() == Some(EIO) => {
                    if Instant::now() >= end {
                        return Err(no_producer(&address));
                    }
                    std::thread::sleep(ASK_AGAIN);
                }
                Err(e) => return Err(explain(&address, "start the stream", e)),
            }
        };
        Ok(Self {
            address,
            queue,
            layout: PixelLayout { stride, ..layout },
            format,
            last: None,
            skipped: false,
            bytes: Vec::new(),
        })
    }

    /// Returns the frame's id. It follows the driver's sequence number, so that lost frames show as
    /// gaps. If the driver does not count (v4l2loopback 0.12 always reports 0), the id is a running
    /// number.
    fn count(&mut self, sequence: u32) -> u64 {
        let id = self.last.map_or(0, |(id, before)| {
            id + u64::from(sequence.checked_sub(before).unwrap_or(1).max(1))
        });
        self.last = Some((id, sequence));
        id
    }

    /// Returns the frame without row padding, or a description of the damage if it is damaged.
    fn frame(&mut self, taken: Taken) -> Result<Frame, String> {
        let id = self.count(taken.sequence);
        let layout = self.layout;
        let row = self.format.row_bytes(layout.width);
        let stride = layout.stride as usize;
        // The padding of the last row may be missing.
        let need = stride * (layout.height as usize - 1) + row;
        if taken.damaged {
            return Err(format!("frame {id}: the driver says that it is damaged"));
        }
        if self.bytes.len() < need {
            return Err(format!(
                "frame {id}: {} bytes, expected {need}",
                self.bytes.len()
            ));
        }
        let data = if stride == row {
            self.bytes.truncate(need);
            std::mem::take(&mut self.bytes)
        } else {
            let rows = self.bytes.chunks(stride).take(layout.height as usize);
            rows.flat_map(|padded| &padded[..row]).copied().collect()
        };
        let time_ns = u64::try_from(taken.timestamp.as_nanos()).unwrap_or(0);
        Ok(Frame {
            id,
            pattern_index: None,
            width: layout.width,
            height: layout.height,
            format: self.format,
            exposure_start_ns: time_ns,
            exposure_end_ns: time_ns,
            data,
        })
    }
}

impl Camera for V4l2Camera {
    fn info(&self) -> &str {
        &self.address
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>> {
        self.skipped = false;
        let limit = self.layout.stride as usize * self.layout.height as usize;
        let end = Instant::now() + timeout;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let taken = self.queue.take(&mut self.bytes, limit, left);
            // v4l2loopback 0.12 reports EINVAL if it lost a buffer between two calls.
            let forgotten = |e: &io::Error| e.raw_os_error() == Some(EINVAL);
            if taken.as_ref().is_err_and(forgotten) {
                self.skipped = true;
                return Err(Error::device(format!(
                    "{}: a frame is lost: another program started or stopped reading",
                    self.address
                )));
            }
            match taken.map_err(|e: io::Error| explain(&self.address, "take a frame", e))? {
                Some(taken) => {
                    let frame = self.frame(taken).map(Some);
                    self.skipped = frame.is_err();
                    return frame.map_err(|e| Error::device(format!("{}: {e}", self.address)));
                }
                None if left.is_zero() => return Ok(None),
                // The queue was ready but had no frame: pause before the next try.
                None => std::thread::sleep(Duration::from_millis(1).min(left)),
            }
        }
    }

    fn has_skipped(&self) -> bool {
        self.skipped
    }

    fn identifies(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_format_in_use_comes_before_better_ones_and_mono_before_colour() {
        let all = [*b"YUYV", *b"GREY", *b"Y10 ", *b"MJPG"];
        let packed = [*b"GREY", *b"Y10P", *b"Y12P"];
        for (capture, now, offered, chosen) in [
            (CameraDriver::Auto, *b"GREY", &all[..], Some(*b"GREY")),
            (CameraDriver::Auto, *b"YUYV", &all, Some(*b"Y10 ")),
            (CameraDriver::Auto, *b"NV12", &all[..2], Some(*b"GREY")),
            (CameraDriver::Auto, *b"Y12P", &all, Some(*b"Y12P")),
            (CameraDriver::V4l, *b"NV12", &packed, Some(*b"Y12P")),
            (CameraDriver::Auto, *b"MJPG", &[], Some(*b"MJPG")),
            (CameraDriver::V4l, *b"MJPG", &all[..1], Some(*b"YUYV")),
            (CameraDriver::V4l, *b"MJPG", &all[3..], None),
            (CameraDriver::Nokhwa, *b"GREY", &all, Some(*b"YUYV")),
            (CameraDriver::Nokhwa, *b"MJPG", &all, Some(*b"MJPG")),
            (CameraDriver::Nokhwa, *b"GREY", &all[1..3], None),
        ] {
            assert_eq!(choose(capture, now, offered), chosen, "{capture:?} {now:?}");
        }
        let error = nothing_readable("--camera x", CameraDriver::Nokhwa, &all[1..3]);
        assert!(
            error
                .to_string()
                .contains("offers GREY, Y10; expected YUYV"),
            "{error}"
        );
    }

    #[test]
    fn refuses_path_that_is_no_camera() {
        for (address, needle) in [
            ("/dev/null", "no V4L2 device"),
            ("/dev/no-such-video", "no such device"),
        ] {
            let Err(error) = find(address, CameraDriver::Auto, Duration::from_secs(60)) else {
                panic!("{address}")
            };
            assert_eq!(error.exit_code(), 2, "{error}");
            assert!(error.to_string().contains(needle), "{error}");
        }
    }
}
