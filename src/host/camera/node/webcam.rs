//! Webcams through the nokhwa library: YUYV and MJPG.
//!
//! The library waits for a frame without a timeout, returns buffers twice after an error, and
//! panics when its stream ends on a failing device. It therefore runs in a thread of its own, which
//! copies frames into a bounded queue and ends at the first error. Dropping the camera sets a flag
//! that the thread checks after each frame; until the next frame the thread keeps the device open.
//!
//! The library does not report how many bytes of a buffer are used: a YUYV buffer is cut to the
//! size of a frame, and a JPEG image ends at its own end marker. Both times of a frame are the
//! moment at which it was taken from the driver, on the system's monotonic clock. The exposure
//! ended before that moment.

use super::v4l2::{Found, name};
use super::{Camera, explain};
use crate::time::monotonic_ns;
use image::{ImageFormat, ImageReader, Limits};
use nokhwa::utils::{
    CameraFormat, CameraIndex, FrameFormat, RequestedFormat, RequestedFormatType, Resolution,
};
use phasmid_core::error::{Error, Result};
use phasmid_pattern::MAX_SIDE_PX;
use phasmid_protocol::{Frame, PixelFormat};
use phasmid_v4l2::PixelLayout;
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::Duration;
use v4l::Device;
use v4l::frameinterval::FrameIntervalEnum;
use v4l::video::Capture as _;
use v4l::video::capture::Parameters;

/// Limits of the queue of waiting frames: number of frames, and total size in bytes.
const MAX_WAITING: usize = 32;
const MAX_WAITING_BYTES: usize = 256 << 20;
/// Maximum time for the library to open a device.
const OPENING: Duration = Duration::from_secs(20);

/// A frame as delivered by the driver.
struct Raw {
    /// Number of frames before this frame, including dropped frames.
    count: u64,
    taken_ns: u64,
    bytes: Vec<u8>,
}

/// A camera read through nokhwa.
pub(super) struct WebcamCamera {
    address: String,
    layout: PixelLayout,
    frames: Receiver<Result<Raw, String>>,
    stop: Arc<AtomicBool>,
    skipped: bool,
}

impl Drop for WebcamCamera {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

impl WebcamCamera {
    /// Opens a device whose format is YUYV or MJPG.
    pub(super) fn open(found: Found) -> Result<Self> {
        let Found {
            address,
            path,
            device,
            layout,
            ..
        } = found;
        let index = number(&path).ok_or_else(|| {
            Error::input(
                format!("--camera {address}"),
                format!("{}, which nokhwa cannot open", path.display()),
                "/dev/videoN, a link to one, or --capture v4l",
            )
        })?;
        let fps = whole_rate(&device, &layout, &address)?;
        // Close the device: the library opens it itself.
        drop(device);
        let format = if &layout.fourcc == b"MJPG" {
            FrameFormat::MJPEG
        } else {
            FrameFormat::YUYV
        };
        let wanted = CameraFormat::new(Resolution::new(layout.width, layout.height), format, fps);
        let limit = match format {
            FrameFormat::MJPEG => layout.size as usize,
            _ => layout.width as usize * layout.height as usize * 2,
        };
        let waiting = (MAX_WAITING_BYTES / limit.max(1)).clamp(2, MAX_WAITING);
        let (sender, frames) = sync_channel(waiting);
        let (opened, opening) = sync_channel(1);
        let stop = Arc::new(AtomicBool::new(false));
        let told = Arc::clone(&stop);
        std::thread::Builder::new()
            .name("webcam".into())
            .spawn(move || read(index, wanted, limit, &opened, &sender, &told))
            .map_err(|e| Error::io(&address, e))?;
        let camera = Self {
            address,
            layout,
            frames,
            stop,
            skipped: false,
        };
        let why = match opening.recv_timeout(OPENING) {
            Ok(Ok(())) => return Ok(camera),
            Ok(Err(why)) => why,
            Err(RecvTimeoutError::Timeout) => format!("no answer within {} s", OPENING.as_secs()),
            Err(RecvTimeoutError::Disconnected) => "the library failed".to_owned(),
        };
        Err(camera.failed("open", &why))
    }

    fn failed(&self, doing: &str, why: &str) -> Error {
        Error::device(format!(
            "--camera {}: {doing} with nokhwa: {why}; --capture v4l reads GREY, Y10, Y10P, Y12, \
             Y12P, Y16 and YUYV without it",
            self.address
        ))
    }

    fn frame(&self, raw: Raw) -> Result<Frame> {
        let PixelLayout { width, height, .. } = self.layout;
        let place = |what: String| Error::device(format!("{}: {what}", self.address));
        let (format, data) = if &self.layout.fourcc == b"MJPG" {
            let luma = decode_jpeg(&raw.bytes)
                .map_err(|e| place(format!("frame {}: not a JPEG image: {e}", raw.count)))?;
            if luma.dimensions() != (width, height) {
                let (w, h) = luma.dimensions();
                let what = format!("{w} x {h} pixels, expected {width} x {height}");
                return Err(place(format!("frame {}: {what}", raw.count)));
            }
            (PixelFormat::Grey, luma.into_raw())
        } else {
            (PixelFormat::Yuyv, raw.bytes)
        };
        Ok(Frame {
            id: raw.count,
            pattern_index: None,
            width,
            height,
            format,
            exposure_start_ns: raw.taken_ns,
            exposure_end_ns: raw.taken_ns,
            data,
        })
    }
}

impl Camera for WebcamCamera {
    fn info(&self) -> &str {
        &self.address
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>> {
        self.skipped = false;
        match self.frames.recv_timeout(timeout) {
            Ok(Ok(raw)) => {
                let frame = self.frame(raw);
                self.skipped = frame.is_err();
                frame.map(Some)
            }
            Ok(Err(why)) => Err(self.failed("take a frame", &why)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => {
                Err(self.failed("take a frame", "the stream has ended"))
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

/// Thread body: opens the device, reports the result, and copies frames until `stop` is set or the
/// camera fails.
fn read(
    index: u32,
    wanted: CameraFormat,
    limit: usize,
    opened: &SyncSender<Result<(), String>>,
    frames: &SyncSender<Result<Raw, String>>,
    stop: &AtomicBool,
) {
    let formats = [wanted.format()];
    let request = RequestedFormat::with_formats(RequestedFormatType::Exact(wanted), &formats);
    let start = || {
        let mut camera = nokhwa::Camera::new(CameraIndex::Index(index), request)?;
        camera.open_stream()?;
        Ok::<_, nokhwa::NokhwaError>(camera)
    };
    let mut camera = match start() {
        Ok(camera) => camera,
        Err(e) => {
            // Sending fails if the opener no longer waits.
            let _ = opened.send(Err(e.to_string()));
            return;
        }
    };
    if opened.send(Ok(())).is_err() {
        return;
    }
    for count in 0.. {
        let frame = camera
            .frame_raw()
            .map_err(|e| e.to_string())
            .and_then(|bytes| {
                let whole = bytes.len() >= limit || wanted.format() == FrameFormat::MJPEG;
                whole
                    .then(|| bytes[..bytes.len().min(limit)].to_vec())
                    .ok_or_else(|| format!("a buffer of {} bytes, expected {limit}", bytes.len()))
            });
        let failed = frame.is_err();
        let frame = frame.map(|bytes| Raw {
            count,
            taken_ns: monotonic_ns(),
            bytes,
        });
        if stop.load(Ordering::Relaxed) {
            return;
        }
        match frames.try_send(frame) {
            // If the queue is full, drop the frame: the gap in the count shows it.
            Ok(()) | Err(TrySendError::Full(Ok(_))) => {}
            // If the queue is full, the error is dropped; the closed channel shows the end of the
            // stream.
            Err(TrySendError::Full(Err(_)) | TrySendError::Disconnected(_)) => return,
        }
        if failed {
            return;
        }
    }
}

/// Returns N of `/dev/videoN`.
fn number(path: &Path) -> Option<u32> {
    let text = path.to_str()?.strip_prefix("/dev/video")?;
    text.parse().ok()
}

/// Returns the frame rate in frames per second, an integer as the library requires: the current
/// rate, or else the highest that the device offers.
fn whole_rate(device: &Device, layout: &PixelLayout, address: &str) -> Result<u32> {
    let params = device
        .params()
        .map_err(|e| explain(address, "ask for the frame interval", e))?;
    let now = params.interval;
    if now.numerator == 1 && now.denominator > 0 {
        return Ok(now.denominator);
    }
    let fourcc = v4l::FourCC::new(&layout.fourcc);
    let offered = device
        .enum_frameintervals(fourcc, layout.width, layout.height)
        .unwrap_or_default();
    let best = offered
        .iter()
        .filter_map(|offer| match &offer.interval {
            FrameIntervalEnum::Discrete(each) if each.numerator == 1 => Some(each.denominator),
            _ => None,
        })
        .max();
    let set = best.filter(|fps| {
        let after = device.set_params(&Parameters::with_fps(*fps));
        after.is_ok_and(|after| (after.interval.numerator, after.interval.denominator) == (1, *fps))
    });
    set.ok_or_else(|| {
        Error::device(format!(
            "--camera {address}: {} every {}/{} s, and nokhwa supports whole frames per second \
             only; --capture v4l supports any rate of GREY, Y10, Y10P, Y12, Y12P, Y16 and YUYV",
            name(layout.fourcc),
            now.numerator,
            now.denominator
        ))
    })
}

/// Decodes a JPEG image of bounded size to grey levels.
fn decode_jpeg(bytes: &[u8]) -> image::ImageResult<image::GrayImage> {
    let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Jpeg);
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE_PX);
    limits.max_image_height = Some(MAX_SIDE_PX);
    limits.max_alloc = Some(MAX_WAITING_BYTES as u64);
    reader.limits(limits);
    Ok(reader.decode()?.into_luma8())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_number_of_video_node_from_its_path() {
        assert_eq!(number(Path::new("/dev/video10")), Some(10));
        for other in ["/dev/videoX", "/dev/v4l/by-id/cam", "/dev/video"] {
            assert_eq!(number(Path::new(other)), None);
        }
    }

    #[test]
    fn decodes_jpeg_up_to_its_end_marker_and_refuses_noise() {
        let ramp = image::GrayImage::from_fn(64, 48, |x, y| image::Luma([(2 * x + y) as u8]));
        let mut bytes = Cursor::new(Vec::new());
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 95)
            .encode_image(&ramp)
            .unwrap();
        let mut bytes = bytes.into_inner();
        // Append bytes as an earlier, longer frame may have left them in the buffer.
        bytes.extend((0..5000).map(|i| (i * 31) as u8));
        let back = decode_jpeg(&bytes).unwrap();
        let worst = ramp
            .iter()
            .zip(back.iter())
            .map(|(a, b)| a.abs_diff(*b))
            .max();
        assert!(worst.unwrap() <= 4, "{worst:?}");
        assert!(decode_jpeg(&bytes[3000..]).is_err());
    }
}
