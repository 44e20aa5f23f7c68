//! Buffers in the GPU's memory, by the names that shaders have for them.

use super::Gpu;
use phasmid_core::error::{Error, Result};
use std::collections::HashMap;
use std::sync::Arc;

/// Bytes of the smallest buffer: more than any element takes, as no binding may hold less than one.
const LEAST: u64 = 256;

/// Named buffers.
pub(super) struct Store {
    gpu: Arc<Gpu>,
    buffers: HashMap<&'static str, wgpu::Buffer>,
    /// Changes with every buffer that takes another's place.
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

    /// Gives a buffer contents, and room for them. Empty contents are zeros.
    pub(super) fn write(&mut self, name: &'static str, bytes: &[u8]) {
        let bytes = if bytes.is_empty() { &[0; 16] } else { bytes };
        self.reserve(name, bytes.len() as u64);
        if let Some(buffer) = self.buffers.get(name) {
            // A whole number of words.
            let whole = bytes.len() & !3;
            self.gpu.queue.write_buffer(buffer, 0, &bytes[..whole]);
            if whole < bytes.len() {
                let mut word = [0; 4];
                word[..bytes.len() - whole].copy_from_slice(&bytes[whole..]);
                self.gpu.queue.write_buffer(buffer, whole as u64, &word);
            }
        }
    }

    /// Sees that a buffer has room; what it held is lost where it had not. One that is far too large
    /// gives its memory back.
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
        // The one before goes first, so that both need not fit.
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

    /// Gives a part of a buffer contents, whole words; there is room for them.
    pub(super) fn write_at(&self, name: &str, offset: u64, bytes: &[u8]) {
        if let Some(buffer) = self.buffers.get(name)
            && !bytes.is_empty()
        {
            self.gpu.queue.write_buffer(buffer, offset, bytes);
        }
    }

    /// Sees that there is a buffer, of whatever size, for shaders that name it and do without it.
    pub(super) fn provide(&mut self, name: &'static str) {
        if !self.buffers.contains_key(name) {
            self.reserve(name, 0);
        }
    }

    /// How many bytes a buffer has room for; 0 of none.
    pub(super) fn size(&self, name: &str) -> u64 {
        self.buffers.get(name).map_or(0, wgpu::Buffer::size)
    }

    pub(super) fn get(&self, name: &str) -> Result<&wgpu::Buffer> {
        let missing = || Error::device(format!("GPU: no buffer {name}"));
        self.buffers.get(name).ok_or_else(missing)
    }
}
