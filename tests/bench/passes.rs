//! Rates of the passes, each beside a memory copy of the same bytes in the same run: machines
//! differ and wander, the ratio less so.
//!
//! `cargo bench` runs all; `cargo bench -- geometry` those whose name holds a word.

use phasma::decode::{Decoded, Decoder, FrameStack, Options, Samples};
use phasma::emulator::render::{Options as RenderOptions, Renderer};
use phasma::emulator::{Shot, Slide};
use phasma::geometry::raycast::Bvh;
use phasma::geometry::{Mesh, ply, shapes};
use phasma::profile::{Deform, Interreflection, Keyframe, MeshKeyframe, Motion, Profile, Scene};
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

fn main() {
    let wanted: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with("--"))
        .collect();
    let bench = Bench { wanted };
    let profile = Profile::load("pmp-bench").expect("built in");
    let pixels = (profile.camera.width_px * profile.camera.height_px) as usize;
    println!(
        "{} x {} pixels, {} threads",
        profile.camera.width_px,
        profile.camera.height_px,
        rayon::current_num_threads()
    );
    println!(
        "{:<44}{:>10}{:>12}{:>12}{:>10}",
        "", "ms", "Mpixel/s", "copy ms", "ratio"
    );
    for name in ["torso", "trapezoid"] {
        let mut setup = Setup::new(&profile, name);
        let triangles = setup.renderer.triangle_count();
        // What the pass writes: ten maps, 45 bytes a pixel.
        bench.run(
            &format!("geometry, {name}, {triangles} triangles"),
            1,
            pixels,
            45,
            || {
                setup.renderer.invalidate();
                setup.renderer.prepare();
            },
        );
        let frames = setup.slides.len();
        let mut id = 0;
        bench.run(
            &format!("exposure + sensor, {name}"),
            frames,
            pixels,
            21,
            || {
                for i in 0..frames {
                    id += 1;
                    black_box(setup.renderer.expose(&setup.shot(id, i)));
                }
            },
        );
    }
    samples(&bench, &profile, pixels);
    bounce(&bench, &profile, pixels);
    motion(&bench, &profile, pixels);
    frames(&bench, &profile, pixels);
    decode(&bench, &profile, pixels);
}

/// Frames of a projector out of focus, whose every pixel is lit, and black ones, where electrons are few.
fn frames(bench: &Bench, profile: &Profile, pixels: usize) {
    let mut blurred = profile.clone();
    blurred.projector.focus = Some(phasma::profile::Focus {
        distance_mm: 1000.0,
        aperture_mm: 6.0,
    });
    let mut setup = Setup::new(&blurred, "torso");
    let (count, mut id) = (setup.slides.len(), 0);
    bench.run(
        "exposure + sensor, torso, defocus",
        count,
        pixels,
        21,
        || {
            for i in 0..count {
                id += 1;
                black_box(setup.renderer.expose(&setup.shot(id, i)));
            }
        },
    );
    let mut setup = Setup::new(&lit_all_over(profile), "plane");
    let count = setup.slides.len();
    let mut id = 0;
    bench.run("exposure + sensor, lit all over", count, pixels, 21, || {
        for i in 0..count {
            id += 1;
            black_box(setup.renderer.expose(&setup.shot(id, i)));
        }
    });
    // Light that leaves so many electrons, of the 10,500 that fill the well.
    for electrons in [0.0, 8.0, 25.0] {
        let name = format!("exposure + sensor, {electrons} electrons");
        bench.run(&name, 8, pixels, 9, || {
            for _ in 0..8 {
                id += 1;
                let mut shot = setup.shot(id, 0);
                shot.slide = setup.slides.iter().rfind(|s| is_white(s)).cloned();
                shot.light = electrons / 8000.0;
                black_box(setup.renderer.expose(&shot));
            }
        });
    }
}

/// Frames of a torso that moves, each with the geometry of four instants, and what bends a mesh.
fn motion(bench: &Bench, profile: &Profile, pixels: usize) {
    let folder = tempfile::tempdir().expect("a folder");
    let mesh = shapes::torso(&shapes::Torso {
        seed: 1,
        ..shapes::Torso::default()
    });
    let keys: Vec<MeshKeyframe> = (0..2)
        .map(|k| {
            let file = folder.path().join(format!("{k}.ply"));
            let swollen = Mesh {
                vertices: mesh
                    .vertices
                    .iter()
                    .map(|v| *v * (1.0 + 0.02 * f64::from(k)))
                    .collect(),
                ..mesh.clone()
            };
            ply::write_mesh(&file, &swollen).expect("a file");
            MeshKeyframe {
                time_s: f64::from(k),
                file,
            }
        })
        .collect();
    let key = |time_s: f64| Keyframe {
        time_s,
        position_mm: [0.0, 0.0, -8.0 * time_s],
        rotation_deg: [0.0; 3],
    };
    let period_s = Some(4.0);
    let rigid = Motion {
        period_s,
        keyframes: vec![key(0.0), key(2.0)],
    };
    let deform = Deform {
        period_s,
        keyframes: keys,
    };
    let ways = [
        ("rigid", Some(rigid), None),
        ("deforming", None, Some(deform)),
    ];
    for (name, motion, deform) in ways {
        let mut scene = Scene::load("torso").expect("built in");
        scene.object[1].motion = motion;
        scene.object[1].deform = deform;
        let mut setup = Setup::of(profile, &scene, RenderOptions::default());
        let mut id = 0;
        bench.run(
            &format!("frame of 4 instants, torso {name}"),
            1,
            pixels,
            45 * 4,
            || {
                id += 1;
                let mut shot = setup.shot(id, 0);
                shot.start_ns = id * 20_000_000;
                black_box(setup.renderer.expose(&shot));
            },
        );
    }
    let mut tree = Bvh::build(&mesh.vertices, &mesh.triangles).ordered();
    let triangles = mesh.triangles.len();
    bench.run(
        &format!("refit of {triangles} triangles"),
        1,
        triangles,
        100,
        || {
            tree.refit(&mesh.vertices, &mesh.triangles);
        },
    );
}

/// The geometry pass with more rays a pixel, and with rays through all of the pupil.
fn samples(bench: &Bench, profile: &Profile, pixels: usize) {
    let mut blurred = profile.clone();
    blurred.camera.f_number = 4.0;
    blurred.camera.focus_mm = Some(1000.0);
    for (what, profile, samples) in [
        ("4 samples", profile, 4),
        ("16 samples", profile, 16),
        ("16 samples, depth of field", &blurred, 16),
    ] {
        let mut setup = Setup::with_samples(profile, "torso", samples);
        let name = format!("geometry, torso, {what}");
        bench.run(&name, 1, pixels, 45 * samples as usize, || {
            setup.renderer.invalidate();
            setup.renderer.prepare();
        });
    }
}

/// What surfaces throw on each other: gathered once, and averaged for each slide.
fn bounce(bench: &Bench, profile: &Profile, pixels: usize) {
    for name in ["torso", "trapezoid"] {
        let mut scene = Scene::load(name).expect("built in");
        scene.interreflection = Some(Interreflection {
            samples: 64,
            step_px: 4,
        });
        let mut setup = Setup::of(profile, &scene, RenderOptions::default());
        bench.run(
            &format!("geometry, {name}, interreflection"),
            1,
            pixels,
            45,
            || {
                setup.renderer.invalidate();
                setup.renderer.prepare();
            },
        );
        let frames = setup.slides.len();
        let name = format!("exposure + sensor, {name}, interreflection");
        bench.run(&name, frames, pixels, 41, || {
            for i in 0..frames {
                black_box(setup.renderer.expose(&setup.shot(i as u64, i)));
            }
        });
    }
}

fn is_white(slide: &Slide) -> bool {
    matches!(slide, Slide::Uniform(level) if *level > 0)
}

/// A plane as large as the camera sees, lit all over.
fn lit_all_over(profile: &Profile) -> Profile {
    let mut wide = profile.clone();
    wide.projector.throw_ratio = 0.5;
    wide.projector.lens_shift_px = [384.0, 0.0];
    wide.projector.radiant_intensity_w_sr = 1.1;
    wide
}

fn decode(bench: &Bench, profile: &Profile, pixels: usize) {
    // Lit all over, every pixel has to be decoded.
    let wide = lit_all_over(profile);
    for (what, profile) in [
        ("scene a fifth lit", profile),
        ("scene lit all over", &wide),
    ] {
        let mut setup = Setup::new(profile, "plane");
        let frames: Vec<Vec<u8>> = (0..setup.slides.len())
            .map(|i| {
                let shot = setup.shot(i as u64, i);
                setup.renderer.expose(&shot).data
            })
            .collect();
        let manifest = profile.manifest(&profile.sequence[0]);
        let rig = profile.nominal_rig();
        let (w, h) = (
            profile.camera.width_px as usize,
            profile.camera.height_px as usize,
        );
        let decoder = Decoder::new(&manifest, w, h, Some(&rig), Options::default()).expect("whole");
        let samples = frames.iter().map(|f| Samples::U8(f)).collect();
        let stack = FrameStack::new(w, h, samples).expect("one size");
        let mut out = Decoded::default();
        let mut points = Vec::new();
        let name = format!("{} frames to points, {what}", frames.len());
        bench.run(&name, 1, pixels, frames.len(), || {
            decoder.decode_into(&stack, &mut out).expect("decodes");
            decoder.points_into(&out, &mut points);
            black_box(&points);
        });
    }
}

struct Setup {
    renderer: Renderer,
    slides: Vec<Arc<Slide>>,
    exposure_ns: u64,
}

impl Setup {
    fn new(profile: &Profile, scene: &str) -> Self {
        Self::with_samples(profile, scene, 1)
    }

    fn with_samples(profile: &Profile, scene: &str, samples: u32) -> Self {
        let options = RenderOptions {
            samples,
            ..RenderOptions::default()
        };
        Self::of(profile, &Scene::load(scene).expect("built in"), options)
    }

    fn of(profile: &Profile, scene: &Scene, options: RenderOptions) -> Self {
        let mut renderer = Renderer::with_options(profile, scene, 1, options).expect("built in");
        let slide = |frame: &phasma::pattern::ManifestFrame| {
            let none = |_: &std::path::Path| unreachable!("no images");
            Arc::new(Slide::new(&frame.pattern, &profile.projector, &none).expect("has a formula"))
        };
        let slides: Vec<_> = profile.sequence[0].frame.iter().map(slide).collect();
        renderer.expect_slides(slides.iter().map(AsRef::as_ref));
        Self {
            renderer,
            slides,
            exposure_ns: (profile.camera.exposure_us * 1e3) as u64,
        }
    }

    fn shot(&self, id: u64, index: usize) -> Shot {
        Shot {
            id,
            noise_id: id,
            pattern_index: Some(index as u32),
            slide: Some(self.slides[index].clone()),
            light: 1.0,
            exposure_ns: self.exposure_ns,
            ..Shot::default()
        }
    }
}

struct Bench {
    wanted: Vec<String>,
}

impl Bench {
    /// Times `run`, which does `count` times the work on `pixels` pixels, in turn with a copy of
    /// the bytes that one unit of work touches; prints the best of each.
    fn run(
        &self,
        name: &str,
        count: usize,
        pixels: usize,
        bytes_per_pixel: usize,
        mut run: impl FnMut(),
    ) {
        if !self.wanted.is_empty() && !self.wanted.iter().any(|w| name.contains(w)) {
            return;
        }
        let from = vec![1u8; pixels * bytes_per_pixel];
        let mut to = vec![0u8; from.len()];
        let (mut best, mut copy) = (f64::INFINITY, f64::INFINITY);
        run();
        let start = Instant::now();
        while start.elapsed().as_secs_f64() < 1.5 {
            best = best.min(seconds(&mut run) / count as f64);
            copy = copy.min(seconds(|| {
                black_box(&mut to).copy_from_slice(black_box(&from))
            }));
        }
        println!(
            "{name:<44}{:>10.2}{:>12.1}{:>12.3}{:>10.1}",
            best * 1e3,
            pixels as f64 / best * 1e-6,
            copy * 1e3,
            best / copy
        );
    }
}

fn seconds(mut run: impl FnMut()) -> f64 {
    let start = Instant::now();
    run();
    start.elapsed().as_secs_f64()
}
