//! Pending frames: a GPU has several frames in flight; the CPU renders each frame immediately.

use super::Renderer;
use crate::Backend;
use crate::gpu::{self, Adapter, PassTime, Passes, Shown, Ticket, View};
use crate::shot::Shot;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::Frame;
use std::collections::BTreeMap;

/// Maximum number of times that a frame is rendered again with more capacity for mixed pixels. If
/// nothing has moved, the capacity that the first attempt turned out to need suffices for the
/// second.
const MOST_TRIES: usize = 4;

/// A frame that a renderer has begun.
pub struct Pending(State);

enum State {
    Done(Frame),
    /// Being rendered by the GPU.
    Coming(Ticket, Box<Shot>),
}

impl Renderer {
    /// Returns the number of frames that may be begun before the first of them is finished.
    pub fn depth(&self) -> usize {
        match self.gpu {
            Some(_) => gpu::DEPTH,
            None => 1,
        }
    }

    /// Returns the GPU in use, if any.
    pub fn adapter(&self) -> Option<&Adapter> {
        self.gpu.as_ref().map(|gpu| &gpu.gpu().adapter)
    }

    /// Begins the frame of one exposure. Frames must be finished in the order in which they were
    /// begun.
    pub fn submit(&mut self, shot: &Shot) -> Pending {
        if let Some(mut gpu) = self.gpu.take() {
            match self.submit_to(&mut gpu, shot) {
                Ok(ticket) => {
                    self.gpu = Some(gpu);
                    return Pending(State::Coming(ticket, Box::new(shot.clone())));
                }
                Err(e) => self.give_up(&e),
            }
        }
        Pending(State::Done(self.expose_here(shot)))
    }

    /// Finishes a begun frame and returns it. If the GPU fails, the CPU renders the frame, so that
    /// no frame is lost.
    pub fn finish(&mut self, pending: Pending) -> Frame {
        match pending.0 {
            State::Done(frame) => frame,
            State::Coming(ticket, shot) => {
                if let Some(mut gpu) = self.gpu.take() {
                    match self.take(&mut gpu, ticket, &shot) {
                        Ok(data) => {
                            self.gpu = Some(gpu);
                            return self.frame(&shot, data);
                        }
                        Err(e) => self.give_up(&e),
                    }
                }
                self.expose_here(&shot)
            }
        }
    }

    /// Renders the frame of one exposure. The same seed, noise id and settings give the same bytes
    /// on any number of threads.
    pub fn expose(&mut self, shot: &Shot) -> Frame {
        let pending = self.submit(shot);
        self.finish(pending)
    }

    /// Returns a notice for the user about the backend in use and the scene's meshes. Each notice is
    /// returned once.
    ///
    /// # Errors
    /// Returns an error if an explicitly requested GPU has failed; the frames so far are complete.
    pub fn news(&mut self) -> Result<Option<String>> {
        match self.news.failed.take() {
            Some(words) => Err(Error::device(words)),
            None => Ok(self.news.text.take()),
        }
    }

    /// Enables timing of the GPU's passes.
    pub fn time_passes(&mut self) {
        if let Some(gpu) = &mut self.gpu {
            gpu.time_passes();
        }
    }

    /// Returns the GPU time spent in passes since timing was enabled, by shader and entry point;
    /// empty if the adapter has no timestamps.
    pub fn pass_times(&mut self) -> BTreeMap<String, PassTime> {
        self.gpu.as_mut().map(|gpu| gpu.times()).unwrap_or_default()
    }

    /// Stops using the GPU and records the reason; from now on the CPU renders.
    pub(super) fn give_up(&mut self, e: &Error) {
        self.gpu = None;
        match self.options.backend {
            Backend::Gpu => self.news.failed = Some(e.to_string()),
            _ => self.news.text = Some(format!("{e}; rendering continues on the CPU")),
        }
    }

    /// Waits for a frame; renders the frame again if the capacity for mixed pixels was too small.
    fn take(&mut self, gpu: &mut Passes, mut ticket: Ticket, shot: &Shot) -> Result<Vec<u8>> {
        for _ in 0..MOST_TRIES {
            if let Some(data) = gpu.take(ticket)? {
                return Ok(data);
            }
            ticket = self.submit_to(gpu, shot)?;
        }
        Err(Error::device(
            "GPU: the samples of mixed pixels still exceed the buffers",
        ))
    }

    /// Submits a frame to the GPU.
    fn submit_to(&mut self, gpu: &mut Passes, shot: &Shot) -> Result<Ticket> {
        let mut adds = false;
        for (instant, part) in self.instants(shot) {
            if let Some(instant) = &instant {
                self.go_to_instant(instant);
            }
            let (when, tables) = self.pattern_images(&part);
            gpu.geometry_pass(&self.view())?;
            gpu.expose(&Shown {
                plan: &self.plan,
                when: &when,
                tables: &tables,
                blur_aspect: self.optics.defocus.aspect,
                pixels: self.pixel_count(),
                adds,
            })?;
            adds = true;
        }
        gpu.read(&self.sensor(shot))
    }

    fn view(&self) -> View<'_> {
        View {
            profile: &self.profile,
            worlds: &self.worlds,
            optics: &self.optics,
            rays: self.rays.as_deref(),
            plan: &self.plan,
            options: self.options,
            fixed: self.fixed.as_ref(),
            revision: self.revision,
        }
    }
}

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use super::*;
    use crate::Options;
    use crate::pattern_image::PatternImage;
    use phasmid_profile::{Profile, Scene};
    use std::sync::Arc;

    fn renderer(backend: Backend) -> Result<Renderer> {
        let profile = Profile::load("webcam-grey").unwrap();
        let scene = Scene::load("plane").unwrap();
        let options = Options {
            backend,
            ..Options::default()
        };
        Renderer::with_options(&profile, &scene, 3, options)
    }

    fn shot(noise_id: u64) -> Shot {
        Shot {
            noise_id,
            pattern_image: Some(Arc::new(PatternImage::Uniform(200))),
            light: 1.0,
            exposure_ns: 5_000_000,
            ..Shot::default()
        }
    }

    /// Checks that all frames arrive although `fail` breaks the GPU, and that frames after the
    /// failure equal the CPU's frames.
    fn goes_on_after(fail: impl Fn(&mut Passes), backend: Backend) -> Renderer {
        let mut alone = renderer(Backend::Cpu).unwrap();
        let mut renderer = renderer(Backend::Gpu).unwrap();
        renderer.options.backend = backend;
        renderer.expose(&shot(0));
        assert!(renderer.adapter().is_some() && renderer.depth() > 1);
        let under_way = [1, 2].map(|id| renderer.submit(&shot(id)));
        fail(renderer.gpu.as_mut().unwrap());
        for (pending, id) in under_way.into_iter().zip(1..) {
            let frame = renderer.finish(pending);
            assert_eq!(frame.data.len(), alone.expose(&shot(id)).data.len());
        }
        assert_eq!(renderer.expose(&shot(3)), alone.expose(&shot(3)));
        assert!(renderer.adapter().is_none());
        renderer
    }

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn cpu_continues_after_loss_of_the_gpu() {
        for fail in [
            |gpu: &mut Passes| gpu.gpu().fail("lost: pulled out"),
            |gpu: &mut Passes| gpu.gpu().device.destroy(),
        ] {
            let mut renderer = goes_on_after(fail, Backend::Auto);
            let news = renderer.news().unwrap().unwrap();
            assert!(news.ends_with("; rendering continues on the CPU"), "{news}");
            assert_eq!(renderer.news().unwrap(), None, "said once");
        }
    }

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn loss_of_a_requested_gpu_is_an_error() {
        let fail = |gpu: &mut Passes| gpu.gpu().fail("lost: pulled out");
        let mut renderer = goes_on_after(fail, Backend::Gpu);
        let said = renderer.news().unwrap_err().to_string();
        assert!(said.contains("lost: pulled out"), "{said}");
    }

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn lack_of_gpu_memory_is_reported() {
        let fail = |gpu: &mut Passes| gpu.reserve("frame", u64::MAX / 2);
        let mut renderer = goes_on_after(fail, Backend::Auto);
        let news = renderer.news().unwrap().unwrap();
        assert!(
            news.contains("frame takes") && news.contains("bytes"),
            "{news}"
        );
    }

    /// If there is a hardware adapter, it is used without a notice; if there is none, a notice
    /// explains why the CPU is used.
    #[test]
    fn auto_uses_a_hardware_gpu_or_reports_why_not() {
        let mut renderer = renderer(Backend::Auto).unwrap();
        let news = renderer.news().unwrap();
        match renderer.adapter() {
            Some(adapter) => assert!(adapter.hardware && news.is_none()),
            None => assert!(news.unwrap().starts_with("rendering on the CPU: ")),
        }
        assert_eq!(renderer.news().unwrap(), None);
    }

    #[test]
    fn mesh_of_equal_triangles_is_reduced_with_a_notice() {
        let dir = tempfile::tempdir().unwrap();
        let faces = "f 1 2 3\n".repeat(50_000) + "f 1 1 2\n";
        let mesh = "v -50 -50 0\nv 50 -50 0\nv 0 50 0\n".to_owned() + &faces;
        std::fs::write(dir.path().join("m.obj"), mesh).unwrap();
        let path = dir.path().join("scene.toml");
        let moving =
            "motion = { keyframes = [{ time_s = 0 }, { time_s = 1, position_mm = [1, 0, 0] }] }\n";
        for motion in ["", moving] {
            let object = "name = \"m\"\ndescription = \"m\"\n[[object]]\nshape = { kind = \"mesh\", file = \"m.obj\" }\nalbedo = 0.5\n\
                          position_mm = [0, 0, 900]\n";
            std::fs::write(&path, object.to_owned() + motion).unwrap();
            let scene = Scene::load(path.to_str().unwrap()).unwrap();
            let profile = Profile::load("webcam-grey").unwrap();
            let options = Options {
                backend: Backend::Cpu,
                ..Options::default()
            };
            let mut renderer = Renderer::with_options(&profile, &scene, 1, options).unwrap();
            let notice = renderer.news().unwrap().unwrap();
            let removed = "m.obj: removed 1 triangles without area and 49999 duplicate triangles";
            assert!(
                notice.starts_with("scene, object[0].shape.file: "),
                "{notice}"
            );
            assert!(notice.contains(removed), "{notice}");
            assert_eq!(renderer.worlds.any().triangle_count(), 1);
        }
    }
}
