//! Triangulation with nearly parallel rays, near and far points, rays that do not meet, and distortion.

use super::case::{Case, Group, Sweep, worse};
use crate::draws::Draws;
use glam::{DVec2, DVec3};
use phasmid_core::error::Result;
use phasmid_decode::triangulate::{CoordinateRow, Measured, Triangulator};
use phasmid_geometry::{Lens, Pose, Rig, View};
use phasmid_report::lab::Context;

/// Half of the distance between neighbouring numbers below 1.
pub(super) const EPS: f64 = f64::EPSILON / 2.0;
pub(super) const EPS_F32: f64 = f32::EPSILON as f64 / 2.0;
/// Number of roundings between a coordinate and a depth, in the test and in the program, estimated
/// generously.
const ROUNDINGS: f64 = 16.0;
const WIDTH: usize = 64;
/// Message for a depth that the parallax does not determine.
const NO_DEPTH: &str = "no depth (NaN)";

pub(super) const GROUP: Group = Group {
    title: "Triangulation",
    sweeps: &[
        Sweep {
            key: "baseline",
            title: "Tiny baselines, a plane at 1000 mm, projector coordinates exact to f64",
            oracle: "Oracle: the coordinate of a known point, projected in closed form. Allowed: 16 \
                roundings of the coordinate times the slope of depth",
            ratio: "distance over baseline",
            error: "depth error in mm",
            rounding: true,
            cases: |_| Ok(baselines(false)),
        },
        Sweep {
            key: "baseline-f32",
            title: "Tiny baselines, coordinates in f32 as a decoder gives them",
            oracle: "Allowed: half a unit in the last place of f32 in coordinate, ray and depth, \
                times their slopes",
            ratio: "distance over baseline",
            error: "depth error in mm",
            rounding: false,
            cases: |_| Ok(baselines(true)),
        },
        Sweep {
            key: "baseline-noise",
            title: "Tiny baselines, noise of 0.02 projector pixels",
            oracle: "RMS over 4096 draws. Allowed: slope times noise, plus the second order of 1/t \
                and 5 % for the finite number of draws. A depth with a standard deviation above a \
                twentieth of its value is rejected",
            ratio: "distance over baseline",
            error: "RMS depth error in mm",
            rounding: false,
            cases: noisy_baselines,
        },
        Sweep {
            key: "scale",
            title: "Rig and scene scaled together, from 1 mm to ten kilometres, baseline 0.4 of \
                the distance",
            oracle: "Allowed: as for f32 coordinates, relative to the distance, at every scale",
            ratio: "distance in mm",
            error: "depth error over depth",
            rounding: false,
            cases: |_| Ok(scales()),
        },
        Sweep {
            key: "far",
            title: "From 1 mm to ten kilometres with a baseline of 400 mm",
            oracle: "Allowed: 16 roundings of the coordinate times the slope of depth",
            ratio: "distance over baseline",
            error: "depth error over depth",
            rounding: true,
            cases: |_| Ok(far()),
        },
        Sweep {
            key: "distorted",
            title: "A projector with strong distortion, both axes, planes from 300 mm to 100 m",
            oracle: "A known point, projected in closed form. Allowed: 16 roundings of the coordinates \
                times the slope of depth. Ratio: largest distortion over the lit field",
            ratio: "shift in px",
            error: "depth error over depth",
            rounding: true,
            cases: |_| distorted(),
        },
        Sweep {
            key: "parallel",
            title: "Rays that are parallel, diverge, or meet behind the lens",
            oracle: "No valid intersection exists; ratio: distance of the intersection over the baseline",
            ratio: "distance over baseline",
            error: "depth error in mm",
            rounding: false,
            cases: |_| parallel(),
        },
    ],
};

/// Creates a camera and a projector without distortion, `baseline_mm` apart, with the projector
/// slightly rotated.
fn rig(baseline_mm: f64, turn_deg: DVec3) -> Rig {
    let view = |width_px, focal, principal_px, rig_from_view| View {
        lens: Lens {
            width_px,
            height_px: 48,
            focal_px: DVec2::splat(focal),
            principal_px,
            distortion: [0.0; 5],
        },
        rig_from_view,
    };
    let place = DVec3::new(baseline_mm, 0.05 * baseline_mm, -0.04 * baseline_mm);
    Rig {
        camera: view(WIDTH as u32, 60.0, DVec2::new(31.5, 23.5), Pose::IDENTITY),
        projector: view(
            1024,
            1500.0,
            DVec2::new(511.5, 23.5),
            Pose::from_xyz_deg(place, turn_deg),
        ),
        noise: None,
        covariance: None,
    }
}

/// A point on a camera ray as the projector sees it.
struct Lit {
    depth: f64,
    px: f64,
    /// Derivative of the depth with respect to the coordinate, in mm per pixel.
    slope: f64,
    /// Magnitude of the numbers whose difference is the coordinate, in pixels.
    size: f64,
}

/// Intersects the ray of pixel `u` with a plane of slope 0.2, in closed form.
fn lit(rig: &Rig, u: usize, distance: f64) -> Lit {
    let ray = rig.camera.lens.ray(DVec2::new(u as f64, 20.0));
    let depth = distance / (1.0 + 0.2 * ray.x);
    let lens = &rig.projector.lens;
    let into = rig.projector.rig_from_view.inverse();
    let (a, b) = (into.translation_mm, into.rotation * ray);
    let p = a + b * depth;
    let f = lens.focal_px.x;
    Lit {
        depth,
        px: f * p.x / p.z + lens.principal_px.x,
        slope: (p.z * p.z / (f * (b.x * a.z - a.x * b.z))).abs(),
        size: f * (p.x / p.z).abs()
            + lens.principal_px.x
            + f * (a.length() + b.length() * depth) / p.z,
    }
}

const TURN: DVec3 = DVec3::new(1.0, -3.0, 2.0);

/// Returns the worst error over a row of pixels and its allowed value, in f64 or in f32.
fn row(rig: &Rig, distance: f64, f32_path: bool) -> Result<(f64, f64)> {
    let triangulator = Triangulator::new(rig, WIDTH, 48)?;
    let lits: Vec<Lit> = (0..WIDTH).map(|u| lit(rig, u, distance)).collect();
    let depths: Vec<f64> = if f32_path {
        let px: Vec<f32> = lits.iter().map(|lit| lit.px as f32).collect();
        let sigma = vec![0.0; WIDTH];
        let (mut depth, mut sd) = (vec![0.0; WIDTH], vec![0.0; WIDTH]);
        let x = CoordinateRow {
            px: &px,
            sigma: &sigma,
        };
        triangulator.row(20, Some(x), None, &mut depth, &mut sd);
        depth.into_iter().map(f64::from).collect()
    } else {
        let of = |(u, lit): (usize, &Lit)| {
            let x = Measured {
                px: lit.px,
                sigma: 0.0,
            };
            let found = triangulator.depth(DVec2::new(u as f64, 20.0), Some(x), None);
            found.map_or(f64::NAN, |(depth, _)| depth)
        };
        lits.iter().enumerate().map(of).collect()
    };
    // Find the pixel with the largest ratio of error to allowed error.
    let mut worst = (0.0, f64::INFINITY);
    for (u, (lit, depth)) in lits.iter().zip(depths).enumerate() {
        let ray = rig.camera.lens.ray(DVec2::new(u as f64, 20.0));
        let f = rig.projector.lens.focal_px.x;
        let exact = ROUNDINGS * EPS * (lit.size * lit.slope + lit.depth);
        let coarse =
            EPS_F32 * ((lit.px.abs() + f * (ray.x.abs() + ray.y.abs())) * lit.slope + lit.depth);
        let allowed = exact + if f32_path { coarse } else { 0.0 };
        let error = (depth - lit.depth).abs();
        worse(&mut worst, error, allowed);
    }
    Ok(worst)
}

fn baselines(f32_path: bool) -> Vec<Case> {
    let last = if f32_path { 2 } else { 5 };
    let mut cases: Vec<Case> = (-3..=last)
        .map(|k| {
            let baseline = 10f64.powi(-k);
            let name = format!("{baseline} mm");
            match row(&rig(baseline, TURN), 1000.0, f32_path) {
                Ok((found, allowed)) => Case::held(name, 1000.0 / baseline, found, allowed),
                Err(e) => Case::failed(name, 1000.0 / baseline, &e.to_string()),
            }
        })
        .collect();
    if !f32_path {
        let says = match rig(1e-7, TURN).check() {
            Err(v) => format!("{}: {}; expected {}", v.field, v.found, v.allowed),
            Ok(()) => String::new(),
        };
        cases.push(Case::refused("0.0000001 mm", 1e10, &says, "zero baseline"));
    }
    cases
}

const NOISE_PX: f64 = 0.02;

fn noisy_baselines(context: &Context<'_>) -> Result<Vec<Case>> {
    let one = |(stream, baseline): (usize, f64)| {
        let rig = rig(baseline, TURN);
        let triangulator = Triangulator::new(&rig, WIDTH, 48)?;
        let draws = Draws::new(context.seed, stream as u32);
        let (mut squares, mut allowed, mut kept, mut all) = (0.0, 0.0, 0.0, 0.0);
        for index in 0..64u64 {
            for u in 0..WIDTH {
                let lit = lit(&rig, u, 1000.0);
                let noise = draws.normals(index * WIDTH as u64 + u as u64).x * NOISE_PX;
                let x = Measured {
                    px: lit.px + noise,
                    sigma: NOISE_PX,
                };
                all += 1.0;
                let at = DVec2::new(u as f64, 20.0);
                let Some((depth, _)) = triangulator.depth(at, Some(x), None) else {
                    continue;
                };
                let relative = lit.slope * NOISE_PX / lit.depth;
                kept += 1.0;
                squares += (depth - lit.depth).powi(2);
                // Expand 1/(1 + e) to third order in a normal e: the variance is r^2 (1 + 9 r^2).
                allowed += (lit.slope * NOISE_PX).powi(2) * (1.0 + 9.0 * relative * relative);
            }
        }
        let (name, ratio) = (format!("{baseline} mm"), 1000.0 / baseline);
        Ok(if kept == 0.0 {
            Case::refused(name, ratio, NO_DEPTH, NO_DEPTH)
        } else {
            let [found, allowed] = [squares, allowed].map(|sum: f64| (sum / kept).sqrt());
            Case::held(name, ratio, found, 1.05 * allowed).kept(kept / all, 0.99)
        })
    };
    let baselines = [1000.0, 400.0, 100.0, 40.0, 10.0, 4.0, 1.0, 0.5, 0.1, 0.01];
    baselines.into_iter().enumerate().map(one).collect()
}

fn scales() -> Vec<Case> {
    (0..=7)
        .map(|k| {
            let distance = 10f64.powi(k);
            let name = format!("{distance} mm");
            match row(&rig(0.4 * distance, TURN), distance, true) {
                Ok((found, allowed)) => {
                    Case::held(name, distance, found / distance, allowed / distance)
                }
                Err(e) => Case::failed(name, distance, &e.to_string()),
            }
        })
        .collect()
}

fn far() -> Vec<Case> {
    [1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6, 1e7]
        .map(|distance| {
            let name = format!("{distance} mm");
            // The nearest points are beside the projector, so rotate it towards them.
            let mut rig = rig(400.0, DVec3::new(1.0, -3.0, 2.0));
            if distance < 1000.0 {
                let place = rig.projector.rig_from_view.translation_mm;
                rig.projector.rig_from_view =
                    Pose::from_xyz_deg(place, DVec3::new(1.0, -70.0, 2.0));
            }
            match row(&rig, distance, false) {
                Ok((found, allowed)) => {
                    Case::held(name, distance / 400.0, found / distance, allowed / distance)
                }
                Err(e) => Case::failed(name, distance / 400.0, &e.to_string()),
            }
        })
        .to_vec()
}

/// Tests depth from both coordinates and from columns alone, with a distorted projector lens.
fn distorted() -> Result<Vec<Case>> {
    let one = |k1: f64| {
        let mut rig = rig(400.0, DVec3::new(1.0, -18.0, 2.0));
        rig.projector.lens.distortion = [k1, 0.1 * k1.abs(), 1e-3 * k1, -2e-3 * k1, 0.0];
        rig.projector.lens.height_px = 768;
        rig.projector.lens.principal_px.y = 383.5;
        let triangulator = Triangulator::new(&rig, WIDTH, 48)?;
        let (mut worst, mut shift, mut lit, mut none) = ((0.0, f64::INFINITY), 0.0_f64, 0, 0);
        for distance in [300.0, 1e3, 3e3, 1e4, 1e5] {
            for i in 0..WIDTH * 48 {
                let at = DVec2::new((i % WIDTH) as f64, (i / WIDTH) as f64);
                let ray = rig.camera.lens.ray(at);
                let depth = distance / (1.0 + 0.2 * ray.x - 0.1 * ray.y);
                let seen = |depth: f64| rig.projector.project(ray * depth);
                let ends = [1.0 - 1e-5, 1.0 + 1e-5].map(|by| seen(depth * by));
                let (Some(px), [Some(low), Some(high)]) = (seen(depth), ends) else {
                    continue;
                };
                let lens = &rig.projector.lens;
                if !lens.contains(px) {
                    continue;
                }
                lit += 1;
                let ideal = Lens {
                    distortion: [0.0; 5],
                    ..*lens
                };
                let way = rig.projector.rig_from_view.inverse().point(ray * depth);
                shift = ideal
                    .project(way)
                    .map_or(shift, |ideal| shift.max((ideal - px).length()));
                let both = [px.x, px.y].map(|px| Some(Measured { px, sigma: 1e-6 }));
                let slope = 2e-5 * depth / (high - low).x.abs();
                // The allowed error follows from columns alone, and applies with rows too.
                let allowed = ROUNDINGS * EPS * (1.0 + slope * 4000.0 / depth);
                for y in [both[1], None] {
                    let Some((found, _)) = triangulator.depth(at, both[0], y) else {
                        none += 1;
                        continue;
                    };
                    let error = (found - depth).abs() / depth;
                    worse(&mut worst, error, allowed);
                }
            }
        }
        let name = format!("k1 = {k1}");
        let case = Case::held(name, shift, worst.0, worst.1);
        Ok(case.kept(1.0 - f64::from(none) / f64::from((2 * lit).max(1)), 0.999))
    };
    [-1e-6, -0.1, -0.5, -1.0, 0.5, 2.0, 10.0]
        .into_iter()
        .map(one)
        .collect()
}

/// Tests a ray of the camera parallel to the plane of the projector's column: without rotation, this is
/// the column whose ideal coordinate equals the ray's.
fn parallel() -> Result<Vec<Case>> {
    let mut rig = rig(400.0, DVec3::ZERO);
    rig.projector.rig_from_view.translation_mm = DVec3::new(400.0, 0.0, 0.0);
    let triangulator = Triangulator::new(&rig, WIDTH, 48)?;
    // x = 0.125 is exact in binary, so the ray is exactly parallel.
    let at = DVec2::new(31.5 + 0.125 * 60.0, 23.5);
    let px = |distance: f64| 511.5 + 1500.0 * (0.125 - 400.0 / distance);
    let depth = |px: f64, sigma: f64| triangulator.depth(at, Some(Measured { px, sigma }), None);
    let silent = |found: Option<(f64, f64)>| match found {
        None => NO_DEPTH.to_owned(),
        Some((depth, _)) => format!("a depth of {depth} mm"),
    };
    let mut cases = Vec::new();
    for ratio in [1e2, 1e4, 1e6, 1e8, 1e10] {
        let truth = 400.0 * ratio;
        let name = format!("{:e} rad from parallel", 1.0 / ratio);
        let found = depth(px(truth), 0.0).map_or(f64::NAN, |(depth, _)| (depth - truth).abs());
        let slope = truth * truth / (400.0 * 1500.0);
        cases.push(Case::held(
            name,
            ratio,
            found,
            ROUNDINGS * EPS * 700.0 * slope,
        ));
    }
    for (name, ratio, coordinate, sigma) in [
        (
            "1e-6 rad from parallel, coordinate sigma 1e-3 px",
            1e6,
            px(4e8),
            1e-3,
        ),
        ("parallel", f64::INFINITY, 511.5 + 1500.0 * 0.125, 0.0),
        (
            "parallel, coordinate sigma 1e-3 px",
            f64::INFINITY,
            511.5 + 1500.0 * 0.125,
            1e-3,
        ),
        ("meet 1 mm behind the lens", 0.0025, px(-1.0), 1e-3),
        ("meet 1 km behind the lens", 2500.0, px(-1e6), 1e-3),
        ("a NaN coordinate", f64::NAN, f64::NAN, 1e-3),
        ("an infinite coordinate", f64::NAN, f64::INFINITY, 1e-3),
    ] {
        let says = silent(depth(coordinate, sigma));
        cases.push(Case::refused(name, ratio, &says, NO_DEPTH));
        let (mut z, mut sd) = ([0.0f32; WIDTH], [0.0f32; WIDTH]);
        let x = CoordinateRow {
            px: &[coordinate as f32; WIDTH],
            sigma: &[sigma as f32; WIDTH],
        };
        // Index in the row of the pixel with this ray; its x is exact in f32 too.
        triangulator.row(23, Some(x), None, &mut z, &mut sd);
        let says = silent((!z[39].is_nan()).then_some((f64::from(z[39]), 0.0)));
        cases.push(Case::refused(
            format!("{name}, in f32"),
            ratio,
            &says,
            NO_DEPTH,
        ));
    }
    Ok(cases)
}
