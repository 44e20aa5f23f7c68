//! Pass durations measured with GPU timestamps.

use super::{Gpu, PassTime};
use std::collections::BTreeMap;

/// Maximum number of passes between two readbacks of timestamps.
const MOST: u32 = 256;

/// Records timestamps before and after passes. Inactive until it is enabled, and always if the
/// adapter has no timestamps.
pub(super) struct Timing {
    queries: Option<Queries>,
    taken: BTreeMap<String, PassTime>,
}

struct Queries {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    read: wgpu::Buffer,
    tick_ns: f32,
    names: Vec<String>,
}

impl Timing {
    pub(super) fn off() -> Self {
        Self {
            queries: None,
            taken: BTreeMap::new(),
        }
    }

    /// Enables timing, if the adapter supports timestamps.
    pub(super) fn on(gpu: &Gpu) -> Self {
        let buffer = |label, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: u64::from(MOST) * 16,
                usage,
                mapped_at_creation: false,
            })
        };
        let queries = gpu.tick_ns.map(|tick_ns| Queries {
            set: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timing"),
                ty: wgpu::QueryType::Timestamp,
                count: MOST * 2,
            }),
            resolved: buffer(
                "timing",
                wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            ),
            read: buffer(
                "timing read back",
                wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            ),
            tick_ns,
            names: Vec::new(),
        });
        Self {
            queries,
            taken: BTreeMap::new(),
        }
    }

    /// Returns the timestamp writes for the next pass; `None` if the pass is not timed.
    pub(super) fn writes(&mut self, name: &str) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let queries = self.queries.as_mut()?;
        let index = queries.names.len() as u32;
        if index >= MOST {
            return None;
        }
        queries.names.push(name.to_owned());
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &queries.set,
            beginning_of_pass_write_index: Some(index * 2),
            end_of_pass_write_index: Some(index * 2 + 1),
        })
    }

    /// Waits for all passes so far and adds up their times.
    pub(super) fn collect(&mut self, gpu: &Gpu) -> BTreeMap<String, PassTime> {
        if let Some(queries) = &mut self.queries
            && !queries.names.is_empty()
        {
            let names = std::mem::take(&mut queries.names);
            if let Some(ticks) = queries.ticks(gpu, names.len()) {
                for (name, [from, to]) in names.into_iter().zip(ticks) {
                    let taken = self.taken.entry(name).or_default();
                    taken.runs += 1;
                    taken.total_ns += to.saturating_sub(from) as f64 * f64::from(queries.tick_ns);
                }
            }
        }
        self.taken.clone()
    }
}

impl Queries {
    fn ticks(&self, gpu: &Gpu, count: usize) -> Option<Vec<[u64; 2]>> {
        let bytes = count as u64 * 16;
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.resolve_query_set(&self.set, 0..count as u32 * 2, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.read, 0, bytes);
        gpu.queue.submit([encoder.finish()]);
        self.read.map_async(wgpu::MapMode::Read, ..bytes, |_| {});
        gpu.wait().ok()?;
        let ticks = {
            let view = self.read.get_mapped_range(..bytes).ok()?;
            let words: &[[u64; 2]] = bytemuck::try_cast_slice(&view).ok()?;
            words.to_vec()
        };
        self.read.unmap();
        Some(ticks)
    }
}
