//! Measures the cost of processing patient data (the skin of a CT, volume and field files, point
//! displacements) relative to a memory copy of the same bytes.
//!
//! `cargo bench --bench patients`

use glam::DVec3;
use phasmid::patient::isosurface::{Parts, SKIN_HU, isosurface};
use phasmid::patient::metaimage::{Packing, read_field, read_volume, write_field, write_volume};
use phasmid::patient::volume::{Field, Grid, Volume, Voxels};
use phasmid::study::timing::Stopwatch;
use std::hint::black_box;
use std::time::Instant;

/// Measuring time for each figure, in seconds.
const ENOUGH_S: f64 = 1.0;

fn main() {
    let begin = Instant::now();
    let clock = || begin.elapsed();
    let watch = Stopwatch::new(&clock);
    println!(
        "{:<36}{:>12}{:>12}{:>12}{:>10}",
        "patient", "things", "ns each", "copy ns", "ratio"
    );
    let show = |name: &str, things: usize, bytes: usize, work: &mut dyn FnMut()| {
        let [took, copy] = watch
            .beside_a_copy(bytes, ENOUGH_S, work)
            .map(|s| s * 1e9 / things as f64);
        let ratio = took / copy;
        println!("{name:<36}{things:>12}{took:>12.3}{copy:>12.3}{ratio:>10.1}");
    };

    let ct = ct();
    let voxels = ct.grid().voxels();
    let mut triangles = 0;
    for (name, parts) in [
        ("surface, all of it", Parts::All),
        ("surface, largest body", Parts::Largest),
        ("surface, largest body filled", Parts::LargestFilled),
    ] {
        show(name, voxels, 2 * voxels, &mut || {
            let mesh = isosurface(&ct, SKIN_HU, parts, "ct").expect("a body");
            triangles = black_box(mesh).triangles.len();
        });
    }
    println!("{:<36}{triangles:>12}", "triangles of the last surface");

    let folder = tempfile::tempdir().expect("a scratch folder");
    let path = folder.path().join("ct.mha");
    for (name, packing) in [("plain", Packing::Plain), ("packed", Packing::Zlib)] {
        show(
            &format!("volume, written {name}"),
            voxels,
            2 * voxels,
            &mut || {
                write_volume(&path, &ct, packing).expect("room for it");
            },
        );
        show(
            &format!("volume, read {name}"),
            voxels,
            2 * voxels,
            &mut || {
                black_box(read_volume(&path).expect("a readable volume"));
            },
        );
    }
    let grid = Grid::upright([120, 80, 100], DVec3::splat(3.0), DVec3::splat(-100.0));
    let field = Field::of(grid, |p| 0.01 * p, "field").expect("a field");
    write_field(&path, &field, Packing::Plain).expect("room for it");
    show(
        "field, read plain",
        grid.voxels(),
        12 * grid.voxels(),
        &mut || {
            black_box(read_field(&path).expect("as it was written"));
        },
    );
    let points: Vec<DVec3> = (0..100_000)
        .map(|n| DVec3::from_array([97, 89, 83].map(|m| f64::from(n * m % 230) - 95.0)))
        .collect();
    show(
        "field, at a point",
        points.len(),
        24 * points.len(),
        &mut || {
            let sum: DVec3 = points.iter().filter_map(|&p| field.at(p)).sum();
            black_box(sum);
        },
    );
}

/// Returns a trunk with lungs and a couch in 256 x 256 x 128 voxels, with the noise of a CT scanner.
fn ct() -> Volume {
    let size = [256, 256, 128];
    let grid = Grid::upright(size, DVec3::new(1.6, 1.6, 3.0), DVec3::splat(-200.0));
    let smooth = |p: DVec3| {
        let p = DVec3::new(p.x + 4.0, p.y + 4.0, p.z + 10.0);
        let body = 1.0 - (p.x / 170.0).hypot(p.y / 110.0);
        let lung = |side: f64| 1.0 - ((p - DVec3::new(80.0 * side, 0.0, 0.0)) / 70.0).length();
        let couch = if (p.y - 130.0).abs() < 4.0 { 1.0 } else { -1.0 };
        let inside = (60.0 * body).min(-60.0 * lung(1.0)).min(-60.0 * lung(-1.0));
        -480.0 + 520.0 * inside.max(couch).clamp(-1.0, 1.0)
    };
    let smooth = Volume::of(grid, smooth, "ct").expect("a CT");
    let mut state = 1_u64;
    let noisy = (0..grid.voxels()).map(|n| {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        // The noise is uniform with 20 Hounsfield units RMS.
        let noise = (state >> 40) as f32 / (1 << 24) as f32 - 0.5;
        (smooth.voxels().get(n) + 69.3 * noise) as i16
    });
    Volume::new(grid, Voxels::I16(noisy.collect()), "ct").expect("a CT")
}
