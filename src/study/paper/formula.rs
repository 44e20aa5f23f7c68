//! The effect of holding f0, in closed form.
//!
//! On the bench both pupils are equally far from the reference plane, so the width of a projected
//! fringe on the plane is proportional to the plane's distance: f0 at L is f0 at 1000 mm times
//! 1000 mm / L. A point at height h changes the phase by `dphi = 2 pi f0(L) D h / (L - h)`. The paper's
//! formula, with the actual L but f0 from 1000 mm, is `h' = L dphi / (2 pi f0 D + dphi)`. With
//! r = f0(L) / f0(1000 mm) = 1000 mm / L it gives
//!
//! ```text
//! h' = L r h / (L - h + r h)
//! ```
//!
//! The result depends neither on the baseline nor on the fringes' width.

/// Distance in mm at which f0 was measured.
pub const MEASURED_AT_MM: f64 = 1000.0;

/// Side of the trapezoid's base in mm.
pub const BASE_MM: f64 = 200.0;
/// Side of the trapezoid's top in mm.
pub const TOP_MM: f64 = 100.0;
/// Height of the trapezoid in mm.
pub const HEIGHT_MM: f64 = 80.0;

/// Returns the height in mm that the formula gives for a height `height_mm` over a plane at
/// `distance_mm`, with f0 from 1000 mm.
pub fn with_f0_held(height_mm: f64, distance_mm: f64) -> f64 {
    let r = MEASURED_AT_MM / distance_mm;
    distance_mm * r * height_mm / (distance_mm - height_mm + r * height_mm)
}

/// Returns the mean absolute error of [`with_f0_held`] in mm over the trapezoid's base: each part of the
/// surface is weighted by its projected area, as seen from afar along the axis.
pub fn mean_over_base(distance_mm: f64) -> f64 {
    // The area of the section at height h is w(h)^2; the base's share between h and h + dh is
    // -dA/dh, the top's share A(80 mm).
    let error = |h: f64| (with_f0_held(h, distance_mm) - h).abs();
    let width = |h: f64| BASE_MM - (BASE_MM - TOP_MM) * h / HEIGHT_MM;
    let slope = 2.0 * (BASE_MM - TOP_MM) / HEIGHT_MM;
    let sides = simpson(|h| error(h) * width(h) * slope);
    (sides + error(HEIGHT_MM) * TOP_MM * TOP_MM) / (BASE_MM * BASE_MM)
}

/// Returns the mean absolute error of [`with_f0_held`] in mm over the cross-section through the middle,
/// weighted by length.
pub fn mean_over_section(distance_mm: f64) -> f64 {
    let error = |h: f64| (with_f0_held(h, distance_mm) - h).abs();
    let sides = simpson(|h| error(h) * (BASE_MM - TOP_MM) / HEIGHT_MM);
    (sides + error(HEIGHT_MM) * TOP_MM) / BASE_MM
}

/// Integrates over the height by Simpson's rule: the integrands are smooth, and 64 intervals have a
/// relative error below 1e-9.
fn simpson(f: impl Fn(f64) -> f64) -> f64 {
    const INTERVALS: usize = 64;
    let step = HEIGHT_MM / INTERVALS as f64;
    let weight = |i: usize| match i {
        0 | INTERVALS => 1.0,
        _ if i % 2 == 1 => 4.0,
        _ => 2.0,
    };
    let sum: f64 = (0..=INTERVALS)
        .map(|i| weight(i) * f(i as f64 * step))
        .sum();
    sum * step / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use phasmid_calibrate::height::{Given, Mapping};
    use phasmid_pattern::Axis;
    use phasmid_profile::Profile;

    /// Compares the means of the error with sums over a grid of the base, and along its middle.
    #[test]
    fn the_column_that_holding_f0_alone_makes() {
        const N: usize = 400;
        let at = |i: usize| (i as f64 + 0.5) / N as f64 * BASE_MM - BASE_MM / 2.0;
        let height = |x: f64, y: f64| {
            let aside = x.abs().max(y.abs());
            let inwards = (BASE_MM / 2.0 - aside) / ((BASE_MM - TOP_MM) / 2.0);
            HEIGHT_MM * inwards.min(1.0)
        };
        for (distance, wanted) in [
            (800.0, 10.5),
            (900.0, 4.8),
            (1000.0, 0.0),
            (1100.0, 4.0),
            (1200.0, 7.4),
        ] {
            let error = |x, y| {
                let h = height(x, y);
                (with_f0_held(h, distance) - h).abs()
            };
            let row = |y: f64| (0..N).map(|i| error(at(i), y)).sum::<f64>() / N as f64;
            let base = (0..N).map(|j| row(at(j))).sum::<f64>() / N as f64;
            let found = [mean_over_base(distance), mean_over_section(distance)];
            assert!(
                (found[0] - base).abs() < 1e-3,
                "{distance}: {found:?} {base}"
            );
            assert!((found[1] - row(0.0)).abs() < 1e-3, "{distance}: {found:?}");
            assert!((found[0] - wanted).abs() < 0.05, "{distance}: {found:?}");
        }
    }

    /// Compares the closed form with the mapping itself, applied to points projected by the rig.
    #[test]
    fn the_mapping_errs_as_the_closed_form_says() {
        let mut profile = Profile::load("pmp-bench").unwrap();
        profile.camera.sensor_width_mm *= 64.0 / 1138.0;
        (profile.camera.width_px, profile.camera.height_px) = (64, 33);
        let rig = profile.nominal_rig();
        let plane = |z| Mapping::of_plane(&rig, Axis::X, 16.0, z).unwrap();
        let f0 = plane(1000.0).constants.fringes_per_mm;
        for distance in [800.0, 1200.0] {
            let held = plane(distance).with(&Given {
                fringes_per_mm: Some(f0),
                ..Given::default()
            });
            for (i, h) in [(16 * 64 + 30, 80.0), (3 * 64 + 50, 17.0)] {
                let px = DVec2::new((i % 64) as f64, (i / 64) as f64);
                let point = rig.camera.ray(px) * (distance - h);
                let x = rig.projector.project(point).unwrap().x;
                let (z, _) = held.depth_mm(i, x, 0.0).unwrap();
                let wanted = with_f0_held(h, distance);
                assert!((distance - z - wanted).abs() < 1e-9, "{z} {wanted}");
            }
        }
    }
}
