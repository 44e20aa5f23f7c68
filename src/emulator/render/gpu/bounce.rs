//! Interreflection on the GPU: points at which light is gathered, and their rays. Twin of
//! `bounce/mod.rs`.
//!
//! A point has room for all of its rays, 16 bytes each and axis that slides vary along, and those
//! that bring light come first: at every fourth pixel both ways 64 rays take 128 bytes a pixel of the
//! camera and axis... 

use super::{Engine, Stage, grid, upload};
use crate::emulator::render::bounce::{Bounce, Hemisphere};
use crate::emulator::render::{Plan, Term};
use crate::error::{Error, Result};
use crate::profile::Interreflection;
use bytemuck::{Pod, Zeroable};

/// Bytes of a ray along one axis of the slide.
const RAY: u64 = 16;
/// Bytes of a point.
const POINT: u64 = 16;

/// Twin of `BounceParams` in `bounce_types.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
struct Params {
    size: [u32; 2],
    /// Of the grid.
    places: [u32; 2],
    step: u32,
    samples: u32,
    points: u32,
    spare: u32,
}

/// Twin of `BouncePoint` in `bounce_types.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(in crate::emulator::render) struct Point {
    pub(in crate::emulator::render) pixel: u32,
    pub(in crate::emulator::render) first: u32,
    pub(in crate::emulator::render) kept: u32,
    pub(in crate::emulator::render) white: f32,
}

impl Params {
    fn new(wanted: Interreflection, (width, height): (u32, u32)) -> Self {
        let step = wanted.step_px;
        // Every `step`th of them, and the last.
        let places = |count: u32| (count - 1).div_ceil(step) + 1;
        Self {
            size: [width, height],
            places: [places(width), places(height)],
            step,
            samples: wanted.samples,
            ..Self::default()
        }
    }

    fn on_grid(&self) -> u32 {
        self.places[0] * self.places[1]
    }
}

/// Gathers the light that surfaces throw on each other, of which the maps of all pixels are at hand,
/// and adds that of lamps to the ambient maps. Waits for the GPU once: how many points there are
/// decides how much memory they take.
///
/// # Errors
/// More points than there is memory for, or a GPU that has failed.
pub(in crate::emulator::render) fn run(
    engine: &mut Engine,
    wanted: Interreflection,
    plan: &Plan,
    (width, height): (u32, u32),
) -> Result<()> {
    let mut params = Params::new(wanted, (width, height));
    let pixels = width as usize * height as usize;
    shares(engine, &params, plan)?;
    params.points = upload::words::<u32>(engine, "bounce_count", 1)?[0];
    reserve(engine, &params, plan)?;
    engine.write("bounce_params", bytemuck::bytes_of(&params));
    engine.write("bounce_disc", bytemuck::cast_slice(&disc(wanted.samples)));
    let mut commands = engine.commands();
    let points = Stage::new("grid", "points", plan);
    engine.run(&mut commands, &points, grid(params.on_grid() as usize))?;
    engine.run(&mut commands, &Stage::new("grid", "alone", plan), grid(pixels))?;
    let gather = Stage::new("gather", "main", plan).with("rays_a_point", wanted.samples.into());
    // A workgroup a point.
    engine.run(&mut commands, &gather, grid(64 * params.points as usize))?;
    if plan.has(Term::Lights) {
        engine.run(&mut commands, &Stage::new("add_lamps", "main", plan), grid(pixels))?;
        let mixed = Stage::new("add_lamps", "mixed", plan);
        engine.run_indirect(&mut commands, &mixed, "mixed_count", 4)?;
    }
    engine.submit(commands);
    Ok(())
}

/// Which points each pixel is interpolated from; counts them in `bounce_count`.
fn shares(engine: &mut Engine, params: &Params, plan: &Plan) -> Result<()> {
    let pixels = u64::from(params.size[0]) * u64::from(params.size[1]);
    engine.write("bounce_params", bytemuck::bytes_of(params));
    engine.write("bounce_count", bytemuck::bytes_of(&params.on_grid()));
    engine.reserve("bounce_first", 4 * pixels);
    engine.reserve("bounce_shares", 16 * pixels);
    let mut commands = engine.commands();
    engine.run(&mut commands, &Stage::new("grid", "shares", plan), grid(pixels as usize))?;
    engine.submit(commands);
    Ok(())
}

/// Room for points and rays.
fn reserve(engine: &mut Engine, params: &Params, plan: &Plan) -> Result<()> {
    let points = u64::from(params.points);
    let bytes = points * u64::from(params.samples) * RAY;
    let limits = engine.gpu().device.limits();
    let most = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
    if bytes > most {
        return Err(Error::device(format!(
            "interreflection by {} rays at {points} points takes {bytes} bytes in one buffer of the \
             GPU, which has up to {most}: a larger step_px or fewer samples do with less",
            params.samples
        )));
    }
    engine.reserve("bounce_points", points * POINT);
    engine.reserve("bounce_lamps", 8 * points);
    for (name, term) in [("bounce_x", Term::FootprintX), ("bounce_y", Term::FootprintY)] {
        engine.reserve(name, if plan.has(term) { bytes } else { 0 });
    }
    Ok(())
}

/// Of each direction its place in the disc under the hemisphere, its height above it, and what the
/// height of its patch's sides is divided by.
fn disc(samples: u32) -> Vec<[f32; 4]> {
    let hemisphere = Hemisphere::new(samples as usize);
    let lowest = hemisphere.lowest();
    let point = |p: glam::DVec2| {
        let height = (1.0 - p.length_squared()).max(0.0).sqrt();
        [p.x, p.y, height, height.max(lowest)].map(|v| v as f32)
    };
    hemisphere.points().map(point).collect()
}

/// Takes what the CPU has gathered to the GPU.
pub(in crate::emulator::render) fn upload(
    engine: &mut Engine,
    bounce: &Bounce,
    wanted: Interreflection,
    size: (u32, u32),
) {
    let mut params = Params::new(wanted, size);
    params.points = bounce.ends.len() as u32;
    let (mut points, mut x, mut y) = (Vec::new(), Vec::new(), Vec::new());
    let mut before = 0;
    for (&end, &white) in bounce.ends.iter().zip(&bounce.white) {
        let first = x.len().max(y.len()) as u32;
        let mut kept = 0;
        for block in before..end as usize {
            for lane in (0..bounce.weight[block].len()).filter(|&l| bounce.weight[block][l] > 0.0) {
                let weight = bounce.weight[block][lane];
                let ray = |at: &[[f32; 8]], slope: &[[[f32; 2]; 8]]| {
                    let [a, b] = slope[block][lane];
                    [at[block][lane], a, b, weight]
                };
                if !bounce.x.is_empty() {
                    x.push(ray(&bounce.x, &bounce.x_slope));
                }
                if !bounce.y.is_empty() {
                    y.push(ray(&bounce.y, &bounce.y_slope));
                }
                kept += 1;
            }
        }
        before = end as usize;
        points.push(Point { pixel: 0, first, kept, white });
    }
    engine.write("bounce_params", bytemuck::bytes_of(&params));
    engine.write("bounce_points", bytemuck::cast_slice(&points));
    engine.write("bounce_x", bytemuck::cast_slice(&x));
    engine.write("bounce_y", bytemuck::cast_slice(&y));
    engine.write("bounce_first", bytemuck::cast_slice(&bounce.first));
    engine.write("bounce_shares", bytemuck::cast_slice(&bounce.shares));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::emulator::render::aperture::Aperture;
    use crate::emulator::render::buffer::GeometryBuffer;
    use crate::emulator::render::geometry::{self, Rays};
    use crate::emulator::render::gpu::optics;
    use crate::emulator::render::shade::Optics;
    use crate::emulator::render::term::Needs;
    use crate::emulator::render::world::World;
    use crate::emulator::render::worlds::Worlds;
    use crate::emulator::render::{self, Options};
    use crate::profile::{Profile, Scene};
    use glam::{DVec3, Vec3, Vec4};

    /// A box about a ball, in front of a wall, under a lamp.
    const CLUTTER: &str = "interreflection = { samples = 64, step_px = 4 }\n\
        ambient = { irradiance_w_m2 = 0.02 }\n\
        [[light]]\nkind = \"point\"\nposition_mm = [-300, 200, 400]\nintensity_w_sr = 0.04\n\
        flicker = { frequency_hz = 100, depth = 0.4 }\n\
        [[object]]\nshape = { kind = \"plane\", size_mm = [300, 20000] }\n\
        position_mm = [-106.066, 0, 943.934]\nrotation_deg = [0, -45, 0]\nalbedo = 0.8\n\
        [[object]]\nshape = { kind = \"plane\", size_mm = [200, 20000] }\n\
        position_mm = [70.711, 0, 979.289]\nrotation_deg = [0, 45, 0]\nalbedo = 0.6\n\
        [[object]]\nshape = { kind = \"sphere\", radius_mm = 60.0 }\n\
        position_mm = [0, 0, 940]\nalbedo = 0.8\n";

    /// A scene with the maps of its geometry pass, but for what bounces.
    struct Bench {
        worlds: Worlds,
        optics: Optics,
        plan: Plan,
        map: GeometryBuffer,
        wanted: Interreflection,
    }

    impl Bench {
        fn new(scene: &str) -> Self {
            let mut profile = Profile::load("pmp-bench").unwrap();
            (profile.camera.width_px, profile.camera.height_px) = (286, 123);
            let text = format!("name = \"bench\"\ndescription = \"\"\n{scene}");
            let scene = Scene::parse(&text, "bench").unwrap();
            let mut optics = Optics::new(&profile, &scene);
            let world = World::new(&scene, &optics.skins).unwrap();
            let mut plan = Plan::new(&Needs {
                profile: &profile,
                optics: &optics,
                world: &world,
            });
            plan.set(Term::FootprintX, true);
            plan.set(Term::FootprintY, true);
            let worlds = Worlds::new(world);
            let wanted = optics.interreflection.take().unwrap();
            let mut map = GeometryBuffer::default();
            let rays = Rays {
                optics: &optics,
                table: None,
                width: profile.camera.width_px as usize,
            };
            let (options, aperture) = (Options::default(), Aperture::new(&profile.camera));
            geometry::run(&worlds, &optics, &rays, &plan, options, aperture, &mut map);
            Self {
                worlds,
                plan,
                map,
                wanted,
                optics,
            }
        }

        fn size(&self) -> (u32, u32) {
            (self.map.width as u32, self.map.height as u32)
        }

        /// The CPU's maps with what bounces.
        fn bounced(&mut self) -> GeometryBuffer {
            let mut map = self.map.clone();
            self.optics.interreflection = Some(self.wanted);
            let rays = Rays {
                optics: &self.optics,
                table: None,
                width: map.width,
            };
            render::bounce::run(&self.worlds, &rays, &self.plan, &mut map);
            map
        }

        /// An engine that has its maps.
        fn engine(&self) -> Engine {
            let mut engine = Engine::for_tests();
            optics::write(&mut engine, &self.optics);
            upload::maps(&mut engine, &self.map);
            engine
        }
    }

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn pixels_are_interpolated_from_the_points_that_the_cpu_takes() {
        let mut bench = Bench::new(CLUTTER);
        let (wanted, size) = (bench.wanted, bench.size());
        let cpu = bench.bounced().bounce;
        let mut engine = bench.engine();
        let params = Params::new(wanted, size);
        super::shares(&mut engine, &params, &bench.plan).unwrap();
        let pixels = cpu.first.len() as u64;
        let points = upload::words::<u32>(&engine, "bounce_count", 1).unwrap()[0];
        let first: Vec<u32> = upload::words(&engine, "bounce_first", pixels).unwrap();
        let shares: Vec<[f32; 4]> = upload::words(&engine, "bounce_shares", pixels).unwrap();
        let (mut differ, mut worst, mut alone) = (0, 0.0f32, Vec::new());
        for i in 0..first.len() {
            let [a, b] = [cpu.first[i], first[i]].map(|f| f.min(params.on_grid()));
            let scale = bench.map.evenly[i].max(1e-30);
            let off = (0..4).map(|k| (cpu.shares[i][k] - shares[i][k]).abs() / scale);
            let off = off.fold(0.0, f32::max);
            // Whether a point is on the same surface may be a matter of rounding.
            if a != b || off > 1e-3 {
                differ += 1;
            } else {
                worst = worst.max(off);
            }
            if first[i] >= params.on_grid() {
                alone.push(first[i]);
            }
        }
        println!("{differ} of {} pixels, {} alone; {worst}", first.len(), alone.len());
        assert!(differ <= first.len() / 10_000 && worst < 1e-5);
        // Each of those beside the grid is one, and they are all.
        alone.sort_unstable();
        assert!(alone.iter().copied().eq(params.on_grid()..points));
        assert!(alone.len() > 100);
    }

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn directions_are_those_of_the_cpu() {
        let mut engine = Engine::for_tests();
        let samples = 64;
        engine.write("bounce_disc", bytemuck::cast_slice(&disc(samples)));
        let count = 6400;
        let at = |i: u32| {
            let z = 1.0 - (2.0 * f64::from(i / samples) + 1.0) / 100.0;
            let (sin, cos) = (f64::from(i / samples) * 2.4).sin_cos();
            DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z).as_vec3()
        };
        let turn = |i: u32| (i / samples).wrapping_mul(2_654_435_769);
        let input: Vec<u32> = (0..count)
            .flat_map(|i| {
                let n = at(i).to_array().map(f32::to_bits);
                [n[0], n[1], n[2], turn(i)]
            })
            .collect();
        let found = engine.call("tests/hemisphere_test", &input, 12 * count as usize, count as usize);
        let found: Vec<f32> = found.into_iter().map(f32::from_bits).collect();
        let hemisphere = Hemisphere::new(samples as usize);
        let (mut worst, mut sides) = (0.0f64, 0.0f64);
        for point in 0..count / samples {
            let angle = f64::from(turn(point * samples)) / 4_294_967_296.0 * std::f64::consts::TAU;
            let normal = at(point * samples).as_dvec3().normalize();
            let above = hemisphere.above(normal, angle).flatten();
            for (k, ray) in above.enumerate() {
                let words = &found[(point as usize * samples as usize + k) * 12..][..12];
                let v = |k: usize| Vec3::from_slice(&words[4 * k..]).as_dvec3();
                worst = worst.max((v(0) - ray.direction).length());
                let turned = glam::DVec2::new(words[3].into(), words[7].into());
                worst = worst.max((turned - glam::DVec2::from_angle(angle)).length());
                for side in 0..2 {
                    let size = ray.sides[side].length();
                    sides = sides.max((v(1 + side) - ray.sides[side]).length() / size);
                }
            }
        }
        println!("{worst:.1e}, sides {sides:.1e}");
        assert!(worst < 6e-7 && sides < 1e-6);
    }

    /// What points have is what each pixel gets from them.
    fn at(pixel: usize, first: &[u32], shares: &[[f32; 4]], columns: usize, points: &[f32]) -> f32 {
        let first = first[pixel] as usize;
        let corners = [first, first + 1, first + columns, first + columns + 1];
        let given = (0..4).filter(|&k| shares[pixel][k] > 0.0);
        given.map(|k| shares[pixel][k] * points[corners[k]]).sum()
    }

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn as_much_light_bounces_as_on_the_cpu() {
        let mut bench = Bench::new(CLUTTER);
        let (wanted, size, plan) = (bench.wanted, bench.size(), bench.plan);
        let map = bench.bounced();
        let mut engine = bench.engine();
        engine.write("mixed_count", &[0; 16]);
        engine.write("mixed_heads", &[0; 16]);
        super::run(&mut engine, wanted, &plan, size).unwrap();
        let pixels = map.x.len() as u64;
        let points = upload::words::<u32>(&engine, "bounce_count", 1).unwrap()[0];
        let points: Vec<Point> = upload::words(&engine, "bounce_points", points.into()).unwrap();
        let white: Vec<f32> = points.iter().map(|p| p.white).collect();
        let first: Vec<u32> = upload::words(&engine, "bounce_first", pixels).unwrap();
        let shares: Vec<[f32; 4]> = upload::words(&engine, "bounce_shares", pixels).unwrap();
        let light: Vec<[f32; 2]> = upload::words(&engine, "light", pixels).unwrap();
        let mut padded = map.bounce.white.clone();
        padded.resize(map.bounce.padded(), 0.0);
        let columns = Params::new(wanted, size).places[0] as usize;
        let (mut off, mut lamps) = (Vec::new(), Vec::new());
        for i in 0..map.x.len() {
            let (a, b) = (map.bounce.at(i, &padded), at(i, &first, &shares, columns, &white));
            let scale = bench.map.evenly[i].max(1e-30);
            off.push((a - b).abs() / scale);
            lamps.push((map.ambient[i] - light[i][1]).abs() / scale);
        }
        off.sort_by(f32::total_cmp);
        lamps.sort_by(f32::total_cmp);
        let n = off.len();
        let most = padded.iter().fold(0.0f32, |m, &w| m.max(w));
        println!("white {most}: {:?}", [0.5, 0.99, 0.999, 1.0].map(|q| off[((n - 1) as f64 * q) as usize]));
        println!("lamps: {:?}", [0.5, 0.99, 0.999, 1.0].map(|q| lamps[((n - 1) as f64 * q) as usize]));
        let _ = Vec4::ZERO;
        assert!(off[n / 2] < 1e-6 * most);
    }
}
