//! Test scenes whose geometry maps come from the CPU and are uploaded to the GPU together with the
//! scene.

use super::sampled::Sampler;
use super::{Engine, geometry as gpu, materials, optics, scene, skin, upload};
use crate::exposure::{Gathering, GeometryBuffer, Optics};
use crate::plan::Needs;
use crate::scene::{World, Worlds};
use crate::transport::{Aperture, Input, Rays, geometry, ideal_points, interreflection};
use crate::{Options, Plan, Term};
use glam::DVec2;
use phasmid_profile::{Profile, Scene};
use std::path::Path;

/// A scene and its maps from the CPU's geometry pass, without indirect light.
pub(super) struct TestScene {
    profile: Profile,
    worlds: Worlds,
    pub(super) optics: Optics,
    pub(super) plan: Plan,
    table: Option<Vec<DVec2>>,
    pub(super) map: GeometryBuffer,
    /// Interreflection settings of the scene.
    pub(super) wanted: Option<Gathering>,
}

impl TestScene {
    /// Builds a test scene from lines of TOML, whose files are in `folder`. A small camera with the
    /// field of view of the `pmp-bench` profile sees it.
    pub(super) fn new(lines: &str, folder: &Path, change: impl Fn(&mut Profile)) -> Self {
        let mut profile = Profile::load("pmp-bench").unwrap();
        (profile.camera.width_px, profile.camera.height_px) = (286, 123);
        change(&mut profile);
        let text = format!("name = \"bench\"\ndescription = \"\"\n{lines}");
        let mut scene = Scene::parse(&text, "bench").unwrap();
        scene.folder = folder.to_path_buf();
        let mut optics = Optics::new(&profile, &scene);
        let world = World::new(&scene, &optics.skins).unwrap();
        let mut plan = Plan::new(&Needs {
            profile: &profile,
            optics: &optics,
            world: &world,
        });
        plan.set(Term::FootprintX, true);
        plan.set(Term::FootprintY, true);
        let wanted = optics.interreflection.take();
        let distorted = plan.has(Term::CameraDistortion);
        let table = distorted.then(|| ideal_points(&optics));
        let mut bench = Self {
            profile,
            worlds: Worlds::new(world),
            plan,
            table,
            map: GeometryBuffer::default(),
            wanted,
            optics,
        };
        let mut map = GeometryBuffer::default();
        geometry::run(&bench.input(&bench.rays()), &mut map);
        bench.map = map;
        bench
    }

    fn input<'a>(&'a self, rays: &'a Rays<'a>) -> Input<'a> {
        Input {
            worlds: &self.worlds,
            optics: &self.optics,
            rays,
            plan: &self.plan,
            options: Options::default(),
            aperture: Aperture::new(&self.profile.camera),
            occluders: None,
        }
    }

    fn rays(&self) -> Rays<'_> {
        Rays {
            optics: &self.optics,
            table: self.table.as_deref(),
            width: self.optics.camera.lens.width_px as usize,
        }
    }

    pub(super) fn size(&self) -> [usize; 2] {
        let lens = &self.optics.camera.lens;
        [lens.width_px, lens.height_px].map(|side| side as usize)
    }

    /// Returns the CPU's maps including indirect light.
    pub(super) fn bounced(&mut self) -> GeometryBuffer {
        let mut map = self.map.clone();
        self.optics.interreflection = self.wanted;
        interreflection::run(&self.input(&self.rays()), &mut map);
        map
    }

    /// Returns an engine to which scene and maps have been uploaded.
    pub(super) fn engine(&self) -> Engine {
        let mut engine = Engine::for_tests();
        optics::write(&mut engine, &self.optics);
        gpu::write_rays(&mut engine, self.table.as_deref());
        skin::write(&mut engine, &self.optics.skins);
        scene::Scene::default().update(&mut engine, &self.worlds, self.map.height);
        materials::Materials::default().update(&mut engine, &self.optics, &self.worlds);
        upload::maps(&mut engine, &self.map);
        engine
    }

    /// Finds the mixed pixels on the GPU.
    pub(super) fn see_mixed(&self, engine: &mut Engine) {
        let options = Options::default();
        let aperture = Aperture::new(&self.profile.camera);
        let sampler = Sampler::new(
            engine,
            &self.worlds,
            &self.optics,
            &self.plan,
            options,
            aperture,
        );
        let mut commands = engine.commands();
        sampler.run(engine, &mut commands, &self.plan).unwrap();
        engine.submit(commands);
    }
}
