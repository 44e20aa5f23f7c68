//! Depth edges, steep slopes and shadows: depth profiles z(X) that are constant along Y, seen by a
//! rig like the bench's. Each pixel is integrated over its footprint here in f64. Points that the
//! decoder keeps must be right, and it must not remove surfaces only because they are steep.

use glam::{DVec2, DVec3};
use phasmid::decode::{Decoded, Decoder, Options};
use phasmid::geometry::{Lens, NoiseModel, Pose, Rig, View};
use phasmid::pattern::{Axis, Image, Manifest, ManifestFrame, Pattern, ProjectorSize};
use rayon::prelude::*;
use std::f64::consts::TAU;

const WIDTH: usize = 1138;
const HEIGHT: usize = 12;
const SUB: usize = 16;
const NOISE: f64 = 1.2;

fn rig() -> Rig {
    let view = |width_px, height_px, focal, cx, cy, x| View {
        lens: Lens {
            width_px,
            height_px,
            focal_px: DVec2::splat(focal),
            principal_px: DVec2::new(cx, cy),
            distortion: [0.0; 5],
        },
        rig_from_view: Pose {
            translation_mm: DVec3::new(x, 0.0, 0.0),
            ..Pose::IDENTITY
        },
    };
    Rig {
        camera: view(WIDTH as u32, HEIGHT as u32, 632.2, 568.5, 5.5, 0.0),
        projector: view(1920, 1080, 2751.4, 2060.0, 539.5, 400.0),
        noise: Some(NoiseModel {
            gain_dn_per_e: 0.0,
            read_noise_dn: NOISE,
            black_level_dn: 0.0,
            saturation_dn: 255.0,
        }),
        covariance: None,
    }
}

fn manifest() -> Manifest {
    let fringes = (0..12).map(|i| Pattern::Fringe {
        axis: Axis::X,
        period_px: 16.0,
        phase_rad: TAU * f64::from(i) / 12.0,
    });
    let gray = |cell_px, bits, bit| Pattern::Gray {
        axis: Axis::X,
        cell_px,
        bits,
        bit,
        inverted: false,
    };
    let patterns = fringes
        .chain((0..7).rev().map(|bit| gray(16.0, 7, bit)))
        .chain([gray(8.0, 8, 0), Pattern::White {}, Pattern::Black {}]);
    Manifest {
        projector: ProjectorSize {
            width_px: 1920,
            height_px: 1080,
        },
        frame: patterns
            .map(|pattern| ManifestFrame {
                file: None,
                pattern,
            })
            .collect(),
    }
}

/// One sample of a footprint: its depth, and the projector column that lights it if it is lit.
#[derive(Clone, Copy)]
struct Hit {
    z: f64,
    column: Option<f64>,
    shade: f64,
}

fn trace(rig: &Rig, surface: &(dyn Fn(f64) -> f64 + Sync), u: f64) -> Hit {
    let slope = (u - 568.5) / 632.2;
    // Step along the ray until the point is behind the surface, then bisect the last interval.
    let (mut near, mut far) = (800.0, 800.0);
    while far < surface(slope * far) && far < 1100.0 {
        near = far;
        far += 0.25;
    }
    for _ in 0..40 {
        let middle = 0.5 * (near + far);
        if middle < surface(slope * middle) {
            near = middle;
        } else {
            far = middle;
        }
    }
    let (x, z) = (slope * near, near);
    let shadowed = (1..2000).any(|i| {
        let t = f64::from(i) * 0.0005;
        let (sx, sz) = (x + t * (400.0 - x), z - t * z);
        sz > surface(sx) + 1e-3
    });
    let column = rig.projector.project(DVec3::new(x, 0.0, z)).unwrap().x;
    let lit = !shadowed && (-0.5..1919.5).contains(&column);
    // Lambert's cosine towards the projector.
    let h = 1e-4;
    let normal = DVec2::new((surface(x + h) - surface(x - h)) / (2.0 * h), -1.0).normalize();
    let to_light = DVec2::new(400.0 - x, -z).normalize();
    Hit {
        z,
        column: lit.then_some(column),
        shade: normal.dot(to_light).max(0.0),
    }
}

struct Case {
    /// Hits over the footprint of each pixel column.
    footprints: Vec<Vec<Hit>>,
    middles: Vec<Hit>,
    decoded: Decoded,
    kept: Decoded,
}

fn uniform(counter: u64) -> f64 {
    let mut z = counter.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 + 1e-17
}

fn run(surface: &(dyn Fn(f64) -> f64 + Sync)) -> Case {
    let (rig, manifest) = (rig(), manifest());
    let footprints: Vec<Vec<Hit>> = (0..WIDTH)
        .into_par_iter()
        .map(|u| {
            (0..SUB)
                .map(|k| u as f64 - 0.5 + (k as f64 + 0.5) / SUB as f64)
                .map(|u| trace(&rig, surface, u))
                .collect()
        })
        .collect();
    let middles = (0..WIDTH).map(|u| trace(&rig, surface, u as f64)).collect();
    let frames: Vec<Vec<u8>> = manifest
        .frame
        .par_iter()
        .enumerate()
        .map(|(k, frame)| {
            let level = |column: f64| match frame.pattern {
                Pattern::Fringe { phase_rad, .. } => {
                    0.5 + 0.5 * (TAU * column / 16.0 + phase_rad).cos()
                }
                ref other => other.level(column.round().max(0.0) as u32).unwrap(),
            };
            let row: Vec<f64> = footprints
                .iter()
                .map(|hits| {
                    let light = |h: &Hit| h.column.map_or(0.0, |c| h.shade * level(c));
                    15.0 + 190.0 * hits.iter().map(light).sum::<f64>() / SUB as f64
                })
                .collect();
            (0..WIDTH * HEIGHT)
                .map(|i| {
                    let c = ((k * WIDTH * HEIGHT + i) as u64) * 2;
                    let normal = (-2.0 * uniform(c).ln()).sqrt() * (TAU * uniform(c + 1)).cos();
                    (row[i % WIDTH] + NOISE * normal).round().clamp(0.0, 255.0) as u8
                })
                .collect()
        })
        .collect();
    let images: Vec<_> = frames
        .into_iter()
        .map(|f: Vec<u8>| Image::new(WIDTH, HEIGHT, f).unwrap())
        .collect();
    let [decoded, kept] = [false, true].map(|keep_mixed| {
        let options = Options {
            keep_mixed,
            ..Options::default()
        };
        let decoder = Decoder::new(&manifest, WIDTH, HEIGHT, Some(&rig), options).unwrap();
        decoder.decode(&images).unwrap()
    });
    Case {
        footprints,
        middles,
        decoded,
        kept,
    }
}

/// Statistics of the clean pixels, whose footprint sees one lit, unbroken surface, and of the other
/// pixels.
#[derive(Debug, Default)]
struct Figures {
    clean: usize,
    clean_valid: usize,
    /// Errors above 1 mm among the clean, valid pixels.
    clean_gross: usize,
    clean_squares: f64,
    clean_relative: f64,
    /// Valid pixels at depth edges and light borders.
    edge_valid: usize,
    /// Pixels counted in `edge_valid` that are more than 1 mm outside of the depth range of the lit
    /// surface in their footprint.
    edge_gross: usize,
}

fn figures(case: &Case, decoded: &Decoded) -> Figures {
    let mut f = Figures::default();
    for i in 0..WIDTH * HEIGHT {
        let (hits, middle) = (&case.footprints[i % WIDTH], case.middles[i % WIDTH]);
        let lit: Vec<f64> = hits
            .iter()
            .filter(|h| h.column.is_some())
            .map(|h| h.z)
            .collect();
        if lit.is_empty() {
            continue;
        }
        let lo = lit.iter().copied().fold(f64::INFINITY, f64::min);
        let hi = lit.iter().copied().fold(0.0, f64::max);
        let broken = hits.windows(2).any(|w| (w[0].z - w[1].z).abs() > 2.0);
        // At a crease, the depth at the footprint's centre differs from the mean of the depths at
        // its ends.
        let crease = (hits[0].z + hits[SUB - 1].z - 2.0 * middle.z).abs() > 0.05;
        let z = f64::from(decoded.depth[i]);
        if lit.len() == SUB && !broken {
            if crease {
                continue;
            }
            f.clean += 1;
            if z.is_nan() {
                continue;
            }
            f.clean_valid += 1;
            let error = z - middle.z;
            if error.abs() > 1.0 {
                f.clean_gross += 1;
            } else {
                f.clean_squares += error * error;
                f.clean_relative += (error / f64::from(decoded.depth_sigma[i])).powi(2);
            }
        } else if !z.is_nan() {
            f.edge_valid += 1;
            f.edge_gross += usize::from(
                z < lo - 1.0 || z > hi + 1.0 || hi - lo > 4.0 && z > lo + 1.0 && z < hi - 1.0,
            );
        }
    }
    f
}

fn judge(name: &str, surface: &(dyn Fn(f64) -> f64 + Sync), coverage: f64) -> (Figures, Figures) {
    let case = run(surface);
    let f = figures(&case, &case.decoded);
    let kept = figures(&case, &case.kept);
    let inliers = (f.clean_valid - f.clean_gross) as f64;
    println!(
        "{name}: rmse {:.4} mm, over sigma {:.3}, {f:?}\n  with mixed pixels: {kept:?}",
        (f.clean_squares / inliers).sqrt(),
        (f.clean_relative / inliers).sqrt(),
    );
    assert!(f.clean > 2000, "{name}: {f:?}");
    assert_eq!(f.clean_gross, 0, "{name}: {f:?}");
    let covered = f.clean_valid as f64 / f.clean as f64;
    assert!(covered >= coverage, "{name}: {covered} {f:?}");
    (f, kept)
}

#[test]
fn slopes_of_a_frustum_are_not_removed() {
    // The frustum has a base of 200 mm, a top of 100 mm and a height of 80 mm, so its sides slope by
    // 58 degrees.
    let frustum = |x: f64| 1000.0 - 80.0 * ((100.0 - x.abs()) / 50.0).clamp(0.0, 1.0);
    let (f, _) = judge("frustum", &frustum, 0.99);
    assert_eq!(f.edge_gross, 0, "{f:?}");
}

#[test]
fn flanks_of_a_torso_like_bulge_are_not_removed() {
    let torso = |x: f64| {
        let r = (x / 170.0).abs();
        1000.0
            - if r < 1.0 {
                110.0 * (1.0 - r * r).powf(0.6)
            } else {
                0.0
            }
    };
    let (f, _) = judge("torso", &torso, 0.985);
    assert_eq!(f.edge_gross, 0, "{f:?}");
}

#[test]
fn steps_lose_their_mixed_pixels_and_little_else() {
    for shift in [0.0, 0.3, 0.55, 0.8] {
        // Blocks of different heights; vertical walls towards and away from the projector.
        let steps = move |x: f64| {
            let x = x + shift;
            1000.0
                - match x {
                    x if (-200.0..-120.0).contains(&x) => 60.0,
                    x if (-60.0..-20.0).contains(&x) => 25.0,
                    x if (40.0..120.0).contains(&x) => 90.0,
                    x if (180.0..200.0).contains(&x) => 12.0,
                    _ => 0.0,
                }
        };
        let (f, kept) = judge("steps", &steps, 0.97);
        assert!(f.edge_gross * 4 <= kept.edge_gross, "{f:?} {kept:?}");
    }
}
