//! Tests that shapes which leave motions undetermined are reported, and that others are not.

use super::super::super::testing::{
    Random, cylinder, is_front, patient, plane, scan, sphere, torus,
};
use super::*;

/// A noisy scan of a shape, tracked from a pose nearby.
fn shape(mesh: &Mesh, inner: impl Fn(DVec3) -> bool, sigma: f64) -> RigidFit {
    let region = Region::Box {
        lo: DVec3::new(-300.0, -180.0, 0.0),
        hi: DVec3::new(300.0, 180.0, 300.0),
    };
    let reference = Reference::new(mesh, &region).unwrap();
    let mut random = Random::new(11);
    let truth = six([0.3, -0.2, 0.8], [0.2, -0.3, 0.1]).pose();
    let points = scan(mesh, 8000, &mut random, inner)
        .into_iter()
        .map(|p| truth.point(p) + random.vector() * sigma)
        .collect();
    track_rigid(
        &Measured::isotropic(points, sigma),
        &reference,
        &near(),
        &white(),
    )
    .unwrap()
}

fn freedoms(fit: &RigidFit) -> (Vec<DVec3>, Vec<(DVec3, DVec3)>, String) {
    let (mut shifts, mut turns, mut words) = (Vec::new(), Vec::new(), String::new());
    for warning in &fit.warnings {
        if let Warning::Undetermined { free, .. } = warning {
            words = warning.to_string();
            for f in free {
                match f {
                    Freedom::Shift { along } => shifts.push(*along),
                    Freedom::Turn { about, through } => turns.push((*about, *through)),
                }
            }
        }
    }
    (shifts, turns, words)
}

#[test]
fn a_plane_leaves_two_shifts_and_a_turn() {
    for sigma in [1e-6, 0.2] {
        let fit = shape(
            &plane(),
            |p| p.truncate().abs().max_element() < 150.0,
            sigma,
        );
        let (shifts, turns, words) = freedoms(&fit);
        assert_eq!(
            (fit.determined, shifts.len(), turns.len()),
            (3, 2, 1),
            "{words}"
        );
        assert!(shifts.iter().all(|s| s.z.abs() < 0.02), "{shifts:?}");
        assert!(turns[0].0.z.abs() > 0.999, "{turns:?}");
        assert!(
            words.contains("a plane") && words.contains("LAT shift, LNG shift, yaw"),
            "{words}"
        );
        // Along the free motions the start pose is kept; across them the plane's height at the
        // isocentre is found.
        let t = fit.six.translation_mm;
        assert!(t.truncate().length() < 0.4, "{t}");
        let [lat, lng, vrt, pitch, _, yaw] = fit.deviations();
        assert!(
            lat > 30.0 && lng > 30.0 && yaw > 5.0,
            "{:?}",
            fit.deviations()
        );
        assert!(vrt < 0.5 && pitch < 0.2, "{:?}", fit.deviations());
    }
}

#[test]
fn a_sphere_leaves_three_turns_about_its_centre() {
    let fit = shape(&sphere(), |p| p.z > 50.0, 0.2);
    let (shifts, turns, words) = freedoms(&fit);
    assert_eq!(
        (fit.determined, shifts.len(), turns.len()),
        (3, 0, 3),
        "{words}"
    );
    let centre = fit.room_from_reference.point(DVec3::new(10.0, 20.0, -40.0));
    for (about, through) in turns {
        let off = (through - centre).cross(about).length();
        assert!(off < 3.0, "{off}");
    }
    assert!(words.contains("a sphere"), "{words}");
    // The sphere's centre is found correctly, although its rotation is undetermined.
    let truth = six([0.3, -0.2, 0.8], [0.2, -0.3, 0.1])
        .pose()
        .point(DVec3::new(10.0, 20.0, -40.0));
    assert!((centre - truth).length() < 0.05, "{}", centre - truth);
}

#[test]
fn a_cylinder_leaves_a_shift_and_a_turn_along_its_axis() {
    let fit = shape(&cylinder(), |p| p.y.abs() < 170.0, 0.2);
    let (shifts, turns, words) = freedoms(&fit);
    assert_eq!(
        (fit.determined, shifts.len(), turns.len()),
        (4, 1, 1),
        "{words}"
    );
    assert!(shifts[0].y.abs() > 0.999, "{shifts:?}");
    let (about, through) = turns[0];
    assert!(about.y.abs() > 0.999, "{about}");
    assert!(
        (through - DVec3::new(0.0, through.y, -100.0)).length() < 3.0,
        "{through}"
    );
    assert!(
        words.contains("a cylinder") && words.contains("LNG shift"),
        "{words}"
    );
}

#[test]
fn a_rough_cylinder_warns_all_the_same() {
    // The vertices of an isosurface are noisy; their slopes must not be mistaken for shape.
    let truth = cylinder();
    let mut rough = truth.clone();
    let mut random = Random::new(12);
    for v in &mut rough.vertices {
        *v += random.vector() * 0.05;
    }
    let reference = Reference::new(&rough, &Region::All).unwrap();
    let pose = six([0.0, 6.0, 0.0], [0.0, 0.0, 0.0]).pose();
    let points = scan(&truth, 10_000, &mut random, |p| p.y.abs() < 150.0)
        .into_iter()
        .map(|p| pose.point(p) + random.vector() * 0.05)
        .collect();
    let measured = Measured::isotropic(points, 0.05);
    let fit = track_rigid(&measured, &reference, &near(), &white()).unwrap();
    let (shifts, turns, words) = freedoms(&fit);
    assert_eq!(
        (shifts.len(), turns.len()),
        (1, 1),
        "{words} {:?}",
        fit.deviations()
    );
}

#[test]
fn a_bent_torus_and_a_torso_hold_everything() {
    let truth = six([0.3, -0.2, 0.8], [0.2, -0.3, 0.1]);
    for fit in [
        shape(&torus(), |p| p.z > 5.0, 0.2),
        shape(&patient(20_000), is_front, 0.2),
    ] {
        assert!(
            fit.determined == 6 && fit.warnings.is_empty(),
            "{:?}",
            fit.warnings
        );
        let (mm, deg) = miss(&fit, &truth);
        assert!(mm < 0.1 && deg < 0.05, "{mm} mm, {deg} degrees");
    }
}
