//! Compares GPU and CPU maps of scenes with textures, vertex colours, highlights and lamps.

use crate::exposure::GeometryBuffer;
use crate::gpu::Engine;
use crate::gpu::geometry::tests::{Case, at_silhouette, small};
use crate::scene::World;
use crate::truth::Truth;
use glam::DVec3;
use phasmid_geometry::shapes::{Torso, torso};
use phasmid_profile::{Focus, Profile, Scene, Vignetting};
use std::fmt::Write as _;
use std::path::Path;

/// Returns the errors of a map at the pixels in `alike`, in descending order. Each error is relative
/// to the sum of the map's 95th percentile and its value at the pixel.
fn errors(wanted: &[f32], found: &[f32], alike: &[usize]) -> Vec<f32> {
    let mut light: Vec<f32> = alike.iter().map(|&i| wanted[i].abs()).collect();
    light.sort_by(f32::total_cmp);
    let bright = light.get(light.len() * 19 / 20).copied();
    let bright = bright.unwrap_or(0.0).max(1e-30);
    let error = |&i: &usize| (wanted[i] - found[i]).abs() / (bright + wanted[i].abs());
    let mut errors: Vec<f32> = alike.iter().map(error).collect();
    errors.sort_by(|a, b| b.total_cmp(a));
    errors
}

/// Checks all maps that depend on materials. In the limits, a grey level is 1/255 = 4e-3 of a bright
/// pixel.
fn check(case: &mut Case, engine: &mut Engine, name: &str) {
    let [wanted, found] = case.both(engine);
    let world = case.worlds.any();
    let (alike, lamps_differ) = alike(world, &wanted, &found);
    let maps = [
        ("projected", &wanted.projected, &found.projected),
        ("ambient", &wanted.ambient, &found.ambient),
        ("flickering", &wanted.flickering, &found.flickering),
        ("evenly", &wanted.evenly, &found.evenly),
        ("blur", &wanted.blur, &found.blur),
    ];
    let mut said = format!("{name:<24}{} px", alike.len());
    for (map, wanted, found) in maps {
        if wanted.is_empty() {
            continue;
        }
        assert_eq!(wanted.len(), found.len(), "{name}: {map}");
        let errors = errors(wanted, found, &alike);
        let most = |share: usize| errors[errors.len() / share];
        let _ = write!(
            said,
            "; {map} {:.1e} {:.1e} {:.1e} of 99, 99.99, all",
            most(100),
            most(10000),
            errors[0]
        );
        assert!(errors[0].is_finite(), "{name}: {map}");
        assert!(
            most(100) < 1e-4 && most(10000) < 5e-4 && errors[0] < 4e-3,
            "{said}"
        );
    }
    println!("{said}; {lamps_differ} px with other lamps");
    assert!(alike.len() > wanted.x.len() / 4, "{said}");
    assert!(
        lamps_differ * 2000 <= wanted.x.len(),
        "{said}: {lamps_differ}"
    );
}

/// Returns the pixels that see the same surface in the same light on CPU and GPU, and the number of
/// lamps that light a pixel on only one of them.
fn alike(world: &World, wanted: &GeometryBuffer, found: &GeometryBuffer) -> (Vec<usize>, usize) {
    let (mut alike, mut lamps_differ, mut wrong) = (Vec::new(), 0, 0);
    for i in 0..wanted.x.len() {
        let flags = |map: &GeometryBuffer| map.flags[i] & !Truth::CREASE;
        if wanted.surface[i] != found.surface[i] || flags(wanted) != flags(found) {
            wrong += usize::from(!at_silhouette(world, wanted, i));
            continue;
        }
        let lamps = |map: &GeometryBuffer| map.lamps.get(i).copied().unwrap_or(0);
        if lamps(wanted) != lamps(found) {
            lamps_differ += 1;
        } else if flags(wanted) & Truth::SEEN != 0 {
            alike.push(i);
        }
    }
    assert!(wrong <= 2, "{wrong}");
    (alike, lamps_differ)
}

/// Writes a coloured noise image in which some neighbouring texels are equal.
fn picture(folder: &Path) {
    let hash = |x: u32, y: u32| (x / 3 * 31 + y * 17 + x * y * 7).wrapping_mul(2_654_435_769) >> 24;
    let texel = |x: u32, y: u32| image::Rgb([0, 1, 2].map(|c| hash(x + 5 * c, y) as u8));
    let picture = image::RgbImage::from_fn(64, 48, texel);
    picture.save(folder.join("noise.png")).unwrap();
}

/// Writes two meshes of a torso with vertex colours and texture coordinates: at rest and with
/// greater depth.
fn torsos(folder: &Path) {
    let mesh = torso(&Torso {
        triangles: 3000,
        ..Torso::default()
    });
    for (name, bend) in [
        ("out.obj", DVec3::ONE),
        ("in.obj", DVec3::new(1.05, 1.0, 1.15)),
    ] {
        let mut text = String::new();
        for (i, v) in mesh.vertices.iter().enumerate() {
            let [x, y, z] = (*v * bend).to_array();
            let grey = (i * 37 % 101) as f64 / 100.0;
            writeln!(text, "v {x} {y} {z} {grey} {grey} {grey}").unwrap();
        }
        for v in &mesh.vertices {
            writeln!(text, "vt {} {}", v.x / 90.0, v.y / 70.0).unwrap();
        }
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| i + 1);
            writeln!(text, "f {a}/{a} {b}/{b} {c}/{c}").unwrap();
        }
        std::fs::write(folder.join(name), text).unwrap();
    }
}

fn scene(folder: &Path, name: &str, text: &str) -> Scene {
    let file = folder.join(format!("{name}.toml"));
    let text = format!("name = \"{name}\"\ndescription = \"\"\n{text}");
    std::fs::write(&file, text).unwrap();
    Scene::load(file.to_str().unwrap()).unwrap()
}

/// Scene with textures on all kinds of shapes, with texels from far smaller to far larger than a
/// pixel, and with a mesh that has vertex colours and texture coordinates.
const PAINTED: &str = r#"
ambient = { irradiance_w_m2 = 0.2 }
[[object]]
shape = { kind = "plane" }
position_mm = [10, -5, 1100]
rotation_deg = [20, -35, 15]
albedo = 0.8
texture = "noise.png"
texture_size_mm = [120, 90]
[[object]]
shape = { kind = "sphere", radius_mm = 60.0 }
position_mm = [80, -20, 900]
rotation_deg = [20, 100, 30]
albedo = 0.9
texture = "noise.png"
texture_size_mm = [300, 70]
[[object]]
shape = { kind = "cylinder", radius_mm = 35.0, length_mm = 90.0 }
position_mm = [-20, 40, 860]
rotation_deg = [40, 10, 35]
albedo = 0.8
texture = "noise.png"
texture_size_mm = [25, 300]
[[object]]
shape = { kind = "frustum", base_mm = 60.0, top_mm = 20.0, height_mm = 40.0 }
position_mm = [160, 60, 1000]
rotation_deg = [0, 0, 30]
scale = 1.5
albedo = 0.8
texture = "noise.png"
texture_size_mm = [640, 480]
[[object]]
shape = { kind = "mesh", file = "out.obj" }
position_mm = [-140, 0, 1080]
rotation_deg = [0, 0, 80]
scale = 0.5
albedo = 0.7
vertex_colours = true
texture = "noise.png"
"#;

/// Scene with boards near and far, head-on and oblique, seen from the front and from behind.
const PRINTED: &str = r#"
ambient = { irradiance_w_m2 = 0.2 }
[[object]]
shape = { kind = "plane" }
position_mm = [0, 0, 1350]
albedo = 0.5
[[object]]
shape = { kind = "board", board = { pattern = "dots", columns = 25, rows = 19, pitch_mm = 24.0, dot_mm = 10.0, marker_mm = 20.0 } }
position_mm = [10, -5, 1100]
rotation_deg = [20, -35, 15]
albedo = 0.8
[[object]]
shape = { kind = "board", ink = 0.2, board = { pattern = "chess", columns = 9, rows = 6, pitch_mm = 10.0 } }
position_mm = [80, -20, 900]
rotation_deg = [50, 10, 30]
scale = 1.5
albedo = 0.9
specular = { f0 = 0.05, roughness = 0.4 }
[[object]]
shape = { kind = "board", ink = 0.0, board = { pattern = "dots", columns = 60, rows = 40, pitch_mm = 2.0, dot_mm = 1.1, marker_mm = 2.2 } }
position_mm = [-90, 30, 950]
rotation_deg = [10, 60, 0]
albedo = 0.7
[[object]]
shape = { kind = "board", board = { pattern = "chess", columns = 90, rows = 90, pitch_mm = 0.5 } }
position_mm = [-60, -50, 800]
albedo = 0.7
[[object]]
shape = { kind = "board", board = { pattern = "chess", columns = 3, rows = 3, pitch_mm = 10.0 } }
position_mm = [40, 60, 800]
rotation_deg = [0, 180, 0]
albedo = 0.7
"#;

/// Scene with highlights and with flickering lamps of both kinds, on solids and on a mesh.
const SHINY: &str = r#"
ambient = { irradiance_w_m2 = 0.1, flicker = { frequency_hz = 100, depth = 0.4, phase_deg = 25 } }
[[light]]
kind = "point"
position_mm = [-200, -300, 500]
intensity_w_sr = 0.1
flicker = { frequency_hz = 100, depth = 0.3, phase_deg = 25 }
[[light]]
kind = "directional"
direction = [3, 1, 2]
irradiance_w_m2 = 0.3
[[light]]
kind = "point"
position_mm = [150, 60, 820]
intensity_w_sr = 0.005
[[object]]
shape = { kind = "plane" }
position_mm = [10, -5, 1100]
rotation_deg = [10, -15, 15]
albedo = 0.5
specular = { f0 = 0.05, roughness = 0.4 }
[[object]]
shape = { kind = "sphere", radius_mm = 60.0 }
position_mm = [80, -20, 900]
albedo = 0.3
texture = "noise.png"
texture_size_mm = [200, 140]
specular = { f0 = 0.6, roughness = 0.15 }
[[object]]
shape = { kind = "cylinder", radius_mm = 30.0, length_mm = 90.0 }
position_mm = [0, 40, 860]
rotation_deg = [40, 10, 35]
albedo = 0.6
[[object]]
shape = { kind = "mesh", file = "out.obj" }
position_mm = [-140, 0, 1080]
rotation_deg = [0, 0, 80]
scale = 0.6
albedo = 0.4
vertex_colours = true
specular = { f0 = 0.1, roughness = 0.3 }
"#;

/// Scene with moving textured and specular objects, one of which deforms.
const MOVING: &str = r#"
ambient = { irradiance_w_m2 = 0.1 }
[[object]]
shape = { kind = "board", board = { pattern = "dots", columns = 9, rows = 7, pitch_mm = 8.0, dot_mm = 4.0, marker_mm = 8.0 } }
position_mm = [100, -60, 950]
albedo = 0.7
motion = { keyframes = [ { time_s = 0 }, { time_s = 1, rotation_deg = [30, 40, 20], position_mm = [0, 30, 0] } ] }
[[light]]
kind = "point"
position_mm = [-200, -300, 500]
intensity_w_sr = 0.1
[[object]]
shape = { kind = "plane" }
position_mm = [0, 0, 1150]
albedo = 0.5
motion = { keyframes = [ { time_s = 0 }, { time_s = 1, rotation_deg = [0, 10, 20] } ] }
texture = "noise.png"
texture_size_mm = [300, 300]
[[object]]
shape = { kind = "mesh", file = "out.obj" }
position_mm = [-40, 0, 1100]
rotation_deg = [0, 0, 80]
scale = 0.8
albedo = 0.6
motion = { keyframes = [ { time_s = 0 }, { time_s = 1, rotation_deg = [0, 10, 20], position_mm = [30, 0, -20] } ] }
deform = { keyframes = [ { time_s = 0, file = "out.obj" }, { time_s = 1, file = "in.obj" } ] }
texture = "noise.png"
texture_size_mm = [100, 100]
vertex_colours = true
specular = { f0 = 0.1, roughness = 0.35 }
[[object]]
shape = { kind = "mesh", file = "in.obj" }
position_mm = [140, 30, 1000]
scale = 0.3
motion = { keyframes = [ { time_s = 0 }, { time_s = 1, rotation_deg = [0, 40, 90], position_mm = [10, 0, 0] } ] }
albedo = 0.8
texture = "noise.png"
specular = { f0 = 0.1, roughness = 0.5 }
[[object]]
shape = { kind = "sphere", radius_mm = 30.0 }
position_mm = [-100, -20, 850]
motion = { keyframes = [ { time_s = 0 }, { time_s = 1, position_mm = [200, 40, 0], rotation_deg = [0, 200, 0] } ] }
albedo = 0.8
texture = "noise.png"
texture_size_mm = [60, 60]
"#;

fn profiles() -> [(&'static str, Profile); 2] {
    ["pmp-bench", "pmp-real"].map(|name| (name, small(Profile::load(name).unwrap())))
}

/// Adds vignetting to both lenses and a finite depth of focus to the projector.
fn dim(mut profile: Profile) -> Profile {
    profile.camera.vignetting = Vignetting {
        natural: true,
        falloff: [-0.3, 0.1, -0.05],
    };
    profile.projector.vignetting = Vignetting {
        natural: true,
        falloff: [-0.2, -0.05, 0.02],
    };
    profile.projector.focus = Some(Focus {
        distance_mm: 950.0,
        aperture_mm: 12.0,
    });
    profile
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_materials_of_still_scenes_match_the_cpu() {
    let folder = tempfile::tempdir().unwrap();
    picture(folder.path());
    torsos(folder.path());
    let mut engine = Engine::for_tests();
    let interreflection = "interreflection = { samples = 16, step_px = 8 }\n";
    for (of, profile) in profiles() {
        for (name, text) in [
            ("painted", PAINTED.to_owned()),
            ("printed", PRINTED.to_owned()),
            ("shiny", SHINY.to_owned()),
            ("thrown-on", format!("{interreflection}{PAINTED}")),
        ] {
            let scene = scene(folder.path(), name, &text);
            let mut case = Case::new(profile.clone(), &scene);
            check(&mut case, &mut engine, &format!("{of} {name}"));
        }
        let scene = scene(folder.path(), "dim", SHINY);
        let mut case = Case::new(dim(profile), &scene);
        check(&mut case, &mut engine, &format!("{of} dim"));
    }
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_materials_of_moving_scenes_match_the_cpu() {
    let folder = tempfile::tempdir().unwrap();
    picture(folder.path());
    torsos(folder.path());
    let mut engine = Engine::for_tests();
    let scene = scene(folder.path(), "moving", MOVING);
    let mut case = Case::new(small(Profile::load("pmp-real").unwrap()), &scene);
    check(&mut case, &mut engine, "at power-on");
    for (name, from_ns, line_time_ns) in [
        ("at 0.8 s", 0.8e9, 0),
        ("rolling", 0.2e9, 1_000_000),
        ("rolling on", 0.4e9, 700_000),
        ("together", 0.5e9, 0),
    ] {
        case.roll(from_ns, line_time_ns);
        check(&mut case, &mut engine, name);
    }
}
