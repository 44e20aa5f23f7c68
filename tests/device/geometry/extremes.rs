//! Extreme inputs: distances, sizes, angles and counts at the limits of their allowed ranges.

use super::closed_form::{Plane, Rig, Sphere, Surface};
use super::exact::plane;
use super::hold::{bench, hold, scene};
use glam::{DVec2, DVec3};
use phasmid::emulator::render::Renderer;
use phasmid::emulator::{PatternImage, Shot, Truth};
use phasmid::geometry::{Mesh, ply};
use phasmid::pattern::{Axis, Pattern};
use phasmid::profile::Profile;
use std::sync::Arc;

#[test]
fn near_and_far_scenes_and_a_tiny_baseline_are_exact() {
    // The scene at 50 mm uses a baseline of 20 mm and a lens with twice the focal length of the
    // bench. The scenes at 1 m and at 100 m use the lens of the bench with a baseline of 1 mm.
    let mut near = bench();
    near.projector.position_mm = [20.0, 0.0, 0.0];
    near.projector.lens_shift_px = [0.0, 0.0];
    near.projector.rotation_deg = [0.0, -20.0, 0.0];
    near.camera.focal_length_mm = 40.0;
    let mut narrow = bench();
    narrow.projector.position_mm = [1.0, 0.0, 0.0];
    narrow.projector.lens_shift_px = [0.0, 0.0];
    narrow.projector.rotation_deg = [0.0, 0.0, 0.0];
    for (profile, z_mm) in [(near, 50.0), (narrow.clone(), 1e5), (narrow, 1000.0)] {
        let held = hold(&profile, &plane(20.0, z_mm));
        assert!(held > 20_000, "{z_mm}: {held} pixels");
        let ball = Sphere {
            center_mm: DVec3::new(0.0, 0.0, z_mm),
            radius_mm: z_mm / 10.0,
        };
        let held = hold(&profile, &ball);
        assert!(held > 1000, "{z_mm}: {held} pixels");
    }
}

/// A surface in a scene that is, with the rig, rotated about y and moved far away.
struct Far<S>(S);

const FAR_MM: [f64; 3] = [6e6, -5e6, 6.2e6];
const FAR_DEG: f64 = 33.0;

impl Surface for Far<Plane> {
    fn meet(&self, ray: DVec3) -> Option<(DVec3, DVec3)> {
        self.0.meet(ray)
    }

    fn toml(&self) -> String {
        let (sin, cos) = FAR_DEG.to_radians().sin_cos();
        let [x, y, z] = FAR_MM;
        format!(
            "[rig]\nposition_mm = {FAR_MM:?}\nrotation_deg = [0.0, {FAR_DEG:?}, 0.0]\n\
             [[object]]\nshape = {{ kind = \"plane\" }}\nalbedo = 0.5\n\
             position_mm = [{:?}, {y:?}, {:?}]\nrotation_deg = [0, {:?}, 0]\n",
            x + self.0.z_mm * sin,
            z + self.0.z_mm * cos,
            self.0.tilt_deg + FAR_DEG
        )
    }

    fn condition(&self, rig: &Rig, px: DVec2) -> Option<f64> {
        // A coordinate of 10 km has a resolution of 2e-9 mm.
        self.0.condition(rig, px).map(|times| times * 100.0)
    }
}

#[test]
fn rig_ten_kilometres_from_the_origin_is_exact() {
    assert!(DVec3::from(FAR_MM).length() > 9.9e6);
    for tilt_deg in [0.0, -50.0] {
        assert!(hold(&bench(), &Far(plane(tilt_deg, 1000.0))) > 20_000);
    }
}

/// A plane made of triangles.
struct Meshed {
    plane: Plane,
    file: std::path::PathBuf,
    _folder: tempfile::TempDir,
}

impl Meshed {
    fn new(plane: Plane, mesh: &Mesh) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("plane.ply");
        ply::write_mesh(&file, mesh).unwrap();
        Self {
            plane,
            file,
            _folder: folder,
        }
    }
}

impl Surface for Meshed {
    fn meet(&self, ray: DVec3) -> Option<(DVec3, DVec3)> {
        let met = self.plane.meet(ray);
        // The meshes in this file end 500 m from their centre.
        met.filter(|(point, _)| (*point - DVec3::Z * self.plane.z_mm).abs().max_element() < 4e5)
    }

    fn toml(&self) -> String {
        let shape = format!("kind = \"mesh\", file = {:?}", self.file);
        self.plane.toml().replace("kind = \"plane\"", &shape)
    }

    fn condition(&self, _: &Rig, _: DVec2) -> Option<f64> {
        None
    }
}

const HALF_MM: f64 = 5e5;

fn corners(half: f64) -> [DVec3; 4] {
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, y)| DVec3::new(x * half, y * half, 0.0))
}

/// Returns two triangles with sides of a kilometre.
fn giants() -> Mesh {
    Mesh {
        vertices: corners(HALF_MM).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// Returns a square of a nanometre in the centre, and rings of ever larger triangles around it. The
/// outermost ring is a kilometre wide and adjoins a ring of 2 mm.
fn from_nanometres_to_kilometres() -> Mesh {
    let sides = [5e-7, 6e-7, 1e-3, 1.0, HALF_MM];
    let vertices: Vec<_> = sides.iter().flat_map(|&half| corners(half)).collect();
    let mut triangles = vec![[0, 1, 2], [0, 2, 3]];
    for ring in 1..sides.len() as u32 {
        let (inner, outer) = (4 * ring - 4, 4 * ring);
        for k in 0..4 {
            let next = (k + 1) % 4;
            triangles.push([inner + k, outer + k, inner + next]);
            triangles.push([inner + next, outer + k, outer + next]);
        }
    }
    Mesh {
        vertices,
        triangles,
        ..Mesh::default()
    }
}

#[test]
fn triangles_of_a_nanometre_and_a_kilometre_are_exact() {
    let mut profile = bench();
    profile.projector.throw_ratio = 0.5;
    for mesh in [giants(), from_nanometres_to_kilometres()] {
        for tilt_deg in [0.0, 60.0, 89.0, 89.9] {
            let plane = plane(tilt_deg, 1000.0);
            let held = hold(&profile, &Meshed::new(plane, &mesh));
            assert!(held > 1000, "{tilt_deg}: {held} pixels");
        }
    }
}

#[test]
fn a_plate_just_before_a_plane_of_a_kilometre_is_seen_and_shades() {
    // f32 resolves the plane's hits to about 0.06 mm.
    let gap_mm = 0.01;
    let plane = plane(40.0, 1000.0);
    let mut mesh = giants();
    // The mesh extends towards -z.
    mesh.vertices
        .extend(corners(40.0).map(|c| c - DVec3::Z * gap_mm));
    mesh.triangles.extend([[4, 5, 6], [4, 6, 7]]);
    let surface = Meshed::new(plane, &mesh);
    let scene = scene(&surface);
    let profile = bench();
    let truth = Renderer::new(&profile, &scene, 1).unwrap().truth(&[]);
    let camera = profile.camera.view();
    let (sin, cos) = 40f64.to_radians().sin_cos();
    let (mut on, mut off) = (0, 0);
    for i in (0..truth.flags.len()).filter(|&i| truth.flags[i] & Truth::LIT != 0) {
        let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
        let point = camera.ray(px) * f64::from(truth.depth_mm[i]);
        // Point in the mesh's own frame.
        let p = point - DVec3::Z * 1000.0;
        let across = p.x * cos - p.z * sin;
        let height = -(p.x * sin + p.z * cos);
        let inside = across.abs().max(p.y.abs());
        if inside < 39.0 {
            assert!((height - gap_mm).abs() < 1e-3, "{px}: {height}");
            on += 1;
        } else if inside > 41.0 {
            assert!(height.abs() < 1e-3, "{px}: {height}");
            off += 1;
        }
    }
    assert!(on > 1000 && off > 10_000, "{on} {off}");
}

fn fringe(period_px: f64, profile: &Profile) -> Arc<PatternImage> {
    let pattern = Pattern::Fringe {
        axis: Axis::X,
        period_px,
        phase_rad: 0.4,
    };
    Arc::new(PatternImage::new(&pattern, &profile.projector, &|_| unreachable!()).unwrap())
}

fn shot(pattern_image: Arc<PatternImage>, id: u64) -> Shot {
    Shot {
        id,
        noise_id: id,
        pattern_image: Some(pattern_image),
        light: 1.0,
        start_ns: id * 20_000_000,
        exposure_ns: 8_000_000,
        ..Shot::default()
    }
}

/// Returns the mean level under the convolution of two boxes centred at x, from many samples along
/// the axis.
fn mean_level(levels: &[u16], x: f64, boxes: [f64; 2]) -> f64 {
    let (a, b) = (boxes[0].abs(), boxes[1].abs().max(1e-6));
    let weight = |d: f64| ((a + b) / 2.0 - d.abs()).clamp(0.0, a.min(b));
    let (n, half) = (20_000, (a + b) / 2.0);
    let (mut sum, mut weights) = (0.0, 0.0);
    for i in 0..n {
        let d = half * ((f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0);
        let at = (x + d + 0.5).floor().clamp(0.0, levels.len() as f64 - 1.0);
        sum += weight(d) * f64::from(levels[at as usize]);
        weights += weight(d);
    }
    sum / weights
}

#[test]
fn fringes_from_two_pixels_to_the_whole_width_are_exact() {
    let profile = bench();
    let plane = plane(15.0, 1000.0);
    let rig = Rig::new(&profile);
    let mut renderer = Renderer::new(&profile, &scene(&plane), 1).unwrap();
    let white = renderer.expected_dn(&shot(Arc::new(PatternImage::Uniform(255)), 0));
    for period_px in [2.1, 3.7, 16.0, 400.0, 1920.0] {
        let pattern_image = fringe(period_px, &profile);
        let seen = renderer.expected_dn(&shot(pattern_image.clone(), 0));
        let PatternImage::Row(_, levels) = pattern_image.as_ref() else {
            panic!("a fringe is a row")
        };
        let truth = renderer.truth(&[]);
        let black = profile.camera.sensor.black_level_dn;
        let of_field = (0..seen.len())
            .filter(|&i| truth.flags[i] & (Truth::LIT | Truth::CREASE) == Truth::LIT);
        for i in of_field.step_by(397) {
            let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
            let x = |px| rig.lit_from(&plane, px).unwrap().x;
            let by = |axis: DVec2| x(px + axis * 0.5) - x(px - axis * 0.5);
            // This footprint has no extent along the other axis. The table assigns an extent along
            // that axis, on which no level depends.
            let exact = mean_level(levels, x(px), [by(DVec2::X), by(DVec2::Y)]);
            let level = (f64::from(seen[i]) - black) / (f64::from(white[i]) - black) * 255.0;
            assert!(
                (level - exact).abs() < 0.05,
                "period {period_px}, {px}: {level} {exact}"
            );
        }
    }
}

#[test]
fn frames_are_sound_after_a_thousand_million_frames() {
    let profile = bench();
    let plane = plane(0.0, 1000.0);
    let mut renderer = Renderer::new(&profile, &scene(&plane), 1).unwrap();
    let pattern_image = fringe(16.0, &profile);
    let mut frame = |id: u64| renderer.expose(&shot(pattern_image.clone(), id));
    let (first, late, next) = (frame(0), frame(1_000_000_000), frame(1_000_000_001));
    assert_eq!(late.id, 1_000_000_000);
    assert_eq!(late.exposure_start_ns, 20_000_000_000_000_000);
    assert_eq!(late.exposure_end_ns, late.exposure_start_ns + 8_000_000);
    let differing = |a: &[u8], b: &[u8]| a.iter().zip(b).filter(|(a, b)| a != b).count();
    let many = first.data.len() / 10;
    assert!(differing(&late.data, &next.data) > many && differing(&late.data, &first.data) > many);
    let mean = |data: &[u8]| data.iter().map(|&v| f64::from(v)).sum::<f64>() / data.len() as f64;
    assert!((mean(&late.data) - mean(&first.data)).abs() < 0.02);
}

#[test]
fn longer_exposures_are_never_darker_from_1_us_to_10_s() {
    let profile = bench();
    let ball = Sphere {
        center_mm: DVec3::new(0.0, 0.0, 1000.0),
        radius_mm: 100.0,
    };
    let mut renderer = Renderer::new(&profile, &scene(&ball), 1).unwrap();
    let pattern_image = fringe(16.0, &profile);
    let mut former = vec![0.0; 1138 * 489];
    for exposure_ns in [1_000, 100_000, 10_000_000, 1_000_000_000, 10_000_000_000] {
        let signal = renderer.expected_dn(&Shot {
            exposure_ns,
            ..shot(pattern_image.clone(), 0)
        });
        for (now, before) in signal.iter().zip(&former) {
            assert!((*before..=255.0).contains(now), "{before} {now}");
        }
        former = signal;
    }
}

/// Needs 2.7 GB. `.ci/run` runs this test by name, with `--ignored --nocapture`, so that its output
/// is shown.
#[test]
#[ignore = "ten million triangles: 2.7 GB, and a quarter of a minute"]
fn renders_ten_million_triangles() {
    let text = "name = \"s\"\ndescription = \"\"\n[[object]]\n\
        shape = { kind = \"torso\", triangles = 10000000 }\nposition_mm = [0, 0, 1150]\n\
        rotation_deg = [0, 0, 80]\nalbedo = 0.5\n";
    let scene = phasmid::profile::Scene::parse(text, "s").unwrap();
    let begin = std::time::Instant::now();
    let mut renderer = Renderer::new(&bench(), &scene, 1).unwrap();
    let built = begin.elapsed();
    assert!(renderer.triangle_count() > 9_500_000);
    let begin = std::time::Instant::now();
    renderer.prepare();
    let rendered = begin.elapsed();
    let truth = renderer.truth(&[]);
    let lit = truth.flags.iter().filter(|&f| f & Truth::LIT != 0).count();
    assert!(lit > 20_000, "{lit}");
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find(|l| l.starts_with("VmHWM"));
    println!(
        "{} triangles: built in {built:.1?}, geometry pass {rendered:.3?}, peak memory {}",
        renderer.triangle_count(),
        peak.unwrap_or("unknown")
    );
}
