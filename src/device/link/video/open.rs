//! Opens a loopback node for writing and sets its format.

use super::candidates::{Unfit, unfit};
use crate::Stream;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::PixelFormat;
use phasmid_v4l2::{
    CaptureQueue, Node, OutputQueue, PixFormat, announce_interval, announced_interval, lock,
};
use rustix::io::Errno;
use std::io;
use std::path::Path;
use std::time::Duration;
use v4l::Device;

/// Number of buffers requested, which is the maximum, so that a frame being read is overwritten as
/// late as possible. The number of frames by which readers may fall behind depends on the module:
/// two in version 0.12, the number of buffers since 0.15.
const BUFFERS: u32 = 32;

/// A loopback node that is open for frames in one format.
pub(super) struct Open {
    pub(super) queue: OutputQueue,
    device: Device,
    pub(super) label: String,
}

impl Open {
    /// Opens a node and prepares it for the stream of a sensor with `bits` bits. `contested` says
    /// that another program may be writing to the node.
    ///
    /// # Errors
    /// Returns an error if the node is not a loopback node, is in use, or cannot carry the stream,
    /// or if the system refuses.
    pub(super) fn new(path: &Path, stream: &Stream, bits: u32, contested: bool) -> Result<Self> {
        let place = path.display();
        let failed = |e| Error::io(path, e);
        let (device, node) = Node::open(path).map_err(|e| cannot_open(path, e))?;
        let state = match unfit(&node) {
            None => None,
            Some(Unfit::Kind(found)) => {
                return Err(Error::input(
                    format!("--camera {place}"),
                    found,
                    "a node of v4l2loopback (`phasmid doctor` lists them), auto or socket",
                ));
            }
            Some(Unfit::State(why)) => Some(why),
        };
        // The lock is checked before the node's state: if another device of this program uses the
        // node, this error explains it better.
        if !lock(&device).map_err(failed)? {
            let why = "another phasmid serves its camera there";
            return Err(Error::device(format!("{place}: {why}")));
        }
        if let Some(why) = state {
            return Err(Error::device(format!("{place}: {why}")));
        }
        // A node loaded with exclusive_caps=0 does not report whether it has a producer.
        if contested && PixFormat::of_capture(&device).is_ok() && is_fed(path, &device) {
            return Err(Error::device(format!(
                "{place}: another program streams into it (`fuser -v {place}` names it)"
            )));
        }
        settle(path, &device, stream, bits)?;
        announce_interval(&device, fraction(stream.interval_ns)).map_err(failed)?;
        let queue = OutputQueue::start(&device, BUFFERS).map_err(failed)?;
        if queue.capacity() < stream.bytes() {
            let (found, wanted) = (queue.capacity(), stream.bytes());
            let why = format!("its buffers hold {found} bytes, a frame has {wanted}");
            return Err(Error::device(format!("{place}: {why}")));
        }
        Ok(Self {
            queue,
            device,
            label: node.card,
        })
    }

    /// Sets the frame interval that readers are shown; nothing else depends on it.
    pub(super) fn announce_interval(&self, interval_ns: u64) {
        let _ = announce_interval(&self.device, fraction(interval_ns));
    }
}

fn cannot_open(path: &Path, e: io::Error) -> Error {
    let place = path.display();
    let errno = Errno::from_io_error(&e);
    match errno {
        Some(Errno::NOENT | Errno::NXIO | Errno::NODEV) => Error::input(
            format!("--camera {place}"),
            "no such device",
            "a node of v4l2loopback (`phasmid doctor` lists them), auto or socket",
        ),
        Some(Errno::NOTTY | Errno::ISDIR | Errno::INVAL) => Error::input(
            format!("--camera {place}"),
            "no V4L2 device",
            "a node of v4l2loopback (`phasmid doctor` lists them), auto or socket",
        ),
        Some(Errno::ACCESS | Errno::PERM) => Error::device(format!(
            "{place}: permission denied; access is usually through the group video: \
             `sudo usermod -aG video $USER`, then log in again"
        )),
        Some(Errno::BUSY) => Error::device(format!(
            "{place}: too many programs have it open (`fuser -v {place}` names them)"
        )),
        _ => Error::io(path, e),
    }
}

/// Sets the format of a node exactly to the format of the stream.
fn settle(path: &Path, device: &Device, stream: &Stream, bits: u32) -> Result<()> {
    let mut held = None;
    for wanted in formats(stream, bits) {
        let found = wanted.tried(device).map_err(|e| Error::io(path, e))?;
        if found == wanted {
            return wanted.set(device).map_err(|e| Error::io(path, e));
        }
        held = Some(found);
    }
    let place = path.display();
    // A node with readers keeps its present format.
    match (held, PixFormat::of_capture(device)) {
        (Some(found), _) if stream.format.is_packed() => Err(Error::device(format!(
            "{place}: the node cannot carry a packed format, found {found}; expected {stream}: set \
             format = \"Y16\" in the profile's [camera], or use --camera socket"
        ))),
        (_, Ok(kept)) => Err(Error::device(format!(
            "{place} stays at {kept} while another program has it open, expected {stream} \
             (`fuser -v {place}` names it)"
        ))),
        (Some(found), Err(_)) => Err(Error::device(format!(
            "{place} turns {stream} into {found}: the module cannot carry such frames"
        ))),
        (None, Err(e)) => Err(Error::io(path, e)),
    }
}

/// Returns the pixel formats that can carry a stream, the best first.
fn formats(stream: &Stream, bits: u32) -> Vec<PixFormat> {
    let codes: &[[u8; 4]] = match (stream.format, bits) {
        (PixelFormat::Grey, _) => &[*b"GREY"],
        (PixelFormat::Yuyv, _) => &[*b"YUYV"],
        // v4l2loopback 0.12 packs Y10 and Y12, unlike V4L2; a format whose frame size differs is
        // therefore rejected.
        (PixelFormat::Y10, _) | (PixelFormat::Y16, ..=10) => &[*b"Y10 ", *b"Y16 "],
        (PixelFormat::Y12, _) | (PixelFormat::Y16, ..=12) => &[*b"Y12 ", *b"Y16 "],
        (PixelFormat::Y16, _) => &[*b"Y16 "],
        (PixelFormat::Y10P, _) => &[*b"Y10P"],
        (PixelFormat::Y12P, _) => &[*b"Y12P"],
    };
    let format = |fourcc: &[u8; 4]| PixFormat {
        width: stream.width,
        height: stream.height,
        fourcc: *fourcc,
        size: u32::try_from(stream.bytes()).unwrap_or(u32::MAX),
    };
    codes.iter().map(format).collect()
}

/// Returns whether a node delivers new frames; up to two old frames may still be buffered in the
/// node.
fn is_fed(path: &Path, device: &Device) -> bool {
    let wait = match announced_interval(device) {
        Ok((seconds, per)) if per > 0 => {
            Duration::from_secs_f64(3.0 * f64::from(seconds) / f64::from(per))
        }
        _ => Duration::ZERO,
    };
    let wait = wait.clamp(Duration::from_millis(100), Duration::from_secs(1));
    let Ok((reader, _)) = Node::open(path) else {
        return false;
    };
    let Ok(mut queue) = CaptureQueue::start(&reader, BUFFERS) else {
        return false;
    };
    let mut nothing = Vec::new();
    (0..3).all(|_| matches!(queue.take(&mut nothing, 0, wait), Ok(Some(_))))
}

/// Returns an interval as a fraction of a second with small numbers, correct to 1e-4: the first
/// convergent of its continued fraction that is close enough. Many programs accept only integer
/// frame rates, and 33333 us is meant to be one thirtieth of a second.
fn fraction(interval_ns: u64) -> (u32, u32) {
    let exact = interval_ns.max(1) as f64 / 1e9;
    let (mut before, mut last) = ((0u64, 1u64), (1u64, 0u64));
    let (mut a, mut b) = (interval_ns.max(1), 1_000_000_000);
    while b > 0 {
        let whole = a / b;
        (before, last) = (last, (whole * last.0 + before.0, whole * last.1 + before.1));
        (a, b) = (b, a % b);
        let close = last.0 as f64 / last.1 as f64;
        if last.0 > 0 && (close / exact - 1.0).abs() <= 1e-4 {
            break;
        }
    }
    // Intervals are at most minutes, so both numbers are small enough.
    (
        u32::try_from(last.0).unwrap_or(u32::MAX),
        u32::try_from(last.1).unwrap_or(u32::MAX),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_intervals_become_common_frame_rates() {
        for (us, rate) in [
            (33_333, (1, 30)),
            (33_366, (1, 30)),
            (20_000, (1, 50)),
            (16_667, (1, 60)),
            (100, (1, 10_000)),
            (1_000_000, (1, 1)),
            (60_000_000, (60, 1)),
            (1_500_000, (3, 2)),
            (66_733, (1, 15)),
        ] {
            let (n, d) = fraction(us * 1000);
            let off = f64::from(n) / f64::from(d) / (us as f64 / 1e6) - 1.0;
            assert!(off.abs() <= 1e-4, "{us}: {n}/{d}");
            if (f64::from(rate.0) / f64::from(rate.1) / (us as f64 / 1e6) - 1.0).abs() <= 1e-4 {
                assert_eq!((n, d), rate, "{us}");
            }
        }
    }

    #[test]
    fn every_interval_has_a_fraction() {
        for ns in (0..2000).map(|i| 100_000 + i * 7_919_333) {
            let (n, d) = fraction(ns);
            let off = f64::from(n) / f64::from(d) / (ns as f64 / 1e9) - 1.0;
            assert!(off.abs() <= 1e-4 && n > 0 && d <= 10_000, "{ns}: {n}/{d}");
        }
        assert!(fraction(0).1 > 0);
    }

    #[test]
    fn words_of_the_sensor_s_width_are_offered_first() {
        let stream = |format| Stream {
            width: 320,
            height: 241,
            format,
            interval_ns: 1,
        };
        let codes = |format, bits| -> Vec<_> {
            let formats = formats(&stream(format), bits).into_iter();
            formats.map(|f| (f.fourcc, f.size)).collect()
        };
        let (single, double) = (320 * 241, 2 * 320 * 241);
        assert_eq!(codes(PixelFormat::Grey, 8), [(*b"GREY", single)]);
        assert_eq!(codes(PixelFormat::Yuyv, 8), [(*b"YUYV", double)]);
        assert_eq!(
            codes(PixelFormat::Y16, 10),
            [(*b"Y10 ", double), (*b"Y16 ", double)]
        );
        assert_eq!(codes(PixelFormat::Y16, 11)[0].0, *b"Y12 ");
        assert_eq!(codes(PixelFormat::Y16, 16), [(*b"Y16 ", double)]);
        assert_eq!(codes(PixelFormat::Y12, 12), codes(PixelFormat::Y16, 12));
        assert_eq!(codes(PixelFormat::Y10P, 10), [(*b"Y10P", 400 * 241)]);
        assert_eq!(codes(PixelFormat::Y12P, 12), [(*b"Y12P", 480 * 241)]);
    }

    #[test]
    fn opening_what_is_no_video_node_names_the_reason() {
        let refused = |path: &str| {
            let stream = Stream {
                width: 320,
                height: 240,
                format: PixelFormat::Grey,
                interval_ns: 1,
            };
            match Open::new(Path::new(path), &stream, 8, true) {
                Ok(_) => panic!("{path}"),
                Err(e) => (e.exit_code(), e.to_string()),
            }
        };
        let (code, words) = refused("/dev/video-that-is-not");
        assert!(code == 2 && words.contains("no such device"), "{words}");
        for path in ["/dev/null", "/dev"] {
            let (code, words) = refused(path);
            assert!(code == 2 && words.contains("no V4L2 device"), "{words}");
            assert!(words.contains(path), "{words}");
        }
    }
}
