//! Queues of buffers shared with the driver (V4L2 memory-mapped streaming I/O).
//!
//! Other processes may access the buffers at any time, so no Rust reference to them is ever created:
//! bytes are copied in and out.

use super::call::ioctl;
use std::io;
use std::ptr::NonNull;
use std::sync::Arc;
use std::time::Duration;
use v4l::Device;
use v4l::device::Handle;
use v4l::v4l_sys::{
    V4L2_BUF_FLAG_ERROR, V4L2_BUF_FLAG_MAPPED, v4l2_buf_type,
    v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE as CAPTURE,
    v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_OUTPUT as OUTPUT, v4l2_buffer,
    v4l2_field_V4L2_FIELD_NONE as PROGRESSIVE, v4l2_memory_V4L2_MEMORY_MMAP as MMAP,
    v4l2_requestbuffers,
};
use v4l::v4l2::{self, vidioc};

/// Maximum number of buffers to request, which is the limit of v4l2loopback.
const MAX_BUFFERS: u32 = 32;
/// Maximum size of a mapped buffer in bytes.
const MAX_BUFFER_BYTES: usize = 1 << 30;
const PROT_READ_WRITE: i32 = 3;
const MAP_SHARED: i32 = 1;
const POLLIN: i16 = 1;
const POLLOUT: i16 = 4;

/// Mapped memory of one buffer.
struct Mapping {
    start: NonNull<u8>,
    len: usize,
    /// Offset of the buffer in the device's memory, by which v4l2loopback identifies the buffer.
    offset: u32,
}

// SAFETY: the memory belongs to the process, not to a thread, and is accessed through `&mut` only.
#[allow(unsafe_code)]
unsafe impl Send for Mapping {}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: the mapping was created with this address and length and is unmapped once. The
        // result is ignored, since nothing can be done about it.
        #[allow(unsafe_code)]
        let _ = unsafe { v4l2::munmap(self.start.as_ptr().cast(), self.len) };
    }
}

/// Buffers of an open device, for one direction.
struct Queue {
    handle: Arc<Handle>,
    kind: v4l2_buf_type,
    mappings: Vec<Mapping>,
}

impl Queue {
    fn new(device: &Device, kind: v4l2_buf_type, count: u32) -> io::Result<Self> {
        let mut queue = Self {
            handle: device.handle(),
            kind,
            mappings: Vec::new(),
        };
        let mut request = v4l2_requestbuffers {
            count: count.min(MAX_BUFFERS),
            type_: kind,
            memory: MMAP,
            capabilities: 0,
            flags: 0,
            reserved: [0; 3],
        };
        // SAFETY: VIDIOC_REQBUFS takes a `v4l2_requestbuffers`.
        #[allow(unsafe_code)]
        unsafe {
            ioctl(&queue.handle, vidioc::VIDIOC_REQBUFS, &mut request)?;
        }
        for index in 0..request.count.min(MAX_BUFFERS) {
            let buffer = queue.query(index)?;
            let mapping = queue.map(&buffer)?;
            queue.mappings.push(mapping);
        }
        if queue.mappings.is_empty() {
            return Err(io::Error::other("the driver has no buffers"));
        }
        Ok(queue)
    }

    fn empty_buffer(&self) -> v4l2_buffer {
        // SAFETY: a `v4l2_buffer` consists of plain numbers, for which zero is valid; the null
        // pointer in its union is never followed for mapped buffers.
        #[allow(unsafe_code)]
        let zero: v4l2_buffer = unsafe { std::mem::zeroed() };
        v4l2_buffer {
            type_: self.kind,
            memory: MMAP,
            ..zero
        }
    }

    /// Makes a request to the driver that takes a buffer.
    fn call(&self, request: vidioc::_IOC_TYPE, mut buffer: v4l2_buffer) -> io::Result<v4l2_buffer> {
        // SAFETY: this module only passes QUERYBUF, QBUF and DQBUF, which take a `v4l2_buffer`, for
        // mapped single-plane buffers, which carry no pointers.
        #[allow(unsafe_code)]
        unsafe {
            ioctl(&self.handle, request, &mut buffer)?;
        }
        Ok(buffer)
    }

    fn query(&self, index: u32) -> io::Result<v4l2_buffer> {
        let buffer = v4l2_buffer {
            index,
            ..self.empty_buffer()
        };
        self.call(vidioc::VIDIOC_QUERYBUF, buffer)
    }

    fn map(&self, buffer: &v4l2_buffer) -> io::Result<Mapping> {
        let len = buffer.length as usize;
        if len == 0 || len > MAX_BUFFER_BYTES {
            return Err(io::Error::other(format!(
                "buffers of {len} bytes, expected 1 to {MAX_BUFFER_BYTES}"
            )));
        }
        let offset = offset(buffer);
        // SAFETY: a new mapping with the driver's own length and offset, at an address chosen by
        // the system.
        #[allow(unsafe_code)]
        let start = unsafe {
            v4l2::mmap(
                std::ptr::null_mut(),
                len,
                PROT_READ_WRITE,
                MAP_SHARED,
                self.handle.fd(),
                offset as _,
            )?
        };
        let start = NonNull::new(start.cast::<u8>())
            .ok_or_else(|| io::Error::other("the system mapped a buffer to address 0"))?;
        Ok(Mapping { start, len, offset })
    }

    /// Maps the buffers again if the driver no longer regards them as mapped. v4l2loopback 0.12
    /// forgets the mappings whenever any program requests or releases buffers, and then delivers no
    /// frames.
    fn keep_mapped(&mut self) -> io::Result<()> {
        let first = self.query(0)?;
        if first.flags & V4L2_BUF_FLAG_MAPPED != 0 {
            return Ok(());
        }
        for index in 0..self.mappings.len() {
            let buffer = self.query(index as u32)?;
            let mapping = self.map(&buffer)?;
            self.mappings[index] = mapping;
        }
        Ok(())
    }

    fn stream(&self, on: bool) -> io::Result<()> {
        let request = if on {
            vidioc::VIDIOC_STREAMON
        } else {
            vidioc::VIDIOC_STREAMOFF
        };
        let mut kind = self.kind;
        // SAFETY: both requests take the buffer type as an integer.
        #[allow(unsafe_code)]
        unsafe {
            ioctl(&self.handle, request, &mut kind)
        }
    }

    /// Waits until the device is ready; returns `false` on timeout.
    fn ready(&self, events: i16, timeout: Duration) -> io::Result<bool> {
        // Round up, so that a short wait does not become a busy loop.
        let ms = timeout.as_nanos().div_ceil(1_000_000).min(i32::MAX as u128);
        match self.handle.poll(events, ms as i32) {
            Ok(count) => Ok(count > 0),
            Err(e) if e.kind() == io::ErrorKind::Interrupted => Ok(false),
            Err(e) => Err(e),
        }
    }
}

impl Drop for Queue {
    fn drop(&mut self) {
        // If this fails, the device is gone and has already stopped.
        let _ = self.stream(false);
    }
}

fn offset(buffer: &v4l2_buffer) -> u32 {
    // SAFETY: all members of the union are plain numbers of at least this size, and mapped buffers
    // use this one.
    #[allow(unsafe_code)]
    unsafe {
        buffer.m.offset
    }
}

/// Properties of a captured frame, as reported by the driver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Taken {
    /// Timestamp of the frame; most drivers take it from the system's monotonic clock.
    pub timestamp: Duration,
    /// Frame number counted by the driver.
    pub sequence: u32,
    /// Whether the driver marked the frame as damaged.
    pub damaged: bool,
}

/// Capture stream of a device.
pub struct CaptureQueue(Queue);

impl CaptureQueue {
    /// Requests buffers (`count`, at most 32; the driver may give fewer or more) and starts
    /// streaming.
    ///
    /// # Errors
    /// Returns the driver's error: EINVAL or EIO if no format has been set yet, EBUSY if another
    /// program streams.
    pub fn start(device: &Device, count: u32) -> io::Result<Self> {
        let queue = Queue::new(device, CAPTURE, count)?;
        for index in 0..queue.mappings.len() as u32 {
            let buffer = v4l2_buffer {
                index,
                ..queue.empty_buffer()
            };
            queue.call(vidioc::VIDIOC_QBUF, buffer)?;
        }
        queue.stream(true)?;
        Ok(Self(queue))
    }

    /// Copies the used bytes of the next frame, at most `limit` bytes, to `bytes` and returns the
    /// buffer to the driver. Returns `None` on timeout.
    ///
    /// # Errors
    /// Returns the driver's error: ENODEV if the device is gone.
    pub fn take(
        &mut self,
        bytes: &mut Vec<u8>,
        limit: usize,
        timeout: Duration,
    ) -> io::Result<Option<Taken>> {
        let queue = &mut self.0;
        if !queue.ready(POLLIN, timeout)? {
            return Ok(None);
        }
        queue.keep_mapped()?;
        let buffer = match queue.call(vidioc::VIDIOC_DQBUF, queue.empty_buffer()) {
            // Another reader of the queue took the frame, or the wake-up was spurious.
            Err(e) if e.kind() == io::ErrorKind::WouldBlock => return Ok(None),
            buffer => buffer?,
        };
        let mapping = queue.mappings.get(buffer.index as usize).ok_or_else(|| {
            io::Error::other(format!(
                "the driver returned unknown buffer {}",
                buffer.index
            ))
        })?;
        let used = (buffer.bytesused as usize).min(mapping.len).min(limit);
        bytes.clear();
        bytes.reserve(used);
        // SAFETY: the mapping holds `used` bytes, the vector has room for them, and the two do not
        // overlap. Other processes may write meanwhile, but any byte value is valid.
        #[allow(unsafe_code)]
        unsafe {
            std::ptr::copy_nonoverlapping(mapping.start.as_ptr(), bytes.as_mut_ptr(), used);
            bytes.set_len(used);
        }
        let again = v4l2_buffer {
            index: buffer.index,
            ..queue.empty_buffer()
        };
        queue.call(vidioc::VIDIOC_QBUF, again)?;
        let seconds = u64::try_from(buffer.timestamp.tv_sec).unwrap_or(0);
        let micros = u64::try_from(buffer.timestamp.tv_usec).unwrap_or(0);
        Ok(Some(Taken {
            timestamp: Duration::from_secs(seconds) + Duration::from_micros(micros),
            sequence: buffer.sequence,
            damaged: buffer.flags & V4L2_BUF_FLAG_ERROR != 0,
        }))
    }
}

/// Output stream to a v4l2loopback node.
///
/// When a buffer is dequeued, v4l2loopback 0.12 returns the buffer that was queued last, which
/// readers may still be reading. A reader that requests few buffers shrinks the ring for all
/// programs. Buffers are therefore filled in turn and never dequeued, and the driver is asked for
/// the present offset of a buffer before each use.
pub struct OutputQueue {
    queue: Queue,
    next: u32,
}

impl OutputQueue {
    /// Requests buffers (`count`, at most 32; the driver may give fewer or more) and starts
    /// streaming.
    ///
    /// # Errors
    /// Returns the driver's error.
    pub fn start(device: &Device, count: u32) -> io::Result<Self> {
        let queue = Queue::new(device, OUTPUT, count)?;
        queue.stream(true)?;
        Ok(Self { queue, next: 0 })
    }

    /// Returns the size of the smallest buffer in bytes.
    pub fn capacity(&self) -> usize {
        let lens = self.queue.mappings.iter().map(|mapping| mapping.len);
        lens.min().unwrap_or(0)
    }

    /// Writes a frame, with its timestamp on the system's monotonic clock.
    ///
    /// # Errors
    /// Returns an error if the frame exceeds a buffer, `WouldBlock` if no buffer is ready, else the
    /// driver's error: ENODEV if the device is gone.
    pub fn put(&mut self, bytes: &[u8], timestamp: Duration) -> io::Result<()> {
        let queue = &self.queue;
        if !queue.ready(POLLOUT, Duration::ZERO)? {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        let index = self.next % queue.mappings.len() as u32;
        self.next = index + 1;
        // Retry once, because a reader that shrinks the ring meanwhile moves the buffer.
        for _ in 0..2 {
            let at = offset(&queue.query(index)?);
            let mapping = queue.mappings.iter().find(|mapping| mapping.offset == at);
            let mapping = mapping
                .filter(|mapping| bytes.len() <= mapping.len)
                .ok_or_else(|| {
                    io::Error::other(format!("no buffer of {} bytes at {at}", bytes.len()))
                })?;
            // SAFETY: the mapping has room for `bytes`, and no reference of ours points into it.
            #[allow(unsafe_code)]
            unsafe {
                std::ptr::copy_nonoverlapping(bytes.as_ptr(), mapping.start.as_ptr(), bytes.len());
            }
            let mut buffer = v4l2_buffer {
                index,
                bytesused: bytes.len() as u32,
                field: PROGRESSIVE,
                ..queue.empty_buffer()
            };
            buffer.timestamp.tv_sec = timestamp.as_secs().try_into().unwrap_or(0);
            buffer.timestamp.tv_usec = timestamp.subsec_micros() as _;
            if offset(&queue.query(index)?) == at {
                queue.call(vidioc::VIDIOC_QBUF, buffer)?;
                return Ok(());
            }
        }
        Err(io::ErrorKind::WouldBlock.into())
    }
}
