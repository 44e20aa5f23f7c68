//! Compares the maps of the geometry pass on the GPU with the CPU's maps, for every pixel of every
//! scene.

use super::super::{Engine, materials, optics, scene, upload};
use crate::exposure::{GeometryBuffer, Optics};
use crate::plan::Needs;
use crate::scene::{Moment, Surface, World, Worlds};
use crate::shot::Shutter;
use crate::transport::{Aperture, Input, Rays, geometry as cpu, ideal_points};
use crate::truth::Truth;
use crate::{Options, Plan, Term};
use glam::DVec3;
use phasmid_geometry::shapes::{Torso, torso};
use phasmid_geometry::{Mesh, ply};
use phasmid_profile::{Profile, Scene};
use std::path::Path;

/// A camera in front of a scene, which both CPU and GPU render.
pub(in crate::gpu) struct Case {
    profile: Profile,
    pub(in crate::gpu) optics: Optics,
    pub(in crate::gpu) worlds: Worlds,
    pub(in crate::gpu) plan: Plan,
    pub(in crate::gpu) scene: scene::Scene,
    materials: materials::Materials,
}

impl Case {
    pub(in crate::gpu) fn new(profile: Profile, scene: &Scene) -> Self {
        let optics = Optics::new(&profile, scene);
        let world = World::new(scene, &optics.skins).unwrap();
        let mut plan = Plan::new(&Needs {
            profile: &profile,
            optics: &optics,
            world: &world,
        });
        plan.set(Term::FootprintX, true);
        plan.set(Term::FootprintY, true);
        // Depth of field is applied by a later pass.
        plan.set(Term::DepthOfField, false);
        Self {
            worlds: Worlds::new(world),
            profile,
            optics,
            plan,
            scene: scene::Scene::default(),
            materials: materials::Materials::default(),
        }
    }

    /// Returns the maps of the CPU, then of the GPU.
    pub(in crate::gpu) fn both(&mut self, engine: &mut Engine) -> [GeometryBuffer; 2] {
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
            options: Options::default(),
            aperture: Aperture::new(&self.profile.camera),
            occluders: None,
        };
        cpu::run(&input, &mut wanted);
        optics::write(engine, &self.optics);
        super::write_rays(engine, table.as_deref());
        self.scene.update(engine, &self.worlds, size.1);
        self.materials.update(engine, &self.optics, &self.worlds);
        let mut commands = engine.commands();
        super::run(engine, &mut commands, &self.plan, lens).unwrap();
        engine.submit(commands);
        [wanted, upload::maps_back(engine, size, &self.plan).unwrap()]
    }

    /// Sets a rolling shutter whose first row starts at a device time.
    pub(in crate::gpu) fn roll(&mut self, from_ns: f64, line_time_ns: u64) {
        let shutter = Shutter {
            line_time_ns,
            first_row: 0,
            rows: self.optics.camera.lens.height_px,
        };
        let moment = Moment::new(self.worlds.any(), from_ns, shutter);
        self.worlds.set(&moment);
    }

    fn check(&mut self, engine: &mut Engine, name: &str) {
        let [wanted, found] = self.both(engine);
        let off = Off::new(self.worlds.any(), &wanted, &found);
        println!("{name:<30}{off:?}");
        off.check(name, wanted.x.len());
    }
}

/// Differences between the maps of GPU and CPU.
#[derive(Debug, Default)]
struct Off {
    /// Error of the projector coordinate relative to its tolerance, the larger of 2e-3 px and 2e-4
    /// of the footprint.
    bar: f32,
    /// Error of the projector coordinate in projector pixels.
    px: f32,
    /// Depth error relative to the distance; normal error absolute.
    depth: f32,
    normal: f32,
    /// Error of the derivatives relative to the footprint.
    slope: f32,
    /// Error of the light relative to the brightest light.
    light: f32,
    /// Number of pixels whose centres lie on the shared edge of two triangles and that see a
    /// different one of them on the GPU.
    seams: usize,
    /// Number of pixels at a silhouette that see another object, or are in shadow, on only one of
    /// CPU and GPU.
    edges: usize,
    /// Number of such pixels away from silhouettes.
    wrong: usize,
    seen: usize,
    lit: usize,
}

fn larger(most: &mut f32, value: f32) {
    *most = if value > *most || value.is_nan() {
        value
    } else {
        *most
    };
}

impl Off {
    fn new(world: &World, wanted: &GeometryBuffer, found: &GeometryBuffer) -> Self {
        let mut off = Self::default();
        let most = |light: &[f32]| light.iter().fold(1e-30f32, |a, &b| a.max(b));
        let (brightest, ambient) = (most(&wanted.projected), most(&wanted.ambient));
        for i in 0..wanted.x.len() {
            let object = |map: &GeometryBuffer| {
                let surface = Surface(map.surface[i]);
                (surface != Surface::NONE).then(|| world.object(surface))
            };
            let flags = |map: &GeometryBuffer| map.flags[i] & !Truth::CREASE;
            let leap = (wanted.depth[i] - found.depth[i]).abs() > 1e-4 * wanted.depth[i];
            if object(wanted) != object(found) || flags(wanted) != flags(found) || leap {
                if at_silhouette(world, wanted, i) {
                    off.edges += 1;
                } else {
                    off.wrong += 1;
                }
                continue;
            }
            if object(wanted).is_none() {
                continue;
            }
            off.seen += 1;
            off.lit += usize::from(wanted.flags[i] & Truth::LIT != 0);
            for (a, b, slope) in [
                (wanted.x[i], found.x[i], wanted.x_slope[i]),
                (wanted.y[i], found.y[i], wanted.y_slope[i]),
            ] {
                // An unlit point has no meaningful projector coordinate.
                if wanted.flags[i] & Truth::LIT == 0 {
                    continue;
                }
                let footprint = slope[0].abs().max(slope[1].abs());
                larger(&mut off.px, (a - b).abs());
                larger(&mut off.bar, (a - b).abs() / (2e-4 * footprint).max(2e-3));
            }
            larger(
                &mut off.depth,
                (wanted.depth[i] - found.depth[i]).abs() / wanted.depth[i],
            );
            if wanted.surface[i] != found.surface[i] {
                off.seams += 1;
                continue;
            }
            for axis in 0..3 {
                let (a, b) = (wanted.normal[i][axis], found.normal[i][axis]);
                larger(&mut off.normal, (a - b).abs());
            }
            for (a, b) in [
                (wanted.x_slope[i], found.x_slope[i]),
                (wanted.y_slope[i], found.y_slope[i]),
            ] {
                if wanted.flags[i] & Truth::LIT != 0 {
                    let size = a[0].abs().max(a[1].abs());
                    larger(&mut off.slope, (a[0] - b[0]).abs() / size);
                    larger(&mut off.slope, (a[1] - b[1]).abs() / size);
                }
            }
            let light = (wanted.projected[i] - found.projected[i]).abs() / brightest;
            larger(&mut off.light, light);
            let light = (wanted.ambient[i] - found.ambient[i]).abs() / ambient;
            larger(&mut off.light, light);
        }
        off
    }

    fn check(&self, name: &str, pixels: usize) {
        assert!(self.bar <= 0.5, "{name}: {self:?}");
        assert!(
            self.depth <= 5e-6 && self.normal <= 2e-5,
            "{name}: {self:?}"
        );
        assert!(self.light <= 2e-5 && self.slope <= 1e-3, "{name}: {self:?}");
        assert!(self.edges <= pixels / 5000, "{name}: {self:?}");
        assert!(self.seams <= pixels / 1000, "{name}: {self:?}");
        assert!(self.wrong == 0, "{name}: {self:?}");
        assert!(self.seen > pixels / 20 && self.lit > pixels / 50, "{name}");
    }
}

/// Returns whether a neighbour of pixel `i` sees another object, is lit differently, or is much
/// farther away.
pub(in crate::gpu) fn at_silhouette(world: &World, map: &GeometryBuffer, i: usize) -> bool {
    let (u, v) = (i % map.width, i / map.width);
    let state = |i: usize| {
        let surface = Surface(map.surface[i]);
        let object = (surface != Surface::NONE).then(|| world.object(surface));
        (object, map.flags[i] & !Truth::CREASE)
    };
    let mut neighbours = (v.saturating_sub(1)..(v + 2).min(map.height))
        .flat_map(|v| (u.saturating_sub(1)..(u + 2).min(map.width)).map(move |u| (u, v)))
        .map(|(u, v)| v * map.width + u);
    neighbours.any(|j| {
        let leap = (map.depth[i] - map.depth[j]).abs() > 5e-3 * map.depth[i];
        state(i) != state(j) || leap
    })
}

/// Reduces the pixel count by a factor of eight, keeping the field of view.
pub(in crate::gpu) fn small(mut profile: Profile) -> Profile {
    let camera = &mut profile.camera;
    (camera.width_px, camera.height_px) = (398, 171);
    profile
}

fn profiles() -> [(&'static str, Profile); 2] {
    ["pmp-bench", "pmp-real"].map(|name| (name, small(Profile::load(name).unwrap())))
}

/// Scene of tilted solids that shadow each other; one of them extends beyond the floor behind it.
pub(in crate::gpu) const SOLIDS: &str = r#"
name = "solids"
description = ""
ambient = { irradiance_w_m2 = 0.05 }
[[object]]
shape = { kind = "plane", size_mm = [520.0, 300.0] }
position_mm = [20, 5, 1040]
rotation_deg = [4, -7, 2]
albedo = 0.7
[[object]]
shape = { kind = "cylinder", radius_mm = 40.0, length_mm = 120.0 }
position_mm = [-60, 10, 960]
rotation_deg = [10, 0, 35]
albedo = 0.6
[[object]]
shape = { kind = "sphere", radius_mm = 30.0 }
position_mm = [70, -20, 900]
albedo = 0.5
[[object]]
shape = { kind = "frustum", base_mm = 60.0, top_mm = 20.0, height_mm = 40.0 }
position_mm = [140, 60, 1020]
rotation_deg = [0, 0, 30]
scale = 1.5
albedo = 0.4
"#;

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_geometry_of_still_scenes_matches_the_cpu() {
    let mut engine = Engine::for_tests();
    let named = ["plane", "sphere", "trapezoid", "torso", "couch"];
    let mut scenes: Vec<_> = named.map(|name| Scene::load(name).unwrap()).into();
    scenes.push(Scene::parse(SOLIDS, "solids").unwrap());
    for (of, profile) in profiles() {
        for scene in &scenes {
            let name = format!("{of} {}", scene.name);
            Case::new(profile.clone(), scene).check(&mut engine, &name);
        }
    }
}

/// GPU and CPU agree for views from inside a sphere and through a strongly distorting lens.
#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_geometry_from_inside_a_sphere_matches_the_cpu() {
    let mut engine = Engine::for_tests();
    let around = r#"
name = "around"
description = ""
[[object]]
shape = { kind = "sphere", radius_mm = 1200.0 }
position_mm = [100, 50, 200]
albedo = 0.7
[[object]]
shape = { kind = "cylinder", radius_mm = 60.0, length_mm = 90.0 }
position_mm = [-60, 10, 960]
rotation_deg = [60, 0, 35]
albedo = 0.6
"#;
    let scene = Scene::parse(around, "around").unwrap();
    for (of, mut profile) in profiles() {
        profile.camera.distortion = [-0.21, 0.08, 1.2e-3, -7e-4, -0.011];
        profile.projector.distortion = [-0.05, 0.02, -4e-4, 6e-4, 0.001];
        Case::new(profile, &scene).check(&mut engine, &format!("{of} around"));
    }
}

fn write(folder: &Path, name: &str, mesh: &Mesh, bend: impl Fn(DVec3) -> DVec3) {
    let mut bent = mesh.clone();
    for vertex in &mut bent.vertices {
        *vertex = bend(*vertex);
    }
    ply::write_mesh(&folder.join(name), &bent).unwrap();
}

/// Returns a scene with a breathing, rotating torso, a couch, and a ball that passes in front of
/// them.
pub(super) fn moving(folder: &Path) -> Scene {
    let mesh = torso(&Torso {
        triangles: 4000,
        ..Torso::default()
    });
    write(folder, "out.ply", &mesh, |v| v);
    write(folder, "in.ply", &mesh, |v| {
        v * DVec3::new(1.05, 1.0, 1.1 + 0.05 * (v.y / 90.0).sin())
    });
    let text = r#"
name = "moving"
description = ""
ambient = { irradiance_w_m2 = 0.02 }
[[object]]
shape = { kind = "plane" }
position_mm = [0, 0, 1150]
rotation_deg = [3, -4, 0]
albedo = 0.5
[[object]]
shape = { kind = "mesh", file = "out.ply" }
position_mm = [0, 0, 1150]
rotation_deg = [0, 0, 80]
scale = 0.9
albedo = 0.6
motion = { keyframes = [ { time_s = 0 }, { time_s = 1, rotation_deg = [0, 10, 20], position_mm = [30, 0, -20] } ] }
deform = { keyframes = [ { time_s = 0, file = "out.ply" }, { time_s = 1, file = "in.ply" } ] }
[[object]]
shape = { kind = "couch" }
position_mm = [0, 130, 900]
rotation_deg = [20, 10, 0]
scale = 0.1
albedo = 0.6
motion = { keyframes = [ { time_s = 0 }, { time_s = 1, rotation_deg = [0, 0, 90], position_mm = [60, 0, 0] } ] }
[[object]]
shape = { kind = "sphere", radius_mm = 30.0 }
position_mm = [-100, -20, 850]
albedo = 0.6
motion = { keyframes = [ { time_s = 0 }, { time_s = 1, position_mm = [200, 40, 0] } ] }
"#;
    let file = folder.join("moving.toml");
    std::fs::write(&file, text).unwrap();
    Scene::load(file.to_str().unwrap()).unwrap()
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_geometry_of_moving_scenes_matches_the_cpu() {
    let mut engine = Engine::for_tests();
    let folder = tempfile::tempdir().unwrap();
    let scene = moving(folder.path());
    for (of, profile) in profiles() {
        let mut case = Case::new(profile, &scene);
        case.check(&mut engine, &format!("{of} at power-on"));
        for time_s in [0.31, 0.8, 0.8] {
            case.roll(time_s * 1e9, 0);
            case.check(&mut engine, &format!("{of} at {time_s} s"));
        }
        case.roll(0.2e9, 1_000_000);
        case.check(&mut engine, &format!("{of} rolling"));
        case.roll(0.4e9, 700_000);
        case.check(&mut engine, &format!("{of} rolling on"));
        case.roll(0.5e9, 0);
        case.check(&mut engine, &format!("{of} together"));
    }
}
