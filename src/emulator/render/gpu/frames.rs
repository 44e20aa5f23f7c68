//! Frames on their way back from the GPU: several at a time, so that it works at the next while the
//! processor copies the last, once, to where the link takes it from.

use super::engine::Commands;
use super::{Engine, Gpu};
use crate::error::{Error, Result};
use std::sync::mpsc;

/// Frames under way together: one that is worked at, one that waits, one that is copied.
pub(in crate::emulator::render) const DEPTH: usize = 3;

/// Buffers that the processor can read.
#[derive(Default)]
pub(super) struct Frames {
    free: Vec<wgpu::Buffer>,
}

/// A frame that is on its way.
pub(in crate::emulator::render) struct Ticket {
    buffer: wgpu::Buffer,
    bytes: usize,
    submission: wgpu::SubmissionIndex,
    mapped: mpsc::Receiver<Result<(), wgpu::BufferAsyncError>>,
}

impl Frames {
    /// Submits passes, and a copy of the frame that they leave behind.
    pub(super) fn submit(
        &mut self,
        engine: &Engine,
        mut commands: Commands,
        bytes: usize,
    ) -> Result<Ticket> {
        let size = (bytes as u64).next_multiple_of(4);
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
        engine.copy_out(&mut commands, "frame", 0..size, &buffer)?;
        let submission = engine.submit(commands);
        engine.gpu().check()?;
        let (tell, mapped) = mpsc::channel();
        buffer.map_async(wgpu::MapMode::Read, .., move |outcome| {
            // Whoever asked may have given up.
            let _ = tell.send(outcome);
        });
        Ok(Ticket {
            buffer,
            bytes,
            submission,
            mapped,
        })
    }

    /// Waits for a frame.
    pub(super) fn take(&mut self, gpu: &Gpu, ticket: Ticket) -> Result<Vec<u8>> {
        gpu.wait_for(ticket.submission)?;
        let mapped = ticket.mapped.try_recv();
        mapped.map_err(Error::device)?.map_err(Error::device)?;
        let data = {
            let view = ticket.buffer.get_mapped_range(..).map_err(Error::device)?;
            view[..ticket.bytes].to_vec()
        };
        ticket.buffer.unmap();
        self.free.push(ticket.buffer);
        Ok(data)
    }
}
