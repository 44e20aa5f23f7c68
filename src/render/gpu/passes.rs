//! All GPU passes of one renderer: keeps track of whether the maps are valid, and reads frames back.

use super::engine::Commands;
use super::exposure::Exposure;
use super::frames::{Arrived, Frames, Ticket};
use super::glare::Glare;
use super::materials::Materials;
use super::sampled::Sampler;
use super::scene::Scene;
use super::sensor::SensorPass;
use super::{Engine, Gpu, PassTime, Shown, View, geometry, interreflection, optics, skin};
use crate::sensor::Sensor;
use crate::transport::Aperture;
use crate::{Plan, Term};
use phasmid_core::error::{Error, Result};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The passes of one renderer.
pub(crate) struct Passes {
    engine: Engine,
    frames: Frames,
    made: Option<Made>,
    exposure: Exposure,
    /// Recorded passes that expose the last instant; they are submitted together with the next
    /// passes.
    open: Option<Commands>,
    /// Revision of scene and plan from which the maps were computed.
    holds: Option<u64>,
}

/// Buffers and passes built for one plan.
struct Made {
    plan: Plan,
    scene: Scene,
    materials: Materials,
    sampler: Sampler,
    glare: Option<Glare>,
    sensor: SensorPass,
}

impl View<'_> {
    fn size(&self) -> [usize; 2] {
        let camera = &self.profile.camera;
        [camera.width_px, camera.height_px].map(|side| side as usize)
    }
}

impl Made {
    fn new(engine: &mut Engine, view: &View<'_>) -> Self {
        let camera = &view.profile.camera;
        let [width, height] = view.size();
        optics::write(engine, view.optics);
        geometry::write_rays(engine, view.rays);
        if view.plan.has(Term::Subsurface) {
            skin::write(engine, &view.optics.skins);
        }
        let aperture = Aperture::new(camera);
        let glare = camera.glare.filter(|_| view.plan.has(Term::Glare));
        let bloom = camera.sensor.blooming_percent;
        Self {
            plan: *view.plan,
            scene: Scene::default(),
            materials: Materials::default(),
            sampler: Sampler::new(
                engine,
                view.worlds,
                view.optics,
                view.plan,
                view.options,
                aperture,
            ),
            glare: glare
                .and_then(|glare| Glare::new(engine, &glare, [width, height], camera.pixel_aspect)),
            sensor: SensorPass::new(engine, view.plan, (width, height), bloom, view.fixed),
        }
    }
}

impl Passes {
    pub(crate) fn new(gpu: Arc<Gpu>) -> Self {
        Self {
            engine: Engine::new(gpu),
            frames: Frames::default(),
            made: None,
            exposure: Exposure::default(),
            open: None,
            holds: None,
        }
    }

    pub(crate) fn gpu(&self) -> &Gpu {
        self.engine.gpu()
    }

    /// Discards everything that depends on the scene after it has changed; pipelines are kept.
    pub(crate) fn forget(&mut self) {
        self.made = None;
        self.holds = None;
    }

    /// Runs the geometry pass unless the maps are up to date.
    ///
    /// # Errors
    /// Returns an error if the GPU has failed.
    pub(crate) fn geometry_pass(&mut self, view: &View<'_>) -> Result<()> {
        let engine = &mut self.engine;
        // The revision also changes when the plan changes.
        if self.holds == Some(view.revision) {
            return engine.gpu().check();
        }
        // The next lines change the inputs of the recorded passes, so submit these passes first.
        if let Some(open) = self.open.take() {
            engine.submit(open);
        }
        let made = match self.made.take() {
            Some(made) if made.plan == *view.plan => made,
            _ => Made::new(engine, view),
        };
        let made = self.made.insert(made);
        made.scene.update(engine, view.worlds, view.size()[1]);
        made.materials.update(engine, view.optics, view.worlds);
        made.sampler.see(engine, view.worlds);
        let mut commands = engine.commands();
        geometry::run(engine, &mut commands, view.plan, &view.optics.camera.lens)?;
        made.sampler.run(engine, &mut commands, view.plan)?;
        let size = view.size();
        if view.plan.has(Term::Subsurface) {
            skin::run(engine, &mut commands, view.plan, size[0] * size[1])?;
        }
        engine.submit(commands);
        let interreflection = view.optics.interreflection;
        if let Some(wanted) = interreflection.filter(|_| view.plan.has(Term::Interreflection)) {
            interreflection::run(engine, wanted, view.plan, size)?;
        }
        self.holds = Some(view.revision);
        engine.gpu().check()
    }

    /// Exposes the pixels to a shot, or to the instant of a shot for which [`Self::geometry_pass`]
    /// was called last.
    ///
    /// # Errors
    /// Returns an error if the GPU has failed.
    pub(crate) fn expose(&mut self, shown: &Shown<'_>) -> Result<()> {
        // The next lines overwrite the schedule that the recorded passes read, so submit these
        // passes first.
        if let Some(open) = self.open.take() {
            self.engine.submit(open);
        }
        let mut commands = self.engine.commands();
        self.exposure.run(&mut self.engine, &mut commands, shown)?;
        self.open = Some(commands);
        Ok(())
    }

    /// Converts the accumulated light to a frame and starts reading it back, in one submission with
    /// the exposure.
    ///
    /// # Errors
    /// Returns an error if the GPU has failed.
    pub(crate) fn read(&mut self, sensor: &Sensor<'_>) -> Result<Ticket> {
        let engine = &mut self.engine;
        let (Some(made), Some(mut commands)) = (&self.made, self.open.take()) else {
            return Err(Error::device("GPU: no frame to read"));
        };
        if let Some(glare) = &made.glare {
            glare.run(engine, &mut commands, &made.plan)?;
        }
        made.sensor.read(engine, &mut commands, sensor)?;
        let bytes = made.sensor.frame_bytes(sensor);
        self.frames
            .submit(engine, commands, bytes, made.sampler.room())
    }

    /// Waits for a frame. Returns `None` if there was not enough capacity for the samples of mixed
    /// pixels. The capacity has then been increased, and the frame must be rendered again.
    ///
    /// # Errors
    /// Returns an error if the GPU has failed or has too little memory for the samples.
    pub(crate) fn take(&mut self, ticket: Ticket) -> Result<Option<Vec<u8>>> {
        let Arrived { data, wanted, room } = self.frames.take(self.engine.gpu(), ticket)?;
        if wanted <= room {
            return Ok(Some(data));
        }
        if let Some(made) = &mut self.made {
            made.sampler.has_grown(&mut self.engine, wanted)?;
        }
        self.holds = None;
        Ok(None)
    }

    /// Reserves a buffer in the same way as the passes do.
    #[cfg(test)]
    pub(crate) fn reserve(&mut self, name: &'static str, bytes: u64) {
        self.engine.reserve(name, bytes);
    }

    /// Enables timing of passes.
    pub(crate) fn time_passes(&mut self) {
        self.engine.time_passes();
    }

    /// Returns the time spent in passes since timing was enabled, by shader and entry point.
    pub(crate) fn times(&mut self) -> BTreeMap<String, PassTime> {
        self.engine.times()
    }
}
