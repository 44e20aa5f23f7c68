//! The passes that see pixels by several rays: those that are mixed, or all of them.

use super::engine::Commands;
use super::mixed::{self, Room};
use super::{Engine, Stage, aperture, grid};
use crate::emulator::render::aperture::Aperture;
use crate::emulator::render::look::Looks;
use crate::emulator::render::shade::Optics;
use crate::emulator::render::worlds::Worlds;
use crate::emulator::render::{Options, Plan, Term};
use crate::error::Result;
use bytemuck::{Pod, Zeroable};

/// Twin of `Sampling` in `sampling.wgsl`, its tables aside.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct SamplingData {
    size: [u32; 2],
    rows: u32,
    room: u32,
    pixel_slope: f32,
    focus: f32,
    spread: f32,
    turns: u32,
    varies: u32,
    spare: [u32; 3],
}

/// Sees pixels by several rays.
pub(in crate::emulator::render) struct Sampler {
    aperture: Aperture,
    /// Samples on a side of a pixel.
    side: usize,
    room: Room,
    data: SamplingData,
    /// A bit for each object whose albedo varies over its surface.
    varies: Vec<[u32; 2]>,
}

impl Sampler {
    /// Takes what the passes need beside maps, optics and world to the GPU.
    pub(in crate::emulator::render) fn new(
        engine: &mut Engine,
        worlds: &Worlds,
        optics: &Optics,
        plan: &Plan,
        options: Options,
        aperture: Aperture,
    ) -> Self {
        let lens = &optics.camera.lens;
        let depth_of_field = plan.has(Term::DepthOfField) && aperture.radius_mm > 0.0;
        let side = options.side(depth_of_field);
        let pixels = u64::from(lens.width_px) * u64::from(lens.height_px);
        // What scenes mostly take: all that is on edges, a quarter of what may be out of focus.
        let heads = match side {
            1 | 2 => pixels / 16,
            4 => pixels / 4,
            _ => pixels,
        };
        let data = SamplingData {
            size: [lens.width_px, lens.height_px],
            pixel_slope: (1.0 / lens.focal_px.min_element()) as f32,
            focus: aperture.focus as f32,
            spread: (aperture.focal_px * aperture.radius_mm) as f32,
            turns: (side * side) as u32,
            ..SamplingData::zeroed()
        };
        engine.reserve("candidates", pixels * 4);
        engine.reserve("candidate_count", 16);
        let mut sampler = Self {
            aperture,
            side,
            room: Room::new(engine, heads, plan.has(Term::Subsurface)),
            data,
            varies: varies(&worlds.any().looks),
        };
        sampler.room.reserve(engine);
        sampler.see(engine, worlds);
        sampler
    }

    /// Takes note of a scene that may be seen otherwise than before: by all rows at once, or by each
    /// at its own time.
    pub(in crate::emulator::render) fn see(&mut self, engine: &mut Engine, worlds: &Worlds) {
        let rows = worlds.rows_together() as u32;
        if self.data.rows != rows {
            self.data.rows = rows;
            self.write(engine);
        }
    }

    /// Groups of sixteen samples that there is room for.
    pub(super) fn room(&self) -> u64 {
        self.room.heads
    }

    fn write(&mut self, engine: &mut Engine) {
        let size = self.data.size.map(|n| n as usize);
        let turns = aperture::turns(size.into(), self.data.rows as usize);
        let points = aperture::points(&self.aperture, self.side);
        let pairs: Vec<[f32; 2]> = points.chain(turns).collect();
        self.data.varies = pairs.len() as u32;
        self.data.room = self.room.heads as u32;
        let parts: [&[u8]; 3] = [
            bytemuck::bytes_of(&self.data),
            bytemuck::cast_slice(&pairs),
            bytemuck::cast_slice(&self.varies),
        ];
        engine.write("sampling", &parts.concat());
    }

    /// Adds the passes that follow the one over pixels' centres, to be submitted with it.
    ///
    /// # Errors
    /// A GPU that has failed.
    pub(in crate::emulator::render) fn run(
        &self,
        engine: &mut Engine,
        commands: &mut Commands,
        plan: &Plan,
    ) -> Result<()> {
        let pixels = (self.data.size[0] * self.data.size[1]) as usize;
        let samples = pixels * self.side * self.side;
        let through_pupil = self.aperture.radius_mm > 0.0;
        let sampled = |entry| {
            Stage::new("sampled", entry, plan)
                .with("side", self.side as f64)
                .with("through_pupil", u8::from(through_pupil).into())
        };
        let mixed = |entry| Stage::new("mixed", entry, plan);
        engine.run(commands, &mixed("clear"), [1; 3])?;
        match self.side {
            1 => {}
            2 => engine.run(commands, &sampled("mark"), grid(samples))?,
            _ => engine.run(commands, &sampled("gather"), grid(samples))?,
        }
        if self.side < 4 {
            engine.run(commands, &mixed("find"), grid(pixels))?;
            engine.run(commands, &mixed("ready"), [1; 3])?;
            let sample = Stage::new("mixed_sample", "main", plan);
            engine.run_indirect(commands, &sample, "candidate_count", 4)?;
        }
        engine.run(commands, &mixed("close"), [1; 3])?;
        if plan.has(Term::DepthOfField) {
            engine.run(commands, &Stage::new("widen", "main", plan), grid(pixels))?;
        }
        Ok(())
    }

    /// Waits for the passes that were submitted, and makes room where there was too little for the
    /// mixed pixels that they found; tells whether there was: then the pass over the centres and
    /// these have to be run again.
    ///
    /// # Errors
    /// More mixed pixels than the adapter can hold, or a GPU that has failed.
    pub(in crate::emulator::render) fn has_grown(&mut self, engine: &mut Engine) -> Result<bool> {
        let wanted = mixed::wanted(engine)?;
        self.has_grown_for(engine, wanted)
    }

    /// The same where the last word of `mixed_count` is at hand.
    ///
    /// # Errors
    /// As [`Self::has_grown`], waiting aside.
    pub(in crate::emulator::render) fn has_grown_for(
        &mut self,
        engine: &mut Engine,
        wanted: u64,
    ) -> Result<bool> {
        let grown = self.room.grow(wanted)?;
        if grown {
            self.room.reserve(engine);
            self.write(engine);
        }
        Ok(grown)
    }
}

fn varies(looks: &Looks) -> Vec<[u32; 2]> {
    let mut varies = vec![[0u32; 2]; looks.len().div_ceil(64)];
    for object in (0..looks.len()).filter(|&object| looks.vary(object as u16)) {
        varies[object / 64][object / 32 % 2] |= 1 << (object % 32);
    }
    varies
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::emulator::render::aperture::widened;
    use crate::emulator::render::sampled::{offset, pupil_index, turn};
    use crate::emulator::render::term::Needs;
    use crate::emulator::render::world::World;
    use crate::profile::{Profile, Scene};

    /// A camera before a scene.
    struct Setup {
        profile: Profile,
        worlds: Worlds,
        optics: Optics,
        plan: Plan,
    }

    impl Setup {
        fn new(profile: Profile, scene: &Scene) -> Self {
            let optics = Optics::new(&profile, scene);
            let world = World::new(scene, &optics.skins).unwrap();
            let mut plan = Plan::new(&Needs {
                profile: &profile,
                optics: &optics,
                world: &world,
            });
            plan.set(Term::FootprintX, true);
            plan.set(Term::FootprintY, true);
            Self {
                profile,
                worlds: Worlds::new(world),
                optics,
                plan,
            }
        }

        fn aperture(&self) -> Aperture {
            Aperture::new(&self.profile.camera)
        }

        fn sampler(&self, engine: &mut Engine, samples: u32) -> Sampler {
            let options = Options {
                samples,
                ..Options::default()
            };
            let (worlds, optics) = (&self.worlds, &self.optics);
            Sampler::new(engine, worlds, optics, &self.plan, options, self.aperture())
        }
    }

    /// A small image, in focus at a distance in millimetres.
    fn focused(focus_mm: f64) -> Profile {
        let mut profile = Profile::load("pmp-bench").unwrap();
        (profile.camera.width_px, profile.camera.height_px) = (151, 70);
        profile.camera.f_number = 2.0;
        profile.camera.focus_mm = Some(focus_mm);
        profile
    }

    fn call(engine: &mut Engine, entry: &'static str, input: &[u32]) -> Vec<[f32; 4]> {
        let stage = Stage::new("tests/samples_test", entry, &Plan::default());
        let output = engine.call_stage(&stage, input, input.len(), input.len() / 4);
        bytemuck::cast_vec(output)
    }

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn samples_are_where_the_cpu_has_them() {
        let setup = Setup::new(focused(900.0), &Scene::load("plane").unwrap());
        let (engine, aperture) = (&mut Engine::for_tests(), setup.aperture());
        let (width, height) = (151usize, 70usize);
        for (samples, side) in [(4, 4usize), (16, 4), (64, 8)] {
            let mut sampler = setup.sampler(engine, samples);
            assert_eq!(sampler.side, side, "depth of field takes sixteen");
            for rows in [4, 1] {
                sampler.data.rows = rows as u32;
                sampler.write(engine);
                let asked: Vec<[usize; 4]> = (0..width * height)
                    .map(|i| [i % width, i / width, i * 7 % (side * side), side])
                    .collect();
                let input: Vec<u32> = asked.iter().flatten().map(|&n| n as u32).collect();
                let found = call(engine, "places", &input);
                for ([u, v, k, side], found) in asked.into_iter().zip(found) {
                    let (across, count) = (16 / rows, side * side);
                    let tile = v / rows * width.div_ceil(across) + u / across;
                    let point = aperture.point(pupil_index(k, count), count, turn(tile));
                    let offset = offset(k, side);
                    let wanted = [point.x, point.y, offset.x, offset.y];
                    for (found, wanted) in found.into_iter().zip(wanted) {
                        assert!((f64::from(found) - wanted).abs() < 2e-6, "{u} {v} {k}");
                    }
                }
            }
        }
    }

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn blur_widens_as_on_the_cpu() {
        let setup = Setup::new(focused(900.0), &Scene::load("plane").unwrap());
        let (engine, aperture) = (&mut Engine::for_tests(), setup.aperture());
        setup.sampler(engine, 16);
        let sizes = [0.0f32, 1e-4, 0.1, 0.7, 1.0, 3.0, 500.0];
        let depths = [
            0.0f32, 0.001, 50.0, 600.0, 850.0, 899.9, 900.0, 901.0, 940.0, 1e4, 1e6,
        ];
        let mut asked = Vec::new();
        for depth in depths {
            for a in sizes {
                asked.extend(sizes.map(|b| [a, -b, depth, 0.0]));
            }
        }
        let input: Vec<u32> = asked.iter().flatten().map(|v| v.to_bits()).collect();
        for ([a, b, depth, _], found) in asked.into_iter().zip(call(engine, "widths", &input)) {
            let radius = match depth {
                0.0 => 0.0,
                depth => aperture.blur_px(depth.into()),
            };
            assert!((f64::from(found[2]) - radius).abs() < 3e-6 * radius + 2e-6);
            let wanted = widened([a, b], radius);
            let energy = |[a, b]: [f32; 2]| f64::from(a).hypot(b.into());
            let (now, then) = (energy([found[0], found[1]]), energy(wanted));
            assert!(
                (now - then).abs() <= 5e-6 * then,
                "{a} {b} {depth}: {found:?} {wanted:?}"
            );
            for (found, wanted) in found.into_iter().zip(wanted) {
                // Near the width that two boxes no longer have, a root takes half of the digits.
                let bar = 5e-4 * then as f32;
                assert!(
                    (found - wanted).abs() <= bar,
                    "{a} {b} {depth}: {found} {wanted}"
                );
            }
        }
    }
}
