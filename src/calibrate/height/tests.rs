//! Tests against closed forms: depths on the rig of `pmp-bench`, where the formula is exact, with
//! the projector on any side; and, for other rigs, the errors that the module documents.

use super::*;
use crate::{Measured, Triangulator};
use glam::{DVec2, DVec3};
use phasmid_geometry::{Lens, Pose, Rig, View};
use phasmid_pattern::Axis;

const PERIOD: f64 = 16.0;

/// The bench rig with the projector's pupil at `place` and its image centred on the camera's axis
/// at 1000 mm; optionally `turned` by 180 degrees about its axis.
fn rig(place: DVec3, turned: bool) -> Rig {
    let lens = |width_px, height_px, f, principal_px| Lens {
        width_px,
        height_px,
        focal_px: DVec2::splat(f),
        principal_px,
        distortion: [0.0; 5],
    };
    let side = if turned { -1.0 } else { 1.0 };
    let f = 2751.36;
    let shift = place.truncate() * (side * f / (1000.0 - place.z));
    let pose = Pose::from_xyz_deg(
        place,
        DVec3::new(0.0, 0.0, if turned { 180.0 } else { 0.0 }),
    );
    Rig {
        camera: View {
            // Fewer pixels with the same field of view.
            lens: lens(114, 49, 63.2, DVec2::new(56.5, 24.0)),
            rig_from_view: Pose::IDENTITY,
        },
        projector: View {
            lens: lens(1920, 1080, f, DVec2::new(959.5, 539.5) + shift),
            rig_from_view: pose,
        },
        noise: None,
        covariance: None,
    }
}

/// Maximum depth error and number of points tested, over points at the given heights that camera
/// and projector both see.
fn worst(rig: &Rig, mapping: &Mapping, heights: &[f64]) -> (f64, usize) {
    let width = rig.camera.lens.width_px;
    let (mut worst, mut count) = (0.0f64, 0);
    for i in 0..width * rig.camera.lens.height_px {
        let ray = rig
            .camera
            .lens
            .ray(DVec2::new(f64::from(i % width), f64::from(i / width)));
        for &h in heights {
            let z = mapping.plane.depth_mm(ray, h);
            let Some(px) = rig.projector.project(ray * z) else {
                continue;
            };
            if !rig.projector.lens.contains(px) {
                continue;
            }
            let x = px[mapping.axis as usize];
            let Some(found) = mapping.depth_mm(i as usize, x, 0.02) else {
                continue;
            };
            worst = worst.max((found.0 - z).abs());
            count += 1;
        }
    }
    (worst, count)
}

const HEIGHTS: [f64; 5] = [-60.0, 0.0, 30.0, 80.0, 250.0];

#[test]
fn the_formula_is_exact_on_the_bench_with_the_projector_on_any_side() {
    for (place, axis) in [
        (DVec3::new(400.0, 0.0, 0.0), Axis::X),
        (DVec3::new(-400.0, 0.0, 0.0), Axis::X),
        (DVec3::new(120.0, 60.0, 0.0), Axis::X),
        (DVec3::new(0.0, 300.0, 0.0), Axis::Y),
        (DVec3::new(30.0, -300.0, 0.0), Axis::Y),
    ] {
        for turned in [false, true] {
            let rig = rig(place, turned);
            assert!((rig.meeting_mm().unwrap() - 1000.0).abs() < 1e-9);
            let mapping = Mapping::of_plane(&rig, axis, PERIOD, 1000.0).unwrap();
            let c = mapping.constants;
            let k = axis as usize;
            let baseline = if turned { -place[k] } else { place[k] };
            assert!((c.baseline_mm - baseline).abs() < 1e-9, "{c:?}");
            assert_eq!(c.distance_mm, 1000.0);
            // The paper's 0.172 line pairs per mm.
            assert!((c.fringes_per_mm - 2751.36 / 1000.0 / PERIOD).abs() < 1e-12);
            assert!((c.fringes_per_mm - 0.172).abs() < 1e-4);
            let (worst, count) = worst(&rig, &mapping, &HEIGHTS);
            assert!(
                worst < 1e-9 && count > 1000,
                "{place} {turned}: {worst:e} of {count}"
            );
            assert!(
                mapping.quality.linear_rms_px < 1e-9,
                "{:?}",
                mapping.quality
            );
            assert!(mapping.quality.farther_mm.abs() < 1e-9);
        }
    }
}

#[test]
fn phase_shift_follows_formula_of_the_paper() {
    // h = L dphi / (2 pi f0 D + dphi), solved for dphi: 80 mm on the bench are 37.6 rad, 6 fringes.
    let rig = rig(DVec3::new(400.0, 0.0, 0.0), false);
    let mapping = Mapping::of_plane(&rig, Axis::X, PERIOD, 1000.0).unwrap();
    let ray = rig.camera.lens.ray(DVec2::new(60.0, 20.0));
    let px = rig.projector.project(ray * 920.0).unwrap();
    let dphi = mapping.dphi(20 * 114 + 60, px.x);
    let wanted = std::f64::consts::TAU * 0.17196 * 400.0 * 80.0 / 920.0;
    assert!((dphi - wanted).abs() < 1e-9, "{dphi} {wanted}");
    assert!((mapping.constants.height_mm(dphi) - 80.0).abs() < 1e-9);
    // The result does not depend on the period.
    let other = Mapping::of_plane(&rig, Axis::X, 100.0, 1000.0).unwrap();
    let (a, b) = (
        mapping.depth_mm(2340, px.x, 0.02),
        other.depth_mm(2340, px.x, 0.02),
    );
    assert!((a.unwrap().0 - b.unwrap().0).abs() < 1e-10);
    assert!((a.unwrap().1 / b.unwrap().1 - 1.0).abs() < 1e-10);
}

#[test]
fn sigma_is_that_of_triangulation_where_both_are_exact() {
    let rig = rig(DVec3::new(400.0, 0.0, 0.0), false);
    let mapping = Mapping::of_plane(&rig, Axis::X, PERIOD, 1000.0).unwrap();
    let triangulator = Triangulator::new(&rig, 114, 49).unwrap();
    for (u, v, z) in [
        (50.0, 20.0, 930.0),
        (61.0, 3.0, 1040.0),
        (57.0, 48.0, 700.0),
    ] {
        let camera_px = DVec2::new(u, v);
        let px = rig
            .projector
            .project(rig.camera.lens.ray(camera_px) * z)
            .unwrap()
            .x;
        let x = Some(Measured { px, sigma: 0.02 });
        let (z, s) = triangulator.depth(camera_px, x, None).unwrap();
        let i = v as usize * 114 + u as usize;
        let (z2, s2) = mapping.depth_mm(i, px, 0.02).unwrap();
        assert!(
            (z - z2).abs() < 1e-8 && (s / s2 - 1.0).abs() < 1e-8,
            "{z} {z2} {s} {s2}"
        );
    }
}

/// Coordinates and depths, with standard deviations, of a plane through (0, 0, z) with normal
/// `tilt`, as f32 maps.
fn capture(rig: &Rig, axis: Axis, z: f64, tilt: DVec3) -> [Vec<f32>; 4] {
    let mut maps = [const { Vec::new() }; 4];
    for i in 0..114 * 49 {
        let ray = rig
            .camera
            .lens
            .ray(DVec2::new((i % 114) as f64, (i / 114) as f64));
        let t = z * tilt.z / tilt.dot(ray);
        let px = rig
            .projector
            .project(ray * t)
            .filter(|px| rig.projector.lens.contains(*px));
        let lit = px.is_some();
        let row = [px.map_or(f64::NAN, |px| px[axis as usize]), 0.02, t, 0.1];
        for (map, value) in maps.iter_mut().zip(row) {
            map.push(if lit { value as f32 } else { f32::NAN });
        }
    }
    maps
}

#[test]
fn a_captured_plane_gives_the_constants_of_the_computed_one() {
    let rig = rig(DVec3::new(400.0, 0.0, 0.0), false);
    let [x, s, z, zs] = capture(&rig, Axis::X, 1000.0, DVec3::Z);
    let mut broken = z.clone();
    // An object in front of the plane.
    broken[2300..2340].fill(900.0);
    for z in [&z, &broken] {
        let mapping = Mapping::of_capture(&rig, Axis::X, PERIOD, [&x, &s], [z, &zs]);
        let mapping = mapping.unwrap();
        let c = mapping.constants;
        assert!((c.distance_mm - 1000.0).abs() < 1e-3, "{c:?}");
        assert!((c.baseline_mm - 400.0).abs() < 1e-2, "{c:?}");
        assert!((c.fringes_per_mm - 0.17196).abs() < 1e-6, "{c:?}");
        let (worst, count) = worst(&rig, &mapping, &HEIGHTS);
        assert!(worst < 0.01 && count > 1000, "{worst} of {count}");
        // The noise of the object and of the reference add up.
        let i = (0..x.len()).find(|i| x[*i] > 900.0).unwrap();
        let (_, two) = mapping.depth_mm(i, f64::from(x[i]), 0.02).unwrap();
        let (_, one) = mapping.depth_mm(i, f64::from(x[i]), 0.0).unwrap();
        assert!((two / one - std::f64::consts::SQRT_2).abs() < 1e-6);
    }
}

#[test]
fn error_of_violated_assumptions_is_as_documented() {
    // The projector 40 mm nearer to the plane: e = -0.04.
    let nearer = rig(DVec3::new(400.0, 0.0, 40.0), false);
    let mapping = Mapping::of_plane(&nearer, Axis::X, PERIOD, 1000.0).unwrap();
    assert!((mapping.quality.farther_mm + 40.0).abs() < 1e-9);
    let (error, _) = worst(&nearer, &mapping, &[80.0]);
    // Expected: 80 mm times e (1 + x / D), for x up to 350 mm.
    assert!((2.0..7.0).contains(&error), "{error}");
    // With the projector rotated by 10 degrees, the error is at most 2 a x / L times the height,
    // here 80 mm.
    let mut turned = rig(DVec3::new(400.0, 0.0, 0.0), false);
    turned.projector.rig_from_view.rotation = glam::DMat3::from_rotation_y(-0.17);
    turned.projector.lens.principal_px.x = 959.5 + 600.0;
    let mapping = Mapping::of_plane(&turned, Axis::X, PERIOD, 1000.0).unwrap();
    assert!(mapping.quality.linear_rms_px > 5.0, "{:?}", mapping.quality);
    let (error, count) = worst(&turned, &mapping, &[80.0]);
    assert!(
        (1.0..20.0).contains(&error) && count > 100,
        "{error} of {count}"
    );
    // On the plane itself the error is zero for any rig.
    let (error, _) = worst(&turned, &mapping, &[0.0]);
    assert!(error < 1e-9, "{error}");
}

#[test]
fn given_constants_take_the_place_of_the_calibration_s() {
    let rig = rig(DVec3::new(-400.0, 0.0, 0.0), false);
    let mapping = Mapping::of_plane(&rig, Axis::X, PERIOD, 1000.0).unwrap();
    let given = Given {
        distance_mm: Some(990.0),
        baseline_mm: Some(396.0),
        fringes_per_mm: None,
    };
    let other = mapping.clone().with(&given);
    assert_eq!(other.constants.baseline_mm, -396.0);
    assert_eq!(other.plane.distance_mm, 990.0);
    // Replace L and D by values that are 1 % smaller.
    let px = rig
        .projector
        .project(rig.camera.lens.ray(DVec2::new(56.0, 24.0)) * 920.0)
        .unwrap();
    let i = 24 * 114 + 56;
    let dphi = mapping.dphi(i, px.x);
    let wanted = 990.0 * dphi / (std::f64::consts::TAU * 0.17196 * -396.0 + dphi);
    assert!((other.depth_mm(i, px.x, 0.0).unwrap().0 - (990.0 - wanted)).abs() < 1e-6);
}

#[test]
fn refuses_invalid_reference_plane() {
    let rig = rig(DVec3::new(400.0, 0.0, 0.0), false);
    let error = |mapping: phasmid_core::error::Result<Mapping>| mapping.err().unwrap().to_string();
    for (axis, z, needle) in [
        (Axis::X, -1000.0, "the camera sees and the projector lights"),
        (
            Axis::X,
            f64::NAN,
            "the camera sees and the projector lights",
        ),
        (Axis::X, 50.0, "the camera sees and the projector lights"),
        (Axis::Y, 1000.0, "are separated"),
    ] {
        let found = error(Mapping::of_plane(&rig, axis, PERIOD, z));
        assert!(found.contains(needle), "{z}: {found}");
    }
    let [x, s, z, zs] = capture(&rig, Axis::X, 1000.0, DVec3::Z);
    let bent: Vec<f32> = z
        .iter()
        .enumerate()
        .map(|(i, z)| z + 40.0 * (i as f32 * 0.3).sin())
        .collect();
    let none = vec![f32::NAN; z.len()];
    for (z, x) in [(&bent, &x), (&none, &x), (&none, &none)] {
        let found = error(Mapping::of_capture(
            &rig,
            Axis::X,
            PERIOD,
            [x, &s],
            [z, &zs],
        ));
        assert!(found.contains("no plane in its points"), "{found}");
    }
    let found = error(Mapping::of_capture(
        &rig,
        Axis::X,
        PERIOD,
        [&x[1..], &s],
        [&z, &zs],
    ));
    assert!(found.contains("another size"), "{found}");
    let mapping = Mapping::of_plane(&rig, Axis::X, PERIOD, 1000.0).unwrap();
    assert_eq!(mapping.depth_mm(0, f64::NAN, 0.1), None);
    // A tilted plane is a valid reference.
    let [x, s, z, zs] = capture(&rig, Axis::X, 1000.0, DVec3::new(0.2, 0.1, 1.0).normalize());
    let mapping = Mapping::of_capture(&rig, Axis::X, PERIOD, [&x, &s], [&z, &zs]).unwrap();
    assert!((mapping.plane.normal + DVec3::new(0.2, 0.1, 1.0).normalize()).length() < 1e-4);
    let (error, _) = worst(&rig, &mapping, &[0.0]);
    assert!(error < 0.01, "{error}");
}
