//! Reads frames back from the GPU. Several frames are in flight, so that the GPU renders the next
//! frame while the CPU copies the previous one, once, into the memory that the link reads.

use super::engine::Commands;
use super::{Engine, Gpu};
use phasmid_core::error::{Error, Result};
use std::sync::mpsc;

/// Maximum number of frames in flight: one being rendered, one waiting, one being copied.
pub(crate) const DEPTH: usize = 3;

/// Pool of buffers that the CPU can map.
#[derive(Default)]
pub(super) struct Frames {
    free: Vec<wgpu::Buffer>,
}

/// A frame in flight.
pub(crate) struct Ticket {
    buffer: wgpu::Buffer,
    bytes: usize,
    /// Capacity of the frame's pass in groups of sixteen samples.
    room: u64,
    submission: wgpu::SubmissionIndex,
    mapped: mpsc::Receiver<Result<(), wgpu::BufferAsyncError>>,
}

/// A frame that has been read back.
pub(super) struct Arrived {
    pub(super) data: Vec<u8>,
    /// Number of sample groups that mixed pixels need, and number for which there was capacity.
    pub(super) wanted: u64,
    pub(super) room: u64,
}

/// Size in bytes of `mixed_count`, whose last word is the number of sample groups needed.
const COUNT: u64 = 20;

impl Frames {
    /// Submits passes, followed by a copy of the resulting frame into a buffer that the CPU can map.
    pub(super) fn submit(
        &mut self,
        engine: &Engine,
        mut commands: Commands,
        bytes: usize,
        room: u64,
    ) -> Result<Ticket> {
        let frame = (bytes as u64).next_multiple_of(4);
        let size = frame + COUNT;
        self.free.retain(|buffer| buffer.size() == size);
        let new = || {
            engine.gpu().device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("frame read back"),
                size,
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let buffer = self.free.pop().unwrap_or_else(new);
        engine.copy_out(&mut commands, "frame", 0..frame, &buffer, 0)?;
        engine.copy_out(&mut commands, "mixed_count", 0..COUNT, &buffer, frame)?;
        let submission = engine.submit(commands);
        engine.gpu().check()?;
        let (tell, mapped) = mpsc::channel();
        buffer.map_async(wgpu::MapMode::Read, .., move |outcome| {
            // The receiver may have been dropped.
            let _ = tell.send(outcome);
        });
        Ok(Ticket {
            buffer,
            bytes,
            room,
            submission,
            mapped,
        })
    }

    /// Waits until a frame has been read back and returns it.
    pub(super) fn take(&mut self, gpu: &Gpu, ticket: Ticket) -> Result<Arrived> {
        gpu.wait_for(ticket.submission)?;
        let mapped = ticket.mapped.try_recv();
        mapped.map_err(Error::device)?.map_err(Error::device)?;
        let arrived = {
            let view = ticket.buffer.get_mapped_range(..).map_err(Error::device)?;
            let (rest, wanted) = view.split_last_chunk().ok_or_else(short)?;
            Arrived {
                data: rest[..ticket.bytes].to_vec(),
                wanted: u32::from_le_bytes(*wanted).into(),
                room: ticket.room,
            }
        };
        ticket.buffer.unmap();
        self.free.push(ticket.buffer);
        Ok(arrived)
    }
}

fn short() -> Error {
    Error::device("GPU: a truncated frame")
}
