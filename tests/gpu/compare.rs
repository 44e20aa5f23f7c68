//! Compares a GPU's frames with the CPU's, pixel by pixel.

use crate::case::Case;
use image::{GrayImage, Luma, Rgb, RgbImage};
use phasmid::emulator::Truth;
use phasmid::emulator::render::{Backend, Plan, Renderer};
use phasmid::protocol::{Frame, PixelFormat};
use std::path::Path;

/// Maximum fraction of the pixels that may differ by more than one grey level, not counting pixels
/// on silhouettes and pixels that rounding decides.
const MORE_THAN_ONE: f64 = 1e-4;
/// Maximum difference of a pixel in grey levels, except on silhouettes.
const MOST: u32 = 3;
/// Maximum fraction of the silhouettes' pixels that may differ by more than [`MOST`].
const SILHOUETTES: f64 = 2e-3;
/// Translations of the scene, in millimetres, that reveal pixels decided by rounding. They are a few
/// units in the last place of f32 at the scene's distance.
const NUDGES: [[f64; 3]; 4] = [
    [4e-4, 3e-4, 5e-4],
    [-4e-4, -3e-4, -5e-4],
    [4e-4, -3e-4, -5e-4],
    [-4e-4, 3e-4, 5e-4],
];
/// Maximum fraction of the pixels that rounding may decide.
const UNDECIDED: f64 = 2e-4;

/// Differences between two frames, in grey levels.
#[derive(Debug, Default)]
struct Difference {
    even: usize,
    even_over_1: usize,
    even_over_3: usize,
    silhouettes: usize,
    silhouettes_over_3: usize,
    worst: u32,
}

impl Difference {
    fn between(a: &[u32], b: &[u32], silhouette: &[bool]) -> Self {
        let mut all = Self::default();
        for ((a, b), &silhouette) in a.iter().zip(b).zip(silhouette) {
            let apart = a.abs_diff(*b);
            if silhouette {
                all.silhouettes += 1;
                all.silhouettes_over_3 += usize::from(apart > MOST);
            } else {
                all.even += 1;
                all.even_over_1 += usize::from(apart > 1);
                all.even_over_3 += usize::from(apart > MOST);
                all.worst = all.worst.max(apart);
            }
        }
        all
    }

    fn is_small(&self) -> bool {
        self.even_over_1 as f64 <= MORE_THAN_ONE * self.even as f64
            && self.even_over_3 == 0
            && self.silhouettes_over_3 as f64 <= (SILHOUETTES * self.silhouettes as f64).max(4.0)
            && self.even > 0
    }
}

/// Exposes all shots of a case on both GPU and CPU and compares the frames; returns the plan that
/// was used.
pub fn agree(case: &Case) -> Plan {
    let mut here = case.renderer(Backend::Cpu);
    let mut there = case.renderer(Backend::Gpu);
    let silhouettes = silhouettes(case, &mut here);
    // Levels are compared at 8 bits: at higher bit depths, the nudges would change levels by the
    // scene's own gradients.
    let coarse = (1u32 << case.profile.camera.sensor.bits) / 256;
    let mut nudged = NUDGES.map(|by| nudged(case, by));
    for (i, shot) in case.shots.iter().enumerate() {
        let (a, b) = (here.expose(shot), there.expose(shot));
        let failed = there.news().map(|_| ());
        failed.unwrap_or_else(|e| panic!("{}: {e}", case.name));
        assert!(
            there.adapter().is_some(),
            "{}: the GPU is not used",
            case.name
        );
        let (a, b) = (levels(&a), levels(&b));
        let others = nudged.each_mut().map(|other| levels(&other.expose(shot)));
        let undecided = |pixel: usize| {
            let apart = others.iter().map(|other| other[pixel].abs_diff(a[pixel]));
            !silhouettes[pixel] && apart.max() > Some(coarse)
        };
        let undecided: Vec<_> = (0..a.len()).map(undecided).collect();
        let count = undecided.iter().filter(|&&u| u).count();
        println!("{} {i}: rounding decides {count} pixels", case.name);
        assert!(
            count as f64 <= UNDECIDED * a.len() as f64,
            "{} {i}: {count} pixels that rounding decides",
            case.name
        );
        let apart: Vec<_> = (0..a.len())
            .map(|i| silhouettes[i] || undecided[i])
            .collect();
        let found = Difference::between(&a, &b, &apart);
        println!("{} {i}: {found:?}", case.name);
        if !found.is_small() {
            let folder = leave(case, i, &a, &b);
            panic!("{} {i}: {found:?}; see {folder}", case.name);
        }
        // Two uniform frames would agree even if nothing had been rendered.
        assert!(
            a.iter().any(|&v| v != a[0]),
            "{}: a uniform image",
            case.name
        );
    }
    here.plan()
}

/// Returns the CPU's renderer for a slightly displaced scene. If a pixel's level differs in this
/// scene, f32 rounding may decide the level: for example, a ray barely passes an edge between two
/// triangles, or a pixel's samples barely count as one surface.
fn nudged(case: &Case, by: [f64; 3]) -> Renderer {
    let mut case = case.clone();
    for object in &mut case.scene.object {
        for (at, by) in object.position_mm.iter_mut().zip(by) {
            *at += by;
        }
    }
    case.renderer(Backend::Cpu)
}

/// Returns grey levels at the converter's full bit depth.
fn levels(frame: &Frame) -> Vec<u32> {
    match frame.format {
        PixelFormat::Y16 => {
            let words = frame.data.chunks_exact(2);
            words
                .map(|w| u32::from(u16::from_le_bytes([w[0], w[1]])))
                .collect()
        }
        _ => frame.data.iter().map(|&v| u32::from(v)).collect(),
    }
}

/// Returns the pixels on edges of surfaces and shadows, and their neighbours.
fn silhouettes(case: &Case, renderer: &mut Renderer) -> Vec<bool> {
    let first = case.shots[0].start_ns;
    let mut found = Vec::new();
    // In a moving scene, silhouettes are taken at the start, in the middle and at the end.
    for time_ns in [0, 4_000_000, 8_000_000].map(|ns| first + ns) {
        let truth = renderer.truth_at(&[], time_ns);
        let (width, height) = (truth.width as usize, truth.height as usize);
        found.resize(width * height, false);
        for i in (0..width * height).filter(|&i| truth.flags[i] & Truth::CREASE != 0) {
            let (u, v) = (i % width, i / width);
            for y in v.saturating_sub(1)..=(v + 1).min(height - 1) {
                for x in u.saturating_sub(1)..=(u + 1).min(width - 1) {
                    found[y * width + x] = true;
                }
            }
        }
    }
    found
}

/// Writes both images and their difference, which is red where the first image is brighter and blue
/// where the second is brighter.
fn leave(case: &Case, i: usize, a: &[u32], b: &[u32]) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/gpu-parity");
    std::fs::create_dir_all(&folder).unwrap();
    let width = case.profile.camera.width_px;
    let height = a.len() as u32 / width;
    let at = |x: u32, y: u32| (y * width + x) as usize;
    let full = a.iter().chain(b).copied().max().unwrap_or(0).max(255);
    let byte = |v: u32| (v.min(full) * 255 / full) as u8;
    let path = |what: &str| folder.join(format!("{}-{i}-{what}.png", case.name));
    for (levels, what) in [(a, "cpu"), (b, "gpu")] {
        let picture = GrayImage::from_fn(width, height, |x, y| Luma([byte(levels[at(x, y)])]));
        picture.save(path(what)).unwrap();
    }
    let apart = RgbImage::from_fn(width, height, |x, y| {
        let (a, b) = (a[at(x, y)], b[at(x, y)]);
        let much = |by: u32| byte(by.saturating_mul(40));
        Rgb([much(b.saturating_sub(a)), 0, much(a.saturating_sub(b))])
    });
    apart.save(path("difference")).unwrap();
    folder.display().to_string()
}

#[test]
fn comparison_tells_small_differences_from_large() {
    let grey = [100u32; 20_000];
    let silhouette: Vec<_> = (0..grey.len()).map(|i| i >= 10_000).collect();
    let with = |i: usize, by: u32| {
        let mut other = grey;
        other[i] += by;
        Difference::between(&grey, &other, &silhouette).is_small()
    };
    assert!(with(0, 0) && with(0, 1) && with(0, 3) && with(10_000, 90));
    assert!(!with(0, 4));
    let mut other = grey;
    (other[0], other[1]) = (102, 98);
    assert!(!Difference::between(&grey, &other, &silhouette).is_small());
    let mut other = grey;
    other[10_000..10_100].fill(200);
    assert!(!Difference::between(&grey, &other, &silhouette).is_small());
}
