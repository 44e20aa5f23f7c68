//! Buffers in GPU memory, identified by their names in the shaders.

use super::Gpu;
use phasmid_core::error::{Error, Result};
use std::collections::HashMap;
use std::sync::Arc;

/// Minimum size of a buffer in bytes. It is larger than any element, since a binding must hold at
/// least one.
const LEAST: u64 = 256;

/// Named buffers.
pub(super) struct Store {
    gpu: Arc<Gpu>,
    buffers: HashMap<&'static str, wgpu::Buffer>,
    /// Number that is incremented whenever a buffer is replaced.
    generation: u64,
}

impl Store {
    pub(super) fn new(gpu: Arc<Gpu>) -> Self {
        Self {
            gpu,
            buffers: HashMap::new(),
            generation: 0,
        }
    }

    pub(super) fn generation(&self) -> u64 {
        self.generation
    }

    /// Writes a buffer's contents, allocating it as needed. Empty contents are stored as zeros.
    pub(super) fn write(&mut self, name: &'static str, bytes: &[u8]) {
        let bytes = if bytes.is_empty() { &[0; 16] } else { bytes };
        self.reserve(name, bytes.len() as u64);
        if let Some(buffer) = self.buffers.get(name) {
            // A write must be a whole number of words.
            let whole = bytes.len() & !3;
            self.gpu.queue.write_buffer(buffer, 0, &bytes[..whole]);
            if whole < bytes.len() {
                let mut word = [0; 4];
                word[..bytes.len() - whole].copy_from_slice(&bytes[whole..]);
                self.gpu.queue.write_buffer(buffer, whole as u64, &word);
            }
        }
    }

    /// Ensures that a buffer has this capacity; a reallocation loses its contents. A buffer that is
    /// far too large is shrunk.
    pub(super) fn reserve(&mut self, name: &'static str, bytes: u64) {
        let bytes = (bytes.div_ceil(16) * 16).max(LEAST);
        let fits = |b: &wgpu::Buffer| b.size() >= bytes && b.size() <= bytes.max(1 << 20) * 4;
        if self.buffers.get(name).is_some_and(fits) {
            return;
        }
        let most = self.gpu.largest_buffer();
        if bytes > most {
            self.gpu.fail(format!(
                "{name} takes {bytes} bytes; a buffer has up to {most}"
            ));
            return;
        }
        // Free the old buffer first, so that both buffers need not fit at the same time.
        self.buffers.remove(name);
        self.generation += 1;
        let buffer = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(name),
            size: bytes,
            usage: wgpu::BufferUsages::STORAGE
                | wgpu::BufferUsages::INDIRECT
                | wgpu::BufferUsages::COPY_SRC
                | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.buffers.insert(name, buffer);
    }

    /// Writes a part of a buffer. The part must consist of whole words and lie within the buffer's
    /// capacity.
    pub(super) fn write_at(&self, name: &str, offset: u64, bytes: &[u8]) {
        if let Some(buffer) = self.buffers.get(name)
            && !bytes.is_empty()
        {
            self.gpu.queue.write_buffer(buffer, offset, bytes);
        }
    }

    /// Ensures that a buffer of any size exists, for shaders that bind the buffer but do not use it.
    pub(super) fn provide(&mut self, name: &'static str) {
        if !self.buffers.contains_key(name) {
            self.reserve(name, 0);
        }
    }

    /// Returns a buffer's capacity in bytes; 0 if it does not exist.
    pub(super) fn size(&self, name: &str) -> u64 {
        self.buffers.get(name).map_or(0, wgpu::Buffer::size)
    }

    pub(super) fn get(&self, name: &str) -> Result<&wgpu::Buffer> {
        let missing = || Error::device(format!("GPU: no buffer {name}"));
        self.buffers.get(name).ok_or_else(missing)
    }
}
