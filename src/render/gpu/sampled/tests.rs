//! Compares pixels sampled with several rays on the GPU with the same pixels on the CPU.

mod places;

use super::super::geometry::tests::SOLIDS;
use super::super::{Engine, geometry, materials, mixed, optics, scene, upload};
use super::Sampler;
use crate::exposure::{GeometryBuffer, Mixed, Optics};
use crate::plan::Needs;
use crate::scene::{Moment, World, Worlds};
use crate::shot::Shutter;
use crate::transport::{Aperture, Input, Rays, geometry as cpu, ideal_points};
use crate::truth::Truth;
use crate::{Options, Plan, Term};
use phasmid_profile::{Focus, Profile, Scene};
use std::collections::BTreeMap;

/// A camera in front of a scene.
struct Case {
    profile: Profile,
    optics: Optics,
    worlds: Worlds,
    plan: Plan,
    options: Options,
}

impl Case {
    fn new(profile: Profile, scene: &Scene, samples: u32) -> Self {
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
            worlds: Worlds::new(world),
            profile,
            optics,
            plan,
            options: Options {
                samples,
                ..Options::default()
            },
        }
    }

    fn aperture(&self) -> Aperture {
        Aperture::new(&self.profile.camera)
    }

    fn sampler(&self, engine: &mut Engine) -> Sampler {
        let (worlds, optics) = (&self.worlds, &self.optics);
        Sampler::new(
            engine,
            worlds,
            optics,
            &self.plan,
            self.options,
            self.aperture(),
        )
    }

    /// Returns the maps of the CPU, then of the GPU, with their mixed pixels, and the number of
    /// times that the GPU's capacity, initially `room` heads, had to grow.
    fn both(&self, engine: &mut Engine, room: Option<u64>) -> ([GeometryBuffer; 2], usize) {
        let lens = &self.optics.camera.lens;
        let size = (lens.width_px as usize, lens.height_px as usize);
        let distorted = self.plan.has(Term::CameraDistortion);
        let table = distorted.then(|| ideal_points(&self.optics));
        let rays = Rays {
            optics: &self.optics,
            table: table.as_deref(),
            width: size.0,
        };
        let mut wanted = GeometryBuffer::default();
        let input = Input {
            worlds: &self.worlds,
            optics: &self.optics,
            rays: &rays,
            plan: &self.plan,
            options: self.options,
            aperture: self.aperture(),
            occluders: None,
        };
        cpu::run(&input, &mut wanted);
        optics::write(engine, &self.optics);
        geometry::write_rays(engine, table.as_deref());
        scene::Scene::default().update(engine, &self.worlds, size.1);
        materials::Materials::default().update(engine, &self.optics, &self.worlds);
        let mut sampler = self.sampler(engine);
        if let Some(heads) = room {
            sampler.room.heads = heads;
            sampler.write(engine);
        }
        let mut grown = 0;
        loop {
            let mut commands = engine.commands();
            geometry::run(engine, &mut commands, &self.plan, lens).unwrap();
            sampler.run(engine, &mut commands, &self.plan).unwrap();
            engine.submit(commands);
            if !sampler
                .has_grown(engine, mixed::wanted(engine).unwrap())
                .unwrap()
            {
                break;
            }
            grown += 1;
        }
        let mut found = upload::maps_back(engine, size, &self.plan).unwrap();
        found.mixed = mixed::back(engine).unwrap();
        ([wanted, found], grown)
    }

    fn check(&self, engine: &mut Engine, name: &str) {
        let ([wanted, found], _) = self.both(engine, None);
        let off = Off::new(&wanted, &found);
        println!("{name:<30}{off:.6?}");
        off.check(name);
    }
}

/// Differences between the maps of GPU and CPU.
#[derive(Debug, Default)]
struct Off {
    /// Number of pixels that are mixed on the CPU.
    mixed: usize,
    /// Number of pixels that are mixed on only one of CPU and GPU.
    alone: usize,
    /// Number of lit samples in pixels that are mixed on both.
    lit: usize,
    /// Number of samples that are lit on only one of CPU and GPU or lie on different surfaces (their
    /// rays hit an edge).
    astray: usize,
    /// Error of the projector coordinate of the remaining samples, relative to its tolerance: the
    /// larger of 2e-3 px and 2e-4 of the pixel's footprint.
    bar: f32,
    /// Error of the slopes of these samples relative to the footprint.
    slope: f32,
    /// Error of the light of these samples relative to the brightest light.
    light: f32,
    /// Error of the blur of these samples.
    blur: f32,
    /// Error of the projector and ambient light of whole pixels without stray samples, relative to
    /// the brightest light.
    pixel: f32,
    /// Relative error of the footprint widths of all pixels.
    wide: f32,
}

fn larger(most: &mut f32, value: f32) {
    *most = if value > *most || value.is_nan() {
        value
    } else {
        *most
    };
}

fn by_pixel(map: &GeometryBuffer) -> BTreeMap<u32, Vec<&Mixed>> {
    let mut pixels: BTreeMap<u32, Vec<&Mixed>> = BTreeMap::new();
    for mixed in &map.mixed {
        pixels.entry(mixed.pixel).or_default().push(mixed);
    }
    pixels
}

impl Off {
    fn new(wanted: &GeometryBuffer, found: &GeometryBuffer) -> Self {
        let mut off = Self::default();
        let light = |map: &GeometryBuffer, i: usize| map.projected[i].max(map.ambient[i]);
        let brightest = (0..wanted.x.len()).fold(1e-30f32, |a, i| a.max(light(wanted, i)));
        let (cpu, gpu) = (by_pixel(wanted), by_pixel(found));
        for map in [wanted, found] {
            let pixels = by_pixel(map);
            for (i, flags) in map.flags.iter().enumerate() {
                let flagged = flags & Truth::CREASE != 0;
                assert_eq!(flagged, pixels.contains_key(&(i as u32)), "{i}");
            }
        }
        off.mixed = cpu.len();
        off.alone = cpu.keys().filter(|i| !gpu.contains_key(i)).count()
            + gpu.keys().filter(|i| !cpu.contains_key(i)).count();
        for (pixel, wanted) in &cpu {
            let Some(found) = gpu.get(pixel) else {
                continue;
            };
            assert_eq!(wanted.len(), found.len(), "groups of {pixel}");
            let whole = |groups: &[&Mixed]| -> [f32; 3] {
                let projected: f32 = groups.iter().flat_map(|m| m.projected).sum();
                let ambient = groups.iter().map(|m| m.ambient).sum();
                let flickering = groups.iter().map(|m| m.flickering).sum();
                [projected / 16.0, ambient, flickering]
            };
            let apart = whole(wanted)
                .iter()
                .zip(whole(found))
                .map(|(a, b)| (a - b).abs() / brightest)
                .fold(0.0, f32::max);
            let astray = off.astray;
            for (wanted, found) in wanted.iter().zip(found) {
                off.samples(wanted, found, brightest);
            }
            // A stray sample contributes 1/16 of the light of its pixel, so pixels with stray
            // samples are left out.
            if off.astray == astray {
                larger(&mut off.pixel, apart);
            }
        }
        for i in 0..wanted.x.len() {
            if wanted.surface[i] == found.surface[i] && wanted.flags[i] & Truth::LIT != 0 {
                for (a, b) in [
                    (wanted.x_slope[i], found.x_slope[i]),
                    (wanted.y_slope[i], found.y_slope[i]),
                ] {
                    let energy = |s: [f32; 2]| s[0].hypot(s[1]);
                    larger(&mut off.wide, (energy(a) / energy(b) - 1.0).abs());
                }
            }
        }
        off
    }

    fn samples(&mut self, wanted: &Mixed, found: &Mixed, brightest: f32) {
        for k in 0..16 {
            let lit = |mixed: &Mixed| mixed.projected[k] > 0.0;
            if lit(wanted) != lit(found) {
                self.astray += 1;
                continue;
            }
            if !lit(wanted) {
                continue;
            }
            self.lit += 1;
            let apart = [
                (wanted.x[k] - found.x[k], wanted.x_slope[k]),
                (wanted.y[k] - found.y[k], wanted.y_slope[k]),
            ]
            .map(|(off, slope)| {
                let footprint = 4.0 * slope[0].abs().max(slope[1].abs());
                off.abs() / (2e-4 * footprint).max(2e-3)
            });
            let size = |slope: [f32; 2]| slope[0].abs().max(slope[1].abs());
            let slopes = [
                (wanted.x_slope[k], found.x_slope[k]),
                (wanted.y_slope[k], found.y_slope[k]),
            ]
            .map(|(a, b)| (a[0] - b[0]).abs().max((a[1] - b[1]).abs()) / size(a));
            let slope = slopes[0].max(slopes[1]);
            let light = (wanted.projected[k] - found.projected[k]).abs() / brightest;
            if apart[0].max(apart[1]) > 1.0 || slope > 2e-3 || light > 1e-3 {
                self.astray += 1;
                continue;
            }
            larger(&mut self.bar, apart[0].max(apart[1]));
            larger(&mut self.slope, slope);
            larger(&mut self.light, light);
            let blur = (wanted.blur[k] - found.blur[k]).abs();
            larger(&mut self.blur, blur / wanted.blur[k].max(0.1));
        }
    }

    fn check(&self, name: &str) {
        assert!(self.mixed > 50, "{name}: {self:?}");
        assert!(self.alone <= 2 + self.mixed / 200, "{name}: {self:?}");
        assert!(self.astray <= 2 + self.lit / 1000, "{name}: {self:?}");
        assert!(self.bar <= 0.5, "{name}: {self:?}");
        assert!(self.blur <= 1e-3, "{name}: {self:?}");
        assert!(self.pixel <= 5e-4 && self.wide <= 1e-3, "{name}: {self:?}");
    }
}

/// Reduces the number of pixels, keeping the field of view.
fn small(name: &str) -> Profile {
    let mut profile = Profile::load(name).unwrap();
    let camera = &mut profile.camera;
    (camera.width_px, camera.height_px) = (198, 86);
    profile
}

/// Scene of solids that shadow each other and themselves, with flickering lamps.
fn solids() -> Scene {
    let lamps = r#"
[[light]]
kind = "point"
position_mm = [-300, 200, 400]
intensity_w_sr = 0.12
flicker = { frequency_hz = 100, depth = 0.5 }
[[light]]
kind = "directional"
direction = [3, 1, 2]
irradiance_w_m2 = 0.1
"#;
    Scene::parse(&format!("{SOLIDS}{lamps}"), "solids").unwrap()
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_mixed_pixels_match_the_cpu() {
    let engine = &mut Engine::for_tests();
    let named = ["sphere", "trapezoid", "torso", "couch"];
    let mut scenes: Vec<_> = named.map(|name| Scene::load(name).unwrap()).into();
    scenes.push(solids());
    for of in ["pmp-bench", "pmp-real"] {
        for scene in &scenes {
            let case = Case::new(small(of), scene, 1);
            case.check(engine, &format!("{of} {}", scene.name));
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_pixels_of_more_samples_match_the_cpu() {
    let engine = &mut Engine::for_tests();
    for of in ["pmp-bench", "pmp-real"] {
        for scene in [solids(), Scene::load("torso").unwrap()] {
            for samples in [4, 16, 64] {
                let case = Case::new(small(of), &scene, samples);
                case.check(engine, &format!("{of} {} {samples}", scene.name));
            }
        }
    }
}

/// GPU and CPU agree with the camera out of focus, also if the projector has defocus.
#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_depth_of_field_matches_the_cpu() {
    let engine = &mut Engine::for_tests();
    for of in ["pmp-bench", "pmp-real"] {
        for (samples, focus_mm) in [(1, 900.0), (64, 1030.0)] {
            let mut profile = small(of);
            profile.camera.f_number = 4.0;
            profile.camera.focus_mm = Some(focus_mm);
            profile.projector.focus = Some(Focus {
                distance_mm: 950.0,
                aperture_mm: 10.0,
            });
            let case = Case::new(profile, &solids(), samples);
            case.check(engine, &format!("{of} {samples} at {focus_mm} mm"));
        }
    }
}

/// With depth of field, an albedo that varies makes the GPU keep the samples of all pixels that see
/// it, as on the CPU.
#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_depth_of_field_over_a_texture_matches_the_cpu() {
    let engine = &mut Engine::for_tests();
    let folder = tempfile::tempdir().unwrap();
    let picture = image::RgbImage::from_fn(64, 48, |u, v| {
        image::Rgb([
            ((u * 29 + v * 53) % 256) as u8,
            (u * 4) as u8,
            (v * 5) as u8,
        ])
    });
    picture.save(folder.path().join("spots.png")).unwrap();
    let text = r#"
name = "spots"
description = ""
ambient = { irradiance_w_m2 = 0.05 }
[[object]]
shape = { kind = "plane", size_mm = [900.0, 400.0] }
position_mm = [20, 5, 1040]
rotation_deg = [4, -7, 2]
albedo = 0.7
texture = "spots.png"
texture_size_mm = [300, 200]
[[object]]
shape = { kind = "sphere", radius_mm = 30.0 }
position_mm = [70, -20, 900]
albedo = 0.5
"#;
    let file = folder.path().join("spots.toml");
    std::fs::write(&file, text).unwrap();
    let scene = Scene::load(file.to_str().unwrap()).unwrap();
    let mut profile = small("pmp-bench");
    profile.camera.f_number = 4.0;
    profile.camera.focus_mm = Some(900.0);
    let case = Case::new(profile, &scene, 16);
    let ([wanted, found], _) = case.both(engine, None);
    let off = Off::new(&wanted, &found);
    println!("{off:.6?}");
    off.check("spots");
    assert!(off.mixed > wanted.x.len() / 10, "{}", off.mixed);
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_samples_of_rolling_rows_match_the_cpu() {
    let engine = &mut Engine::for_tests();
    let text = r#"
name = "moving"
description = ""
ambient = { irradiance_w_m2 = 0.02 }
[[object]]
shape = { kind = "plane" }
position_mm = [0, 0, 1150]
albedo = 0.5
[[object]]
shape = { kind = "sphere", radius_mm = 60.0 }
position_mm = [-100, -20, 850]
albedo = 0.6
motion = { keyframes = [ { time_s = 0 }, { time_s = 1, position_mm = [200, 40, 0] } ] }
"#;
    let scene = Scene::parse(text, "moving").unwrap();
    for (samples, focus_mm) in [(1, None), (16, Some(900.0))] {
        let mut profile = small("pmp-bench");
        profile.camera.focus_mm = focus_mm;
        profile.camera.f_number = 4.0;
        let mut case = Case::new(profile, &scene, samples);
        let shutter = Shutter {
            line_time_ns: 1_000_000,
            first_row: 0,
            rows: 86,
        };
        let moment = Moment::new(case.worlds.any(), 0.2e9, shutter);
        case.worlds.set(&moment);
        case.check(engine, &format!("rolling {samples}"));
    }
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn buffer_that_is_too_small_grows_and_is_sampled_again() {
    let engine = &mut Engine::for_tests();
    for samples in [1, 64] {
        let case = Case::new(small("pmp-bench"), &solids(), samples);
        let ([wanted, found], grown) = case.both(engine, Some(10));
        assert_eq!(grown, 1);
        Off::new(&wanted, &found).check("grown");
        let ([_, again], grown) = case.both(engine, None);
        assert_eq!(grown, 0);
        let places = |map: &GeometryBuffer| -> Vec<_> {
            map.mixed
                .iter()
                .map(|m| (m.pixel, m.x, m.projected, m.ambient))
                .collect()
        };
        assert_eq!(
            places(&found),
            places(&again),
            "in whatever order they came"
        );
    }
}
