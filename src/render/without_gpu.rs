//! Replaces the module `gpu` in builds without the feature `gpu`: no GPU can be opened.

pub use super::gpu_data::{Adapter, PassTime};
pub(super) use super::gpu_data::{Shown, View};
use super::sensor::Sensor;
use crate::exposure::Optics;
use crate::scene::World;
use phasmid_core::error::{Error, Result};
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;

/// Maximum number of frames in flight.
pub(super) const DEPTH: usize = 1;

/// An opened GPU. This build cannot open one.
pub struct Gpu {
    /// Adapter of this GPU.
    pub adapter: Adapter,
    never: Infallible,
}

/// The passes of one renderer.
pub(super) struct Passes(Arc<Gpu>);

/// A frame in flight.
pub(super) struct Ticket;

/// Returns no adapters, since this build cannot use any.
pub fn adapters() -> Vec<Adapter> {
    Vec::new()
}

/// Accepts every scene; [`Gpu::open`] then refuses the GPU.
pub(super) fn fits(_: &World, _: &Optics) -> Result<(), String> {
    Ok(())
}

impl Gpu {
    /// Fails, because this build cannot open a GPU.
    ///
    /// # Errors
    /// Returns an error that names the missing feature.
    pub fn open(software: bool) -> Result<Arc<Self>> {
        let why = "this program was built without the feature gpu";
        Err(match software {
            true => Error::input("--backend gpu", why, "--backend cpu or auto"),
            false => Error::device(why),
        })
    }

    pub(super) fn holds(&self, _: u64, _: u64) -> Result<()> {
        match self.never {}
    }
}

impl Passes {
    pub(super) fn new(gpu: Arc<Gpu>) -> Self {
        Self(gpu)
    }

    pub(super) fn gpu(&self) -> &Gpu {
        &self.0
    }

    pub(super) fn forget(&mut self) {
        match self.0.never {}
    }

    pub(super) fn geometry_pass(&mut self, _: &View<'_>) -> Result<()> {
        match self.0.never {}
    }

    pub(super) fn expose(&mut self, _: &Shown<'_>) -> Result<()> {
        match self.0.never {}
    }

    pub(super) fn read(&mut self, _: &Sensor<'_>) -> Result<Ticket> {
        match self.0.never {}
    }

    pub(super) fn take(&mut self, _: Ticket) -> Result<Option<Vec<u8>>> {
        match self.0.never {}
    }

    pub(super) fn time_passes(&mut self) {
        match self.0.never {}
    }

    pub(super) fn times(&mut self) -> BTreeMap<String, PassTime> {
        match self.0.never {}
    }
}

#[cfg(test)]
mod tests {
    use crate::{Backend, Options, Renderer};
    use phasmid_core::error::Result;
    use phasmid_profile::{Profile, Scene};

    fn renderer(backend: Backend) -> Result<Renderer> {
        let profile = Profile::load("webcam-grey").unwrap();
        let scene = Scene::load("plane").unwrap();
        let options = Options {
            backend,
            ..Options::default()
        };
        Renderer::with_options(&profile, &scene, 1, options)
    }

    #[test]
    fn requested_gpu_is_refused_and_auto_renders_on_the_cpu() {
        let refused = renderer(Backend::Gpu).err().unwrap();
        assert_eq!(
            (refused.exit_code(), refused.to_string()),
            (
                2,
                "--backend gpu: this program was built without the feature gpu; expected \
                 --backend cpu or auto"
                    .to_owned()
            )
        );
        let mut auto = renderer(Backend::Auto).unwrap();
        assert!(auto.adapter().is_none());
        assert_eq!(
            auto.news().unwrap().unwrap(),
            "rendering on the CPU: this program was built without the feature gpu"
        );
    }
}
