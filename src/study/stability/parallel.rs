//! Rays that are parallel, diverge, or meet behind the lens.

use super::case::Case;
use super::rays::{EPS, NO_DEPTH, ROUNDINGS, WIDTH, rig};
use glam::{DVec2, DVec3};
use phasmid_core::error::Result;
use phasmid_decode::triangulate::{CoordinateRow, Measured, Triangulator};

/// The plane of the projector's column against a ray of the camera: without turn, a coordinate whose
/// ideal is the ray's own never meets it.
pub(super) fn parallel() -> Result<Vec<Case>> {
    let mut rig = rig(400.0, DVec3::ZERO);
    rig.projector.rig_from_view.translation_mm = DVec3::new(400.0, 0.0, 0.0);
    let triangulator = Triangulator::new(&rig, WIDTH, 48)?;
    // x = 0.125, exact in binary, so that parallel is parallel.
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
        let name = format!("parallel but for {:e} rad", 1.0 / ratio);
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
            "parallel but for 1e-6 rad, coordinate known to 1e-3 px",
            1e6,
            px(4e8),
            1e-3,
        ),
        ("parallel", f64::INFINITY, 511.5 + 1500.0 * 0.125, 0.0),
        (
            "parallel, coordinate known to 1e-3 px",
            f64::INFINITY,
            511.5 + 1500.0 * 0.125,
            1e-3,
        ),
        ("meet 1 mm behind the lens", 0.0025, px(-1.0), 1e-3),
        ("meet 1 km behind the lens", 2500.0, px(-1e6), 1e-3),
        ("a coordinate that is no number", f64::NAN, f64::NAN, 1e-3),
        ("a coordinate without an end", f64::NAN, f64::INFINITY, 1e-3),
    ] {
        let says = silent(depth(coordinate, sigma));
        cases.push(Case::refused(name, ratio, &says, NO_DEPTH));
        let (mut z, mut sd) = ([0.0f32; WIDTH], [0.0f32; WIDTH]);
        let x = CoordinateRow {
            px: &[coordinate as f32; WIDTH],
            sigma: &[sigma as f32; WIDTH],
        };
        // The row's pixel at which the ray is the same: its x is exact in f32 as well.
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
