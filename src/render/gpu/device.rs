//! Selects and opens a GPU, and tracks its failures.

use crate::gpu_data::Adapter;
use phasmid_core::error::{Error, Result};
use std::sync::{Arc, Mutex, PoisonError};

/// Maximum number of storage buffers that an entry point binds.
const STORAGE_BUFFERS: u32 = 24;

/// Size in bytes of a pixel in the map with the largest pixels.
const LARGEST_ELEMENT: u64 = 16;
/// Maximum number of threads per pass. It is below 2^32, with headroom for the padding of the
/// dispatch grid.
const MOST_SAMPLES: u64 = 1 << 31;

/// An opened GPU.
pub struct Gpu {
    /// Adapter of this GPU.
    pub adapter: Adapter,
    pub(crate) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    /// Nanoseconds per timestamp tick; `None` if passes cannot be timed.
    pub(super) tick_ns: Option<f32>,
    /// The first failure; after it, all operations fail.
    failure: Arc<Mutex<Option<String>>>,
}

fn instance() -> wgpu::Instance {
    let mut wanted = wgpu::InstanceDescriptor::new_without_display_handle();
    wanted.backends = wgpu::Backends::VULKAN;
    // No flags: validation layers and debug output are disabled.
    wanted.flags = wgpu::InstanceFlags::empty();
    wgpu::Instance::new(wanted)
}

fn describe(info: &wgpu::AdapterInfo) -> Adapter {
    let (kind, hardware) = match info.device_type {
        wgpu::DeviceType::DiscreteGpu => ("discrete", true),
        wgpu::DeviceType::IntegratedGpu => ("integrated", true),
        wgpu::DeviceType::VirtualGpu => ("virtual", true),
        wgpu::DeviceType::Cpu => ("software", false),
        wgpu::DeviceType::Other => ("unknown", false),
    };
    Adapter {
        name: info.name.clone(),
        kind,
        driver: format!("{} {}", info.driver, info.driver_info),
        hardware,
    }
}

/// Returns the Vulkan adapters of this machine, the fastest kind first; empty if there is no driver.
pub fn adapters() -> Vec<Adapter> {
    let mut found: Vec<_> = candidates(&instance())
        .iter()
        .map(|a| describe(&a.get_info()))
        .collect();
    found.dedup();
    found
}

fn candidates(instance: &wgpu::Instance) -> Vec<wgpu::Adapter> {
    let mut found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    found.sort_by_key(|a| match a.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    });
    found
}

impl Gpu {
    /// Opens an adapter of the fastest available kind; a software adapter only if `software` is set.
    ///
    /// # Errors
    /// Returns an error if there is no such adapter, if its limits are too small, or if it cannot be
    /// opened.
    pub fn open(software: bool) -> Result<Arc<Self>> {
        let mut refusal = None;
        for adapter in candidates(&instance()) {
            if !software && !describe(&adapter.get_info()).hardware {
                continue;
            }
            match Self::of(&adapter) {
                Ok(gpu) => return Ok(Arc::new(gpu)),
                Err(e) => refusal = refusal.or(Some(e)),
            }
        }
        Err(refusal.unwrap_or_else(|| {
            Error::device(if software {
                "no Vulkan adapter on this machine: a driver (on Debian mesa-vulkan-drivers) and \
                 the loader libvulkan.so.1 are needed"
            } else {
                "no Vulkan adapter with hardware acceleration on this machine"
            })
        }))
    }

    fn of(adapter: &wgpu::Adapter) -> Result<Self> {
        let about = describe(&adapter.get_info());
        let has = adapter.limits();
        let storage = has.max_storage_buffers_per_shader_stage;
        if storage < STORAGE_BUFFERS {
            return Err(Error::device(format!(
                "GPU {}: {storage} storage buffers per shader; expected {STORAGE_BUFFERS} or more",
                about.name
            )));
        }
        let limits = wgpu::Limits {
            max_storage_buffers_per_shader_stage: STORAGE_BUFFERS,
            max_storage_buffer_binding_size: has.max_storage_buffer_binding_size,
            max_buffer_size: has.max_buffer_size,
            ..wgpu::Limits::default().or_worse_values_from(&has)
        };
        let timed = adapter.features() & wgpu::Features::TIMESTAMP_QUERY;
        let wanted = wgpu::DeviceDescriptor {
            label: Some("phasmid"),
            required_features: timed,
            required_limits: limits,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&wanted))
            .map_err(|e| Error::device(format!("GPU {}: {e}", about.name)))?;
        let failure = Arc::new(Mutex::new(None));
        let note = |what: String| {
            let failure = failure.clone();
            move |words: String| {
                let mut failure = failure.lock().unwrap_or_else(PoisonError::into_inner);
                failure.get_or_insert_with(|| format!("GPU {what}: {words}"));
            }
        };
        let lost = note(about.name.clone());
        device.set_device_lost_callback(move |reason, words| {
            // The callback is also called when this program drops the device.
            if reason != wgpu::DeviceLostReason::Destroyed {
                lost(format!("lost: {words}"));
            }
        });
        let failed = note(about.name.clone());
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            failed(match e {
                wgpu::Error::OutOfMemory { .. } => "out of memory".to_owned(),
                other => other.to_string(),
            });
        }));
        let tick_ns = (!timed.is_empty()).then(|| queue.get_timestamp_period());
        Ok(Self {
            adapter: about,
            device,
            queue,
            tick_ns,
            failure,
        })
    }

    /// Checks that the maps of a camera with `pixels` pixels fit in a buffer and that `samples`
    /// samples can be addressed.
    ///
    /// # Errors
    /// Returns an error if there are too many pixels or samples for this adapter.
    pub(crate) fn holds(&self, pixels: u64, samples: u64) -> Result<()> {
        let most = self.largest_buffer() / LARGEST_ELEMENT;
        let refuse = |what: &str, found: u64, most: u64| {
            let name = &self.adapter.name;
            Err(Error::device(format!(
                "GPU {name}: {found} {what}; expected at most {most}"
            )))
        };
        if pixels > most {
            return refuse("pixels", pixels, most);
        }
        if pixels * samples > MOST_SAMPLES {
            return refuse("samples in all pixels", pixels * samples, MOST_SAMPLES);
        }
        Ok(())
    }

    /// Returns the maximum buffer size in bytes.
    pub(super) fn largest_buffer(&self) -> u64 {
        let limits = self.device.limits();
        limits
            .max_buffer_size
            .min(limits.max_storage_buffer_binding_size)
    }

    /// Records a failure unless an earlier one has been recorded.
    pub(crate) fn fail(&self, words: impl std::fmt::Display) {
        let mut failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure.get_or_insert_with(|| format!("GPU {}: {words}", self.adapter.name));
    }

    /// Checks that the GPU has not failed.
    ///
    /// # Errors
    /// Returns the first failure, such as a lost device or lack of memory.
    pub fn check(&self) -> Result<()> {
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        match &*failure {
            Some(words) => Err(Error::device(words)),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn sizes_beyond_gpu_memory_are_refused_beforehand() {
        let gpu = Gpu::open(true).unwrap();
        gpu.holds(1138 * 489, 64).unwrap();
        let words = gpu.holds(1 << 40, 1).unwrap_err().to_string();
        assert!(words.contains("pixels; expected at most"), "{words}");
        let words = gpu.holds(1 << 20, 1 << 12).unwrap_err().to_string();
        assert!(words.contains("samples in all pixels"), "{words}");
    }

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn first_failure_is_the_one_reported() {
        let gpu = Gpu::open(true).unwrap();
        gpu.check().unwrap();
        gpu.fail("first");
        gpu.fail("second");
        assert_eq!(
            gpu.check().unwrap_err().to_string(),
            format!("GPU {}: first", gpu.adapter.name)
        );
    }
}
