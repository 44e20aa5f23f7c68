//! Compares the averages of patterns under many footprints that shaders compute with the CPU's
//! averages.

use super::exposure::{bell, packed};
use super::tables::Tables;
use super::{Engine, EntryPoint, Shown};
use crate::exposure::{self, GeometryBuffer, Mixed, Table};
use crate::pattern_image::PatternImage;
use crate::shot::Shot;
use crate::timetable::Timetable;
use crate::{Plan, Term};
use phasmid_pattern::Axis;
use phasmid_profile::{Profile, Projector, Response};
use std::sync::Arc;

const WIDTH: u32 = 1920;
const HEIGHT: u32 = 1080;

fn projector() -> Projector {
    let mut projector = Profile::load("pmp-bench").unwrap().projector;
    projector.response = Some(Response::Gamma(2.2));
    projector
}

fn hash(i: u32) -> u32 {
    // Mueller's integer hash.
    let i = (i ^ (i >> 16)).wrapping_mul(0x045d_9f3b);
    let i = (i ^ (i >> 16)).wrapping_mul(0x045d_9f3b);
    i ^ (i >> 16)
}

fn random_levels(count: u32) -> Vec<u16> {
    (0..count).map(|i| (hash(i) >> 24) as u16).collect()
}

/// Pseudo-random numbers in [0, 1).
struct Random(u32);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 += 1;
        (hash(self.0) >> 8) as f32 / (1u32 << 24) as f32
    }

    /// Returns a random size of either sign, over several decades; in some cases 0.
    fn size(&mut self, [low, high]: [f32; 2]) -> f32 {
        let size = low * (high / low).powf(self.next());
        match (self.next() * 8.0) as u32 {
            0 => 0.0,
            1..4 => -size,
            _ => size,
        }
    }

    /// Returns a position on, beside or far from the pattern, often near a border.
    fn place(&mut self, length: u32) -> f32 {
        let x = (self.next() * 1.2 - 0.1) * length as f32;
        match (self.next() * 16.0) as u32 {
            0 => x.round(),
            1..4 => x.round() + 0.5,
            4 => 0.0,
            5 => length as f32 - 0.5,
            6 => x * 1e4,
            _ => x,
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct Case {
    at: [f32; 2],
    slopes: [[f32; 2]; 2],
    sigma: f32,
}

fn cases(count: usize, sizes: [f32; 2], sigmas: [f32; 2]) -> Vec<Case> {
    let mut random = Random(7);
    let mut case = || Case {
        at: [WIDTH, HEIGHT].map(|length| random.place(length)),
        slopes: [[(); 2]; 2].map(|row| row.map(|()| random.size(sizes))),
        sigma: random.size(sigmas).abs(),
    };
    (0..count).map(|_| case()).collect()
}

/// Returns the CPU's levels. Each footprint is passed as the only lit sample of a mixed pixel.
fn on_cpu(table: &Table, plan: &Plan, cases: &[Case]) -> Vec<f32> {
    let mut map = GeometryBuffer::default();
    for case in cases {
        let mut mixed = Mixed::new(0);
        mixed.projected[3] = 16.0;
        (mixed.x[3], mixed.y[3]) = (case.at[0], case.at[1]);
        [mixed.x_slope[3], mixed.y_slope[3]] = case.slopes;
        mixed.blur[3] = case.sigma;
        map.mixed.push(mixed);
    }
    map.blur_footprints([WIDTH as usize, HEIGHT as usize], plan, None);
    (0..cases.len())
        .map(|i| exposure::mixed(&map, i, table, [1.0, 1.0]))
        .collect()
}

fn on_gpu(
    (engine, placed): (&mut Engine, &mut Tables),
    table: &Arc<Table>,
    plan: &Plan,
    cases: &[Case],
) -> Vec<f32> {
    let tables = [table.clone()];
    let heads = placed.place(engine, &tables).unwrap();
    let shown = Shown {
        plan,
        when: &Timetable::new(&Shot::default(), &Plan::default(), None, [1, 1]),
        tables: &tables,
        blur_aspect: 1.0,
        pixels: 1,
        adds: false,
    };
    engine.write("schedule", bytemuck::cast_slice(&packed(&shown, &heads)));
    engine.write("bell", bytemuck::cast_slice(&bell()));
    engine.provide("mixtures");
    let mut input = Vec::new();
    for case in cases {
        let [x, y] = case.slopes;
        let none = 0xffff;
        input.extend(case.at.map(f32::to_bits));
        input.extend([case.sigma.to_bits(), none]);
        input.extend([x[0], x[1], y[0], y[1]].map(f32::to_bits));
        input.extend([0; 4]);
    }
    let stage = EntryPoint::new("tests/footprint_test", "main", plan)
        .with("along_rows", f64::from(u8::from(heads[0].is_row())))
        .with("in_images", f64::from(u8::from(heads[0].is_image())));
    let output = engine.call_stage(&stage, &input, cases.len(), cases.len());
    output.into_iter().map(f32::from_bits).collect()
}

/// Checks that every level of the GPU is within `bar` (of 255) of the CPU's level; prints the
/// maximum and mean error.
fn compare(name: &str, pattern_image: &PatternImage, plan: &Plan, cases: &[Case], bar: f32) {
    // On an image, the CPU places the parts of a footprint to within 1e-4 of a projector pixel. This
    // changes the contribution of a border to a level by 1e-4 divided by the footprint's width. The
    // GPU is more precise.
    let placed = |case: &Case| match pattern_image {
        PatternImage::Image { .. } => {
            let width = |s: [f32; 2]| (s[0].hypot(s[1]) / 8.0).max(3.4 * case.sigma).max(1e-3);
            let narrow = width(case.slopes[0]).min(width(case.slopes[1]));
            255.0 * 2.5e-4 / narrow
        }
        _ => 0.0,
    };
    let table = || Table::new(pattern_image, &projector(), plan);
    let mut engine = Engine::for_tests();
    let (cpu, gpu) = (
        on_cpu(&table(), plan, cases),
        on_gpu(
            (&mut engine, &mut Tables::default()),
            &Arc::new(table()),
            plan,
            cases,
        ),
    );
    let mut sum = 0.0;
    let mut worst = (0.0f32, 0);
    for (i, (a, b)) in cpu.iter().zip(&gpu).enumerate() {
        let error = (255.0 * (a - b).abs() - placed(&cases[i])).max(0.0);
        sum += f64::from(error);
        if !(error <= worst.0) {
            worst = (error, i);
        }
    }
    let i = worst.1;
    println!(
        "{name}: mean {:.2e}, worst {:.2e} of 255 at {:?}: {} for {}",
        sum / cases.len() as f64,
        worst.0,
        cases[i],
        gpu[i],
        cpu[i]
    );
    assert!(worst.0 <= bar, "{name}: {} of 255", worst.0);
}

fn plan(terms: &[Term]) -> Plan {
    let mut plan = Plan::default();
    for &term in [Term::FootprintX, Term::FootprintY].iter().chain(terms) {
        plan.set(term, true);
    }
    plan
}

fn rows() -> [(&'static str, PatternImage); 4] {
    let stripes = (0..WIDTH).map(|i| 255 * (i % 2) as u16).collect();
    let edge = (0..HEIGHT).map(|i| 255 * u16::from(i > 500)).collect();
    let tau = std::f64::consts::TAU;
    let cosine = |i: u32| (127.5 + 127.5 * (tau * f64::from(i) / 16.0).cos()).round() as u16;
    [
        ("stripes", PatternImage::Row(Axis::X, stripes)),
        ("edge", PatternImage::Row(Axis::Y, edge)),
        ("random", PatternImage::Row(Axis::X, random_levels(WIDTH))),
        (
            "cosine",
            PatternImage::Row(Axis::Y, (0..HEIGHT).map(cosine).collect()),
        ),
    ]
}

fn image() -> PatternImage {
    PatternImage::Image {
        width: WIDTH,
        height: HEIGHT,
        levels: random_levels(WIDTH * HEIGHT),
    }
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_rows_are_averaged_as_on_the_cpu() {
    for (bits, plan) in [("8", plan(&[])), ("16", plan(&[Term::ProjectorResponse]))] {
        for (name, pattern_image) in rows() {
            let usual = cases(40_000, [1e-3, 30.0], [1.0, 1.0]);
            compare(
                &format!("{name} of {bits} bits"),
                &pattern_image,
                &plan,
                &usual,
                0.01,
            );
            let wild = cases(40_000, [1e-8, 1e8], [1.0, 1.0]);
            compare(
                &format!("{name} of {bits} bits, wild"),
                &pattern_image,
                &plan,
                &wild,
                0.05,
            );
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_images_are_averaged_as_on_the_cpu() {
    for (bits, terms) in [("8", vec![]), ("16", vec![Term::ProjectorResponse])] {
        let plan = plan(&terms);
        let usual = cases(20_000, [1e-3, 30.0], [0.1, 5.0]);
        compare(
            &format!("image of {bits} bits"),
            &image(),
            &plan,
            &usual,
            0.02,
        );
        let wild = cases(20_000, [1e-8, 1e5], [1e-3, 100.0]);
        compare(
            &format!("image of {bits} bits, wild"),
            &image(),
            &plan,
            &wild,
            0.05,
        );
    }
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_blurred_rows_are_averaged_as_on_the_cpu() {
    let plan = plan(&[Term::ProjectorDefocus]);
    for (name, pattern_image) in rows() {
        // Outside the pattern there is no light to blur, so only positions on the pattern are
        // compared.
        let on_pattern_image = |case: &Case| {
            let [x, y] = case.at;
            (-0.5..1919.5).contains(&x) && (-0.5..1079.5).contains(&y)
        };
        let mut usual = cases(10_000, [1e-2, 30.0], [0.1, 10.0]);
        usual.retain(on_pattern_image);
        compare(
            &format!("{name}, blurred"),
            &pattern_image,
            &plan,
            &usual,
            0.02,
        );
        let mut wild = cases(3_000, [1e-8, 1e8], [1e-6, 150.0]);
        wild.retain(on_pattern_image);
        compare(
            &format!("{name}, blurred, wild"),
            &pattern_image,
            &plan,
            &wild,
            0.05,
        );
    }
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn uniform_pattern_images_have_their_level() {
    let some = cases(1_000, [1e-3, 30.0], [0.1, 10.0]);
    compare(
        "uniform",
        &PatternImage::Uniform(77),
        &plan(&[Term::ProjectorResponse]),
        &some,
        0.0,
    );
}

/// If three rows are used in turn and the memory holds two, evicted rows are uploaded again.
#[test]
#[ignore = "needs a Vulkan adapter"]
fn pattern_images_that_do_not_fit_together_take_turns() {
    let plan = plan(&[]);
    let tables = [5, 6, 7].map(|cell| {
        let levels = (0..WIDTH).map(|i| 255 * (i / cell % 2) as u16).collect();
        Arc::new(Table::new(
            &PatternImage::Row(Axis::X, levels),
            &projector(),
            &plan,
        ))
    });
    let cases = cases(500, [1e-2, 3.0], [1.0, 1.0]);
    let mut engine = Engine::for_tests();
    let mut placed = Tables::within(5_000 * 16);
    for i in [0, 1, 0, 2, 1, 1, 0, 2] {
        let gpu = on_gpu((&mut engine, &mut placed), &tables[i], &plan, &cases);
        let cpu = on_cpu(&tables[i], &plan, &cases);
        let worst = cpu.iter().zip(&gpu).map(|(a, b)| (a - b).abs());
        assert!(worst.fold(0.0, f32::max) < 1e-5, "{i}");
    }
    assert!(placed.place(&mut engine, &tables[..2]).is_ok());
    let refused = placed.place(&mut engine, &tables).err().unwrap();
    assert!(refused.to_string().contains("80000"), "{refused}");
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_wide_numbers_match_64_bit_integers() {
    let edges = [
        0,
        1,
        2,
        0xffff,
        0x1_0000,
        0xffff_ffff,
        1 << 32,
        1 << 63,
        u64::MAX,
        0x8000_0000,
    ];
    let random = (0..2_000).map(|i| u64::from(hash(i)) << 32 | u64::from(hash(i + 9_999)));
    let shifted = random.enumerate().map(|(i, v)| v >> (i % 64));
    let numbers: Vec<u64> = edges.into_iter().chain(shifted).collect();
    let pairs: Vec<(u64, u64)> = (0..50_000u32)
        .map(|i| {
            let pick = |k: u32| numbers[hash(k) as usize % numbers.len()];
            (pick(2 * i), pick(2 * i + 1))
        })
        .collect();
    let words = |v: u64| [v as u32, (v >> 32) as u32];
    let input: Vec<u32> = pairs
        .iter()
        .flat_map(|&(a, b)| [words(a), words(b)])
        .flatten()
        .collect();
    let mut engine = Engine::for_tests();
    let output = engine.call("tests/wide_test", &input, 8 * pairs.len(), pairs.len());
    for (&(a, b), found) in pairs.iter().zip(output.chunks(8)) {
        let whole = [a.wrapping_sub(b), a.wrapping_mul(b)].map(words);
        assert_eq!(found[..4], *whole.as_flattened(), "{a} {b}");
        let real = [f32::from_bits(found[4]), f32::from_bits(found[5])];
        for (found, exact) in real.into_iter().zip([a as f32, a as i64 as f32]) {
            let error = (f64::from(found) - f64::from(exact)).abs();
            assert!(
                error <= 1.2e-7 * f64::from(exact).abs(),
                "{a}: {found} for {exact}"
            );
        }
    }
}
