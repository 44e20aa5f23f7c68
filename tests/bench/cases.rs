//! The passes that are timed, with the number of pixels and of bytes that each processes.

use phasmid::decode::{Decoded, Options as DecodeOptions};
use phasmid::emulator::Device;
use phasmid::emulator::render::{Options, Renderer, pattern_image::PatternImage, shot::Shot};
use phasmid::error::{Error, Result};
use phasmid::geometry::raycast::Bvh;
use phasmid::geometry::{Mesh, ply, shapes};
use phasmid::profile::Scene;
use phasmid::profile::{Deform, Focus, Interreflection, Keyframe, MeshKeyframe, Motion, Profile};
use phasmid::study::scanned::Stage;
use std::hint::black_box;
use std::path::Path;

/// A pass, timed on one scene.
pub struct Case {
    /// Number of times that one call of `work` runs the pass on each pixel.
    pub count: usize,
    /// Number of pixels, or of triangles.
    pub pixels: usize,
    /// Bytes per pixel that the pass reads and writes once.
    pub bytes_per_pixel: usize,
    /// Runs the pass `count` times.
    pub work: Box<dyn FnMut()>,
}

/// Bytes per pixel that the geometry pass writes, in ten maps.
const GEOMETRY_BYTES: usize = 45;
/// Bytes per pixel that the passes of a frame read and write.
const FRAME_BYTES: usize = 21;

/// The names of all cases.
pub const NAMES: [&str; 25] = [
    "geometry, torso",
    "geometry, trapezoid",
    "geometry, torso, 4 samples",
    "geometry, torso, 16 samples",
    "geometry, torso, 16 samples, depth of field",
    "geometry, torso, interreflection",
    "geometry, trapezoid, interreflection",
    "exposure + sensor, torso",
    "exposure + sensor, trapezoid",
    "exposure + sensor, torso, interreflection",
    "exposure + sensor, trapezoid, interreflection",
    "exposure + sensor, torso, defocus",
    "exposure + sensor, lit all over",
    "exposure + sensor, 0 electrons",
    "exposure + sensor, 8 electrons",
    "exposure + sensor, 25 electrons",
    "frame of 4 instants, torso rigid",
    "frame of 4 instants, torso deforming",
    "patient, geometry",
    "patient, frame",
    "patient, frame, interpolated",
    "refit, torso",
    "scan to depths, a fifth lit",
    "scan to depths, lit all over",
    "scan to points, lit all over",
];

/// Creates a case with a profile like that of the bench of Wu et al. Files are written to the
/// folder.
///
/// # Errors
/// Returns an error if the name is unknown or files cannot be written.
pub fn case(name: &str, profile: &Profile, folder: &Path) -> Result<Case> {
    let (pass, rest) = name.split_once(", ").unwrap_or((name, ""));
    let (scene, how) = rest.split_once(", ").unwrap_or((rest, ""));
    let sized = |setup: &Setup| setup.renderer.pixel_count();
    match pass {
        "geometry" => {
            let mut profile = profile.clone();
            let samples = match how.split(' ').next() {
                Some("4") => 4,
                Some("16") => 16,
                _ => 1,
            };
            if how.ends_with("depth of field") {
                profile.camera.f_number = 4.0;
                profile.camera.focus_mm = Some(1000.0);
            }
            let scene = scene_of(scene, how)?;
            let options = Options {
                samples,
                ..Options::default()
            };
            let mut setup = Setup::of(&profile, &scene, options)?;
            Ok(Case {
                count: 1,
                pixels: sized(&setup),
                bytes_per_pixel: GEOMETRY_BYTES * samples as usize,
                work: Box::new(move || {
                    setup.renderer.invalidate();
                    setup.renderer.prepare();
                }),
            })
        }
        "exposure + sensor" => frames((scene, how), profile),
        "frame of 4 instants" => moving(name, profile, folder),
        "patient" => patient(rest),
        "refit" => {
            let mesh = torso();
            let mut tree = Bvh::build(&mesh.vertices, &mesh.triangles).ordered();
            Ok(Case {
                count: 1,
                pixels: mesh.triangles.len(),
                bytes_per_pixel: 100,
                work: Box::new(move || tree.refit(&mesh.vertices, &mesh.triangles)),
            })
        }
        _ => decode(name, profile),
    }
}

fn scene_of(name: &str, how: &str) -> Result<Scene> {
    let mut scene = Scene::load(name)?;
    if how == "interreflection" {
        scene.interreflection = Some(Interreflection {
            samples: Some(64),
            ..Interreflection::default()
        });
    }
    Ok(scene)
}

/// Returns the profile with a projector that lights the whole of a plane that the camera sees.
pub fn lit_all_over(profile: &Profile) -> Profile {
    let mut wide = profile.clone();
    wide.projector.throw_ratio = 0.5;
    wide.projector.lens_shift_px = [384.0, 0.0];
    wide.projector.radiant_intensity_w_sr = 1.1;
    wide
}

fn frames((scene, how): (&str, &str), profile: &Profile) -> Result<Case> {
    let mut profile = profile.clone();
    let mut bytes = FRAME_BYTES;
    if how == "defocus" {
        profile.projector.focus = Some(Focus {
            distance_mm: 1000.0,
            aperture_mm: 6.0,
        });
    }
    if how == "interreflection" {
        bytes += 20;
    }
    let dim: Option<f64> = scene
        .strip_suffix(" electrons")
        .and_then(|number| number.parse().ok());
    let scene = match scene {
        "torso" | "trapezoid" => scene_of(scene, how)?,
        _ => {
            profile = lit_all_over(&profile);
            Scene::load("plane")?
        }
    };
    let mut setup = Setup::of(&profile, &scene, Options::default())?;
    if let Some(electrons) = dim {
        // White light that gives each pixel this number of electrons. The full well is 10,500
        // electrons.
        bytes = 9;
        let white = |shot: &&Shot| matches!(shot.pattern_image.as_deref(), Some(PatternImage::Uniform(level)) if *level > 0);
        let white = setup.shots.iter().find(white).cloned();
        let white = white.ok_or_else(|| Error::device("a sequence without white"))?;
        let shot = Shot {
            light: electrons / 8000.0,
            ..white
        };
        setup.shots = vec![shot; 8];
    }
    let mut id = 0;
    Ok(Case {
        count: setup.shots.len(),
        pixels: setup.renderer.pixel_count(),
        bytes_per_pixel: bytes,
        work: Box::new(move || {
            for i in 0..setup.shots.len() {
                id += 1;
                setup.shots[i].noise_id = id;
                black_box(setup.renderer.expose(&setup.shots[i]));
            }
        }),
    })
}

fn torso() -> Mesh {
    shapes::torso(&shapes::Torso {
        seed: 1,
        ..shapes::Torso::default()
    })
}

/// Creates a case that renders frames of a moving torso, each with the geometry of four instants.
fn moving(name: &str, profile: &Profile, folder: &Path) -> Result<Case> {
    let mut scene = Scene::load("torso")?;
    let period_s = Some(4.0);
    if name.ends_with("rigid") {
        let key = |time_s: f64| Keyframe {
            time_s,
            position_mm: [0.0, 0.0, -8.0 * time_s],
            rotation_deg: [0.0; 3],
        };
        let keyframes = vec![key(0.0), key(2.0)];
        scene.object[1].motion = Some(Motion {
            period_s,
            keyframes,
        });
    } else {
        let mesh = torso();
        let key = |k: u32| {
            let file = folder.join(format!("swollen{k}.ply"));
            let larger = 1.0 + 0.02 * f64::from(k);
            let swollen = Mesh {
                vertices: mesh.vertices.iter().map(|v| *v * larger).collect(),
                ..mesh.clone()
            };
            ply::write_mesh(&file, &swollen)?;
            let file = std::path::absolute(&file).map_err(|e| Error::io(&file, e))?;
            Ok(MeshKeyframe {
                time_s: f64::from(k),
                file,
            })
        };
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        let keyframes = (0..2).map(key).collect::<Result<_>>()?;
        scene.object[1].deform = Some(Deform {
            period_s,
            keyframes,
        });
    }
    let options = Options {
        motion_tolerance_px: 0.0,
        ..Options::default()
    };
    let mut setup = Setup::of(profile, &scene, options)?;
    let mut shot = setup.shots[0].clone();
    Ok(Case {
        count: 1,
        pixels: setup.renderer.pixel_count(),
        bytes_per_pixel: GEOMETRY_BYTES * 4,
        work: Box::new(move || {
            shot.noise_id += 1;
            shot.start_ns = shot.noise_id * 20_000_000;
            black_box(setup.renderer.expose(&shot));
        }),
    })
}

/// Number of scans of the breathing patient that fit into half a second.
const SCANS: u64 = 5;
/// Time between the starts of two scans of the same pod, while the other two pods scan.
const SCAN_EVERY_NS: u64 = 97_200_000;

/// Creates a case with a pod of the treatment room in front of its breathing patient: the geometry of
/// one instant, or the frames of consecutive scans.
fn patient(what: &str) -> Result<Case> {
    let options = Options {
        motion_tolerance_px: if what.ends_with("interpolated") {
            0.01
        } else {
            0.0
        },
        ..Options::default()
    };
    let scene = Scene::load("treatment-room")?;
    let mut setup = Setup::of(&Profile::load("sgrt-pod")?, &scene, options)?;
    setup.renderer.make_ready(&setup.shots);
    let mut start_ns = 0;
    let is_geometry = what == "geometry";
    Ok(Case {
        count: match is_geometry {
            true => 1,
            false => SCANS as usize * setup.shots.len(),
        },
        pixels: setup.renderer.pixel_count(),
        bytes_per_pixel: GEOMETRY_BYTES,
        work: Box::new(move || {
            if is_geometry {
                setup.renderer.invalidate();
                setup.renderer.prepare();
                return;
            }
            for _ in 0..SCANS {
                for shot in &setup.shots {
                    let mut shot = shot.clone();
                    shot.start_ns += start_ns;
                    black_box(setup.renderer.expose(&shot));
                }
                start_ns += SCAN_EVERY_NS;
            }
        }),
    })
}

/// Creates a case that decodes the sequence's frames to depths or, if the name says so, also to
/// points.
fn decode(name: &str, profile: &Profile) -> Result<Case> {
    let profile = match name.ends_with("lit all over") {
        true => lit_all_over(profile),
        false => profile.clone(),
    };
    let to_points = name.starts_with("scan to points");
    let mut stage = Stage::new(&profile, &Scene::load("plane")?, 1, Options::default())?;
    let scanned = stage.scan(0)?;
    let decoder = scanned.decoder(DecodeOptions::default())?;
    decoder.decode(&scanned.images)?;
    let mut out = Decoded::default();
    let mut points = Vec::new();
    Ok(Case {
        count: 1,
        pixels: scanned.images[0].samples().len(),
        bytes_per_pixel: scanned.images.len(),
        work: Box::new(move || {
            // Always `Ok`, since the same images have been decoded before.
            if decoder.decode_into(&scanned.images, &mut out).is_ok() && to_points {
                decoder.points_into(&out, &mut points);
            }
            black_box((&out, &points));
        }),
    })
}

/// A device in front of a scene.
struct Setup {
    renderer: Renderer,
    shots: Vec<Shot>,
}

impl Setup {
    fn of(profile: &Profile, scene: &Scene, options: Options) -> Result<Self> {
        let device = Device::builder(profile, scene).seed(1);
        let device = device.options(options).build()?;
        let shots = device.shots().into_iter().map(|(_, shot)| shot);
        Ok(Self {
            shots: shots.collect(),
            renderer: device.renderer,
        })
    }
}
