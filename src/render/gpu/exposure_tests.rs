//! Compares the electrons of whole frames from the GPU's exposure pass with the CPU's electrons.
//! Both use the CPU's geometry maps, so that only the exposure pass differs.

use super::exposure::Exposure;
use super::{Engine, Shown, engine, skin, upload};
use crate::exposure::{GeometryBuffer, Optics, Spread, Table};
use crate::pattern_image::PatternImage;
use crate::plan::Needs;
use crate::scene::{World, Worlds};
use crate::schedule::Schedule;
use crate::shot::{Shot, Showing, Shutter};
use crate::skin::Mixture;
use crate::timetable::Timetable;
use crate::transport::{Aperture, Input, Rays, geometry, ideal_points};
use crate::{Options, Plan, Term};
use phasmid_pattern::{Axis, Pattern};
use phasmid_profile::{Focus, Profile, Response, Scene};
use std::sync::Arc;

const SOLIDS: &str = "
[[object]]
shape = { kind = \"plane\" }
position_mm = [0, 0, 1060]
rotation_deg = [6, -9, 2]
albedo = 0.8
[[object]]
shape = { kind = \"sphere\", radius_mm = 40.0 }
position_mm = [-50, 10, 960]
albedo = 0.7
[[object]]
shape = { kind = \"cylinder\", radius_mm = 30.0, length_mm = 120.0 }
position_mm = [70, 0, 980]
rotation_deg = [10, 20, 35]
albedo = 0.6
";

/// The central part of the `pmp-bench` camera in front of a scene, and its geometry maps.
struct Setup {
    profile: Profile,
    plan: Plan,
    optics: Optics,
    map: GeometryBuffer,
}

impl Setup {
    fn new(scene: &str, change: impl FnOnce(&mut Profile), options: Options) -> Self {
        let mut profile = Profile::load("pmp-bench").unwrap();
        let camera = &mut profile.camera;
        let size = [300, 180];
        camera.sensor_width_mm *= f64::from(size[0]) / f64::from(camera.width_px);
        [camera.width_px, camera.height_px] = size;
        change(&mut profile);
        let text = format!("name = \"s\"\ndescription = \"\"\n{scene}");
        let scene = Scene::parse(&text, "s").unwrap();
        let optics = Optics::new(&profile, &scene);
        let world = World::new(&scene, &optics.skins).unwrap();
        let needs = Needs {
            profile: &profile,
            optics: &optics,
            world: &world,
        };
        let mut plan = Plan::new(&needs);
        plan.set(Term::FootprintX, true);
        plan.set(Term::FootprintY, true);
        let table = plan
            .has(Term::CameraDistortion)
            .then(|| ideal_points(&optics));
        let rays = Rays {
            optics: &optics,
            table: table.as_deref(),
            width: size[0] as usize,
        };
        let mut map = GeometryBuffer::default();
        let aperture = Aperture::new(&profile.camera);
        let worlds = Worlds::new(world);
        let input = Input {
            worlds: &worlds,
            optics: &optics,
            rays: &rays,
            plan: &plan,
            options,
            aperture,
            occluders: None,
        };
        geometry::run(&input, &mut map);
        assert!(!map.mixed.is_empty());
        Self {
            profile,
            plan,
            optics,
            map,
        }
    }

    fn pattern_images(&self) -> [(&'static str, PatternImage); 5] {
        let projector = &self.profile.projector;
        let of = |pattern| PatternImage::new(&pattern, projector, &|_| unreachable!()).unwrap();
        let fringe = |axis, period_px| {
            of(Pattern::Fringe {
                axis,
                period_px,
                phase_rad: 0.3,
            })
        };
        let gray = Pattern::Gray {
            axis: Axis::Y,
            cell_px: 4.0,
            bits: 9,
            bit: 0,
            inverted: false,
        };
        let (width, height) = (projector.width_px, projector.height_px);
        let speckle = |i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u16;
        let image = PatternImage::Image {
            width,
            height,
            levels: (0..width * height).map(speckle).collect(),
        };
        [
            ("white", of(Pattern::White {})),
            ("fringe", fringe(Axis::X, 16.0)),
            ("fine fringe", fringe(Axis::Y, 5.0)),
            ("Gray code", of(gray)),
            ("image", image),
        ]
    }

    fn table(&self, pattern_image: &PatternImage) -> Arc<Table> {
        Arc::new(Table::new(
            pattern_image,
            &self.profile.projector,
            &self.plan,
        ))
    }

    fn on_cpu(&self, shot: &Shot, tables: &[Arc<Table>]) -> Vec<f32> {
        let tables = tables.to_vec();
        let mut electrons = vec![0.0; self.map.x.len()];
        Schedule::new(self.when(shot), tables, &self.plan, &self.map).run(
            &self.map,
            0,
            &mut electrons,
        );
        electrons
    }

    fn when(&self, shot: &Shot) -> Timetable {
        let size = [self.map.width, self.map.height];
        Timetable::new(shot, &self.plan, self.optics.flicker, size)
    }

    fn upload(&self, engine: &mut Engine) {
        upload::maps(engine, &self.map);
        upload::mixed(engine, &self.map);
        skin::write(engine, &self.optics.skins);
        self.upload_skin(engine);
        if self.plan.has(Term::Interreflection) {
            upload_interreflection(engine, &self.map);
        }
    }

    /// Uploads the subsurface data of pixels and samples in the layout of `skin_types.wgsl`.
    fn upload_skin(&self, engine: &mut Engine) {
        let Some(skin) = &self.map.skin else { return };
        let mixtures: Vec<&Mixture> = self.optics.skins.mixtures().collect();
        let under = |origin: [f32; 2], spreads: [Option<Spread<'_>>; 2]| {
            let [x, y] = origin.map(|v| if v.is_finite() { v.to_bits() } else { 0 });
            match spreads {
                [Some(across), Some(down)] => {
                    let tissue = mixtures.iter().position(|m| *m == across.mixture);
                    let [a, b] = [across, down].map(|s| s.px_per_mm.to_bits());
                    [x, y, a, b, tissue.unwrap() as u32, 0]
                }
                _ => [x, y, 0, 0, 0xffff, 0],
            }
        };
        let pixels: Vec<_> = (0..self.map.x.len())
            .map(|i| {
                let origin = [skin.from[0][i], skin.from[1][i]];
                under(origin, [0, 1].map(|axis| skin.spread(i, axis)))
            })
            .collect();
        let mut samples = Vec::new();
        for mixed in &self.map.mixed {
            for k in 0..16 {
                let of = mixed.skin.as_ref();
                let spreads = [0, 1].map(|axis| of.and_then(|of| skin.sample(of, k, axis)));
                samples.push(under([mixed.x[k], mixed.y[k]], spreads));
            }
        }
        engine.write("under_skin", bytemuck::cast_slice(&pixels));
        engine.write("mixed_skin", bytemuck::cast_slice(&samples));
    }

    /// Runs the given number of exposures, each of which adds its electrons to the sum of the
    /// previous ones.
    fn on_gpu(
        &self,
        (engine, exposure): (&mut Engine, &mut Exposure),
        shot: &Shot,
        tables: &[Arc<Table>],
        times: usize,
    ) -> Vec<f32> {
        let when = self.when(shot);
        for i in 0..times {
            let shown = Shown {
                plan: &self.plan,
                when: &when,
                tables,
                blur_aspect: self.profile.projector.pixel_aspect,
                pixels: self.map.x.len(),
                adds: i > 0,
            };
            let mut commands = engine.commands();
            exposure.run(engine, &mut commands, &shown).unwrap();
            engine.submit(commands);
        }
        engine::words(engine, "electrons", self.map.x.len() as u64).unwrap()
    }

    fn shot(&self) -> Shot {
        Shot {
            pattern_image: Some(Arc::new(PatternImage::Uniform(255))),
            light: 0.9,
            start_ns: 3_333_333,
            exposure_ns: 8_000_000,
            ..Shot::default()
        }
    }

    /// Checks every kind of pattern separately, with tolerance `bar`.
    fn check(&self, name: &str, bar: f32) {
        let (mut engine, mut exposure) = (Engine::for_tests(), Exposure::default());
        self.upload(&mut engine);
        for (of, pattern_image) in self.pattern_images() {
            let (shot, tables) = (self.shot(), [self.table(&pattern_image)]);
            let cpu = self.on_cpu(&shot, &tables);
            let gpu = self.on_gpu((&mut engine, &mut exposure), &shot, &tables, 1);
            self.compare(&format!("{name}, {of}"), &cpu, &gpu, bar);
        }
    }

    /// Checks that electrons agree within `bar` grey levels (255 levels per full well).
    fn compare(&self, name: &str, cpu: &[f32], gpu: &[f32], bar: f32) {
        let level = (self.profile.camera.sensor.full_well_e / 255.0) as f32;
        let mixed = |i: usize| self.map.mixed.iter().any(|m| m.pixel as usize == i);
        let (mut worst, mut at, mut most) = (0.0f32, 0, 0.0f32);
        for (i, (a, b)) in cpu.iter().zip(gpu).enumerate() {
            let error = (a - b).abs() / level;
            if !(error <= worst) {
                (worst, at) = (error, i);
            }
            most = most.max(*a / level);
        }
        let (a, b) = (cpu[at], gpu[at]);
        let kind = if mixed(at) { "mixed" } else { "plain" };
        println!("{name}: worst {worst:.2e} of {most:.0} grey levels, {kind}: {b} for {a}");
        assert!(worst <= bar && most > 20.0, "{name}: {worst} of {most}");
    }
}

/// Uploads the CPU's indirect light in the layout of `interreflection_types.wgsl`.
fn upload_interreflection(engine: &mut Engine, map: &GeometryBuffer) {
    let (interreflection, mut before) = (&map.interreflection, 0);
    let (mut points, mut x, mut y) = (Vec::new(), Vec::new(), Vec::new());
    for (&end, white) in interreflection.ends.iter().zip(&interreflection.white) {
        let first = x.len();
        for block in before..end as usize {
            for lane in 0..interreflection.weight[block].len() {
                let weight = interreflection.weight[block][lane];
                let ([a, b], [c, d]) = (
                    interreflection.x_slope[block][lane],
                    interreflection.y_slope[block][lane],
                );
                x.push([interreflection.x[block][lane], a, b, weight]);
                y.push([interreflection.y[block][lane], c, d, weight]);
            }
        }
        before = end as usize;
        points.push([0, first as u32, (x.len() - first) as u32, white.to_bits()]);
    }
    let [width, height, columns] =
        [map.width, map.height, interreflection.stride].map(|n| n as u32);
    let params = [width, height, columns, 0, 0, 0, points.len() as u32, 0];
    engine.write("interreflection_params", bytemuck::cast_slice(&params));
    engine.write("interreflection_points", bytemuck::cast_slice(&points));
    engine.write("interreflection_x", bytemuck::cast_slice(&x));
    engine.write("interreflection_y", bytemuck::cast_slice(&y));
    engine.write(
        "interreflection_first",
        bytemuck::cast_slice(&interreflection.first),
    );
    engine.write(
        "interreflection_shares",
        bytemuck::cast_slice(&interreflection.shares),
    );
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn exposes_all_kinds_of_pattern_images_like_the_cpu() {
    let plain = Setup::new(SOLIDS, |_| {}, Options::default());
    plain.check("solids", 0.01);
    let bent = |profile: &mut Profile| {
        profile.projector.response = Some(Response::Gamma(2.2));
        profile.projector.contrast_ratio = Some(300.0);
    };
    Setup::new(SOLIDS, bent, Options::default()).check("gamma and contrast", 0.01);
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn exposes_pattern_images_out_of_focus_like_the_cpu() {
    let blurred = |profile: &mut Profile| {
        profile.projector.focus = Some(Focus {
            distance_mm: 900.0,
            aperture_mm: 8.0,
        });
    };
    Setup::new(SOLIDS, blurred, Options::default()).check("defocus", 0.02);
    let slightly = |profile: &mut Profile| {
        profile.projector.focus = Some(Focus {
            distance_mm: 1000.0,
            aperture_mm: 0.5,
        });
    };
    Setup::new(SOLIDS, slightly, Options::default()).check("a little defocus", 0.02);
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn exposes_pattern_images_on_skin_like_the_cpu() {
    let skin = "albedo = 0.8\nskin = { absorption_per_mm = 0.02, reduced_scattering_per_mm = 2.0 }";
    let scene = SOLIDS.replace("albedo = 0.8", skin);
    let scene = scene.replace("albedo = 0.7", "albedo = 0.7\nskin = { fitzpatrick = 2 }");
    Setup::new(&scene, |_| {}, Options::default()).check("skin", 0.05);
    let blurred = |profile: &mut Profile| {
        profile.projector.focus = Some(Focus {
            distance_mm: 900.0,
            aperture_mm: 8.0,
        });
    };
    Setup::new(&scene, blurred, Options::default()).check("skin out of focus", 0.05);
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn exposes_interreflection_like_the_cpu() {
    let scene = format!("interreflection = {{ samples = 64, step_px = 4 }}\n{SOLIDS}");
    Setup::new(&scene, |_| {}, Options::default()).check("interreflection", 0.01);
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn exposes_pixels_of_many_samples_like_the_cpu() {
    let options = Options {
        samples: 64,
        ..Options::default()
    };
    let deep = |profile: &mut Profile| {
        profile.camera.focus_mm = Some(1000.0);
        profile.camera.f_number = 8.0;
    };
    let setup = Setup::new(SOLIDS, deep, options);
    let groups =
        |m: &[crate::exposure::Mixed]| m.chunk_by(|a, b| a.pixel == b.pixel).all(|g| g.len() == 4);
    assert!(groups(&setup.map.mixed));
    setup.check("64 samples", 0.01);
}

const FLICKER: &str = "interreflection = { samples = 16, step_px = 5 }
ambient = { irradiance_w_m2 = 0.1, flicker = { frequency_hz = 100, depth = 0.9, phase_deg = 25 } }
[[light]]
kind = \"point\"
position_mm = [-400, -300, 500]
intensity_w_sr = 0.3
flicker = { frequency_hz = 100, depth = 0.5, phase_deg = 25 }
";

/// GPU and CPU agree for rows that see different patterns, each at its own phase of the mains
/// period, and when light accumulates over several exposures.
#[test]
#[ignore = "needs a Vulkan adapter"]
fn exposes_rolling_rows_like_the_cpu() {
    let rolling = |profile: &mut Profile| profile.camera.line_time_us = 30.0;
    let setup = Setup::new(&format!("{FLICKER}{SOLIDS}"), rolling, Options::default());
    let [white, fringe, _, gray, image] = setup
        .pattern_images()
        .map(|(_, pattern_image)| Arc::new(pattern_image));
    let show = |from_ns, pattern_image: Option<&Arc<PatternImage>>, light| Showing {
        from_ns,
        pattern_image: pattern_image.cloned(),
        light,
    };
    let shot = Shot {
        pattern_image: Some(fringe.clone()),
        then: vec![
            show(5_000_000, None, 1.0),
            show(6_000_000, Some(&gray), 0.5),
            show(8_000_000, Some(&image), 1.0),
            show(9_500_000, Some(&white), 0.7),
        ],
        exposure_ns: 4_000_000,
        shutter: Shutter {
            line_time_ns: 30_000,
            first_row: 0,
            rows: 180,
        },
        ..setup.shot()
    };
    let dark = Arc::new(Table::Uniform(0.0));
    let tables = [
        setup.table(&fringe),
        dark,
        setup.table(&gray),
        setup.table(&image),
        setup.table(&white),
    ];
    let (mut engine, mut exposure) = (Engine::for_tests(), Exposure::default());
    setup.upload(&mut engine);
    let mut cpu = setup.on_cpu(&shot, &tables);
    let gpu = setup.on_gpu((&mut engine, &mut exposure), &shot, &tables, 1);
    setup.compare("rolling", &cpu, &gpu, 0.01);
    cpu.iter_mut().for_each(|e| *e *= 3.0);
    let gpu = setup.on_gpu((&mut engine, &mut exposure), &shot, &tables, 3);
    setup.compare("rolling, three times", &cpu, &gpu, 0.03);
}
